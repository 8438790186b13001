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
from thermal_fmu.phase import Fields, Melting
from thermal_fmu.spec import Body
from thermal_fmu.station_kernels import (
    add_melting_fields,
    add_rod_conduction,
    add_rod_slopes,
    add_rod_storage,
    melting_heat,
    rod_points,
)
from thermal_fmu.station_scene import StationScene
from thermal_fmu.station_shapes import N, StationShape
from thermal_fmu.volume import BadPropertyError

Floats = NDArray[np.float64]


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
        return _fields(self.ground.scene.melting, self.s_n)


@dataclass(frozen=True)
class StationBalance:
    """R : (n,) what is missing [J]; at fixed stations the heat that came through them.  flow : (n,) [W] into the
    stations, reactions included.  terms : [W], by boundary.TERMS.  stored : (n_bodies,) [J].  norm : sum of |R| at free
    stations, scale : of the sizes of all heats [J].  band : (3 width + 1, n) dR/ds.
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


def station_balance(problem: StationProblem, s: Floats) -> StationBalance:
    """Residual and derivative (identity in rows and columns of fixed stations) at s : (n,) [K].

    Raises BadPropertyError.
    """
    scene, stage = problem.ground.scene, problem.stage
    weight = stage.a * problem.dt
    at = _fields(scene.melting, s)
    if problem.blur > 0.0:
        at = phase.blurred(scene.melting, at, s, problem.blur, scene.fixed)
    if stage.theta != 1.0:
        # fault: stations see the boundary at the end of a stage only -> at = phase.between(problem.start, at, 1.0) |
        #   thermal_fmu/test_lumped
        at = phase.between(problem.start, at, stage.theta)
    band = np.zeros((3 * scene.stations.width + 1, scene.stations.n))
    S, stored = _store(problem, s, band)
    f = _conduct(problem.ground, at, stage.theta * weight, band)
    boundary = boundary_flow(problem.ground.held, problem.loads, problem.power_M, at.T)
    f += boundary.f
    _gather(scene, boundary, stage.theta * weight, at.dT, band)
    R = S - problem.earlier - weight * f
    reaction = np.where(scene.fixed, R, 0.0)
    scale = float(np.abs(S).sum() + np.abs(reaction).sum()) + weight * boundary.magnitude
    return StationBalance(R, f + reaction / weight if weight else f, boundary.terms, stored,
                          float(np.abs(R - reaction).sum()), scale, band)


def _fields(melting: tuple[Melting, ...], s: Floats) -> Fields:
    """As phase.fields."""
    if not melting:
        return Fields(s)
    T, f_s, dT, df = s.copy(), np.ones(s.size), np.ones(s.size), np.zeros(s.size)
    for body in melting:
        change = body.change
        add_melting_fields(s, body.nodes, (change.T_s, change.T_l, change.W), T, f_s, dT, df)
    return Fields(T, f_s, dT, df)


def _gather(scene: StationScene, boundary: Boundary, slope: float, dT: Floats | None, band: Floats) -> None:
    """The derivatives of the boundary terms, and the identity at fixed stations, go to the band."""
    stations, flat = scene.stations, band.reshape(-1)
    places = [(slots.ravel(), values.ravel()) for slots, values in boundary.places]
    for nodes, values in boundary.across:
        slots = stations.slots(nodes[:, :, None].astype(np.intp), nodes[:, None, :].astype(np.intp))
        places.append((slots.ravel(), values.ravel()))
    for slots, values in places:
        change = slope * values
        np.add.at(flat, slots, change if dT is None else change * dT[slots % stations.n])
    touched, diagonal = scene.fixed_places
    flat[touched] = 0.0
    flat[diagonal] = 1.0


def _store(problem: StationProblem, s: Floats, band: Floats) -> tuple[Floats, Floats]:
    """(n,) increase of enthalpy since s_n [J], and (n_bodies,) sums of it where it is stored; band += dE/ds."""
    scene, first = problem.ground.scene, problem.ground.first
    S, stored = np.zeros(s.size), np.zeros(len(scene.stations.own))
    middle = 2 * scene.stations.width
    for b, (body, own) in enumerate(zip(scene.model.bodies, scene.stations.own, strict=True)):
        if not first.pieces or body.material.phase is not None:
            dE, C = _at_stations(body, body.material.rho * first.volume[own], problem.s_n[own], s[own])
            S[own] += dE
            band[middle, own] += C
        else:
            mass, c = body.material.rho * first.pieces[b].dV, body.material.c.solid
            T = rod_points(s, own, N)
            dE = mass * c.increase(rod_points(problem.s_n, own, N), T)
            add_rod_storage(own, N, dE, mass * _positive("heat capacity", c(T), body), S, band)
        stored[b] = dE.sum()
    return S, stored


def _at_stations(body: Body, mass: Floats, s0: Floats, s1: Floats) -> tuple[Floats, Floats]:
    """Lumped at the stations, as a front inside a piece would else make heat run backwards."""
    change = body.material.phase
    if change is None:
        c = body.material.c.solid
        return mass * c.increase(s0, s1), mass * _positive("heat capacity", c(s1), body)
    if change.T_s == change.T_l and change.solid.constant is not None and change.liquid.constant is not None:
        C = np.empty(s0.size)
        dh = melting_heat(s0, s1, (change.T_s, change.W, change.L), (change.solid.constant, change.liquid.constant), C)
        # fault: lumped latent heat lost -> return mass * C * (s1 - s0), mass * C | thermal_fmu/test_lumped
        return mass * dh, mass * C
    return mass * change.increase(s0, s1), mass * _positive("heat capacity", change.capacity(s1), body)


def _conduct(ground: Ground, at: Fields, scale: float, band: Floats) -> Floats:
    """(n,) heat that flows into the stations from their neighbours [W]; band += scale * the derivative of -f by s."""
    f = np.zeros(at.T.size)
    dT = np.ones(at.T.size) if at.dT is None else at.dT
    for body, own, piece in zip(ground.scene.model.bodies, ground.scene.stations.own, ground.shape.pieces,
                                strict=False):
        k = body.material.k.k_1
        if k.is_constant:
            kA = float(k.solid(at.T[:1])[0]) * piece.conducts
            add_rod_slopes(own, add_rod_conduction(at.T, own, N, kA, np.zeros(kA.shape), f), dT, scale, band)
            continue
        T = rod_points(at.T, own, N)
        f_s = None if at.f_s is None or k.is_one else rod_points(at.f_s, own, N)
        kA = _positive("conductivity", k(T, f_s), body) * piece.conducts
        slope = add_rod_conduction(at.T, own, N, kA, k.slope(T, f_s) * piece.conducts, f)
        add_rod_slopes(own, slope, dT, scale, band)
        if f_s is not None and at.df is not None:
            drop = at.T[own[:-1]] - at.T[own[1:]]
            add_rod_slopes(own, (k.phase_slope(T) * piece.conducts) @ N * drop[:, None], at.df, scale, band)
    return f


def _positive(what: str, values: Floats, body: Body) -> Floats:
    if not (values > 0).all():
        raise BadPropertyError(f"the {what} of body {body.name} is {np.nanmin(values):.6g} at a temperature that was "
                               "met")
    return values
