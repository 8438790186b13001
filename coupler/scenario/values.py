"""What all parts of the schema have in common, and the two kinds of curve: over time and over temperature."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import entry_points
from itertools import pairwise
from math import inf
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Discriminator, Tag, model_validator

from contact.half.functions import property_from, signal_from
from coupler.scenario.document import Document, Name, Number, Text, did_you_mean, looks_like_number, problem


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
            if not cls._knows(key):
                raise problem("unknown key", did_you_mean(str(key), cls._keys()), at=(key,))
        return data

    @classmethod
    def _knows(cls, key: object) -> bool:
        """Whether the mapping may have this key."""
        return key in cls._keys()

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


# Numbers and tables that must lie in a range, whatever key they stand under.

At = tuple[str | int, ...]


def positive(spec: float | PropertyTable | Polynomial, at: At, most: float = inf, zero_in_table: bool = False) -> None:
    """Raises a problem where a number or table is not above zero, or is above `most`.

    zero_in_table : a table may be zero in places, not everywhere.
    A polynomial cannot be checked here: the step that meets a wrong value is discarded.
    """
    numbers = list(numbers_in(spec, at))
    may_be_zero = zero_in_table and isinstance(spec, PropertyTable) and any(value for _, value in numbers)
    for place, value in numbers:
        if not (0 < value <= most or (value == 0 and may_be_zero)):
            raise problem("must be greater than zero" + (f" and at most {most:g}" if most < inf else ""), at=place)


def numbers_in(spec: Any, at: At) -> Iterator[tuple[At, float]]:
    """The number of a property, or those of its table, and their places; none for what cannot be looked at."""
    if isinstance(spec, PropertyTable):
        for i, value in enumerate(spec.value):
            yield (*at, "value", i), value
    elif isinstance(spec, float):
        yield at, spec


def not_negative(spec: Any, at: At) -> None:
    """Raises a problem where a number or table is below zero."""
    for place, value in numbers_in(spec, at):
        if value < 0.0:
            raise problem("must not be less than zero", at=place)


# Fields: data over time and place, as sums of products of a signal and profiles along x and y.

class ProfileTable(Part):
    """at [m], increasing; value; linear in between, constant outside."""

    at: tuple[Number, ...]
    value: tuple[Number, ...]

    @model_validator(mode="after")
    def _is_a_profile(self) -> ProfileTable:
        if not self.at or len(self.at) != len(self.value):
            raise problem("a profile needs as many values as places, and at least one")
        for i, (before, after) in enumerate(pairwise(self.at), start=1):
            if after <= before:
                raise problem(f"the places of a profile must increase, {after:g} m follows {before:g} m", at=("at", i))
        return self


class ProfilePolynomial(Part):
    """a0 + a1 s + a2 s^2 ..., s the coordinate [m]."""

    polynomial: tuple[Number, ...]

    @model_validator(mode="after")
    def _has_a_term(self) -> ProfilePolynomial:
        if not self.polynomial:
            raise problem("at least one coefficient is needed", at=("polynomial",))
        return self


def _profile_form(value: Any) -> str:
    if isinstance(value, ProfilePolynomial) or (isinstance(value, Mapping) and "polynomial" in value):
        return "<polynomial>"
    return "<table>"


ProfileSpec = Annotated[
    Annotated[ProfileTable, Tag("<table>")] | Annotated[ProfilePolynomial, Tag("<polynomial>")],
    Discriminator(_profile_form),
]


class Term(Part):
    """A product: a signal over time, a profile along x (r), a profile along y (z); what is left out is 1."""

    t: SignalSpec = 1.0
    x: ProfileSpec | None = None
    y: ProfileSpec | None = None

    @model_validator(mode="after")
    def _says_something(self) -> Term:
        if not self.model_fields_set:
            raise problem("a term needs at least one of t, x, y")
        return self


class FieldSum(Part):
    """The sum of its terms, at the current coordinates."""

    terms: tuple[Term, ...]

    @model_validator(mode="after")
    def _has_a_term(self) -> FieldSum:
        if not self.terms:
            raise problem("at least one term is needed", "Write {terms: [{t: 3}]}, or a number.", at=("terms",))
        return self


def _field_form(value: Any) -> str:
    if isinstance(value, FieldSum):
        return "<terms>"
    # A term without its list belongs here too: the answer then is the key `terms`.
    if isinstance(value, Mapping) and ({"terms", "x", "y"} & value.keys() or not {"t", "value"} & value.keys()):
        return "<terms>"
    if isinstance(value, Mapping | SignalTable):
        return "<table>"
    return "<name>" if isinstance(value, str) and not looks_like_number(value) else "<number>"


FieldSpec = Annotated[
    Annotated[Number, Tag("<number>")]
    | Annotated[Text, Tag("<name>")]
    | Annotated[SignalTable, Tag("<table>")]
    | Annotated[FieldSum, Tag("<terms>")],
    Discriminator(_field_form),
]


# The part of the schema that says what boundary conditions of both halves stand on.

class Supported(Part):
    """What a boundary condition stands on: a surface (on) or named points (at)."""

    on: Text | None = None
    at: Text | None = None
    name: Name | None = None

    @property
    def where(self) -> str:
        """The surface or node set."""
        return self.on if self.on is not None else str(self.at)

    def only_on(self, kind: str) -> None:
        """A flux through a point is not a number."""
        if self.on is None:
            raise problem(f"{kind} acts on a surface, not at points", "Use `on: body.surface`.", at=("at",))


# Which halves there are: our own, those of other packages (entry points `slideline.halves`), FMUs that lie ready.

GROUP = "slideline.halves"
# role -> word of the scenario -> entry point, which is also the `half` of model.json.  A rod is one in either role.
OWN: dict[str, dict[str, str]] = {
    "thermal": {"thermal": "thermal", "lumped": "lumped", "rod": "thermal_rod"},
    "mechanical": {"elastic": "elastic", "rigid": "rigid", "rod": "mechanical_rod"},
}


def known_kinds(role: str) -> tuple[str, ...]:
    """Kinds that can stand in a role: ours for it, and those of other packages, whose role we cannot know."""
    ours = {kind for kinds in OWN.values() for kind in kinds.values()}
    return tuple(OWN[role]) + tuple(sorted({e.name for e in entry_points(group=GROUP)} - ours))


def fmu_path(kind: str, folder: Path) -> Path | None:
    """The FMU a half's name is the path of, relative to the scenario's folder; None where it names a kind."""
    return (folder / kind).resolve() if kind.endswith(".fmu") else None


def check_kind(document: Document, role: str, kind: str) -> None:
    """Raises ScenarioError where no such half is installed, it is one of the other role, or its FMU is not there."""
    fmu = fmu_path(kind, document.path.parent)
    if fmu is not None:
        if not fmu.is_file():
            raise document.error((role, "half"), f"there is no FMU {fmu}", "Paths are relative to the scenario file.")
        return
    known = known_kinds(role)
    if kind not in known:
        raise document.error(
            (role, "half"), f"there is no {role} half of kind {kind!r}", did_you_mean(kind, known)
        )
