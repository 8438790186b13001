"""Fields: data over time and place, as sums of products of a signal and profiles along x and y."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any

from pydantic import Discriminator, Tag, model_validator

from coupler.scenario.base import Part, SignalSpec, SignalTable
from coupler.scenario.quantity import Number, Text, looks_like_number, problem


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
