"""Curves over time, temperature and place: SIGNAL, PROPERTY, PHASED and FIELD of a scenario or a model.json."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Sized
from enum import StrEnum
from itertools import pairwise
from typing import Annotated, Any

from pydantic import Discriminator, Tag, WithJsonSchema, model_validator

from contact.problem.part import BoundedNumber, Entry, Part
from contact.problem.values import Number, SignalName, looks_like_number, problem


class Form(StrEnum):
    """What joins the points of a table."""

    LINEAR = "linear"
    CUBIC = "cubic"


class Beyond(StrEnum):
    """What follows beyond the last point of a table."""

    FLAT = "flat"
    SLOPE = "slope"


def uneven(at: Sized, word: str, value: Sized) -> str:
    """Say that a table has not one value for each of what it is over."""
    return (f"{len(at)} {word}{'' if len(at) == 1 else 's'}, but {len(value)} value{'' if len(value) == 1 else 's'}: "
            f"each {word} needs one, and at least one is needed")


def increasing(at: Sequence[float], what: str, key: str) -> None:
    """Raise PydanticCustomError at the first number that is not larger than the one before it."""
    for i, (before, after) in enumerate(pairwise(at), start=1):
        if after <= before:
            raise problem(f"{what} must increase", "Put them in order, each once, with their values.", at=(key, i))


class SignalTable(Part):
    """A table over time: linear in between, constant outside.  Two values at one time make a jump."""

    t: Annotated[tuple[Number, ...], Entry("times, not decreasing; one given twice makes a jump", "s")]
    value: Annotated[tuple[Number, ...], Entry("values; at a jump the first holds before it, the second from it on")]

    @model_validator(mode="after")
    def _is_a_signal(self) -> SignalTable:
        t = self.t
        if not t or len(t) != len(self.value):
            raise problem(uneven(t, "time", self.value))
        for i in range(1, len(t)):
            if t[i] < t[i - 1]:
                raise problem(f"time goes backwards, from {t[i - 1]:g} to {t[i]:g}",
                              "Times of a signal must not decrease; equal ones make a jump.", at=("t", i))
        if any(t[i] == t[i + 2] for i in range(len(t) - 2)):
            raise problem("a signal has at most two values at one time (before and after a jump)")
        return self

    def numbers(self) -> Iterator[BoundedNumber]:
        """Every number that bounds are of: its values."""
        for i, one in enumerate(self.value):
            yield ("value", i), one, None


class PropertyTable(Part):
    """A table over temperature, constant outside."""

    T: Annotated[tuple[Number, ...], Entry("temperatures, increasing", "K", temperature=True)]
    value: Annotated[tuple[Number, ...], Entry("values")]
    form: Annotated[Form, Entry("between the points: straight lines, or a monotone cubic",
                              why="As tables of norms and of other programs are meant.")] = Form.LINEAR

    @model_validator(mode="after")
    def _is_a_table(self) -> PropertyTable:
        if not self.T or len(self.T) != len(self.value):
            raise problem(uneven(self.T, "temperature", self.value))
        increasing(self.T, "the temperatures of a table", "T")
        return self

    def numbers(self) -> Iterator[BoundedNumber]:
        """Every number that bounds are of: its values."""
        for i, one in enumerate(self.value):
            yield ("value", i), one, self.value


class Polynomial(Part):
    """a0 + a1 (T - T_ref) + a2 (T - T_ref)^2 + ..."""

    polynomial: Annotated[tuple[Number, ...], Entry("coefficients a0, a1, ...")]
    T_ref: Annotated[Number, Entry("the temperature it counts from", "K", temperature=True)] = 0.0

    @model_validator(mode="after")
    def _has_a_term(self) -> Polynomial:
        if not self.polynomial:
            raise problem("at least one coefficient is needed", at=("polynomial",))
        return self


class ProfileTable(Part):
    """A table over a coordinate: linear in between, constant outside."""

    at: Annotated[tuple[Number, ...], Entry("places, increasing", "m")]
    value: Annotated[tuple[Number, ...], Entry("values")]

    @model_validator(mode="after")
    def _is_a_profile(self) -> ProfileTable:
        if not self.at or len(self.at) != len(self.value):
            raise problem(uneven(self.at, "place", self.value))
        for i, (before, after) in enumerate(pairwise(self.at), start=1):
            if after <= before:
                raise problem(f"the places of a profile must increase, {after:g} m follows {before:g} m", at=("at", i))
        return self


class ProfilePolynomial(Part):
    """a0 + a1 s + a2 s^2 + ..., s the coordinate [m]."""

    polynomial: Annotated[tuple[Number, ...], Entry("coefficients a0, a1, ...")]

    @model_validator(mode="after")
    def _has_a_term(self) -> ProfilePolynomial:
        if not self.polynomial:
            raise problem("at least one coefficient is needed", at=("polynomial",))
        return self


# Tags in angle brackets are taken out of the place of an error again.
def _signal_form(value: Any) -> str:
    if isinstance(value, Mapping | SignalTable):
        return "<table>"
    return "<name>" if isinstance(value, str) and not looks_like_number(value) else "<number>"


def _property_form(value: Any) -> str:
    if isinstance(value, Polynomial) or (isinstance(value, Mapping) and "polynomial" in value):
        return "<polynomial>"
    return "<table>" if isinstance(value, Mapping | PropertyTable) else "<number>"


def _profile_form(value: Any) -> str:
    if isinstance(value, ProfilePolynomial) or (isinstance(value, Mapping) and "polynomial" in value):
        return "<polynomial>"
    return "<table>"


ANumber = Annotated[Number, Tag("<number>")]
ASignalName = Annotated[SignalName, WithJsonSchema({"type": "string", "pattern": "^[A-Za-z_]"}), Tag("<name>")]
ASignalTable = Annotated[SignalTable, Tag("<table>")]
APropertyTable = Annotated[PropertyTable, Tag("<table>")]
APolynomial = Annotated[Polynomial, Tag("<polynomial>")]

SignalSpec = Annotated[ANumber | ASignalName | ASignalTable, Discriminator(_signal_form)]
PropertySpec = Annotated[ANumber | APropertyTable | APolynomial, Discriminator(_property_form)]
ProfileSpec = Annotated[Annotated[ProfileTable, Tag("<table>")] | Annotated[ProfilePolynomial, Tag("<polynomial>")],
                        Discriminator(_profile_form)]


class Phases(Part):
    """A property of its own for each phase, blended by the solid fraction."""

    solid: Annotated[PropertySpec, Entry("of the solid")]
    liquid: Annotated[PropertySpec, Entry("of the liquid")]


class Term(Part):
    """A product of a signal and two profiles; what is left out is 1."""

    t: Annotated[SignalSpec, Entry("over time")] = 1.0
    x: Annotated[ProfileSpec | None, Entry("over x (r)")] = None
    y: Annotated[ProfileSpec | None, Entry("over y (z)")] = None

    @model_validator(mode="after")
    def _says_something(self) -> Term:
        if not self.model_fields_set:
            raise problem("a term needs at least one of t, x, y")
        return self


class FieldSum(Part):
    """A sum of products at the current coordinates x (r), y (z)."""

    terms: Annotated[tuple[Term, ...], Entry("the products")]

    @model_validator(mode="after")
    def _has_a_term(self) -> FieldSum:
        if not self.terms:
            raise problem("at least one term is needed", "Write {terms: [{t: 3}]}, or a number.", at=("terms",))
        return self


def field_form(value: Any) -> str:
    """Return the tag of what stands for a field."""
    if isinstance(value, FieldSum):
        return "<terms>"
    # A term without its list belongs here too: the answer then is the key `terms`.
    if isinstance(value, Mapping) and ({"terms", "x", "y"} & value.keys() or not {"t", "value"} & value.keys()):
        return "<terms>"
    return _signal_form(value)


def phased_form(value: Any) -> str:
    """Return the tag of what stands for a property that may change on melting."""
    if isinstance(value, Phases) or (isinstance(value, Mapping) and {"solid", "liquid"} & value.keys()):
        return "<phases>"
    return _property_form(value)


APhases = Annotated[Phases, Tag("<phases>")]
FieldSpec = Annotated[ANumber | ASignalName | ASignalTable | Annotated[FieldSum, Tag("<terms>")],
                      Discriminator(field_form)]
PhasedSpec = Annotated[ANumber | APropertyTable | APolynomial | APhases, Discriminator(phased_form)]
