"""From what the file says to SI and kelvin: temperatures, signals, properties."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from coupler.scenario.base import Polynomial, PropertyTable, SignalTable
from coupler.scenario.document import Document, Key
from coupler.scenario.quantity import did_you_mean
from coupler.scenario.schema import ScenarioFile, TemperatureUnit
from coupler.scenario.schema_field import FieldSum, Term

ZERO_CELSIUS = 273.15  # K

Json = Any  # a number, or the table of a signal or property as model.json has it


@dataclass(frozen=True)
class Convert:
    """Knows the file's unit of temperature and its named signals.  Every method raises ScenarioError."""

    document: Document
    file: ScenarioFile

    @property
    def offset(self) -> float:
        """What to add to a temperature of the file to have kelvin."""
        return ZERO_CELSIUS if self.file.units.temperature is TemperatureUnit.DEGC else 0.0

    def kelvin(self, T: float, key: Key) -> float:
        """A temperature of the file in K.  Differences of temperature are never converted."""
        # fault: absolute zero unguarded -> if False: | coupler/test_scenario_errors
        if T + self.offset < 0:
            raise self.document.error(
                key,
                f"{T:g} {self.file.units.temperature.value} is below absolute zero",
                "Check units.temperature (degC or K).",
            )
        # fault: temperatures not converted -> return T | coupler/test_scenario_load
        return T + self.offset

    def signal(self, spec: float | str | SignalTable, key: Key, least: float | None = None) -> Json:
        """A SIGNAL of model.json.  least : no value may be smaller."""
        def check(value: float, at: Key) -> float:
            if least is not None and value < least:
                raise self.document.error(at, f"must not be less than {least:g}, but reaches {value:g}")
            return value

        # fault: every signal shifted to kelvin -> return self._mapped(spec, key, self.kelvin) |
        #   coupler/test_scenario_load
        return self._mapped(spec, key, check)

    def temperature(self, spec: float | str | SignalTable, key: Key) -> Json:
        """A SIGNAL of model.json in K."""
        return self._mapped(spec, key, self.kelvin)

    def field(self, spec: float | str | SignalTable | FieldSum, key: Key, least: float | None = None) -> Json:
        """A FIELD of model.json.  least : no value may be smaller (a sum is checked where it stands: Context)."""
        return self._sum(spec, key) if isinstance(spec, FieldSum) else self.signal(spec, key, least)

    def temperature_field(self, spec: float | str | SignalTable | FieldSum, key: Key) -> Json:
        """A FIELD of model.json in K.  A sum has one term more: what makes kelvin of the file's unit."""
        if not isinstance(spec, FieldSum):
            return self.temperature(spec, key)
        terms = self._sum(spec, key)["terms"]
        # fault: a sum of temperatures left in degC -> return {"terms": [*terms, {"t": self.offset}] if False else
        #   terms} | coupler/test_scenario_thermal
        return {"terms": [*terms, {"t": self.offset}] if self.offset else terms}

    def _sum(self, spec: FieldSum, key: Key) -> Json:
        return {"terms": [self._term(term, (*key, "terms", i)) for i, term in enumerate(spec.terms)]}

    def _term(self, term: Term, key: Key) -> Json:
        profiles = {name: getattr(term, name).model_dump(mode="json") for name in ("x", "y")
                    if getattr(term, name) is not None}
        return {"t": self.signal(term.t, (*key, "t")), **profiles}

    def property(self, spec: float | PropertyTable | Polynomial, key: Key) -> Json:
        """A PROPERTY of model.json, its temperatures in K."""
        if isinstance(spec, PropertyTable):
            return {
                "T": [self.kelvin(T, (*key, "T", i)) for i, T in enumerate(spec.T)],
                "value": list(spec.value),
            }
        if isinstance(spec, Polynomial):
            return {"polynomial": list(spec.polynomial), "T_ref": self.kelvin(spec.T_ref, (*key, "T_ref"))}
        return spec

    def _mapped(self, spec: float | str | SignalTable, key: Key, each: Callable[[float, Key], float]) -> Json:
        if isinstance(spec, str):
            if spec not in self.file.signals:
                raise self.document.error(
                    key, f"there is no signal {spec!r}", did_you_mean(spec, self.file.signals)
                )
            named = self.file.signals[spec]
            if isinstance(named, str):
                raise self.document.error(
                    ("signals", spec), "a signal is a number or a table, not another's name"
                )
            # What is wrong is its use here, so the key stays that of the user, not of the signal.
            return self._table(named, lambda v, i: each(v, key))
        where = ("value",) if isinstance(spec, SignalTable) else ()
        return self._table(spec, lambda v, i: each(v, (*key, *where, *((i,) if where else ()))))

    def _table(self, spec: float | SignalTable, each: Callable[[float, int], float]) -> Json:
        if isinstance(spec, SignalTable):
            return {"t": list(spec.t), "value": [each(v, i) for i, v in enumerate(spec.value)]}
        return each(spec, 0)


def kinks_in(model: Json) -> Iterator[float]:
    """Times [s] of every signal table anywhere in a model."""
    for times in _tables_in(model):
        yield from times


def jumps_in(model: Json) -> Iterator[float]:
    """Times [s] at which a signal anywhere in a model has two values."""
    for times in _tables_in(model):
        yield from (t for t, after in pairwise(times) if t == after)


def _tables_in(model: Json) -> Iterator[list[float]]:
    if isinstance(model, Mapping):
        if "t" in model and "value" in model and len(model["t"]) > 1:
            yield model["t"]
        for inner in model.values():
            yield from _tables_in(inner)
    elif isinstance(model, list):
        for inner in model:
            yield from _tables_in(inner)
