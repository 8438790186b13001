"""What the mechanical half solves and what drives it."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from contact.problem.boundary import FORCES, HELD, TRACTIONS, WEIGHTS, Supported
from contact.problem.curves import FieldSpec, SignalSpec
from contact.problem.material import Material
from contact.problem.pairs import ContactPair, PairData
from contact.problem.part import Entry, Part, exactly_one
from contact.problem.regions import regions_in
from contact.problem.start import StartSpec
from contact.problem.values import Count, Flag, Name, Number, Positive, Text, Whole, problem

MOST_CUTS = 12  # 2^-12 of a step is no step any more


class Solution(StrEnum):
    """How the mechanical half finds its equilibrium or motion; `control.method` counts them from 1 in this order."""

    NEWTON = "newton"
    MODIFIED_NEWTON = "modified_newton"
    BFGS = "bfgs"
    EXPLICIT = "explicit"


class Element(StrEnum):
    """What cells are made of."""

    MEAN_DILATATION = "mean_dilatation"
    ENHANCED = "enhanced"


class State(StrEnum):
    """What happens through the thickness of a plane scene."""

    PLANE_STRAIN = "plane_strain"
    PLANE_STRESS = "plane_stress"


class Start(StrEnum):
    """Under which loads the start is solved, where a load jumps at t = 0."""

    BEFORE_JUMPS = "before_jumps"
    EQUILIBRIUM = "equilibrium"


class Mass(StrEnum):
    """The mass matrix."""

    CONSISTENT = "consistent"
    LUMPED = "lumped"


class ContactMass(StrEnum):
    """Where the mass of nodes on contact surfaces is."""

    BEHIND = "behind"
    KEPT = "kept"


class Rotation(Part):
    """A turn in the plane about a fixed point, by a finite angle."""

    about: Annotated[tuple[Number, Number], Entry("centre of the rotation", "m")]
    angle: Annotated[SignalSpec, Entry("anticlockwise, of any size; 1.5708 is a quarter turn", "rad")]


class Closing(StrEnum):
    """What of a pair releases a condition."""

    CLOSES = "closes"


def _release_form(value: Any) -> str:
    return "<pair>" if isinstance(value, Mapping) else "<time>"


Release = Annotated[Annotated[Positive, Tag("<time>")] | Annotated[dict[Name, Closing], Tag("<pair>")],
                    Discriminator(_release_form)]


class ElasticBoundary(Supported):
    """One kind of condition, its components together, on a surface, at a point or of a body."""

    body: Annotated[Name | None, Entry("the place, a body", kind="name")] = None
    u_x: Annotated[FieldSpec | None, Entry("prescribed displacement along x; over reference coordinates", "m",
                                           default="any; a SIGNAL if rigid")] = None
    u_y: Annotated[FieldSpec | None, Entry("prescribed displacement along y", "m",
                                           default="any; a SIGNAL if rigid")] = None
    rotation: Annotated[Rotation | None, Entry(
        "prescribes the position x = about + R(angle) (X + u - about); u is from "
        "`u_x` and `u_y`, so these rotate with the place", default="any (plane)")] = None
    angle: Annotated[SignalSpec | None, Entry("prescribed angle, anticlockwise", "rad", default="`body`, rigid")] = None
    until: Annotated[Release | None, Entry(
        "releases a prescribed displacement at this time, or after the window in which a pair closes; the force "
        "that held it goes to zero within the next window",
        "s", default="where displacements are", kind="number > 0, or {PAIR: closes}")] = None
    pressure: Annotated[SignalSpec | None, Entry("positive pushes on the body and follows it", "Pa",
                                                 default="`on`")] = None
    t_x: Annotated[SignalSpec | None, Entry("traction on the reference surface, of fixed direction", "Pa",
                                            default="`on`")] = None
    t_y: Annotated[SignalSpec | None, Entry("the same along y", "Pa", default="`on`")] = None
    f_x: Annotated[SignalSpec | None, Entry("force, of fixed direction (a metre of depth, or the whole turn)", "N",
                                          default="`at`; `body` if rigid")] = None
    f_y: Annotated[SignalSpec | None, Entry("the same along y", "N", default="`at`; `body` if rigid")] = None
    moment: Annotated[SignalSpec | None, Entry("anticlockwise", "N m", default="`body`, rigid")] = None
    b_x: Annotated[SignalSpec | None, Entry("body force on the reference volume", "N/m3", default="`body`")] = None
    b_y: Annotated[SignalSpec | None, Entry("the same along y", "N/m3", default="`body`")] = None

    @model_validator(mode="after")
    def _one_condition(self) -> ElasticBoundary:
        place = exactly_one(self, ("on", "at", "body"))
        kinds = [kind for kind in (HELD, ("pressure",), TRACTIONS, FORCES, WEIGHTS)
                 if any(getattr(self, key) is not None for key in kind)]
        if len(kinds) != 1:
            each = [next(key for key in kind if getattr(self, key) is not None) for kind in kinds]
            raise problem("one kind of condition is needed: displacements (u_x, u_y, rotation, of a rigid body "
                          "angle), a pressure, tractions (t_x, t_y), forces (f_x, f_y, moment) or body forces (b_x, "
                          "b_y)", f"Write an entry for each of {' and '.join(each)}." if each else "")
        given = [key for key in kinds[0] if getattr(self, key) is not None]
        if kinds[0] in (("pressure",), TRACTIONS):
            self.only_on(given[0])
        if kinds[0] == WEIGHTS and place != "body":
            raise problem("a body force acts on a body", "Use `body: NAME`.", at=(place,))
        if kinds[0] == FORCES and place == "on":
            raise problem("a force acts at a point or on a rigid body", "Use `at: body.point`, `body: NAME`, or a "
                          "traction t_x, t_y [Pa].", at=("on",))
        if self.until is not None and kinds[0] != HELD:
            raise problem("only a displacement is released; a load ends by its signal", at=("until",))
        if isinstance(self.until, dict) and len(self.until) != 1:
            raise problem("one pair is needed", "Write {PAIR: closes}.", at=("until",))
        if self.rotation is not None and self.angle is not None:
            raise problem("the rotation has the angle of the body already", "Keep one of the two.", at=("angle",))
        for key in ("angle", "moment"):
            if getattr(self, key) is not None and place != "body":
                raise problem("only a rigid body has an angle", "Use `body: NAME`.", at=(key,))
        if len(given) > 1 and self.name is not None:
            entries = [f"{{{place}: {getattr(self, place)}, name: {self.name}{f'_{k + 1}' if k else ''}, {key}: ...}}"
                       for k, key in enumerate(given)]
            raise problem(f"a name stands for one factor, but {' and '.join(given)} are given",
                          f"Write an entry for each, of which only what is driven needs a name: {', '.join(entries)}.",
                          at=("name",))
        return self


class Gravity(Part):
    """Acceleration of every body."""

    x: Annotated[SignalSpec, Entry("along x, acts on every body; needs `rho`", "m/s2")] = 0.0
    y: Annotated[SignalSpec, Entry("along y", "m/s2")] = 0.0
    name: Annotated[Name | None, Entry("adds inputs as those of a condition", kind="name")] = None


class BodyOptions(Part):
    """What is said of one body alone."""

    element: Annotated[Element | None, Entry("element type of this body", default="that of all")] = None
    rigid: Annotated[Flag, Entry("the body keeps its shape and moves as a whole")] = False
    reference: Annotated[tuple[Number, Number] | None, Entry(
        "reference point of the motion and the forces of a rigid body; not with inertia", "m",
        default="centre of its volume")] = None
    v0: Annotated[tuple[Number, Number], Entry("velocity at the start (with inertia)", "m/s")] = (0.0, 0.0)
    omega0: Annotated[Number, Entry(
        "angular velocity at the start, about the centre of the body's bounding box (rigid body: "
        "of its volume)", "rad/s")] = 0.0

    @model_validator(mode="after")
    def _reference_of_rigid(self) -> BodyOptions:
        if self.reference is not None and not self.rigid:
            raise problem("only a rigid body has a reference point", at=("reference",))
        return self


class Dynamics(Part):
    """Inertia: beta and gamma of Newmark, or damped by rho_inf or alpha."""

    beta: Annotated[Positive | None, Entry("Newmark's; at least gamma/2", default="1/4")] = None
    gamma: Annotated[Positive | None, Entry("Newmark's; at least 1/2", default="1/2")] = None
    rho_inf: Annotated[Number | None, Entry(
        "instead: generalized-alpha method, damps modes that are too fast for the step (1: no damping)", least=0.0,
                                          most=1.0, remedy="0 is all damping, 1 is none.")] = None
    alpha: Annotated[Number | None, Entry(
        "instead: method of Hilber, Hughes and Taylor, damps the same modes", least=-1.0 / 3.0,
                                          most=0.0, kind="-1/3 to 0")] = None
    mass: Annotated[Mass, Entry("mass matrix")] = Mass.CONSISTENT
    contact_mass: Annotated[ContactMass, Entry(
        "mass of the nodes on contact surfaces: `behind` moves it to the nodes behind them, "
        "so that contact pressure does not oscillate; `kept` leaves it, as `explicit` always"
        " does")] = ContactMass.BEHIND

    @model_validator(mode="after")
    def _one_family(self) -> Dynamics:
        newmark = self.beta is not None or self.gamma is not None
        if sum((newmark, self.rho_inf is not None, self.alpha is not None)) > 1:
            raise problem("one of beta and gamma, rho_inf, alpha is enough")
        gamma, beta = self.gamma or 0.5, self.beta or 0.25
        if gamma < 0.5 or beta < 0.5 * gamma:
            raise problem("stable for small steps only", "Take gamma >= 1/2 and beta >= gamma/2, or method: explicit.",
                          at=("beta" if self.beta is not None else "gamma",))
        return self


class Skip(Part):
    """Steps that would move next to nothing are skipped."""

    u: Annotated[Positive, Entry("a step is skipped if its inputs would move no node by more than this", "m")]
    most: Annotated[Whole, Entry("most steps skipped in a row")] = 10


class ElasticSettings(Part):
    """How displacements are solved for, and what holds and pushes the bodies."""

    tolerance: Annotated[Number, Entry("force residual over the forces on a body", above=0.0, below=1.0,
                                         remedy="It is a share of the forces.")] = 1e-8
    boundary: Annotated[tuple[ElasticBoundary, ...], Entry("entries below", default="none", kind="list")] = ()
    method: Annotated[Solution, Entry("`docs/elements.md` says when to use which")] = Solution.NEWTON
    cuts: Annotated[Count, Entry("how often the half may halve a step that fails before it rejects the step",
                               most=MOST_CUTS)] = 4
    element: Annotated[Element, Entry("`enhanced` for bending")] = Element.MEAN_DILATATION
    start: Annotated[Start, Entry("without inertia: a load or displacement that jumps at t = 0 acts just after it, or "
                                  "the start is in `equilibrium` under it")] = Start.BEFORE_JUMPS
    state: Annotated[State, Entry("plane geometry only")] = State.PLANE_STRAIN
    gravity: Annotated[Gravity | None, Entry("weight of all bodies")] = None
    dynamics: Annotated[Dynamics | None, Entry("inertia: `{}` is Newmark's method with 1/4 and 1/2; needs `rho`",
                                             default="none: no inertia")] = None
    skip: Annotated[Skip | None, Entry("steps that may be skipped")] = None
    thermoelastic_heat: Annotated[Flag, Entry("compression heats, expansion cools")] = False
    adiabatic: Annotated[Flag, Entry("the half can step at frozen entropy (`control.mode` 1); needs `rho`, "
                                     "`c`")] = False

    @property
    def inert(self) -> bool:
        """Whether mass matters."""
        return self.dynamics is not None or self.method is Solution.EXPLICIT

    @model_validator(mode="after")
    def _fits(self) -> ElasticSettings:
        if self.skip is not None and self.inert:
            raise problem("with inertia every step must be solved", at=("skip",))
        bodies: dict[str, BodyOptions] = getattr(self, "bodies", {})
        for name, body in bodies.items():
            if not self.inert and (any(body.v0) or body.omega0):
                raise problem("without dynamics a body has no velocity", at=("bodies", name))
            if self.inert and body.reference is not None:
                raise problem("with inertia the motion of a rigid body is told of its centre", "Leave it out.",
                              at=("bodies", name, "reference"))
        return self


class Elastic(ElasticSettings):
    """The half `elastic`."""

    bodies: Annotated[dict[Name, BodyOptions], Entry("what is said of one body alone")] = Field(default_factory=dict)


class Motion(Part):
    """Displacement of a rigid body."""

    u_x: Annotated[SignalSpec, Entry("displacement along x; bodies not named stay", "m")] = 0.0
    u_y: Annotated[SignalSpec, Entry("along y", "m")] = 0.0
    rotation: Annotated[Rotation | None, Entry(
        "rotation about a point, after the displacement (plane only)", default="none")] = None


class Rigid(Part):
    """The half `rigid`: bodies that only move as prescribed."""

    motion: Annotated[dict[Name, Motion], Entry("of each body")] = Field(default_factory=dict)
    pressure: Annotated[dict[Name, SignalSpec], Entry(
        "contact pressure of a pair, on the whole of it, while a place of it touches", "Pa", least=0.0,
        default="0")] = Field(default_factory=dict)


class Held(Part):
    """Which ends of a rod are held."""

    left: Annotated[SignalSpec | None, Entry(
        "prescribed displacement of this end along x; every body needs at least one such end",
                                           "m", default="free")] = None
    right: Annotated[SignalSpec | None, Entry("the same of the other end", "m", default="free")] = None

    @model_validator(mode="after")
    def _held_somewhere(self) -> Held:
        if self.left is None and self.right is None:
            raise problem("a rod must be held at its left or its right end, or at both", "Write {left: 0}.")
        return self


class Rod(Part):
    """The half `rod`: columns along x."""

    held: Annotated[dict[Name, Held], Entry("of each body")]


class BodyMaterial(Part):
    """What a body is made of."""

    material: Annotated[Name, Entry("what it is made of", kind="name")]


class ElasticRegion(Part):
    """What the elastic half knows of a region of a body."""

    material: Annotated[Name, Entry("what it is made of", kind="name")]
    drawn_at: Annotated[StartSpec | None, Entry("the temperature at which it has the shape of the mesh", "K", above=0.0,
                                              default="at T_ref, solid")] = None


class ElasticBody(BodyOptions):
    """What the elastic half knows of a body beside its mesh."""

    material: Annotated[Name, Entry("what it is made of", kind="name")]
    drawn_at: Annotated[StartSpec | None, Entry("the temperature at which it has the shape of the mesh", "K", above=0.0,
                                              default="at T_ref, solid")] = None
    regions: Annotated[dict[Name, ElasticRegion] | None, Entry("cells with a material of their own",
                                                               default="none")] = None


class ElasticProblem(ElasticSettings):
    """The model.json of the half `elastic`: SI, kelvin, signals written out."""

    half: Annotated[Text, Entry("kind of the half")]
    format: Annotated[Literal[2, 3], Entry("version of this form")]
    materials: Annotated[dict[Name, Material], Entry("by name")]
    bodies: Annotated[dict[Name, ElasticBody], Entry("by name")]
    pairs: Annotated[dict[Name, PairData], Entry("by name; what both halves must agree on is in interface.h5")] = Field(
        default_factory=dict)


    @property
    def parts(self) -> dict[str, ElasticBody | ElasticRegion]:
        """What has a material: the bodies, then their regions as "body.region"."""
        return {**self.bodies, **regions_in(self.bodies)}


class RigidProblem(Rigid):
    """The model.json of the half `rigid`."""

    half: Annotated[Text, Entry("kind of the half")]
    format: Annotated[Literal[2, 3], Entry("version of this form")]


class RodProblem(Rod):
    """The model.json of the half `mechanical_rod`."""

    half: Annotated[Text, Entry("kind of the half")]
    format: Annotated[Literal[2, 3], Entry("version of this form")]
    materials: Annotated[dict[Name, Material], Entry("by name")]
    bodies: Annotated[dict[Name, BodyMaterial], Entry("by name")]


class ForeignRegion(ElasticRegion):
    """What a mechanical half of another package is told of a region."""

    T0: Annotated[StartSpec, Entry("at time 0", "K")]


class ForeignBody(ElasticBody):
    """What a mechanical half of another package is told of a body."""

    T0: Annotated[StartSpec, Entry("at time 0", "K")]
    regions: Annotated[dict[Name, ForeignRegion] | None, Entry(
        "cells with a material of their own")] = None  # type: ignore[assignment]


class ForeignMechanical(ElasticProblem):
    """The model.json of a mechanical half of another package: all that the scene states.

    Its boundary and settings are those of `mechanical.elastic`, where the scenario has that.
    """

    bodies: Annotated[dict[Name, ForeignBody], Entry("by name")]  # type: ignore[assignment]
    pairs: Annotated[dict[Name, ContactPair], Entry("by name, in full")] = Field(  # type: ignore[assignment]
        default_factory=dict)
    options: Annotated[dict[str, Any], Entry("as the scenario has them")] = Field(default_factory=dict)
    rigid: Annotated[Rigid | None, Entry("what the half `rigid` would be told")] = None
    rod: Annotated[Rod | None, Entry("what the half `rod` would be told")] = None
