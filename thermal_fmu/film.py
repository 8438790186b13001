"""Convection from surfaces, covered or not: Eqs. (5-7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.field import Level, resolve
from thermal_fmu.exposed import ExposedPoints, Ground, exposed_points
from thermal_fmu.spec_boundary import Film

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class HeldFilm:
    """A film on given coordinates.  h, Te : (n_terms, n) shapes of its fields at the points, None where uniform."""

    film: Film
    points: ExposedPoints
    h: Floats | None
    Te: Floats | None


def hold_film(film: Film, slots: NDArray[np.int64], ground: Ground) -> HeldFilm:
    """A film where it acts.  slots : (n_edges, 2, 2) of its edges."""
    points = exposed_points(film.where, slots, ground)
    if film.h.is_uniform and film.Te.is_uniform:
        return HeldFilm(film, points, None, None)
    places = points.places(ground.x)
    return HeldFilm(film, points, film.h.shapes(places), film.Te.shapes(places))


def film_flow(held: HeldFilm, level: tuple[Level, Level], T: Floats) -> tuple[Floats, Floats]:
    """(n, 2) heat that leaves each point's nodes [W] at T : (n_nodes,) [K], and (n, 2, 2) its derivative [W/K].

    level : of hbar [W/m2K^(1 + exponent)] and of the ambient Te [K].
    Eq. (5): h h_factor(T) |T - Te|^a (T - Te), odd in T - Te.
    """
    film, points = held.film, held.points
    T_a = (points.N * T[points.nodes]).sum(axis=1)
    dT = T_a - resolve(level[1], held.Te)
    strength = resolve(level[0], held.h) * points.area
    if film.exponent != 0.0:
        # fault: film exponent even -> strength = strength * np.abs(dT) ** (2 * film.exponent) |
        #   thermal_fmu/test_thermal_time
        strength = strength * np.abs(dT) ** film.exponent
    if film.h_factor is None:
        dq = (1.0 + film.exponent) * strength
    else:
        # fault: derivative of h_factor forgotten -> grows = 0.0 * T_a | thermal_fmu/test_thermal_fields
        grows = film.h_factor.slope(T_a) * strength * dT
        # fault: h_factor at the ambient -> strength = film.h_factor(T_a - dT) * strength |
        #   thermal_fmu/test_thermal_fields
        strength = film.h_factor(T_a) * strength
        dq = (1.0 + film.exponent) * strength + grows
    flow = (strength * dT)[:, None] * points.N
    slope = dq[:, None, None] * points.N[:, :, None] * points.N[:, None, :]
    return flow, slope
