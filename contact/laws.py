"""Thermal contact laws: conductance h_CI [W/m2K] from pressure, gap and temperature.  Eqs. (7)-(10).

A law is a pure function of (p_N, g_N, T): touching points give it their pressure and the gap 0, open points
the pressure 0 and their gap.  So one law may serve both branches; then they join.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import TypeAdapter, ValidationError

from contact.problem.errors import wrongs
from contact.problem.laws import LawSpec

Array = NDArray[np.float64]


class Law(Protocol):
    """A conductance law (contact.problem.laws).  law : its word."""

    law: Any

    def conductance(self, p: Array, g: Array, T: Array) -> tuple[Array, Array]:
        """Return h [W/m2K] and its derivative by temperature dh/dT [W/m2K2], same shape each.

        p : any shape, p_N >= 0 [Pa].  g : same shape, g_N >= 0 [m].  T : same shape [K].
        """
        ...


_LAW: TypeAdapter[Law] = TypeAdapter(LawSpec)


def parse_law(spec: Mapping[str, Any]) -> Law:
    """Return the law that an entry of model.json describes (docs/design.md).

    Raises ValueError naming key and value where a parameter is unknown, missing, no number or out of range.
    """
    try:
        return _LAW.validate_python(spec)
    except ValidationError as exc:
        raise ValueError("\n".join(w.sentence(spec, ("law",)) for w in wrongs(exc))) from None


def closed_conductance(law: Law, p: ArrayLike, T_mean: ArrayLike) -> tuple[Array, Array]:
    """Return h [W/m2K] and dh/dT [W/m2K2] of touching points, (n,) each.  Eq. (9).

    p : (n,) pressure [Pa]; a negative one reads as 0.  T_mean : (n,) mean temperature (T_a + T_b)/2 [K].
    """
    p_, T = np.broadcast_arrays(np.asarray(p, dtype=float), np.asarray(T_mean, dtype=float))
    return law.conductance(np.maximum(p_, 0.0), np.zeros(p_.shape), T)


def open_conductance(law: Law, g: ArrayLike, T_mean: ArrayLike) -> tuple[Array, Array]:
    """Return h [W/m2K] and dh/dT [W/m2K2] of points apart, (n,) each.  Eq. (10).

    g : (n,) gap [m]; a negative one reads as 0.  T_mean : (n,) mean temperature (T_a + T_b)/2 [K].
    """
    g_, T = np.broadcast_arrays(np.asarray(g, dtype=float), np.asarray(T_mean, dtype=float))
    # fault: negative gaps reach the law -> return law.conductance(np.zeros(g_.shape), g_, T) | contact/test_laws
    return law.conductance(np.zeros(g_.shape), np.maximum(g_, 0.0), T)


def branch_jump(closed: Law, opened: Law, T: float) -> float:
    """h(p -> 0+) - h(g -> 0+) [W/m2K] at temperature T [K]: zero where the two branches join."""
    h_closed, _ = closed_conductance(closed, 0.0, T)
    h_open, _ = open_conductance(opened, 0.0, T)
    return float(h_closed - h_open)


def gap_factor(g: ArrayLike, d_cut: float, d_full: float) -> Array:
    """Return kappa = clip((g - d_cut)/(d_full - d_cut), 0, 1) of convection, (n,) [1].  Eq. (7), mended.

    g : (n,) gap [m].  d_cut, d_full : gaps [m] at which it is 0 and 1.
    Raises ValueError unless 0 <= d_cut < d_full.
    """
    if not 0.0 <= d_cut < d_full:
        raise ValueError(f"the gap factor needs 0 <= d_cut < d_full, got {d_cut!r} and {d_full!r}")
    # fault: gap factor as misprinted in the paper -> return np.clip((np.asarray(g, dtype=float) - d_full) / (d_full -
    #   d_cut), 0.0, 1.0) | contact/test_laws
    return np.clip((np.asarray(g, dtype=float) - d_cut) / (d_full - d_cut), 0.0, 1.0)
