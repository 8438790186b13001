"""Heat flux inside bodies, and the conductivity that it follows from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.cells import CellBlock, CellGeometry
from thermal_fmu.kernels import at_points, mean_flux
from thermal_fmu.phase_change import NodalFields
from thermal_fmu.potentials import flows, potential, tensors
from thermal_fmu.problem import Conductivity
from thermal_fmu.scene import ThermalScene

Floats = NDArray[np.float64]


def heat_flux(scene: ThermalScene, shapes: Sequence[CellGeometry], at: NodalFields) -> Floats:
    """Return (n_cells, 2) cell means of -k grad T [W/m2]."""
    q = np.empty((scene.volume.n_cells, 2))
    for block, shape in zip(scene.volume.blocks, shapes, strict=True):
        parts = flowing(scene.model.parts[block.part].material.k, block, shape, at)
        q[block.numbers] = np.sum([mean_flux(U, shape.G, K, shape.dC) for U, K in parts], axis=0)
    return q


def flowing(k: Conductivity, block: CellBlock, shape: CellGeometry, at: NodalFields) -> Iterator[tuple[Floats, Floats]]:
    """Yield U : (ne, nn) and K : (ne, nq, 1 or 3) of each part of the heat flux, which is -K grad U [W/m2]."""
    if not k.is_plain:
        for flow in flows(k, block, at.T, at.f_s, shape.turn):
            yield flow.by.U, flow.K
        return
    one = k.k_1.solid
    yield potential(one, block, at.T).U, np.full((*shape.dV.shape, 1), 1.0 if one.constant is None else one.constant)


def conductivity(k: Conductivity, block: CellBlock, shape: CellGeometry, at: NodalFields) -> Floats:
    """Return k at quadrature points [W/mK]: (ne, nq, 1) where isotropic and of one phase, else (ne, nq, 3)."""
    N = block.table.N
    T_q = np.empty(shape.dV.shape) if k.is_constant else at_points(at.T, block.cells, N)
    if k.is_plain:
        return np.asarray(k.k_1(T_q)[:, :, None])
    f_q = None if at.f_s is None else at_points(at.f_s, block.cells, N)
    return tensors(k, T_q, f_q, shape.turn).K
