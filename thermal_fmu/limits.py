"""What boundary data must keep to at the temperatures a stage ends with; Newton's method may stray on its way."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.half.field import resolve
from contact.half.property import Property
from thermal_fmu.held import Held
from thermal_fmu.loads import Loads
from thermal_fmu.volume import BadPropertyError

Floats = NDArray[np.float64]


def demand_limits(held: Held, loads: Loads, T: Floats) -> None:
    """Kelvin where surfaces radiate, emissivities in (0, 1], film coefficients not negative, at T : (n,) [K].

    Raises BadPropertyError saying what was met.
    """
    for radiator, (_, level) in zip(held.radiators, loads.radiators, strict=True):
        T_a = (radiator.points.N * T[radiator.points.nodes]).sum(axis=1)
        where = f"surface {radiator.radiator.where.surface}"
        _demand_kelvin(T_a, where)
        T_inf = np.min(resolve(level, radiator.T_inf))
        if T_inf < 0.0:
            raise BadPropertyError(f"{where} radiates to surroundings of {T_inf:.6g}: "
                                   "radiation needs temperatures in kelvin")
        _demand_emissivity(radiator.radiator.emissivity, T_a, where)
    for group in held.near:
        for side, emissivity, N, nodes in (
                ("slave", group.spec.emissivity_slave, group.N_s, group.nodes[:, :2]),
                ("master", group.spec.emissivity_master, group.N_m, group.nodes[:, 2:])):
            T_a = (N * T[nodes]).sum(axis=1)
            _demand_kelvin(T_a, f"the {side} side of a pair")
            _demand_emissivity(emissivity, T_a, f"the {side} side of a pair")
    for film, (h, _) in zip(held.films, loads.films, strict=True):
        if film.h is not None and np.min(resolve(h, film.h)) < 0.0:
            raise BadPropertyError(f"the film coefficient of surface {film.film.where.surface} is negative "
                                   f"({np.min(resolve(h, film.h)):.6g}) at a place of it")
        if film.film.h_factor is not None:
            T_a = (film.points.N * T[film.points.nodes]).sum(axis=1)
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
