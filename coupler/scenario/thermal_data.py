"""What a thermal half is told from outside: fluxes, temperatures, films, radiation, and how far temperatures span."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Field, Profile, field_from

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StatedData:
    """What one condition states of one kind.

    kind : flux, temperature, convection or radiation.  given : what stands there in model.json.  on : a surface, ""
    for a condition that is not on one.  name : of the condition, "" for none.
    """

    kind: str
    given: Any
    on: str
    name: str


def stated_data(model: Mapping[str, Any]) -> Iterator[StatedData]:
    """Everything of a model.json of a thermal half, condition by condition."""
    for condition in model.get("boundary", ()):
        for kind in ("flux", "temperature", "convection", "radiation"):
            if condition.get(kind) is not None:
                yield StatedData(kind, condition[kind], condition.get("on") or "", condition.get("name") or "")


class TemperatureData:
    """The temperatures that a scene prescribes, and whether its fluxes and sources heat and cool.

    model : of the thermal half (model.json), SI and kelvin.
    """

    def __init__(self, model: Mapping[str, Any]) -> None:
        self._powers = tuple(_powers(model))
        fields = tuple(_fields(model))
        self._steady, self._fields = {}, {}
        for sky in (False, True):
            of = [(f, name) for f, name, radiates in fields if radiates == sky]
            steady = [float(np.sum(f.level(0.0))) for f, name in of if _is_steady(f) and not name]
            self._steady[sky] = min(steady, default=math.inf), max(steady, default=-math.inf)
            self._fields[sky] = tuple((f, name) for f, name in of if name or not _is_steady(f))
        # An FMU that lies ready has data of its own, which nobody here knows.
        self.known = not str(model.get("half", "")).endswith(".fmu")

    def between(self, t0: float, t1: float, x: Array, inputs: Mapping[str, float], sky: bool | None = None
                ) -> tuple[float, float]:
        """Return the lowest and highest [K] of the data from t0 to t1 [s], jumps at both ends included.

        x : (n, 2) [m], in whose box a field over place is bounded.  inputs : of the half in that time, of which
        load.NAME scales a prescribed temperature.  sky : of what surfaces radiate to, of all but that, or None: of all.
        (inf, -inf) where there are no such data.
        """
        low, high = math.inf, -math.inf
        for kind in (False, True) if sky is None else (sky,):
            low, high = min(low, self._steady[kind][0]), max(high, self._steady[kind][1])
            for field, name in self._fields[kind]:
                # fault: what scales a prescribed temperature is not known -> factor = 1.0 | coupler/test_trust
                factor = inputs.get(f"load.{name}", 1.0) if name else 1.0
                ends = [factor * bound for bound in _over(field, t0, t1, x)]
                low, high = min(low, *ends), max(high, *ends)
        return low, high

    def powers(self, t0: float, t1: float, x: Array, inputs: Mapping[str, float]) -> tuple[bool, bool]:
        """Return whether fluxes and sources heat anything from t0 to t1 [s], and whether they cool; as in `between`."""
        heats = cools = False
        for field, name, factors in self._powers:
            load = inputs.get(f"load.{name}", 1.0) if name else 1.0
            bounds = _over(field, t0, t1, x)
            # fault: what heats here and cools there is told by its sum -> ends = [sum(bounds) * load * factors[1]] |
            #   coupler/test_trust_temperatures
            ends = [load * factor * bound for factor in factors for bound in bounds]
            heats, cools = heats or max(ends) > 0.0, cools or min(ends) < 0.0
        return heats, cools


def _over(field: Field, t0: float, t1: float, x: Array) -> tuple[float, float]:
    """The lowest and highest value of a field from t0 to t1 [s], jumps at both ends included."""
    times = {t0, t1, *(float(t) for s in field.signals for t in s.kinks if t0 < t < t1)}
    ends = [bound for t in times for side in (-1, 1) for bound in _bounds(field, t, side, x)]
    return min(ends), max(ends)


def _powers(model: Mapping[str, Any]) -> Iterator[tuple[Field, str, tuple[float, float]]]:
    """Each flux and source, the name by which it is scaled, "" for none, and the least and largest factor of it."""
    for stated in stated_data(model):
        if stated.kind == "flux":
            yield field_from(stated.given), stated.name, (1.0, 1.0)
    for body in model.get("bodies", {}).values():
        for part in (body, *(body.get("regions") or {}).values()):
            if part.get("Q_T"):
                yield field_from(part["Q_T"]), "", _factors(part.get("Q_T_factor"))


def _factors(given: Any) -> tuple[float, float]:
    """The least and the largest value of what multiplies a source, over all temperatures: of a polynomial any."""
    if given is None or isinstance(given, (int, float)):
        return (1.0, 1.0) if given is None else (float(given), float(given))
    return (min(given["value"]), max(given["value"])) if "value" in given else (-1.0, 1.0)


def _fields(model: Mapping[str, Any]) -> Iterator[tuple[Field, str, bool]]:
    """Each field of temperatures, the name by which it is scaled, "" for none, and whether surfaces radiate to it."""
    for stated in stated_data(model):
        given, name = stated.given, stated.name
        if stated.kind in ("convection", "radiation"):
            yield field_from(given["T"]), "", stated.kind == "radiation"
        elif stated.kind == "temperature" and isinstance(given, Mapping) and "dataset" in given:
            yield from ((field_from(given[key]), name, False) for key in ("least", "most"))  # of another run: known
        elif stated.kind == "temperature":
            yield field_from(given), name, False


def _is_steady(field: Field) -> bool:
    return field.is_uniform and all((s.value == s.value[0]).all() for s in field.signals)


def _bounds(field: Field, t: float, side: int, x: Array) -> tuple[float, float]:
    if field.is_uniform:
        value = float(np.sum(field.level(t, side)))
        return value, value
    low = high = 0.0
    for term in field.terms:
        a = b = term.t.at(t, side)
        for profile, s in ((term.x, x[:, 0]), (term.y, x[:, 1])):
            if profile is not None:
                least, most = _profile_bounds(profile, float(s.min()), float(s.max()))
                products = (a * least, a * most, b * least, b * most)
                a, b = min(products), max(products)
        low, high = low + a, high + b
    return low, high


def _profile_bounds(profile: Profile, first: float, last: float) -> tuple[float, float]:
    if profile.at is None:
        # Extremes of a polynomial: at the ends and where its slope is 0.
        roots = np.polynomial.polynomial.polyroots(np.polynomial.polynomial.polyder(profile.value)) if (
            len(profile.value) > 2 and profile.value[2:].any()) else np.empty(0)
        inner = roots.real[(np.abs(roots.imag) < 1e-12) & (roots.real > first) & (roots.real < last)]
        values = profile(np.concatenate([[first, last], inner]))
    else:
        inside = profile.at[(profile.at > first) & (profile.at < last)]
        values = profile(np.concatenate([[first, last], inside]))
    return float(values.min()), float(values.max())
