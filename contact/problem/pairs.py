"""What meets what: contact pairs, their conductance, radiation and friction."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Discriminator, Tag, model_validator

from contact.problem.boundary import RadiationGap
from contact.problem.curves import FieldSpec, PropertySpec, SignalSpec
from contact.problem.laws import LawSpec
from contact.problem.part import Entry, Part
from contact.problem.values import Flag, NotNegative, Number, Positive, Text, problem

LEAST_TOLERANCE = 1e-9  # of multipliers: below the round-off of forces nothing settles


def _stiffness_form(value: Any) -> str:
    return "<auto>" if value == "auto" else "<number>"


# A stiffness [Pa/m], or the word by which the scene finds its own.
Stiffness = Annotated[
    Annotated[Positive, Tag("<number>")] | Annotated[Literal["auto"], Tag("<auto>")],
    Discriminator(_stiffness_form),
]


class Conduction(Part):
    """Conductance h_CI of contact; both laws must be said, null where no heat crosses."""

    closed: Annotated[LawSpec | None, Entry("h_CI where the surfaces touch, from the pressure", kind="LAW or null")]
    open: Annotated[LawSpec | None, Entry("h_CI where they are apart, from the gap; `null`: no heat crosses",
                                        kind="LAW or null")]
    closed_factor: Annotated[SignalSpec, Entry("multiplies h_CI of `closed`", least=0.0)] = 1.0
    open_factor: Annotated[SignalSpec, Entry("multiplies h_CI of `open`", least=0.0)] = 1.0

    @model_validator(mode="after")
    def _factors_have_laws(self) -> Conduction:
        for key in ("closed", "open"):
            if getattr(self, key) is None and getattr(self, f"{key}_factor") != 1.0:
                raise problem(f"a factor without its law: {key} is null", at=(f"{key}_factor",))
        return self


class NearRadiation(Part):
    """Radiation between the sides of a pair, close to parallel planes. Eq. (11)."""

    emissivity_slave: Annotated[PropertySpec, Entry("of the slave, at its temperature", above=0.0, most=1.0)]
    emissivity_master: Annotated[PropertySpec, Entry("of the master, at its temperature", above=0.0, most=1.0)]
    gap: Annotated[RadiationGap | None, Entry(
        "full radiation up to the gap `d_near`, none from `d_far`; radiation of the same surfaces to the "
        "surroundings can grow over the same gaps (`thermal.boundary`)",
        default="full radiation at every gap")] = None


class Friction(Part):
    """Coulomb's law, and where its heat goes.

    Without mu the half makes none, and the share is for one that rubs by a law of its own.
    """

    alone: ClassVar[str] = "mu"

    mu: Annotated[NotNegative, Entry("Coulomb's coefficient (elastic)")] = 0.0
    stick: Annotated[Stiffness, Entry("stiffness of sticking; `auto` = that of the penalty, if `augmented` 4 times",
                                      "Pa/m", kind="number > 0 or `auto`")] = "auto"
    share: Annotated[Number | None, Entry("share of the friction heat that enters the slave", least=0.0, most=1.0,
                                        default="by effusivity")] = None

    @model_validator(mode="after")
    def _says_something(self) -> Friction:
        if not self.model_fields_set & {"mu", "share"}:
            raise problem("friction needs its coefficient", "Add mu, for example mu: 0.3.")
        if self.stick != "auto" and self.mu == 0.0:
            raise problem("a stiffness of sticking without friction: mu is 0 or missing", at=("stick",))
        return self


class Settling(StrEnum):
    """How multipliers settle: in rounds of equilibria, or within Newton's iterations."""

    UZAWA = "uzawa"
    SEMI_SMOOTH = "semi_smooth"


class Augmented(Part):
    """Multipliers drive the penetration out."""

    tolerance: Annotated[Number, Entry(
        "pressures (half `elastic`) are corrected until they change by no more "
        "than this share of the largest; of several pairs the smallest value is "
        "used", least=LEAST_TOLERANCE, below=1.0,
        remedy="1.0e-3 leaves a thousandth of the penetration's share.")] = 1e-3
    method: Annotated[Settling, Entry(
        "`semi_smooth`: pressures and displacements are solved together; `uzawa`: a series of equilibria with "
        "corrected pressures. The same for all pairs",
        why="`semi_smooth` takes about as many iterations as the penalty alone.")] = Settling.SEMI_SMOOTH


class ContactForm(StrEnum):
    """Where contact is evaluated: on edges cut at the other side's nodes, or at one point a slave node."""

    EDGES = "edges"
    NODES = "nodes"


class PairData(Part):
    """What the halves do with a pair."""

    augmented: Annotated[Augmented | None, Entry(
        "removes the penetration (half `elastic`); `null`: contact by the penalty alone",
        default="`{}`; with inertia `null`, but for tied "
        "pairs (`null` with `explicit`)")] = None
    friction: Annotated[Friction | None, Entry("friction")] = None
    conduction: Annotated[Conduction | None, Entry("heat across contact and gap",
                                                   default="none: no heat crosses")] = None
    radiation: Annotated[NearRadiation | None, Entry("between the two sides, beside conduction")] = None

    @property
    def mu(self) -> float:
        """Coulomb's coefficient, 0 without friction."""
        return 0.0 if self.friction is None else self.friction.mu


# What a pair cannot have where it is tied, and why.
TIED_NEVER = {
    "friction": "does not slip, so nothing rubs", "clearance": "keeps the gap it is drawn with",
    "interference": "keeps the gap it is drawn with", "two_pass": "is held at its slave's nodes, from both sides alike",
    "smooth": "keeps the gap it is drawn with",
    "form": "is held on edges cut at the other side's nodes",
    "conduction": "conducts as a bond does: state its resistance [m2K/W], or nothing",
    "radiation": "conducts as a bond does, and nothing crosses a gap in it"}


class ContactPair(PairData):
    """Two surfaces that may meet, or one that may fold onto itself."""

    slave: Annotated[Text, Entry(
        "one surface; it shares no node with `master`, or is the same as `master` if a surface "
        "folds onto itself", kind="surface")]
    master: Annotated[Text, Entry("the other side", kind="surface")]
    gap_max: Annotated[Positive, Entry("largest gap at which the surfaces interact", "m")]
    form: Annotated[ContactForm, Entry(
        "`edges`: contact is integrated along the edges, divided at the nodes of the other "
        "side; `nodes`: one contact point for each slave node, as in the paper")] = ContactForm.EDGES
    two_pass: Annotated[Flag, Entry(
        "contact is evaluated twice, with either side as the slave, each time with half the weight")] = False
    clearance: Annotated[FieldSpec | None, Entry(
        "replaces the initial gap of the drawing where the surfaces face each other; 0: they just touch", "m",
        default="as drawn")] = None
    interference: Annotated[FieldSpec | None, Entry(
        "the same with the opposite sign: replaces the initial overlap", "m",
                                                    default="as drawn")] = None
    smooth: Annotated[Flag, Entry(
        "contact forces use smooth curves through the nodes of both sides instead of the straight edges; "
        "corners stay corners")] = False
    tied: Annotated[Flag, Entry(
        "bonded: places that face each other in the drawing, at most `gap_max` apart, stay bonded for the whole run"
        " and conduct heat"
    )] = False
    resistance: Annotated[Positive | None, Entry(
        "thermal resistance of a tied pair: the temperatures of its sides differ by the flux times this", "m2K/W",
        default="none: the resistance of a hundredth of the two adjacent cells")] = None
    penalty: Annotated[Stiffness, Entry(
        "contact stiffness; `auto`: at each place the stiffness of the two adjacent cells in series. The stiffness "
        "of a cell is its constrained modulus at `T0` (at most 10 E) divided by its size",
        "Pa/m", kind="number > 0 or `auto`")] = "auto"

    @model_validator(mode="after")
    def _fits_once(self) -> ContactPair:
        if self.clearance is not None and self.interference is not None:
            raise problem("an interference is a clearance with the other sign", "Give one of the two.",
                          at=("interference",))
        if self.slave == self.master and (self.clearance is not None or self.interference is not None):
            raise problem("a surface that faces itself has no clearance of its own", "Leave it out.",
                          at=("clearance" if self.clearance is not None else "interference",))
        return self

    @model_validator(mode="after")
    def _tied_alone(self) -> ContactPair:
        if not self.tied:
            if self.resistance is not None:
                raise problem("a resistance is that of a tied pair", "Write tied: true, or state it as conduction: "
                              "{closed: {law: constant, h: 1/resistance}, open: null}.", at=("resistance",))
            return self
        if self.slave == self.master:
            raise problem("a surface is not tied to itself", "Name the surface it is tied to.", at=("master",))
        for key, why in TIED_NEVER.items():
            # fault: what a tied pair cannot have is left aside in silence -> if False: |
            #   coupler/test_ties::test_what_contradicts_is_told_with_its_place
            if key in self.model_fields_set and getattr(self, key) not in (None, False, ContactForm.EDGES):
                raise problem(f"a tied pair {why}", f"Leave {key} out, or leave tied out.", at=(key,))
        return self

    @model_validator(mode="after")
    def _passes_differ(self) -> ContactPair:
        if self.two_pass and self.slave == self.master:
            raise problem("a surface that faces itself is searched from both sides in one pass",
                          "Leave two_pass out.", at=("two_pass",))
        return self
