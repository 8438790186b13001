"""Heat made inside bodies: Q_T of Eq. (1), a field, times a factor of the cell's own temperature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.field import Field, Level, resolve
from contact.half.property import Property
from thermal_fmu.kernels import at_points
from thermal_fmu.nodal import at_nodes
from thermal_fmu.spec import Body
from thermal_fmu.volume import Block, Shape, Volume, spread

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class HeldSource:
    """A source that follows a field: shapes : (n_terms, n) of its terms spread over the nodes [m3]."""

    body: int
    shapes: Floats


@dataclass(frozen=True)
class WarmSource:
    """A source with a factor of temperature, on one block of cells.

    volume : (ne, nq) of the quadrature points [m3].  shapes : (n_terms, ne nq), None where the field is uniform.
    """

    body: int
    block: Block
    factor: Property
    volume: Floats
    shapes: Floats | None


def plain_sources(volume: Volume, shapes: Sequence[Shape], bodies: Sequence[Body]) -> Floats | None:
    """(n_bodies, n) volume of each body spread over its nodes [m3], 0 where it has no uniform source without factor.

    None where no body has one.
    """
    if all(body.Q_T.is_zero or not is_plain(body) for body in bodies):
        return None
    out = np.zeros((len(bodies), volume.n))
    for b, body in enumerate(bodies):
        if is_plain(body) and not body.Q_T.is_zero:
            weights = [np.full(1, float(block.body == b)) for block in volume.blocks]
            out[b] = spread(volume, shapes, weights)
    return out


def is_plain(body: Body) -> bool:
    """Whether its source is the same everywhere, at all temperatures."""
    return body.Q_T.is_uniform and body.Q_T_factor is None


def hold_sources(volume: Volume, shapes: Sequence[Shape], bodies: Sequence[Body],
                 x: Floats) -> tuple[tuple[HeldSource, ...], tuple[WarmSource, ...]]:
    """The other sources of bodies on coordinates x : (n, 2) [m]."""
    held, warm = [], []
    for b, body in enumerate(bodies):
        if is_plain(body) or body.Q_T.is_zero:
            continue
        own = [(block, shape) for block, shape in zip(volume.blocks, shapes, strict=True) if block.body == b]
        if body.Q_T_factor is not None:
            warm += [WarmSource(b, block, body.Q_T_factor, shape.dV, _at_quadrature(body.Q_T, block, x))
                     for block, shape in own]
        else:
            held.append(HeldSource(b, sum((_nodal(volume, body.Q_T, block, shape, x) for block, shape in own),
                                          np.zeros((len(body.Q_T.terms), volume.n)))))
    return tuple(held), tuple(warm)


def _at_quadrature(field: Field, block: Block, x: Floats) -> Floats | None:
    if field.is_uniform:
        return None
    return field.shapes(np.einsum("qi,eij->eqj", block.table.N, x[block.cells]).reshape(-1, 2))


def _nodal(volume: Volume, field: Field, block: Block, shape: Shape, x: Floats) -> Floats:
    at = _at_quadrature(field, block, x)
    assert at is not None, "a uniform source without factor is a plain one"
    # fault: source of a field not weighted in place -> return np.array([_to_nodes(block, term.mean() * shape.dV,
    #   volume.n) for term in at]) | thermal_fmu/test_thermal_fields
    return np.array([_to_nodes(block, term.reshape(shape.dV.shape) * shape.dV, volume.n) for term in at])


def _to_nodes(block: Block, power: Floats, n: int) -> Floats:
    """(n,) nodal sums of N_i times power : (ne, nq)."""
    return at_nodes(block.cells, power @ block.table.N, n)


def warm_flow(source: WarmSource, level: Level, T: Floats) -> tuple[Floats, Floats]:
    """(n,) heat made at nodes [W] at T : (n,) [K], and (ne, nn, nn) the derivative of its opposite [W/K].

    level : of Q_T [W/m3].  Q = Q_T(x, t) factor(T) at quadrature points, on the current volume.
    """
    N = source.block.table.N
    Q = np.reshape(resolve(level, source.shapes), (-1,) if source.shapes is None else source.volume.shape)
    T_q = at_points(T, source.block.cells, N)
    f = _to_nodes(source.block, Q * source.factor(T_q) * source.volume, T.size)
    # fault: derivative of a source by temperature forgotten -> dQ = 0.0 * Q * source.factor.slope(T_q) * source.volume
    #   | thermal_fmu/test_thermal_fields
    dQ = Q * source.factor.slope(T_q) * source.volume
    return f, -np.einsum("eq,qi,qj->eij", dQ, N, N)
