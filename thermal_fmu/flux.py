"""Heat flux inside bodies, and the conductivity that it follows from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.cells import CellBlock, CellGeometry, tensors
from thermal_fmu.kernels import at_points, mean_flux
from thermal_fmu.phase_change import NodalFields
from thermal_fmu.problem import Conductivity
from thermal_fmu.scene import ThermalScene

Floats = NDArray[np.float64]


def heat_flux(scene: ThermalScene, shapes: Sequence[CellGeometry], at: NodalFields) -> Floats:
    """Return (n_cells, 2) cell means of -k grad T [W/m2]."""
    q = np.empty((scene.volume.n_cells, 2))
    for block, shape in zip(scene.volume.blocks, shapes, strict=True):
        K = conductivity(scene.model.parts[block.part].material.k, block, shape, at)
        q[block.numbers] = mean_flux(at.T, block.cells, shape.G, K, shape.dC)
    return q


def conductivity(k: Conductivity, block: CellBlock, shape: CellGeometry, at: NodalFields) -> Floats:
    """Return k at quadrature points [W/mK]: (ne, nq, 1) where isotropic and of one phase, else (ne, nq, 3)."""
    N = block.table.N
    T_q = np.empty(shape.dV.shape) if k.is_constant else at_points(at.T, block.cells, N)
    if k.is_plain:
        return np.asarray(k.k_1(T_q)[:, :, None])
    f_q = None if at.f_s is None else at_points(at.f_s, block.cells, N)
    return tensors(k, T_q, f_q, shape.turn).K
