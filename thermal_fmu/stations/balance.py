"""The heat balance of a stage at the stations, and its derivative as a band matrix."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from thermal_fmu import phase_change
from thermal_fmu.boundary import BoundaryHeat, boundary_flow
from thermal_fmu.cells import BadPropertyError
from thermal_fmu.methods import Stage
from thermal_fmu.phase_change import Melting, NodalFields
from thermal_fmu.problem import ThermalBody
from thermal_fmu.scene import SubstepData
from thermal_fmu.sources import ThermalLoads
from thermal_fmu.stations.scene import StationScene
from thermal_fmu.stations.stations import (
    N,
    StationGeometry,
    add_melting_fields,
    add_rod_conduction,
    add_rod_slopes,
    melting_heat,
    rod_points,
)

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class StationSubstep:
    """What is constant through a substep: shape now, first the shape in the reference, and the boundary data."""

    scene: StationScene
    shape: StationGeometry
    first: StationGeometry
    data: SubstepData


@dataclass(frozen=True)
class StationProblem:
    """Find s with  E(s) - E(s_n) = dt (sum_j a_j F_j + a f(T_n + theta (T(s) - T_n))).

    s_n : (n,) start of the step [K], T itself in bodies that do not melt.  power_M : (n,) [W].
    earlier : (n,) dt sum_j a_j F_j [J].  blur : as in thermal_fmu/newton.py.
    """

    substep: StationSubstep
    loads: ThermalLoads
    stage: Stage
    dt: float
    s_n: Floats
    power_M: Floats
    earlier: Floats
    blur: float = 0.0

    @cached_property
    def start(self) -> NodalFields:
        """The fields at s_n."""
        return _fields(self.substep.scene.melting, self.s_n)


@dataclass(frozen=True)
class StationBalance:
    """The heat balance of a stage at the stations.

    R : (n,) residual [J]; at fixed stations the heat that came through them.  flow : (n,) [W] into the stations,
    reactions included.  terms : (n_terms,) [W], as boundary.TERMS, each : as BoundaryHeat has it.
    stored : (n_bodies,) [J].  norm : sum of |R| at free stations, missing : |sum of R| there, scale : of
    the sizes of all heats [J].
    band : (3 width + 1, n) dR/ds [J/K].
    pull : (n,) what the change of prescribed values since s_n does to the residual of their neighbours [J].
    moved : sum over the stations of what each took up or gave off [J].
    """

    R: Floats
    flow: Floats
    terms: Floats
    each: Floats
    stored: Floats
    norm: float
    missing: float
    scale: float
    band: Floats
    pull: Floats
    moved: float

    @property
    def relative_residual(self) -> float:
        """norm as a part of scale [1]."""
        return self.norm / self.scale if self.scale > 0 else 0.0


def station_balance(problem: StationProblem, s: Floats) -> StationBalance:
    """Evaluate residual and derivative (identity in rows and columns of fixed stations) at s : (n,) [K].

    Raises BadPropertyError.
    """
    scene, stage = problem.substep.scene, problem.stage
    weight = stage.a * problem.dt
    at = _fields(scene.melting, s)
    if problem.blur > 0.0:
        at = phase_change.blurred(scene.melting, at, s, problem.blur, scene.fixed)
    if stage.theta != 1.0:
        # fault: stations see the boundary at the end of a stage only -> at = phase_change.between(problem.start, at,
        #   1.0) | thermal_fmu/test_lumped
        at = phase_change.between(problem.start, at, stage.theta)
    band = np.zeros((3 * scene.stations.width + 1, scene.stations.n))
    S, stored = _store(problem, s, band)
    f = _conduct(problem.substep, at, stage.theta * weight, band)
    boundary = boundary_flow(problem.substep.data, problem.loads, problem.power_M, at.T)
    f += boundary.f
    _gather(scene, boundary, stage.theta * weight, at.dT, band)
    pull = scene.stations.times(band, np.where(scene.fixed, s - problem.s_n, 0.0))
    touched, diagonal = scene.fixed_places
    band.reshape(-1)[touched], band.reshape(-1)[diagonal] = 0.0, 1.0
    R = S - problem.earlier - weight * f
    reaction = np.where(scene.fixed, R, 0.0)
    moved, free = float(np.abs(S).sum()), R - reaction
    scale = moved + float(np.abs(reaction).sum()) + weight * boundary.magnitude
    of_own = moved if problem.substep.data.solved is None else float(np.abs(S[problem.substep.data.solved]).sum())
    return StationBalance(R, f + reaction / weight if weight else f, boundary.terms, boundary.each, stored,
                          float(np.abs(free).sum()), abs(float(free.sum())), scale, band, pull, of_own)


def _fields(melting: tuple[Melting, ...], s: Floats) -> NodalFields:
    """Evaluate the fields as phase_change.fields does."""
    if not melting:
        return NodalFields(s)
    T, f_s, dT, df = s.copy(), np.ones(s.size), np.ones(s.size), np.zeros(s.size)
    for body in melting:
        change = body.change
        add_melting_fields(s, body.nodes, change.T_s, change.T_l, change.W, T, f_s, dT, df)
    return NodalFields(T, f_s, dT, df)


def _gather(scene: StationScene, boundary: BoundaryHeat, slope: float, dT: Floats | None, band: Floats) -> None:
    """Add the derivatives of the boundary terms to the band."""
    stations, flat = scene.stations, band.reshape(-1)
    places = [(slots.ravel(), values.ravel()) for slots, values in boundary.places]
    for nodes, values in boundary.across:
        slots = stations.slots(nodes[:, :, None].astype(np.intp), nodes[:, None, :].astype(np.intp))
        places.append((slots.ravel(), values.ravel()))
    for slots, values in places:
        change = slope * values
        np.add.at(flat, slots, change if dT is None else change * dT[slots % stations.n])


def _store(problem: StationProblem, s: Floats, band: Floats) -> tuple[Floats, Floats]:
    """Return (n,) increase of enthalpy since s_n [J], and (n_bodies,) sums of it where it is stored; band += dE/ds."""
    scene, first = problem.substep.scene, problem.substep.first
    S, stored = np.zeros(s.size), np.zeros(len(scene.stations.own))
    middle = 2 * scene.stations.width
    for b, (body, own) in enumerate(zip(scene.model.bodies, scene.stations.own, strict=True)):
        dE, C = at_stations(body, body.material.rho * first.volume[own], problem.s_n[own], s[own])
        S[own] += dE
        band[middle, own] += C
        stored[b] = dE.sum()
    return S, stored


def at_stations(body: ThermalBody, mass: Floats, s0: Floats, s1: Floats) -> tuple[Floats, Floats]:
    """Store at the stations, as thermal_fmu/cells.py does at nodes and for its reasons; also their capacity [J/K]."""
    change = body.material.phase
    if change is None:
        c = body.material.c.solid
        return mass * c.increase(s0, s1), mass * _positive("heat capacity", c(s1), body)
    if change.T_s == change.T_l and change.solid.constant is not None and change.liquid.constant is not None:
        C = np.empty(s0.size)
        dh = melting_heat(s0, s1, change.T_s, change.W, change.L, change.solid.constant, change.liquid.constant, C)
        # fault: lumped latent heat lost -> return mass * C * (s1 - s0), mass * C | thermal_fmu/test_lumped
        return mass * dh, mass * C
    return mass * change.increase(s0, s1), mass * _positive("heat capacity", change.capacity(s1), body)


def _conduct(substep: StationSubstep, at: NodalFields, scale: float, band: Floats) -> Floats:
    """Return (n,) heat that flows into the stations from their neighbours [W].

    band : to it scale times the derivative of -f by s is added.
    """
    f = np.zeros(at.T.size)
    dT = np.ones(at.T.size) if at.dT is None else at.dT
    for body, own, piece in zip(substep.scene.model.bodies, substep.scene.stations.own, substep.shape.pieces,
                                strict=False):
        k = body.material.k.k_1
        if k.is_constant:
            kA = float(k.solid(at.T[:1])[0]) * piece.conducts
            add_rod_slopes(own, add_rod_conduction(at.T, own, kA, f), dT, scale, band)
            continue
        # Heat flows down the integral of k over temperature, as in cells (thermal_fmu/potentials.py).
        left, right = at.T[own[:-1]], at.T[own[1:]]
        f_s = np.ones(piece.conducts.shape) if at.f_s is None or k.is_one else rod_points(at.f_s, own, N)
        drop, slope = np.zeros(left.size), np.zeros((left.size, 2))
        for phase, share in ((k.solid, f_s), (k.liquid, 1.0 - f_s))[:1 if k.is_one else 2]:
            A = (share * piece.conducts).sum(axis=1)
            # fault: a rod conducts by the mean temperature of a piece -> drop += A * phase(0.5 * (left + right)) *
            #   (left - right) | thermal_fmu/test_steep_conductivity
            drop += A * phase.increase(right, left)
            slope += A[:, None] * np.stack([_positive("conductivity", phase(left), body),
                                            -_positive("conductivity", phase(right), body)], axis=1)
        f[own[:-1]] -= drop
        f[own[1:]] += drop
        add_rod_slopes(own, slope, dT, scale, band)
        if not k.is_one and at.df is not None:
            between = k.solid.increase(right, left) - k.liquid.increase(right, left)
            add_rod_slopes(own, (piece.conducts @ N) * between[:, None], at.df, scale, band)
    return f


def _positive(what: str, values: Floats, body: ThermalBody) -> Floats:
    if not (values > 0).all():
        raise BadPropertyError(f"the {what} of body {body.name} is {np.nanmin(values):.6g} at a temperature that was "
                               "met")
    return values
