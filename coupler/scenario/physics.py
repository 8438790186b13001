"""The part of the schema that says what the mechanical half solves and what drives it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import StrEnum
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, StrictBool, Tag, model_validator

from contact.laws import parse_law
from coupler.scenario.document import Name, NotNegative, Number, Positive, Text, Whole, number, problem
from coupler.scenario.values import (
    At,
    FieldSpec,
    Part,
    Polynomial,
    PropertySpec,
    PropertyTable,
    SignalSpec,
    Supported,
    exactly_one,
    not_negative,
    numbers_in,
    positive,
)

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


# The part of the schema that says what the thermal half solves and what drives it.

MOST_INCREMENTS = 100_000  # a count beyond this is a slip of the pen
SIGMA_SB = 5.670374419e-8  # W/m2K4


class Method(StrEnum):
    """How the thermal half steps in time."""

    MIDPOINT = "midpoint"
    THETA = "theta"
    SDIRK2 = "sdirk2"
    BACKWARD_EULER = "backward_euler"
    STEADY = "steady"


class FilmGap(Part):
    """kappa rises from 0 at a gap of d_cut to 1 at d_full [m]. Eq. (7)."""

    d_cut: NotNegative
    d_full: Positive

    @model_validator(mode="after")
    def _in_order(self) -> FilmGap:
        if self.d_full <= self.d_cut:
            raise problem("d_full must be greater than d_cut", at=("d_full",))
        return self


class Convection(Part):
    """h [W/m2K^(1+exponent)], T of the surroundings, exponent alpha; gap: fades near others. Eqs. (5-7)."""

    h: FieldSpec
    h_factor: PropertySpec | None = None
    T: FieldSpec
    exponent: NotNegative = 0.0
    gap: FilmGap | None = None

    @model_validator(mode="after")
    def _factor_positive(self) -> Convection:
        if self.h_factor is not None:
            positive(self.h_factor, ("h_factor",), zero_in_table=True)
        return self


class RadiationGap(Part):
    """Near radiation up to a gap of d_near, far radiation from d_far on [m], a blend between. After Eq. (12)."""

    d_near: NotNegative
    d_far: Positive

    @model_validator(mode="after")
    def _in_order(self) -> RadiationGap:
        if self.d_far <= self.d_near:
            raise problem("d_far must be greater than d_near", at=("d_far",))
        return self


class Radiation(Part):
    """Far radiation to surroundings at T; emissivity in (0, 1]; gap: fades near others. Eq. (12)."""

    emissivity: PropertySpec
    T: FieldSpec
    gap: RadiationGap | None = None

    @model_validator(mode="after")
    def _emissive(self) -> Radiation:
        positive(self.emissivity, ("emissivity",), most=1.0)
        return self


class NearRadiation(Part):
    """Radiation between the sides of a pair, close to parallel planes; gap: fades far apart. Eq. (11)."""

    emissivity_slave: PropertySpec
    emissivity_master: PropertySpec
    gap: RadiationGap | None = None

    @model_validator(mode="after")
    def _emissive(self) -> NearRadiation:
        for key in ("emissivity_slave", "emissivity_master"):
            positive(getattr(self, key), (key,), most=1.0)
        return self


CONDITIONS = ("temperature", "flux", "convection", "radiation")


class ThermalBoundary(Supported):
    """One of temperature (scenario's unit), flux [W/m2 into the body], convection, radiation."""

    temperature: FieldSpec | None = None
    flux: FieldSpec | None = None
    convection: Convection | None = None
    radiation: Radiation | None = None

    @model_validator(mode="after")
    def _one_condition(self) -> ThermalBoundary:
        exactly_one(self, ("on", "at"))
        if (kind := exactly_one(self, CONDITIONS)) != "temperature":
            self.only_on(kind)
        return self


class Adaptive(Part):
    """Inner steps of a substep: local error below tolerance [K], change below max_dT [K], none below least [s]."""

    tolerance: Positive | None = None
    max_dT: Positive | None = None
    least: Positive | None = None

    @model_validator(mode="after")
    def _has_a_measure(self) -> Adaptive:
        if self.tolerance is None and self.max_dT is None:
            raise problem("at least one of tolerance, max_dT is needed", "Both are in K.")
        return self


class Thermal(Part):
    """half: kind; options: for a half of another package, passed on unchanged in its model.json."""

    half: Text = "thermal"
    method: Method = Method.MIDPOINT
    theta: Number | None = None
    increments: Whole | None = None
    adaptive: Adaptive | None = None
    tolerance: Positive = 1e-10
    sigma_SB: Positive = SIGMA_SB
    boundary: tuple[ThermalBoundary, ...] = ()
    options: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _of_its_method(self) -> Thermal:
        for key, method in (("theta", Method.THETA), ("increments", Method.STEADY)):
            if getattr(self, key) is not None and self.method is not method:
                raise problem(f"{key} belongs to method {method.value}, but the method is {self.method.value}",
                              f"Write method: {method.value}, or leave {key} out.", at=(key,))
        if self.method is Method.THETA and self.theta is None:
            raise problem("method theta needs its theta", "Add theta: 0.5 (midpoint) to 1 (backward Euler).",
                          at=("method",))
        if self.theta is not None and not 0.5 <= self.theta <= 1.0:
            raise problem("theta lies between 0.5 and 1", "Below 0.5 no large step would be stable.", at=("theta",))
        if self.increments is not None and self.increments > MOST_INCREMENTS:
            raise problem(f"more than {MOST_INCREMENTS} increments", at=("increments",))
        if self.adaptive is not None and self.method is Method.STEADY:
            raise problem("a steady solution has no steps in time to adapt", "Use increments.", at=("adaptive",))
        return self


# The part of the schema that says how a material flows: plasticity, creep, melting (docs/materials.md).

class HardeningLaw(StrEnum):
    """How the yield stress grows with plastic strain."""

    LINEAR = "linear"
    VOCE = "voce"
    TABLE = "table"


class TableForm(StrEnum):
    """Between the points of a table."""

    LINEAR = "linear"
    CUBIC = "cubic"


class Beyond(StrEnum):
    """Beyond the last point of a table."""

    FLAT = "flat"
    SLOPE = "slope"


class Hardening(Part):
    """linear: H [Pa]; voce: Q (1 - exp(-b e)) + H e; table: stress [Pa] over plastic strain, of several T if given."""

    law: HardeningLaw
    H: PropertySpec | None = None
    Q: PropertySpec | None = None
    b: Positive | None = None
    strain: tuple[Number, ...] | None = None
    stress: tuple[Number | tuple[Number, ...], ...] | None = None
    T: tuple[Number, ...] | None = None
    form: TableForm = TableForm.LINEAR
    beyond: Beyond = Beyond.FLAT

    @model_validator(mode="after")
    def _complete(self) -> Hardening:
        needed = {"linear": ("H",), "voce": ("Q", "b"), "table": ("strain", "stress")}[self.law.value]
        allowed = {"linear": ("H",), "voce": ("Q", "b", "H"),
                   "table": ("strain", "stress", "T", "form", "beyond")}[self.law.value]
        for key in needed:
            if getattr(self, key) is None:
                raise problem(f"the law {self.law.value} needs {key}", at=("law",))
        for key in sorted(self.model_fields_set - {"law", *allowed}):
            raise problem(f"the law {self.law.value} has no {key}", at=(key,))
        if self.strain is not None and (len(self.strain) < 2 or self.strain[0] != 0.0
                                        or any(b <= a for a, b in zip(self.strain, self.strain[1:], strict=False))):
            raise problem("must begin at 0, increase, and have at least two values", at=("strain",))
        if self.T is not None and any(b <= a for a, b in zip(self.T, self.T[1:], strict=False)):
            raise problem("temperatures must increase", at=("T",))
        if self.strain is not None and self.stress is not None:
            self._rows_fit(self.strain, self.stress)
        return self

    @property
    def falls(self) -> bool:
        """Whether its numbers say that the flow stress falls with strain; tables over T are left to the half."""
        if self.law is HardeningLaw.LINEAR:
            return any(H < 0.0 for _, H in numbers_in(self.H, ()))
        if self.law is HardeningLaw.VOCE:
            Q, b, H = self.Q, self.b, self.H or 0.0
            return isinstance(Q, float) and isinstance(H, float) and b is not None and min(H, H + b * Q) < 0.0
        rows = (self.stress,) if self.T is None else self.stress
        values = [[v for v in row if isinstance(v, float)] for row in rows or () if isinstance(row, tuple)]
        return any(after < before for row in values for before, after in pairwise(row))

    def _rows_fit(self, strain: tuple[float, ...], stress: tuple[float | tuple[float, ...], ...]) -> None:
        rows = stress if self.T is not None else (stress,)
        if self.T is not None and len(rows) != len(self.T):
            raise problem(f"one list for each of the {len(self.T)} temperatures is needed", at=("stress",))
        for row in rows:
            if not isinstance(row, tuple) or len(row) != len(strain) or any(
                    isinstance(v, tuple) or v <= 0.0 for v in row):
                raise problem(f"{len(strain)} positive values are needed, one for each strain", at=("stress",))


class Kinematic(Part):
    """Backstress: dX = 2/3 C d(ep) - gamma X de [Pa], [1]."""

    C: PropertySpec
    gamma: PropertySpec | None = None

    @model_validator(mode="after")
    def _physical(self) -> Kinematic:
        positive(self.C, ("C",))
        not_negative(self.gamma, ("gamma",))
        return self


class Overstress(Part):
    """Stress beyond yield K rate^m, K [Pa s^m]."""

    K: PropertySpec
    m: Positive

    @model_validator(mode="after")
    def _exponent(self) -> Overstress:
        if self.m > 1.0:
            raise problem("must be at most 1", at=("m",))
        not_negative(self.K, ("K",))
        return self


class Plastic(Part):
    """s_y: yield stress [Pa]; factor: times all of the flow stress; chi: share of the work that becomes heat."""

    s_y: PropertySpec | None = None
    hardening: Hardening | None = None
    factor: PropertySpec | None = None
    kinematic: Kinematic | None = None
    overstress: Overstress | None = None
    chi: NotNegative = 0.9
    softening: StrictBool = False

    @model_validator(mode="after")
    def _one_yield(self) -> Plastic:
        table = self.hardening is not None and self.hardening.law is HardeningLaw.TABLE
        if table == (self.s_y is not None):
            raise problem("a table begins with the yield stress" if table else "the yield stress is missing",
                          "Leave s_y out." if table else "Write s_y, in Pa.", at=("hardening",) if table else ())
        if self.chi > 1.0:
            raise problem("is a share, from 0 to 1", at=("chi",))
        if self.s_y is not None:
            positive(self.s_y, ("s_y",))
        not_negative(self.factor, ("factor",))
        # fault: a flow stress that falls goes unnoticed -> if self.hardening is not None and False: |
        #   coupler/test_scenario_mechanical
        if self.hardening is not None and self.hardening.falls and not self.softening:
            raise problem("its flow stress falls with plastic strain", "If that is meant, write softening: true.",
                          at=("hardening",))
        return self


class Creep(Part):
    """Norton: rate = A s^n exp(-Q/RT), A [1/(Pa^n s)], Q [J/mol]; or superplastic: s = K rate^m, K [Pa s^m]."""

    A: PropertySpec | None = None
    n: Positive | None = None
    Q: NotNegative = 0.0
    K: PropertySpec | None = None
    m: Positive | None = None
    heat: NotNegative = 1.0

    @model_validator(mode="after")
    def _one_law(self) -> Creep:
        norton, power = (self.A is not None, self.n is not None), (self.K is not None, self.m is not None)
        if not (all(norton) and not any(power)) and not (all(power) and not any(norton)):
            raise problem("either A and n, or K and m are needed")
        if any(power) and "Q" in self.model_fields_set:
            raise problem("goes with A and n", at=("Q",))
        not_negative(self.A, ("A",))
        if self.K is not None:
            positive(self.K, ("K",))
        for key, most in (("m", 1.0), ("heat", 1.0)):
            if (getattr(self, key) or 0.0) > most:
                raise problem(f"must be at most {most:g}", at=(key,))
        return self


class Liquid(Part):
    """Above T_l: viscous eta [Pa s], bulk [Pa]; T_s, T_l in the scenario's unit; shrinkage: linear strain."""

    eta: PropertySpec
    bulk: PropertySpec
    T_s: Number
    T_l: Number
    shrinkage: Number = 0.0
    heat: NotNegative = 1.0

    @model_validator(mode="after")
    def _in_order(self) -> Liquid:
        if self.T_s > self.T_l:
            raise problem("melting must not begin above where it ends", at=("T_s",))
        positive(self.eta, ("eta",))
        positive(self.bulk, ("bulk",))
        if not -0.5 < self.shrinkage < 0.5:
            raise problem("is a linear strain, between -0.5 and 0.5", "6.6 % of the volume is a shrinkage of 0.0225.",
                          at=("shrinkage",))
        if self.heat > 1.0:
            raise problem("is a share, from 0 to 1", at=("heat",))
        return self


# The part of the schema that says what bodies are made of.

class Phases(Part):
    """A property of its own for each phase, blended by the solid fraction."""

    solid: PropertySpec
    liquid: PropertySpec


def _phased_form(value: Any) -> str:
    if isinstance(value, Phases) or (isinstance(value, Mapping) and {"solid", "liquid"} & value.keys()):
        return "<phases>"
    if isinstance(value, Polynomial) or (isinstance(value, Mapping) and "polynomial" in value):
        return "<polynomial>"
    return "<table>" if isinstance(value, Mapping | PropertyTable) else "<number>"


PhasedSpec = Annotated[
    Annotated[Number, Tag("<number>")] | Annotated[PropertyTable, Tag("<table>")]
    | Annotated[Polynomial, Tag("<polynomial>")] | Annotated[Phases, Tag("<phases>")],
    Discriminator(_phased_form),
]


class Axes(Part):
    """k_1, k_2 along two material axes; angle [degrees] of axis 1 to x in the reference; turns with the body."""

    k_1: PhasedSpec
    k_2: PhasedSpec
    angle: Number = 0.0
    turns: StrictBool = True


AXES_KEYS = frozenset(("k_1", "k_2", "angle", "turns", "k1", "k2"))  # the last two to be told the right ones


def _conductivity_form(value: Any) -> str:
    if isinstance(value, Axes) or (isinstance(value, Mapping) and AXES_KEYS & value.keys()):
        return "<axes>"
    return _phased_form(value)


ConductivitySpec = Annotated[
    Annotated[Number, Tag("<number>")] | Annotated[PropertyTable, Tag("<table>")]
    | Annotated[Polynomial, Tag("<polynomial>")] | Annotated[Phases, Tag("<phases>")]
    | Annotated[Axes, Tag("<axes>")],
    Discriminator(_conductivity_form),
]


class Latent(Part):
    """L [J/kg], taken up from T_s (solidus) to T_l (liquidus), or all at T_m."""

    L: Positive
    T_m: Number | None = None
    T_s: Number | None = None
    T_l: Number | None = None

    @model_validator(mode="after")
    def _one_form(self) -> Latent:
        if (self.T_m is None) == (self.T_s is None) or (self.T_s is None) != (self.T_l is None):
            raise problem("latent heat has either `T_m`, or both `T_s` and `T_l`")
        if self.T_s is not None and self.T_l is not None and self.T_l < self.T_s:
            raise problem("T_l (liquidus) must not be below T_s (solidus)", at=("T_l",))
        return self

    @property
    def limits(self) -> tuple[float, float]:
        """Solidus and liquidus, in the scenario's unit of temperature."""
        if self.T_m is not None:
            return self.T_m, self.T_m
        assert self.T_s is not None
        assert self.T_l is not None
        return self.T_s, self.T_l


class Material(Part):
    """Each half needs its own share: thermal rho, k, c, latent; elastic E, nu, alpha, T_ref, and how it flows."""

    rho: Positive | None = None
    k: ConductivitySpec | None = None
    c: PhasedSpec | None = None
    latent: Latent | None = None
    E: PropertySpec | None = None
    nu: PropertySpec | None = None
    alpha: PropertySpec | None = None
    T_ref: Number | None = None
    plastic: Plastic | None = None
    creep: Creep | None = None
    liquid: Liquid | None = None

    @model_validator(mode="after")
    def _physical(self) -> Material:
        for key in ("k", "c", "E"):
            for at, spec in properties_in(getattr(self, key), (key,)):
                positive(spec, at)
                if at[-1] in ("solid", "liquid") and self.latent is None:
                    raise problem("solid and liquid need to know when it melts",
                                  "Add latent: {L: ..., T_m: ...} to the material.", at=at[:-1])
        for at, nu in numbers_in(self.nu, ("nu",)):
            if not -1.0 < nu < 0.5:
                raise problem("Poisson's ratio lies between -1 and 0.5, both excluded",
                              "For a nearly incompressible material write 0.4999.", at=at)
        if self.creep is not None and self.plastic is not None and self.plastic.kinematic is not None:
            raise problem("creep does not go with a kinematic backstress, which would have to creep too",
                          "Give plastic.overstress instead of creep, or leave plastic.kinematic out.", at=("creep",))
        if self.liquid is not None and self.latent is not None:
            melts = (self.liquid.T_s, self.liquid.T_l)
            if melts != self.latent.limits:
                raise problem(f"it melts from {melts[0]:g} to {melts[1]:g} here, but latent heat is taken up from "
                              f"{self.latent.limits[0]:g} to {self.latent.limits[1]:g}",
                              "One material melts once: state the same temperatures.", at=("liquid",))
        return self


def properties_in(spec: Any, at: At) -> Iterator[tuple[At, float | PropertyTable | Polynomial]]:
    """Every property that makes up a material's datum, and its place; none for None."""
    if isinstance(spec, Phases | Axes):
        for name in ("solid", "liquid", "k_1", "k_2"):
            yield from properties_in(getattr(spec, name, None), (*at, name))
    elif spec is not None:
        yield at, spec


# The part of the schema that says what meets what: contact pairs, their laws, friction.

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


class ContactForm(StrEnum):
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
    form: ContactForm = ContactForm.EDGES
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
