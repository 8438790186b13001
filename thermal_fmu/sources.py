"""Heat sources in bodies, Q_T of Eq. (1), and the boundary data of a scene at one time.

A source is a field, times a factor of the cell's own temperature.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Field, Level, Property, Signal, resolve
from thermal_fmu.cells import CellBlock, CellGeometry, CellMesh, Ints, Slots, spread
from thermal_fmu.elsewhere import TemperatureCourse
from thermal_fmu.kernels import at_points
from thermal_fmu.problem import Model, ThermalBody
from thermal_fmu.source_points import parted_cells
from thermal_fmu.surface_terms import at_nodes

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class FieldSource:
    """A source that follows a field.  shapes : (n_terms, n) of its terms spread over the nodes [m3]."""

    body: int
    shapes: Floats


@dataclass(frozen=True)
class TemperatureSource:
    """A source with a factor of temperature, on cells : (ne, nn) of one part; slots : (ne, nn, nn) as theirs.

    N : (nq, nn) or (ne, nq, nn) shape functions of the quadrature points [1], volume : (ne, nq) theirs [m3].
    shapes : (n_terms, ne nq) [1], None where the field is uniform.
    """

    body: int
    cells: Ints
    slots: Slots
    N: Floats
    factor: Property
    volume: Floats
    shapes: Floats | None

    def at_points(self, T: Floats) -> Floats:
        """Return (ne, nq) [K] of T : (n,) [K]."""
        return at_points(T, self.cells, self.N) if self.N.ndim == 2 else np.einsum("eqi,ei->eq", self.N, T[self.cells])


Sources = list[FieldSource] | list[TemperatureSource]


def plain_sources(volume: CellMesh, shapes: Sequence[CellGeometry], parts: Sequence[ThermalBody]) -> Floats | None:
    """Spread the volume of parts with a uniform source without factor over their nodes: (n_parts, n) [m3].

    Rows of other parts are 0.  None where no part has such a source.
    """
    if all(part.Q_T.is_zero or not is_plain(part) for part in parts):
        return None
    out = np.zeros((len(parts), volume.n))
    for b, body in enumerate(parts):
        if is_plain(body) and not body.Q_T.is_zero:
            weights = [np.full(1, float(block.part == b)) for block in volume.blocks]
            out[b] = spread(volume, shapes, weights)
    return out


def is_plain(body: ThermalBody) -> bool:
    """Return whether a body's source is the same everywhere, at all temperatures."""
    return body.Q_T.is_uniform and body.Q_T_factor is None


class SourceCache:
    """What the sources of a block follow from, on the geometry last asked for."""

    def __init__(self) -> None:
        self._made: dict[int, tuple[CellGeometry, Sources]] = {}

    def of(self, number: int, shape: CellGeometry, make: Callable[[], Sources]) -> Sources:
        """Return the sources of a block, made anew where its geometry is another."""
        known = self._made.get(number)
        # fault: sources stay where they were though their cells moved -> if known is None: |
        #   thermal_fmu/test_source_strip
        if known is None or known[0] is not shape:
            known = self._made[number] = (shape, make())
        return known[1]


def freeze_sources(volume: CellMesh, shapes: Sequence[CellGeometry], parts: Sequence[ThermalBody], x: Floats,
                   cache: SourceCache) -> tuple[tuple[FieldSource, ...], tuple[TemperatureSource, ...]]:
    """Spread the other sources of parts on coordinates x : (n, 2) [m]: those of fields, and those with a factor."""
    found: list[FieldSource | TemperatureSource] = []
    for number, (block, shape) in enumerate(zip(volume.blocks, shapes, strict=True)):
        body = parts[block.part]
        if not is_plain(body) and not body.Q_T.is_zero:
            found += cache.of(number, shape, partial(_sources, volume, block, shape, body, x))
    return (tuple(s for s in found if isinstance(s, FieldSource)),
            tuple(s for s in found if isinstance(s, TemperatureSource)))


def _sources(volume: CellMesh, block: CellBlock, shape: CellGeometry, body: ThermalBody, x: Floats) -> Sources:
    """What a part makes in a block on x : (n, 2) [m]."""
    pieces = _pieces(body.Q_T, block, shape, x, volume.axisymmetric)
    if body.Q_T_factor is not None:
        return [TemperatureSource(block.part, p.cells, p.slots, p.N, body.Q_T_factor, p.volume, p.shapes)
                for p in pieces]
    # fault: source of a field not weighted in place -> return [FieldSource(block.part, np.array([_to_nodes(p.cells,
    #   p.N, term.mean() * p.volume, volume.n) for term in p.terms])) | thermal_fmu/test_thermal_fields
    return [FieldSource(block.part, np.array([_to_nodes(p.cells, p.N, term * p.volume, volume.n) for term in p.terms]))
            for p in pieces]


class _Piece(NamedTuple):
    """Cells of a block with points of their own, as in TemperatureSource."""

    cells: Ints
    slots: Slots
    N: Floats
    volume: Floats
    shapes: Floats | None

    @property
    def terms(self) -> Floats:
        """(n_terms, ne, nq) [1]."""
        assert self.shapes is not None, "a uniform source without factor is a plain one"
        return self.shapes.reshape(-1, *self.volume.shape)


def _pieces(field: Field, block: CellBlock, shape: CellGeometry, x: Floats, axisymmetric: bool) -> list[_Piece]:
    """The points at which a field is read in a block on x : (n, 2) [m]: those of its cells, or parts of them."""
    N, corners = block.table.N, x[block.cells]
    parted = None if field.is_uniform else parted_cells(field, corners, axisymmetric)
    whole = np.arange(len(corners)) if parted is None else np.setdiff1d(np.arange(len(corners)), parted.cells)
    found = []
    if whole.size:
        at = field.shapes(np.einsum("qi,eij->eqj", N, corners[whole]).reshape(-1, 2))
        found.append(_Piece(block.cells[whole], block.slots[whole], N, shape.dV[whole], at))
    if parted is not None:
        found.append(_Piece(block.cells[parted.cell], block.slots[parted.cell], parted.N[:, None],
                            parted.volume[:, None], field.shapes(parted.x)))
    return found


def _to_nodes(cells: Ints, N: Floats, power: Floats, n: int) -> Floats:
    """Return (n,) nodal sums of N_i : (nq, nn) or (ne, nq, nn) times power : (ne, nq)."""
    return at_nodes(cells, power @ N if N.ndim == 2 else np.einsum("eq,eqi->ei", power, N), n)


def temperature_source_flow(source: TemperatureSource, level: Level, T: Floats) -> tuple[Floats, Floats]:
    """Return (n,) heat made at nodes [W] at T : (n,) [K], and (ne, nn, nn) the derivative of its opposite [W/K].

    level : of Q_T [W/m3].  Q = Q_T(x, t) factor(T) at quadrature points, on the current volume.
    """
    Q = np.reshape(resolve(level, source.shapes), (-1,) if source.shapes is None else source.volume.shape)
    T_q = source.at_points(T)
    f = _to_nodes(source.cells, source.N, Q * source.factor(T_q) * source.volume, T.size)
    # fault: derivative of a source by temperature forgotten -> dQ = 0.0 * Q * source.factor.slope(T_q) * source.volume
    #   | thermal_fmu/test_thermal_fields
    dQ = Q * source.factor.slope(T_q) * source.volume
    N = source.N
    return f, -(np.einsum("eq,qi,qj->eij", dQ, N, N) if N.ndim == 2 else np.einsum("eq,eqi,eqj->eij", dQ, N, N))


# Boundary data at a stage time

# A time this close to a breakpoint, as a part of the substep and of the time itself, is on it: clocks of integer ticks
# round a breakpoint to 2^-40 of the end time, and the value on the wrong side of a jump would last a whole stage.
SNAP_STEP, SNAP_TIME = 1e-6, 4e-12

LoadFactors = Mapping[str, float]


class FilmLevels(NamedTuple):
    """A film at one time: h [W/m2K^(1 + exponent)] and Te [K], numbers or levels of fields."""

    h: Level
    Te: Level


class RadiatorLevels(NamedTuple):
    """A radiating surface at one time.  factor : of its flow [1].  T_inf : [K], a number or a level of a field."""

    factor: float
    T_inf: Level


class PairFactors(NamedTuple):
    """The factors of a pair's conductances at one time [1], of its closed and of its open points."""

    closed: float
    open: float

    def of(self, closed: bool) -> float:
        """Return the factor of closed or of open points [1]."""
        return self.closed if closed else self.open


@dataclass(frozen=True)
class ThermalLoads:
    """Boundary data at one time, each in the order of the model: numbers, but for fields that depend on place.

    Q_T [W/m3] of parts.  fluxes [W/m2].  prescribed : temperatures [K]; of nodes of bodies elsewhere last.
    """

    Q_T: tuple[Level, ...]
    fluxes: tuple[Level, ...]
    films: tuple[FilmLevels, ...]
    radiators: tuple[RadiatorLevels, ...]
    prescribed: tuple[Level, ...]
    pairs: tuple[PairFactors, ...]


def loads_at(model: Model, factors: LoadFactors, t: float, side: int,
             elsewhere: TemperatureCourse | None = None) -> ThermalLoads:
    """Evaluate the boundary data at t [s], before a jump then (side = -1) or after it.

    factors : of the named ones.  elsewhere : of the nodes of bodies that another half solves for, where there are any.
    """
    def now(field: Field, name: str = "") -> Level:
        return field.level(t, side) * factor(name)

    def factor(name: str) -> float:
        return factors[name] if name else 1.0

    return ThermalLoads(
        tuple(now(b.Q_T) for b in model.parts),
        tuple(now(b.value, b.name) for b in model.fluxes),
        tuple(FilmLevels(now(b.h, b.name), now(b.Te)) for b in model.films),
        # fault: factor of radiation forgotten -> tuple(RadiatorLevels(1.0, now(b.T_inf)) for b in model.radiators), |
        #   thermal_fmu/test_thermal_radiation
        tuple(RadiatorLevels(factor(b.name), now(b.T_inf)) for b in model.radiators),
        (*(now(b.value, b.name) for b in model.prescribed), *(() if elsewhere is None else (elsewhere.at(t),))),
        tuple(PairFactors(0.0, 0.0) if p is None else
              PairFactors(p.closed_factor.at(t, side), p.open_factor.at(t, side)) for p in model.pairs),
    )


def factors_of(model: Model, inputs: Mapping[str, object]) -> dict[str, float]:
    """Return the factor inputs load.<name> by name."""
    return {name: float(np.asarray(inputs[f"load.{name}"], dtype=float)) for name in model.load_names}


@dataclass(frozen=True)
class Calendar:
    """The times [s] at which signals of a scene change abruptly.

    breakpoints : (m,) at which any signal jumps or bends.  jumps : (k,) at which one jumps.
    """

    breakpoints: NDArray[np.float64]
    jumps: NDArray[np.float64]

    def snap(self, t: float, h: float) -> float:
        """Return the breakpoint t [s] is meant to be, else t itself; h : the substep [s]."""
        if self.breakpoints.size == 0:
            return t
        near = float(self.breakpoints[np.argmin(np.abs(self.breakpoints - t))])
        # fault: no snap -> return t | thermal_fmu/test_thermal_time
        return near if abs(near - t) <= _tolerance(t, h) else t

    def last_jump(self, t: float, h: float) -> float:
        """Return the last time before t [s] at which a signal jumps, -inf where there is none; h : the substep [s]."""
        return float(self.jumps[self.jumps < t - _tolerance(t, h)].max(initial=-np.inf))

    def jump_within(self, t: float, h: float) -> bool:
        """Return whether a signal jumps at the start of [t, t + h] or inside it; a jump at its end is the next one's.
        """
        return _any_within(self.jumps, t, h)

    def bend_within(self, t: float, h: float) -> bool:
        """Return whether a signal jumps or bends at the start of [t, t + h] or inside it."""
        return _any_within(self.breakpoints, t, h)


def calendar_of(model: Model) -> Calendar:
    """Collect the times at which the model's own signals bend and jump."""
    signals = model.signals
    breakpoints = np.unique(np.concatenate([np.empty(0), *(s.kinks for s in signals)]))
    jumps = np.unique(np.concatenate([np.empty(0), *(_jumps(s) for s in signals)]))
    return Calendar(breakpoints, jumps)


def _jumps(signal: Signal) -> NDArray[np.float64]:
    return signal.t[1:][(np.diff(signal.t) == 0) & (np.diff(signal.value) != 0)]


def _any_within(times: NDArray[np.float64], t: float, h: float) -> bool:
    early = _tolerance(t, h)
    return bool(((times >= t - early) & (times < t + h - early)).any())


def _tolerance(t: float, h: float) -> float:
    return SNAP_STEP * h + SNAP_TIME * abs(t)
