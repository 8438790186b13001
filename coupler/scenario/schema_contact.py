"""The part of the schema that says what meets what: contact pairs, their laws, friction."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, StrictBool, Tag, model_validator

from contact.laws import parse_law
from coupler.scenario.base import Part, SignalSpec
from coupler.scenario.quantity import NotNegative, Positive, Text, number, problem
from coupler.scenario.schema_thermal import NearRadiation

LEAST_TOLERANCE = 1e-9  # of multipliers: below the round-off of forces nothing settles
ABOVE_ZERO = 1e4  # more than any temperature of a file is below 0
LAW_WORDS = ("law", "variable")  # the keys of a law that hold a word; all others hold numbers


def _law(value: Any) -> Mapping[str, Any] | None:
    """A contact law, checked by the one who evaluates it.  None: no heat crosses."""
    if value is None:
        return None
    if not isinstance(value, Mapping):
        raise problem("a contact law is needed here, or null where no heat crosses",
                      "For example {law: constant, h: 2000}.")
    _numbers_only(value, ())
    try:
        parse_law(_in_kelvin(value))
    except ValueError as exc:
        raise problem(str(exc)) from exc
    return dict(value)


def _in_kelvin(law: Mapping[str, Any]) -> dict[str, Any]:
    """A law as it may look in kelvin: below zero degC is no error; what is below 0 K is found at conversion."""
    inner = {key: [_in_kelvin(v) if isinstance(v, Mapping) else v for v in value] if key == "of"
             and isinstance(value, list) else value for key, value in law.items()}
    if inner.get("variable") == "T" and isinstance(inner.get("x"), list):
        inner["x"] = [T + ABOVE_ZERO if isinstance(T, int | float) else T for T in inner["x"]]
    return inner


def _numbers_only(value: Any, at: tuple[str | int, ...]) -> None:
    """Refuse text and NaN in a law before its own check, with the same help as everywhere."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            if key not in LAW_WORDS:
                _numbers_only(inner, (*at, key))
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            _numbers_only(inner, (*at, i))
    else:
        try:
            number(value)
        except problem_type as exc:
            context = exc.context or {}
            raise problem(context["text"], context["remedy"], at=at) from None


problem_type = type(problem(""))
Law = Annotated[dict[str, Any] | None, BeforeValidator(_law)]


def _stiffness_form(value: Any) -> str:
    return "<auto>" if value == "auto" else "<number>"


# A stiffness [Pa/m], or the word by which the scene finds its own.
Stiffness = Annotated[
    Annotated[Positive, Tag("<number>")] | Annotated[Literal["auto"], Tag("<auto>")],
    Discriminator(_stiffness_form),
]


class Conduction(Part):
    """h_CI touching and apart [W/m2K]; both must be said, null where no heat crosses; factors are signals."""

    closed: Law
    open: Law
    closed_factor: SignalSpec = 1.0
    open_factor: SignalSpec = 1.0

    @model_validator(mode="after")
    def _factors_have_laws(self) -> Conduction:
        for key in ("closed", "open"):
            if getattr(self, key) is None and f"{key}_factor" in self.model_fields_set:
                raise problem(f"a factor without its law: {key} is null", at=(f"{key}_factor",))
        return self


class Friction(Part):
    """Coulomb's law: mu; stick: stiffness of sticking [Pa/m] or auto (the penalty); share: of the heat, to the slave.

    Without a share the heat is split by effusivities.  Without mu the half makes none, and the share is for one that
    rubs by a law of its own.
    """

    mu: NotNegative = 0.0
    stick: Stiffness = "auto"
    share: NotNegative | None = None

    @model_validator(mode="after")
    def _says_something(self) -> Friction:
        if not self.model_fields_set & {"mu", "share"}:
            raise problem("friction needs its coefficient", "Add mu, for example mu: 0.3.")
        if self.stick != "auto" and self.mu == 0.0:
            raise problem("a stiffness of sticking without friction: mu is 0 or missing", at=("stick",))
        if self.share is not None and self.share > 1.0:
            raise problem("a share lies between 0 and 1", at=("share",))
        return self


class Settling(StrEnum):
    """How multipliers settle: in rounds of equilibria, or within Newton's iterations."""

    UZAWA = "uzawa"
    SEMI_SMOOTH = "semi_smooth"


class Augmented(Part):
    """Multipliers drive the penetration out; tolerance: the share of the largest pressure to which they settle."""

    tolerance: Positive = 1e-3
    method: Settling = Settling.SEMI_SMOOTH

    @model_validator(mode="after")
    def _settles(self) -> Augmented:
        if not LEAST_TOLERANCE <= self.tolerance < 1.0:
            raise problem(f"the tolerance is a share of the largest pressure, from {LEAST_TOLERANCE:g} to below 1",
                          "1.0e-3 leaves a thousandth of the penetration's share.", at=("tolerance",))
        return self


class Form(StrEnum):
    """Where contact is evaluated: on edges cut at the other side's nodes, or at one point a slave node."""

    EDGES = "edges"
    NODES = "nodes"


class ContactPair(Part):
    """slave, master: surfaces "body.surface", or one that may fold onto itself; gap_max [m]; penalty [Pa/m] or auto.

    two_pass: searched from either side, each counting half.
    """

    slave: Text
    master: Text
    gap_max: Positive
    penalty: Stiffness = "auto"
    augmented: Augmented | None = None
    form: Form = Form.EDGES
    two_pass: StrictBool = False
    friction: Friction | None = None
    conduction: Conduction | None = None
    radiation: NearRadiation | None = None

    @model_validator(mode="after")
    def _passes_differ(self) -> ContactPair:
        if self.two_pass and self.slave == self.master:
            raise problem("a surface that faces itself is searched from both sides in one pass",
                          "Leave two_pass out.", at=("two_pass",))
        return self

    @property
    def mu(self) -> float:
        """Coulomb's coefficient, 0 without friction."""
        return 0.0 if self.friction is None else self.friction.mu
