"""The part of the schema that says what the mechanical half solves and what drives it."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Any

from pydantic import AfterValidator, Field, StrictBool, model_validator

from coupler.scenario.base import Part, SignalSpec, exactly_one
from coupler.scenario.quantity import Name, Number, Positive, Text, Whole, problem
from coupler.scenario.schema_halves import Supported

MOST_CUTS = 12
MOTIONS, TRACTIONS, FORCES, WEIGHTS = ("u_x", "u_y", "angle"), ("t_x", "t_y"), ("f_x", "f_y", "moment"), ("b_x", "b_y")


def _cuts(value: float) -> float:
    if value != int(value) or not 0 <= value <= MOST_CUTS:
        raise problem(f"must be a whole number from 0 to {MOST_CUTS}")
    return value


class Solution(StrEnum):
    """How the mechanical half finds its equilibrium or motion."""

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


class Mass(StrEnum):
    """The mass matrix."""

    CONSISTENT = "consistent"
    LUMPED = "lumped"


class ElasticBoundary(Supported):
    """Motions u_x, u_y [m], angle [rad]; or pressure [Pa] (positive pushes, follows the body); or tractions t_x, t_y
    [Pa], forces f_x, f_y [N], moment [N m], body forces b_x, b_y [N/m3], all of fixed direction."""

    body: Name | None = None
    u_x: SignalSpec | None = None
    u_y: SignalSpec | None = None
    angle: SignalSpec | None = None
    pressure: SignalSpec | None = None
    t_x: SignalSpec | None = None
    t_y: SignalSpec | None = None
    f_x: SignalSpec | None = None
    f_y: SignalSpec | None = None
    moment: SignalSpec | None = None
    b_x: SignalSpec | None = None
    b_y: SignalSpec | None = None

    @model_validator(mode="after")
    def _one_condition(self) -> ElasticBoundary:
        place = exactly_one(self, ("on", "at", "body"))
        kinds = [kind for kind in (MOTIONS, ("pressure",), TRACTIONS, FORCES, WEIGHTS)
                 if any(getattr(self, key) is not None for key in kind)]
        if len(kinds) != 1:
            raise problem("one kind of condition is needed: displacements (u_x, u_y, of a rigid body angle), a "
                          "pressure, tractions (t_x, t_y), forces (f_x, f_y, moment) or body forces (b_x, b_y)")
        given = [key for key in kinds[0] if getattr(self, key) is not None]
        if kinds[0] in (("pressure",), TRACTIONS):
            self.only_on(given[0])
        if kinds[0] == WEIGHTS and place != "body":
            raise problem("a body force acts on a body", "Use `body: NAME`.", at=(place,))
        if kinds[0] == FORCES and place == "on":
            raise problem("a force acts at a point or on a rigid body", "Use `at: body.point`, `body: NAME`, or a "
                          "traction t_x, t_y [Pa].", at=("on",))
        for key in ("angle", "moment"):
            if getattr(self, key) is not None and place != "body":
                raise problem("only a rigid body has an angle", "Use `body: NAME`.", at=(key,))
        if len(given) > 1 and self.name is not None:
            raise problem(f"a name stands for one factor, but {' and '.join(given)} are given",
                          "Write an entry with a name for each.", at=("name",))
        return self


class Gravity(Part):
    """Acceleration of every body that is not driven, along x and y [m/s2]."""

    x: SignalSpec = 0.0
    y: SignalSpec = 0.0
    name: Name | None = None


class BodyOptions(Part):
    """element of one body; rigid: it keeps its shape; reference: the point its motion is told of [m]; v0 [m/s] and
    omega0 [rad/s] at the start."""

    element: Element | None = None
    rigid: StrictBool = False
    reference: tuple[Number, Number] | None = None
    v0: tuple[Number, Number] = (0.0, 0.0)
    omega0: Number = 0.0

    @model_validator(mode="after")
    def _reference_of_rigid(self) -> BodyOptions:
        if self.reference is not None and not self.rigid:
            raise problem("only a rigid body has a reference point", at=("reference",))
        return self


class Dynamics(Part):
    """Inertia: beta and gamma of Newmark, or damped by rho_inf or alpha; mass: the matrix."""

    beta: Positive | None = None
    gamma: Positive | None = None
    rho_inf: Number | None = None
    alpha: Number | None = None
    mass: Mass = Mass.CONSISTENT

    @model_validator(mode="after")
    def _one_family(self) -> Dynamics:
        newmark = self.beta is not None or self.gamma is not None
        if sum((newmark, self.rho_inf is not None, self.alpha is not None)) > 1:
            raise problem("one of beta and gamma, rho_inf, alpha is enough")
        if self.rho_inf is not None and not 0.0 <= self.rho_inf <= 1.0:
            raise problem("must lie between 0 (all damping) and 1 (none)", at=("rho_inf",))
        if self.alpha is not None and not -1.0 / 3.0 <= self.alpha <= 0.0:
            raise problem("must lie between -1/3 and 0", at=("alpha",))
        gamma, beta = self.gamma or 0.5, self.beta or 0.25
        if gamma < 0.5 or beta < 0.5 * gamma:
            raise problem("stable for small steps only", "Take gamma >= 1/2 and beta >= gamma/2, or method: explicit.",
                          at=("beta" if self.beta is not None else "gamma",))
        return self


class Skip(Part):
    """A step that would move nothing by u [m] is skipped, at most `most` in a row."""

    u: Positive
    most: Whole = 10


class Elastic(Part):
    """The half `elastic`.  tolerance: of the force balance, relative; cuts: how often a step is halved inside."""

    tolerance: Positive = 1e-8
    boundary: tuple[ElasticBoundary, ...] = ()
    method: Solution = Solution.NEWTON
    cuts: Annotated[Number, AfterValidator(_cuts)] = 4
    element: Element = Element.MEAN_DILATATION
    state: State = State.PLANE_STRAIN
    bodies: dict[Name, BodyOptions] = Field(default_factory=dict)
    gravity: Gravity | None = None
    dynamics: Dynamics | None = None
    skip: Skip | None = None
    thermoelastic_heat: StrictBool = False
    adiabatic: StrictBool = False

    @model_validator(mode="after")
    def _fits(self) -> Elastic:
        inert = self.dynamics is not None or self.method is Solution.EXPLICIT
        if self.tolerance >= 1.0:
            raise problem("is a share of the forces, below 1", at=("tolerance",))
        if self.skip is not None and inert:
            raise problem("with inertia every step must be solved", at=("skip",))
        for name, body in self.bodies.items():
            if not inert and (any(body.v0) or body.omega0):
                raise problem("without dynamics a body has no velocity", at=("bodies", name))
            if inert and body.reference is not None:
                raise problem("with inertia the motion of a rigid body is told of its centre", "Leave it out.",
                              at=("bodies", name, "reference"))
        return self


class Motion(Part):
    """Displacement of a rigid body [m]."""

    u_x: SignalSpec = 0.0
    u_y: SignalSpec = 0.0


class Rigid(Part):
    """The half `rigid`: bodies not named stay; pressure [Pa] of a pair where it touches."""

    motion: dict[Name, Motion] = Field(default_factory=dict)
    pressure: dict[Name, SignalSpec] = Field(default_factory=dict)


class Held(Part):
    """Displacement of the held ends of a rod along x [m]; an end left out is free."""

    left: SignalSpec | None = None
    right: SignalSpec | None = None

    @model_validator(mode="after")
    def _held_somewhere(self) -> Held:
        if self.left is None and self.right is None:
            raise problem("a rod must be held at its left or its right end, or at both", "Write {left: 0}.")
        return self


class Rod(Part):
    """The half `rod`: which ends of every body are held."""

    held: dict[Name, Held]


class Mechanical(Part):
    """half: kind; the settings of the kinds not chosen stay in the file, so that a swap is one word."""

    half: Text
    elastic: Elastic | None = None
    rigid: Rigid | None = None
    rod: Rod | None = None
    options: dict[str, Any] = Field(default_factory=dict)
