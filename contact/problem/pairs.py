"""What meets what: contact pairs, their conductance, radiation and friction."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Any, Literal

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
        "in full up to `d_near`, fading to nothing at `d_far`; far radiation of the same surfaces may fade in over the "
        "same gaps", default="in full at every gap")] = None


class Friction(Part):
    """Coulomb's law, and where its heat goes.

    Without mu the half makes none, and the share is for one that rubs by a law of its own.
    """

    mu: Annotated[NotNegative, Entry("Coulomb's coefficient (elastic)")] = 0.0
    stick: Annotated[Stiffness, Entry("stiffness of sticking; `auto` = that of the penalty", "Pa/m",
                                    kind="number > 0 or `auto`")] = "auto"
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
        "no penetration (elastic): pressures are corrected until they change by no more than this share of the "
        "largest; of several pairs the tightest holds", least=LEAST_TOLERANCE, below=1.0,
        remedy="1.0e-3 leaves a thousandth of the penetration's share.")] = 1e-3
    method: Annotated[Settling, Entry("pressures are found with the displacements, or in rounds of equilibria; one for "
                                    "all pairs", why="As many iterations as none.")] = Settling.SEMI_SMOOTH


class ContactForm(StrEnum):
    """Where contact is evaluated: on edges cut at the other side's nodes, or at one point a slave node."""

    EDGES = "edges"
    NODES = "nodes"


class PairData(Part):
    """What the halves do with a pair."""

    augmented: Annotated[Augmented | None, Entry(
        "no penetration (elastic); `null`: by the penalty alone", default="`{}`; with inertia `null`, but for tied "
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

    slave: Annotated[Text, Entry("without a common node with `master`; or the same one twice, for a surface that folds "
                               "onto itself", kind="surface")]
    master: Annotated[Text, Entry("the other side", kind="surface")]
    gap_max: Annotated[Positive, Entry("farther apart, surfaces do not see each other", "m")]
    form: Annotated[ContactForm, Entry("contact on edges cut at the other side's nodes; or, as in the paper, at one "
                                       "point a slave node")] = ContactForm.EDGES
    two_pass: Annotated[Flag, Entry("searched from either side, each counting half")] = False
    clearance: Annotated[FieldSpec | None, Entry(
        "the gap where the surfaces face each other as drawn, whatever the drawing says; 0: as drawn they touch", "m",
        default="as drawn")] = None
    interference: Annotated[FieldSpec | None, Entry("the same with the other sign: how far they would overlap", "m",
                                                    default="as drawn")] = None
    smooth: Annotated[Flag, Entry(
        "forces see both sides as round as they are drawn, through their nodes, not the edges between these; corners "
        "stay corners")] = False
    tied: Annotated[Flag, Entry(
        "bonded: what faces each other as drawn, no farther apart than `gap_max`, stays so for good and conducts"
    )] = False
    resistance: Annotated[Positive | None, Entry(
        "of a tied pair, to heat: its sides differ by the flux times it", "m2K/W",
        default="none: it conducts as a hundredth of the two cells that meet there")] = None
    penalty: Annotated[Stiffness, Entry(
        "contact stiffness; `auto`: at each place that of the two cells there in a row, of each its constrained "
        "modulus at `T0`, at most 10 E, over its size", "Pa/m", kind="number > 0 or `auto`")] = "auto"

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
