"""What all parts of the schema have in common, and the two kinds of curve: over time and over temperature."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Discriminator, Tag, model_validator

from contact.half.property import property_from
from contact.half.signal import signal_from
from coupler.scenario.quantity import Number, Text, did_you_mean, looks_like_number, problem


class Part(BaseModel):
    """A mapping of the scenario file, frozen; an unknown key is an error that names the nearest known one."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    @model_validator(mode="before")
    @classmethod
    def _known_keys_only(cls, data: Any) -> Any:
        if isinstance(data, cls):
            return data
        if not isinstance(data, Mapping):
            raise problem(f"a mapping is needed here, with the keys {', '.join(cls._keys())}")
        for key in data:
            # fault: unknown keys accepted -> if False: | coupler/test_scenario_override
            if key not in cls._keys():
                raise problem("unknown key", did_you_mean(str(key), cls._keys()), at=(key,))
        return data

    @classmethod
    def _keys(cls) -> list[str]:
        """As the file has them: a key that Python keeps for itself, such as `for`, is an alias."""
        return [field.alias or name for name, field in cls.model_fields.items()]


def exactly_one(part: Part, names: Iterable[str]) -> str:
    """The one of these keys that is given.  Raises a problem where none or several are."""
    names = tuple(names)
    given = [n for n in names if getattr(part, n) is not None]
    if len(given) != 1:
        have = " and ".join(given) or "none"
        raise problem(f"exactly one of {', '.join(names)} is needed, {have} is given")
    return given[0]


class SignalTable(Part):
    """t [s], not decreasing; value, in the unit of what it drives.  Two values at one time: a jump."""

    t: tuple[Number, ...]
    value: tuple[Number, ...]

    @model_validator(mode="after")
    def _is_a_signal(self) -> SignalTable:
        for i in range(1, len(self.t)):
            if self.t[i] < self.t[i - 1]:
                raise problem(f"time goes backwards, from {self.t[i - 1]:g} to {self.t[i]:g}",
                              "Times of a signal must not decrease; equal ones make a jump.", at=("t", i))
        try:
            signal_from({"t": self.t, "value": self.value})
        except ValueError as exc:
            raise problem(str(exc)) from exc
        return self


class PropertyTable(Part):
    """T, increasing, in the scenario's unit of temperature; value, SI; joined by a monotone cubic."""

    T: tuple[Number, ...]
    value: tuple[Number, ...]

    @model_validator(mode="after")
    def _is_a_table(self) -> PropertyTable:
        try:
            property_from({"T": self.T, "value": self.value})
        except ValueError as exc:
            raise problem(str(exc)) from exc
        return self


class Polynomial(Part):
    """a0 + a1 (T - T_ref) + a2 (T - T_ref)^2 ...; T_ref in the scenario's unit of temperature."""

    polynomial: tuple[Number, ...]
    T_ref: Number = 0.0

    @model_validator(mode="after")
    def _has_a_term(self) -> Polynomial:
        if not self.polynomial:
            raise problem("at least one coefficient is needed", at=("polynomial",))
        return self


# Tags in angle brackets: problem.py takes them out of the place of an error again.
def _signal_form(value: Any) -> str:
    if isinstance(value, Mapping | SignalTable):
        return "<table>"
    return "<name>" if isinstance(value, str) and not looks_like_number(value) else "<number>"


def _property_form(value: Any) -> str:
    if isinstance(value, Polynomial) or (isinstance(value, Mapping) and "polynomial" in value):
        return "<polynomial>"
    return "<table>" if isinstance(value, Mapping | PropertyTable) else "<number>"


SignalSpec = Annotated[
    Annotated[Number, Tag("<number>")]
    | Annotated[Text, Tag("<name>")]
    | Annotated[SignalTable, Tag("<table>")],
    Discriminator(_signal_form),
]
PropertySpec = Annotated[
    Annotated[Number, Tag("<number>")] | Annotated[PropertyTable, Tag("<table>")]
    | Annotated[Polynomial, Tag("<polynomial>")],
    Discriminator(_property_form),
]
