"""Outputs that are fields: solid fraction, heat flux in cells, what the surfaces give off."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from contact.half.model import Value, Variable
from thermal_fmu import phase
from thermal_fmu.kernels import at_points, mean_flux
from thermal_fmu.material import Conductivity
from thermal_fmu.phase import Fields
from thermal_fmu.scene import Scene
from thermal_fmu.tensor import tensors
from thermal_fmu.volume import Block, Shape

Floats = NDArray[np.float64]


def field_variables(scene: Scene) -> tuple[Variable, ...]:
    """The blocks that field_outputs fills."""
    n_s = len(scene.interface.contact_nodes)
    melts = (Variable("f_s", (scene.volume.n,), description="solid fraction at the end of the substep"),)
    surface = (Variable("surface.T", (n_s,), unit="K", description="temperature of surface nodes at the end"),
               Variable("surface.E", (n_s,), unit="J", description="heat surface nodes gave off in the substep"))
    return (*(melts if scene.melting else ()),
            Variable("q", (scene.volume.n_cells, 2), unit="W/m2", description="heat flux at the end, cell mean"),
            *(surface if n_s else ()))


def field_outputs(scene: Scene, shapes: Sequence[Shape], s: Floats, given: Floats | None) -> dict[str, Value]:
    """At s : (n,) [K] on shapes.  given : (n,) [J] that left each node through the surface; None: nothing yet.

    given comes from the residual of the terms inside the body (consistent recovery), so it holds whatever made it flow.
    """
    at = phase.fields(scene.melting, s)
    nodes = scene.interface.contact_nodes
    out: dict[str, Value] = {"q": heat_flux(scene, shapes, at)}
    if at.f_s is not None:
        out["f_s"] = at.f_s
    if len(nodes):
        out |= {"surface.T": at.T[nodes], "surface.E": np.zeros(len(nodes)) if given is None else given[nodes]}
    return out


def heat_flux(scene: Scene, shapes: Sequence[Shape], at: Fields) -> Floats:
    """(n_cells, 2) cell means of -k grad T [W/m2]."""
    q = np.empty((scene.volume.n_cells, 2))
    for block, shape in zip(scene.volume.blocks, shapes, strict=True):
        K = _conductivity(scene.model.bodies[block.body].material.k, block, shape, at)
        q[block.numbers] = mean_flux(at.T, block.cells, shape.G, K, shape.dV)
    return q


def _conductivity(k: Conductivity, block: Block, shape: Shape, at: Fields) -> Floats:
    """(ne, nq, 1) where isotropic and of one phase, else (ne, nq, 3)."""
    N = block.table.N
    T_q = np.empty(shape.dV.shape) if k.is_constant else at_points(at.T, block.cells, N)
    if k.is_plain:
        return np.asarray(k.k_1(T_q)[:, :, None])
    f_q = None if at.f_s is None else at_points(at.f_s, block.cells, N)
    return tensors(k, T_q, f_q, shape.turn).K
