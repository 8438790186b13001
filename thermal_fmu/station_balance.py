"""One stage of a method at the stations: its residual, in joules, and the exact derivative of it as a band."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from thermal_fmu import phase
from thermal_fmu.boundary import Boundary, boundary_flow
from thermal_fmu.held import Held
from thermal_fmu.loads import Loads
from thermal_fmu.methods import Stage
from thermal_fmu.nodal import at_nodes
from thermal_fmu.phase import Fields
from thermal_fmu.spec import Body
from thermal_fmu.station_scene import StationScene
from thermal_fmu.station_shapes import N, Piece, StationShape
from thermal_fmu.volume import BadPropertyError

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


@dataclass(frozen=True)
class Ground:
    """Held through a substep: shape now, first the shape in the reference, and the boundary data of `held`."""

    scene: StationScene
    shape: StationShape
    first: StationShape
    held: Held


@dataclass(frozen=True)
class StationProblem:
    """Find s with  E(s) - E(s_n) = dt (sum_j a_j F_j + a f(T_n + theta (T(s) - T_n))).

    s_n : (n,) start of the step [K], T itself in bodies that do not melt.  power_M : (n,) [W].
    earlier : (n,) dt sum_j a_j F_j [J].  blur : as in thermal_fmu/stage.py.
    """

    ground: Ground
    loads: Loads
    stage: Stage
    dt: float
    s_n: Floats
    power_M: Floats
    earlier: Floats
    blur: float = 0.0

    @cached_property
    def start(self) -> Fields:
        """The fields at s_n."""
        return phase.fields(self.ground.scene.melting, self.s_n)


@dataclass(frozen=True)
class StationBalance:
    """R : (n,) what is missing [J]; at fixed stations the heat that came through them.  flow : (n,) [W] into the
    stations, reactions included.  terms : [W], by boundary.TERMS.  stored : (n_bodies,) [J].  norm : sum of |R| at free
    stations, scale : of the sizes of all heats [J].  band : dR/ds by places.
    """

    R: Floats
    flow: Floats
    terms: Floats
    stored: Floats
    norm: float
    scale: float
    band: Floats

    @property
    def share(self) -> float:
        """norm as a share of scale."""
        return self.norm / self.scale if self.scale > 0 else 0.0


class _Places:
    """Entries of the band gathered on the way."""

    def __init__(self) -> None:
        self.slots: list[Ints] = []
        self.values: list[Floats] = []

    def add(self, slots: Ints, values: Floats) -> None:
        self.slots.append(slots.ravel())
        self.values.append(values.ravel())

    def band(self, size: int) -> Floats:
        if not self.slots:
            return np.zeros(size)
        return at_nodes(np.concatenate(self.slots), np.concatenate(self.values), size)


def station_balance(problem: StationProblem, s: Floats) -> StationBalance:
    """Residual and derivative (identity in rows and columns of fixed stations) at s : (n,) [K].

    Raises BadPropertyError.
    """
    scene, stage = problem.ground.scene, problem.stage
    weight = stage.a * problem.dt
    at = phase.fields(scene.melting, s)
    if problem.blur > 0.0:
        at = phase.blurred(scene.melting, at, s, problem.blur, scene.fixed)
    if stage.theta != 1.0:
        at = phase.between(problem.start, at, stage.theta)
    stores, flows, by_phase = _Places(), _Places(), _Places()
    S, stored = _store(problem, s, stores)
    f = _conduct(problem.ground, at, flows, by_phase)
    boundary = boundary_flow(problem.ground.held, problem.loads, problem.power_M, at.T)
    f += boundary.f
    _gather(scene, boundary, flows)
    R = S - problem.earlier - weight * f
    reaction = np.where(scene.fixed, R, 0.0)
    scale = float(np.abs(S).sum() + np.abs(reaction).sum()) + weight * boundary.magnitude
    size, slope = scene.stations.band_size, stage.theta * weight
    change = flows.band(size)
    if at.dT is not None:
        change = change * at.dT[scene.stations.column_of_slot] + by_phase.band(size)
    band = stores.band(size) + slope * change
    touched, diagonal = scene.fixed_places
    band[touched] = 0.0
    band[diagonal] = 1.0
    return StationBalance(R, f + reaction / weight if weight else f, boundary.terms, stored,
                          float(np.abs(R - reaction).sum()), scale, band)


def _gather(scene: StationScene, boundary: Boundary, flows: _Places) -> None:
    for slots, values in boundary.places:
        flows.add(slots, values)
    for nodes, values in boundary.across:
        flows.add(scene.stations.slots(nodes[:, :, None].astype(np.intp), nodes[:, None, :].astype(np.intp)), values)


def _store(problem: StationProblem, s: Floats, places: _Places) -> tuple[Floats, Floats]:
    """(n,) increase of enthalpy since s_n [J], and (n_bodies,) sums of it where it is stored."""
    scene, first = problem.ground.scene, problem.ground.first
    S, stored = np.zeros(s.size), np.zeros(len(scene.stations.own))
    for b, (body, own) in enumerate(zip(scene.model.bodies, scene.stations.own, strict=True)):
        s0, s1 = problem.s_n[own], s[own]
        if not first.pieces or body.material.phase is not None:
            dE, C = _at_stations(body, body.material.rho * first.volume[own], s0, s1)
            S[own] += dE
            places.add(scene.stations.slots(own, own), C)
        else:
            dE_q, C_q = _at_points(body, body.material.rho * first.pieces[b].dV, s0, s1)
            dE = dE_q @ N
            S[own[:-1]] += dE[:, 0]
            S[own[1:]] += dE[:, 1]
            places.add(_pairs(scene, own), np.einsum("mq,qi,qj->mij", C_q, N, N))
            dE = dE_q
        stored[b] = dE.sum()
    return S, stored


def _at_stations(body: Body, mass: Floats, s0: Floats, s1: Floats) -> tuple[Floats, Floats]:
    """Lumped at the stations, as a front inside a piece would else make heat run backwards."""
    change = body.material.phase
    if change is None:
        c = body.material.c.solid
        return mass * c.increase(s0, s1), mass * _positive("heat capacity", c(s1), body)
    return mass * change.increase(s0, s1), mass * _positive("heat capacity", change.capacity(s1), body)


def _at_points(body: Body, mass: Floats, s0: Floats, s1: Floats) -> tuple[Floats, Floats]:
    c = body.material.c.solid
    T0, T1 = _points(s0), _points(s1)
    return mass * c.increase(T0, T1), mass * _positive("heat capacity", c(T1), body)


def _conduct(ground: Ground, at: Fields, by_T: _Places, by_s: _Places) -> Floats:
    """(n,) heat that flows into the stations from their neighbours [W]."""
    f = np.zeros(at.T.size)
    stations = ground.scene.stations
    for body, own, piece in zip(ground.scene.model.bodies, stations.own, ground.shape.pieces, strict=False):
        flow, slope, phase_slope = _between(body, piece, at, own)
        f[own[:-1]] -= flow
        f[own[1:]] += flow
        pairs = _pairs(ground.scene, own)
        by_T.add(pairs, np.stack([slope, -slope], axis=1))
        if phase_slope is not None:
            by_s.add(pairs, np.stack([phase_slope, -phase_slope], axis=1))
    return f


def _between(body: Body, piece: Piece, at: Fields, own: Ints) -> tuple[Floats, Floats, Floats | None]:
    """(m,) heat from left to right in each piece [W]; (m, 2) its derivatives by T and, through f_s, by s of its ends."""
    T = at.T[own]
    k, drop = body.material.k.k_1, T[:-1] - T[1:]
    if k.is_constant:
        G = (k.solid(T[:1])[0] * piece.conducts).sum(axis=1)
        return G * drop, np.stack([G, -G], axis=1), None
    T_q = _points(T)
    f_q = None if at.f_s is None else _points(at.f_s[own])
    k_q = _positive("conductivity", k(T_q, f_q), body)
    G = (k_q * piece.conducts).sum(axis=1)
    slope = (k.slope(T_q, f_q) * piece.conducts) @ N * drop[:, None]
    phase_slope = None
    if at.df is not None and not k.is_one:
        df = at.df[own]
        phase_slope = (k.phase_slope(T_q) * piece.conducts) @ N * drop[:, None] * np.stack([df[:-1], df[1:]], axis=1)
    return G * drop, slope + np.stack([G, -G], axis=1), phase_slope


def _points(values: Floats) -> Floats:
    return np.stack([values[:-1], values[1:]], axis=1) @ N.T


def _pairs(scene: StationScene, own: Ints) -> Ints:
    ends = np.stack([own[:-1], own[1:]], axis=1)
    return scene.stations.slots(ends[:, :, None], ends[:, None, :])


def _positive(what: str, values: Floats, body: Body) -> Floats:
    if not (values > 0).all():
        raise BadPropertyError(f"the {what} of body {body.name} is {np.nanmin(values):.6g} at a temperature that was "
                               "met")
    return values
