"""Boundary terms of a stage: all heat into the nodes except by conduction inside, and the limits of boundary data.

Flux, film, radiation, sources, contact and friction; and the heat of a substep by mechanism.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Property, resolve
from thermal_fmu.cells import BadPropertyError
from thermal_fmu.exchange import exchange_flow, gap_radiation_flow
from thermal_fmu.problem import Model
from thermal_fmu.scene import SubstepData
from thermal_fmu.sources import ThermalLoads, temperature_source_flow
from thermal_fmu.surface_terms import (
    at_nodes,
    film_flow,
    surroundings_radiation_flow,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


TERMS = ("flux", "convection", "source", "mechanical", "contact.slave", "contact.master", "gap.slave", "gap.master",
         "radiation", "near_radiation.slave", "near_radiation.master", "friction.slave", "friction.master", "entropy")
SIDES = ("slave", "master")


@dataclass(frozen=True)
class BoundaryHeat:
    """Heat into the nodes except by conduction inside.

    f : (n,) heat flow into the nodes [W].  inside : (n,) the part of it that is made inside the bodies [W].
    given : (n,) the part of it that comes whatever the surroundings are: sources, fluxes, friction [W].
    terms : (n_terms,) by mechanism [W], as TERMS.  each : (n,) by flux, film, radiating surface, source of a part, and
    of each pair the slave's and the master's side [W].  magnitude : sum of the sizes of all nodal contributions [W].
    The derivative of -f [W/K] is in places, as (places in the matrix data, values), and, where it joins two bodies, in
    across, as (nodes (n, k), values (n, k, k)), k 4 or, where exchange goes by averages, more.
    """

    f: Floats
    inside: Floats
    given: Floats
    terms: Floats
    each: Floats
    magnitude: float
    places: tuple[tuple[NDArray[np.int64], Floats], ...]
    across: tuple[tuple[Ints, Floats], ...]


@dataclass
class _HeatSum:
    """A BoundaryHeat while its terms are added up."""

    f: Floats
    magnitude: float
    terms: dict[str, float]
    pairs: Floats
    solved: NDArray[np.bool_] | None = None
    fluxes: list[float] = field(default_factory=list)
    surroundings: list[float] = field(default_factory=list)
    sources: Floats | None = None
    places: list[tuple[NDArray[np.int64], Floats]] = field(default_factory=list)
    across: list[tuple[Ints, Floats]] = field(default_factory=list)

    def gain(self, term: str, power: Floats) -> None:
        """Add power : (n,) [W] that enters the nodes."""
        self.f += power
        self.terms[term] += power.sum() if self.solved is None else power[self.solved].sum()
        self.magnitude += float(np.abs(power).sum())

    def leave(self, term: str, nodes: Ints, flow: Floats) -> None:
        """Add flow : (n,) [W] that leaves nodes : (n,)."""
        self.f -= at_nodes(nodes, flow, self.f.size)
        out = float(flow.sum())
        self.terms[term] -= out
        self.surroundings.append(-out)
        self.magnitude += float(np.abs(flow).sum())

    def cross(self, term: str, pair: int, nodes: Ints, flow: Floats, slope: Floats, by: Ints | None = None) -> None:
        """Add flow : (n, 4) [W] that leaves nodes : (n, 4) at a pair, with slope : (m, k, k) [W/K] at by : (m, k).

        by : None where it is nodes.  Either side from its own shape functions: that they agree is what the heat balance
        shows.
        """
        self.f -= at_nodes(nodes, flow, self.f.size)
        for side, columns in enumerate((flow[:, :2], flow[:, 2:])):
            out = float(columns.sum())
            # fault: heat of a body that another half solves for is counted here too -> if True: |
            #   coupler/test_several::test_several_halves_are_one[three-staggered]
            if self.solved is None or not len(nodes) or self.solved[nodes[0, 2 * side]]:
                self.terms[f"{term}.{SIDES[side]}"] -= out
            self.pairs[pair, side] -= out
        self.magnitude += float(np.abs(flow).sum())
        self.across.append((nodes if by is None else by, slope))


def boundary_flow(substep: SubstepData, loads: ThermalLoads, power_M: Floats, T: Floats) -> BoundaryHeat:
    """Evaluate the boundary terms at T : (n,) [K].

    power_M : (n,) mechanical heat [W], E_M spread evenly over the substep.
    """
    total = _HeatSum(np.zeros(T.size), 0.0, dict.fromkeys(TERMS, 0.0), np.zeros((len(loads.pairs), 2)), substep.solved)
    if substep.flux_areas:
        total.gain("flux", _flux(total, substep, loads, T.size))
    inside = np.zeros(T.size)
    if substep.uniform_volumes is not None or substep.field_sources or substep.temperature_sources:
        inside += _source(total, substep, loads, T)
        total.gain("source", inside)
    if power_M.any():
        inside = inside + power_M
        total.gain("mechanical", power_M)
    given = total.f.copy()
    _add_surroundings(total, substep, loads, T)
    _add_pairs(total, substep, loads, T)
    if substep.friction is not None:
        # fault: friction of the master only -> pass | thermal_fmu/test_thermal_friction
        total.gain("friction.slave", substep.friction.slave)
        total.gain("friction.master", substep.friction.master)
        total.pairs += substep.friction.pairs
        given += substep.friction.slave + substep.friction.master
    sources = np.zeros(len(loads.Q_T)) if total.sources is None else total.sources
    each = np.concatenate([total.fluxes, total.surroundings, sources, total.pairs.ravel()])
    return BoundaryHeat(total.f, inside, given, np.array([total.terms[name] for name in TERMS]), each, total.magnitude,
                        tuple(total.places), tuple(total.across))


def with_source(heat: BoundaryHeat, made: Floats) -> BoundaryHeat:
    """Return the heat with more that is made inside the bodies, made : (n,) [W], counted as of sources."""
    terms = heat.terms.copy()
    # fault: heat that a given volume makes is in no account -> terms = terms * 1.0 | thermal_fmu/test_given_volume
    terms[TERMS.index("source")] += made.sum()
    return replace(heat, f=heat.f + made, inside=heat.inside + made, given=heat.given + made, terms=terms,
                   magnitude=heat.magnitude + float(np.abs(made).sum()))


def _flux(total: _HeatSum, substep: SubstepData, loads: ThermalLoads, n: int) -> Floats:
    flux = np.zeros(n)
    for q, area in zip(loads.fluxes, substep.flux_areas, strict=True):
        one = q @ area if isinstance(q, np.ndarray) else q * area
        flux += one
        total.fluxes.append(float(one.sum()))
    return flux


def _source(total: _HeatSum, substep: SubstepData, loads: ThermalLoads, T: Floats) -> Floats:
    """Return (n,) heat made in bodies [W]; the derivative of its opposite goes to the total's places."""
    source, parts = np.zeros(T.size), np.zeros(len(loads.Q_T))
    if substep.uniform_volumes is not None:
        Q = np.array([0.0 if isinstance(q, np.ndarray) else q for q in loads.Q_T])
        source += Q @ substep.uniform_volumes
        parts += Q * substep.uniform_volumes.sum(axis=1)
    for of_field in substep.field_sources:
        made = loads.Q_T[of_field.body] @ of_field.shapes
        source += made
        parts[of_field.body] += made.sum()
    for source_of_T in substep.temperature_sources:
        made, slope = temperature_source_flow(source_of_T, loads.Q_T[source_of_T.body], T)
        source += made
        parts[source_of_T.body] += made.sum()
        total.places.append((source_of_T.slots, slope))
    total.sources = parts
    return source


def _add_surroundings(total: _HeatSum, substep: SubstepData, loads: ThermalLoads, T: Floats) -> None:
    for film, levels in zip(substep.films, loads.films, strict=True):
        flow, slope = film_flow(film, levels.h, levels.Te, T)
        total.leave("convection", film.points.node, flow)
        total.places.append((film.points.slots, slope))
    for radiator, around in zip(substep.radiators, loads.radiators, strict=True):
        flow, slope = surroundings_radiation_flow(radiator, substep.sigma_SB, around.factor, around.T_inf, T)
        total.leave("radiation", radiator.points.node, flow)
        total.places.append((radiator.points.slots, slope))


def missed_along(substep: SubstepData, loads: ThermalLoads, T: Floats, body: Ints, n_bodies: int) -> Floats:
    """Return (n_bodies,) [W K] that films and radiation miss because their heat is taken at nodes.

    T : (n,) [K].  body : (n,) of nodes.  Of an edge with conductance G whose ends are d apart the nodes have
    G (a a + b b)/2, and what is linear between them G (a a + a b + b b)/3, which is less by G d d/6.
    """
    missed = np.zeros(n_bodies)
    exposed = [(film.points, film_flow(film, at.h, at.Te, T)[1])
               for film, at in zip(substep.films, loads.films, strict=True)]
    exposed += [(radiator.points, surroundings_radiation_flow(radiator, substep.sigma_SB, at.factor, at.T_inf, T)[1])
                for radiator, at in zip(substep.radiators, loads.radiators, strict=True)]
    for points, slope in exposed:
        one, other = points.edges.T
        G = np.maximum(slope.reshape(-1, 2).sum(axis=1), 0.0)
        missed += np.bincount(body[one], G * (T[one] - T[other]) ** 2 / 6.0, n_bodies)
    return missed


def _add_pairs(total: _HeatSum, substep: SubstepData, loads: ThermalLoads, T: Floats) -> None:
    for group in substep.conduction_groups:
        factor = loads.pairs[group.pair].of(group.closed)
        if factor != 0.0:
            flow, slope, averaged = exchange_flow(group, factor, T)
            total.cross(group.mechanism, group.pair, group.nodes, flow, slope)
            if averaged is not None:
                total.cross(group.mechanism, group.pair, group.nodes, averaged.flow, averaged.slope, averaged.nodes)
    for near in substep.radiation_groups:
        flow, slope = gap_radiation_flow(near, substep.sigma_SB, T)
        total.cross("near_radiation", near.pair, near.nodes, flow, slope)


# Limits of boundary data.  They hold at the temperatures a stage ends with; iterates may exceed them.

def demand_limits(substep: SubstepData, loads: ThermalLoads, T: Floats) -> None:
    """Check boundary data at T : (n,) [K]: kelvin where surfaces radiate, emissivities in (0, 1], h not negative.

    Raises BadPropertyError naming the value that was met.
    """
    for radiator, levels in zip(substep.radiators, loads.radiators, strict=True):
        T_a = T[radiator.points.node]
        where = f"surface {radiator.radiator.where.surface}"
        _demand_kelvin(T_a, where)
        T_inf = np.min(resolve(levels.T_inf, radiator.T_inf))
        if T_inf < 0.0:
            raise BadPropertyError(f"{where} radiates to surroundings of {T_inf:.6g}: "
                                   "radiation needs temperatures in kelvin")
        _demand_emissivity(radiator.radiator.emissivity, T_a, where)
    for group in substep.radiation_groups:
        for side, emissivity, N, nodes in (
                ("slave", group.emissivities[0], group.N_s, group.nodes[:, :2]),
                ("master", group.emissivities[1], group.N_m, group.nodes[:, 2:])):
            T_a = (N * T[nodes]).sum(axis=1)
            _demand_kelvin(T_a, f"the {side} side of a pair")
            _demand_emissivity(emissivity, T_a, f"the {side} side of a pair")
    for film, film_levels in zip(substep.films, loads.films, strict=True):
        if film.h is not None and np.min(resolve(film_levels.h, film.h)) < 0.0:
            raise BadPropertyError(f"the film coefficient of surface {film.film.where.surface} is negative "
                                   f"({np.min(resolve(film_levels.h, film.h)):.6g}) at a place of it")
        if film.film.h_factor is not None:
            T_a = T[film.points.node]
            factor = film.film.h_factor(T_a)
            if (factor < 0.0).any():
                raise BadPropertyError(f"the h_factor of surface {film.film.where.surface} is {factor.min():.6g} "
                                       f"at {T_a[np.argmin(factor)]:.6g} K")


def _demand_kelvin(T: Floats, where: str) -> None:
    # fault: kelvin not asked for -> if not (T > -1e9).all(): | thermal_fmu/test_thermal_radiation
    if not (T > 0.0).all():
        raise BadPropertyError(f"{where} radiates at {np.min(T):.6g}: radiation needs temperatures in kelvin, above 0")


def _demand_emissivity(emissivity: Property, T: Floats, where: str) -> None:
    if emissivity.is_constant:
        return
    eps = emissivity(T)
    # fault: emissivity not watched -> wrong = eps > 1e9 | thermal_fmu/test_thermal_radiation
    wrong = ~((eps > 0.0) & (eps <= 1.0))
    if wrong.any():
        raise BadPropertyError(f"the emissivity of {where} is {eps[wrong][0]:.6g} at {T[wrong][0]:.6g} K; "
                               "it must be greater than 0 and at most 1")


# Heat of a substep by mechanism: the terms of a run's heat balance.

@dataclass(frozen=True)
class Heat:
    """Energies INTO the bodies [J], weighted with the stages the method used.

    stored : (n_bodies,) increase of enthalpy, summed over the nodes.
    temperature : (2,) through prescribed temperatures, in at some nodes and out (< 0) at others, from the residual
    there: a net sum would be round-off where as much comes in as goes out.  terms : (n_terms,) as boundary.TERMS.
    each : (n,) by condition, source and side of a pair (conditions.py).
    moved : sum over the nodes of what each took up or gave off, which is not 0 where heat only runs inside a body.
    """

    stored: Floats
    temperature: Floats
    terms: Floats
    each: Floats
    moved: float = 0.0

    def __add__(self, other: Heat) -> Heat:
        return Heat(self.stored + other.stored, self.temperature + other.temperature,
                    self.terms + other.terms, self.each + other.each, self.moved + other.moved)

    def outputs(self, model: Model) -> dict[str, float]:
        """Return the outputs heat.* by name: the terms that the scene can have."""
        named = {f"heat.stored.{body.name}": float(J) for body, J in zip(model.bodies, self.stored, strict=True)}
        for direction, J in zip(("in", "out"), self.temperature, strict=True):
            named[f"heat.temperature.{direction}"] = float(J)
        possible = terms_of(model)
        return named | {f"heat.{name}": float(J) for name, J in zip(TERMS, self.terms, strict=True) if name in possible}


def inflow_outflow(through: Floats) -> Floats:
    """Return (2,) the sums of positive and of negative values [J] of through : (n,) [J]."""
    return np.array([through[through > 0.0].sum(), through[through < 0.0].sum()])


def through_prescribed(through: Floats, owners: Ints, n: int) -> Floats:
    """Return (n,) the heat through each prescribed temperature [J], of through : (n_fixed,) [J] at fixed nodes.

    owners : (n_fixed,) which of them each node belongs to, n where to none.
    """
    return np.asarray(np.bincount(owners, through, n + 1)[:n], dtype=np.float64)


def no_heat(n_bodies: int) -> Heat:
    """Return the heat before the first step: zeros."""
    return Heat(np.zeros(n_bodies), np.zeros(2), np.zeros(len(TERMS)), np.zeros(0))


def terms_of(model: Model) -> frozenset[str]:
    """Return those of boundary.TERMS that a scene can have."""
    near = any(pair is not None and pair.emissivities is not None for pair in model.pairs)
    possible = {"radiation": bool(model.radiators), "near_radiation": near, "friction": bool(model.pairs)}
    return frozenset(name for name in TERMS if possible.get(name.partition(".")[0], True))


def names_of(model: Model) -> tuple[str, ...]:
    """Return the names of the outputs heat.*"""
    return tuple(no_heat(len(model.bodies)).outputs(model))
