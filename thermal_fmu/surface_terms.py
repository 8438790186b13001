"""Radiation: to the surroundings, Eq. (12), and between facing points, Eq. (11).

T^4 is continued below 0 K as T |T|^3, and an emissivity beyond its range as its nearest bound: Newton's method may pass
there on its way.  What it ends with is checked (thermal_fmu/limits.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.field import Level, resolve
from contact.half.property import Property
from contact.laws import gap_factor
from thermal_fmu.exposed import ExposedPoints, Ground, exposed_points
from thermal_fmu.facing import Points
from thermal_fmu.spec_boundary import NearRadiation, PairLaws, Radiator

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

LEAST_EMISSIVITY = 1e-6  # met only between Newton's steps; it keeps 1/eps a number


@dataclass(frozen=True)
class HeldRadiator:
    """A radiating surface on given coordinates.  T_inf : (n_terms, n) shapes at the points, None where uniform."""

    radiator: Radiator
    points: ExposedPoints
    T_inf: Floats | None


@dataclass(frozen=True)
class NearGroup:
    """Facing points of a pair that radiate to each other.

    nodes : (n, 4), slave's two, master's two.  N_s, N_m : (n, 2).  area : (n,) weighted with 1 - w [m2].
    """

    spec: NearRadiation
    nodes: Ints
    N_s: Floats
    N_m: Floats
    area: Floats


def hold_radiator(radiator: Radiator, slots: NDArray[np.int64], ground: Ground) -> HeldRadiator:
    """A radiating surface where it is open.  slots : (n_edges, 2, 2) of its edges."""
    points = exposed_points(radiator.where, slots, ground)
    uniform = radiator.T_inf.is_uniform
    return HeldRadiator(radiator, points, None if uniform else radiator.T_inf.shapes(points.places(ground.x)))


def near_groups(points: Points, pairs: Sequence[PairLaws | None]) -> tuple[NearGroup, ...]:
    """The facing points that radiate to each other, touching or apart, by pair; Eq. (11) with its weight 1 - w."""
    groups = []
    for pair, laws in enumerate(pairs):
        if laws is None or laws.radiation is None:
            continue
        near, far = laws.radiation.near, laws.radiation.far
        share = np.ones(points.gap.size)
        if near is not None and far is not None:
            # fault: near radiation at every gap -> share -= 0.0 * gap_factor(points.gap, near, far) |
            #   thermal_fmu/test_thermal_radiation
            share -= gap_factor(points.gap, near, far)
        at = np.flatnonzero((points.pair == pair) & (share > 0.0))
        if at.size:
            groups.append(NearGroup(laws.radiation, points.nodes[at], points.N_s[at], points.N_m[at],
                                    (share * points.area)[at]))
    return tuple(groups)


def far_flow(held: HeldRadiator, sigma: float, level: tuple[float, Level], T: Floats) -> tuple[Floats, Floats]:
    """(n, 2) heat that leaves each point's nodes [W] at T : (n_nodes,) [K], and (n, 2, 2) its derivative [W/K].

    sigma : [W/m2K4].  level : factor, and the level of T_inf [K].  Eq. (12): sigma eps(T) (T^4 - T_inf^4).
    """
    points = held.points
    T_a = (points.N * T[points.nodes]).sum(axis=1)
    T_inf = resolve(level[1], held.T_inf)
    eps, deps = _emissivity(held.radiator.emissivity, T_a)
    strength = level[0] * sigma * points.area
    # fault: radiation to 0 K whatever surrounds -> excess = _fourth(T_a) | thermal_fmu/test_thermal_radiation
    excess = _fourth(T_a) - _fourth(T_inf)
    flow = (strength * eps * excess)[:, None] * points.N
    # fault: derivative of far radiation -> dq = strength * (deps * excess + 3.0 * eps * np.abs(T_a) ** 3) |
    #   thermal_fmu/test_thermal_fields
    dq = strength * (deps * excess + 4.0 * eps * np.abs(T_a) ** 3)
    return flow, dq[:, None, None] * points.N[:, :, None] * points.N[:, None, :]


def near_flow(group: NearGroup, sigma: float, T: Floats) -> tuple[Floats, Floats]:
    """(n, 4) heat that leaves the nodes of each point [W], and (n, 4, 4) its derivative [W/K].

    T : (n_nodes,) [K], sigma : [W/m2K4].  Eq. (11): q = (1 - w) sigma (T_s^4 - T_m^4)/(1/eps_s + 1/eps_m - 1) leaves
    the slave's nodes by its shape functions and enters the master's by theirs.
    """
    T_s = (group.N_s * T[group.nodes[:, :2]]).sum(axis=1)
    T_m = (group.N_m * T[group.nodes[:, 2:]]).sum(axis=1)
    # fault: emissivities mixed up between the sides -> eps_s, deps_s = _emissivity(group.spec.emissivity_slave, T_m) |
    #   thermal_fmu/test_thermal_radiation
    eps_s, deps_s = _emissivity(group.spec.emissivity_slave, T_s)
    eps_m, deps_m = _emissivity(group.spec.emissivity_master, T_m)
    # fault: black bodies between plates -> strength = sigma * group.area / (1.0 / eps_s + 1.0 / eps_m) |
    #   thermal_fmu/test_thermal_radiation
    strength = sigma * group.area / (1.0 / eps_s + 1.0 / eps_m - 1.0)
    q = strength * (_fourth(T_s) - _fourth(T_m))
    per_resistance = q * strength / (sigma * group.area)
    dq_s = 4.0 * strength * np.abs(T_s) ** 3 + per_resistance * deps_s / eps_s**2
    # fault: derivative of the master's emissivity forgotten -> dq_m = -4.0 * strength * np.abs(T_m) ** 3 + 0.0 *
    #   per_resistance | thermal_fmu/test_thermal_fields
    dq_m = -4.0 * strength * np.abs(T_m) ** 3 + per_resistance * deps_m / eps_m**2
    # fault: near radiation one-sided -> out = np.concatenate([group.N_s, -0.9 * group.N_m], axis=1) |
    #   thermal_fmu/test_thermal_friction
    out = np.concatenate([group.N_s, -group.N_m], axis=1)
    dq = np.concatenate([dq_s[:, None] * group.N_s, dq_m[:, None] * group.N_m], axis=1)
    return q[:, None] * out, out[:, :, None] * dq[:, None, :]


def _fourth(T: float | Floats) -> Floats:
    return np.asarray(T * np.abs(T) ** 3)


def _emissivity(emissivity: Property, T: Floats) -> tuple[Floats, Floats]:
    """Value and derivative by temperature at T : (n,) [K]."""
    raw = emissivity(T)
    eps = np.clip(raw, LEAST_EMISSIVITY, 1.0)
    return eps, np.where(raw == eps, emissivity.slope(T), 0.0)
