"""From what a scenario states to SI: temperatures to kelvin, names of signals to what they stand for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import radians
from typing import Any, TypeVar

from contact.problem import laws
from contact.problem.curves import FieldSum, SignalTable, Term
from contact.problem.part import Entry, Part
from contact.problem.values import SignalName, did_you_mean
from coupler.scenario.document import Document, Key

ZERO_CELSIUS = 273.15  # K
UNITS = {"degC": ZERO_CELSIUS, "K": 0.0}  # what to add to have kelvin

P = TypeVar("P", bound=Part)


@dataclass(frozen=True)
class ToSI:
    """Knows the file's unit of temperature and its named signals.

    wrong : is told what cannot be converted (place, message, remedy); the walk goes on with a stand-in.
    """

    document: Document
    unit: str
    signals: Mapping[str, Any]
    wrong: Callable[[Key, str, str], None]

    @property
    def offset(self) -> float:
        """What to add to a temperature of the file to have kelvin."""
        return UNITS[self.unit]

    def kelvin(self, T: float, at: Key) -> float:
        """Convert a temperature of the file to K.  Differences of temperature are never converted."""
        # fault: absolute zero unguarded -> if False: | coupler/test_scenario_errors
        if T + self.offset < 0:
            self.wrong(at, f"{T:g} {self.unit} is below absolute zero", "Check units.temperature (degC or K).")
        # fault: temperatures not converted -> return T | coupler/test_scenario_load
        return T + self.offset

    def part(self, part: P, at: Key) -> P:
        """Convert a mapping of the file and all inside it."""
        changed = {}
        for name, field in type(part).model_fields.items():
            value = getattr(part, name)
            new = self._value(value, (*at, field.alias or name), self._key_of(part, name))
            if new is not value:
                changed[name] = new
        return part.model_copy(update=changed) if changed else part

    def _key_of(self, part: Part, name: str) -> Entry | None:
        # fault: tables of conductance left in degC -> if False: | coupler/test_scenario_laws
        if isinstance(part, laws.Table) and name == "x" and part.variable is laws.TableVariable.T:
            return Entry("", temperature=True)
        return type(part).entry(name)

    def _value(self, value: Any, at: Key, key: Entry | None) -> Any:
        if isinstance(value, SignalName):
            return self._named(value, at, key)
        if isinstance(value, SignalTable):
            # fault: every signal shifted to kelvin -> if False: | coupler/test_scenario_load
            if key is None or not key.temperature:
                return value
            return value.model_copy(update={"value": tuple(
                self.kelvin(v, (*at, "value", i)) for i, v in enumerate(value.value))})
        if isinstance(value, FieldSum):
            total = self.part(value, at)
            # fault: a sum of temperatures left in degC -> if True: | coupler/test_scenario_thermal
            if key is None or not key.temperature or not self.offset:
                return total
            # A sum has one term more: what makes kelvin of the file's unit.
            return total.model_copy(update={"terms": (*total.terms, Term(t=self.offset))})
        if isinstance(value, Part):
            return self.part(value, at)
        if isinstance(value, float) and key is not None:
            # fault: degrees taken for radians -> return self.kelvin(value, at) if key.temperature else value |
            #   coupler/test_scenario_thermal
            return self.kelvin(value, at) if key.temperature else radians(value) if key.degrees else value
        if isinstance(value, tuple):
            made = tuple(self._value(v, (*at, i), key) for i, v in enumerate(value))
            return made if any(a is not b for a, b in zip(made, value, strict=True)) else value
        if isinstance(value, dict):
            return {name: self._value(v, (*at, name), key) for name, v in value.items()}
        return value

    def _named(self, name: SignalName, at: Key, key: Entry | None) -> Any:
        """What a signal's name stands for; what is wrong is its use here, so that is the place."""
        if name not in self.signals:
            self.wrong(at, f"there is no signal {str(name)!r}", did_you_mean(name, self.signals))
            return 0.0
        signal = self.signals[name]
        if isinstance(signal, SignalName):
            return 0.0  # another's name: told where it stands
        values = signal.value if isinstance(signal, SignalTable) else (signal,)
        if key is not None and key.temperature:
            # One place for all of them: told once.
            if bad := [v for v in values if v + self.offset < 0]:
                self.kelvin(bad[0], at)
            values = tuple(v + self.offset for v in values)
        elif key is not None and (bad := [v for v in values if not key.holds(v)]):
            self.wrong(at, f"must {key.bounds}, but the signal reaches {bad[0]:g}", key.remedy)
        return signal.model_copy(update={"value": values}) if isinstance(signal, SignalTable) else values[0]
