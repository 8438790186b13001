"""The boundary and the pairs of model.json, checked: what acts on the surfaces, as frozen values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.checks import keys, known, made, nodes_on, number, signal
from contact.half.functions import Field, Property, Signal, field_from, positive_property, property_from
from contact.half.interface import Interface
from contact.laws import Law, parse_law
from thermal_fmu.methods import METHOD_NAMES, METHODS, TimeMethod, theta_method
from thermal_fmu.phase_change import PhaseChange

Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Prescribed:
    """Eq. (2): T = value(x, t) [K] at nodes.  name : of the factor input, or ""."""

    nodes: Ints
    value: Field
    name: str


@dataclass(frozen=True)
class Flux:
    """Eq. (3): value(x, t) [W/m2] into the body through the edges : (n, 2)."""

    edges: Ints
    value: Field
    name: str


@dataclass(frozen=True)
class Exposed:
    """A surface open to its surroundings.

    edges : (n, 2).  near, far : gaps [m] between which facing pieces of it are uncovered from 0 to 1, Eq. (7); None:
    it is open as a whole, facing something or not.
    """

    surface: str
    edges: Ints
    near: float | None
    far: float | None


@dataclass(frozen=True)
class Film:
    """Eqs. (5-7): kappa(g) h(x, t) h_factor(T) |T - Te|^exponent (T - Te) out of the body through a surface.

    where : kappa from d_cut to d_full.  h_factor : None is 1.
    """

    where: Exposed
    h: Field
    h_factor: Property | None
    Te: Field
    exponent: float
    name: str


@dataclass(frozen=True)
class Radiator:
    """Eq. (12): w(g) sigma_SB eps(T) (T^4 - T_inf^4) out of the body through a surface; w from d_near to d_far."""

    where: Exposed
    emissivity: Property
    T_inf: Field
    name: str


@dataclass(frozen=True)
class NearRadiation:
    """Eq. (11): (1 - w(g)) sigma_SB (T_s^4 - T_m^4)/(1/eps_s + 1/eps_m - 1) between the sides of a pair.

    near, far : gaps [m] between which w grows from 0 to 1; None: w = 0.
    """

    emissivity_slave: Property
    emissivity_master: Property
    near: float | None
    far: float | None


@dataclass(frozen=True)
class PairLaws:
    """One contact pair: Eqs. (8-10), laws of touching and of open points (None: none), and their factors.

    friction_share : share of friction heat that the slave takes; None: by effusivities.  radiation : Eq. (11).
    """

    closed: Law | None
    open: Law | None
    closed_factor: Signal
    open_factor: Signal
    friction_share: float | None = None
    radiation: NearRadiation | None = None


Boundary = Prescribed | Flux | Film | Radiator

KINDS = ("temperature", "flux", "convection", "radiation")


def parse_boundary(interface: Interface, spec: Any, where: str) -> Boundary:
    """One entry of `boundary`.  Raises ValueError naming key, value and what would do."""
    kind = known(keys(spec, where, {"kind"}, spec)["kind"], f"{where}.kind", KINDS)
    name = str(spec.get("name") or "")
    if kind == "temperature":
        keys(spec, where, {"kind", "on", "value"}, {"name"})
        return Prescribed(nodes_on(interface, spec["on"], f"{where}.on"), field(spec["value"], f"{where}.value"), name)
    on = _surface(interface, spec, kind, where)
    if kind == "flux":
        keys(spec, where, {"kind", "on", "value"}, {"name"})
        return Flux(interface.surfaces[on], field(spec["value"], f"{where}.value"), name)
    if kind == "convection":
        return _film(interface, spec, where, on)
    keys(spec, where, {"kind", "on", "emissivity", "T"}, {"d_near", "d_far", "name"})
    exposed = Exposed(on, interface.surfaces[on], *_gaps(spec, where, "d_near", "d_far"))
    eps = emissivity(spec["emissivity"], f"{where}.emissivity")
    return Radiator(exposed, eps, field(spec["T"], f"{where}.T"), name)


def _surface(interface: Interface, spec: Mapping[str, Any], kind: str, where: str) -> str:
    on = spec.get("on")
    if on in interface.node_sets and on not in interface.surfaces:
        raise ValueError(f"model.json: {where}.on: {on!r} is a set of nodes, and a {kind} needs an area: one of the "
                         f"surfaces {', '.join(interface.surfaces) or '(none)'}")
    return known(on, f"{where}.on", interface.surfaces)


def _film(interface: Interface, spec: Mapping[str, Any], where: str, on: str) -> Film:
    keys(spec, where, {"kind", "on", "h", "T"}, {"h_factor", "exponent", "d_cut", "d_full", "name"})
    exposed = Exposed(on, interface.surfaces[on], *_gaps(spec, where, "d_cut", "d_full"))
    h = field(spec["h"], f"{where}.h")
    if h.least is not None and h.least < 0:
        raise ValueError(f"model.json: {where}.h must not be negative, not {h.least:g}")
    factor = None
    if spec.get("h_factor") is not None:
        factor = made(_factor, spec["h_factor"], f"{where}.h_factor")
    exponent = number(spec.get("exponent", 0.0), f"{where}.exponent", 0.0, low_itself=True)
    return Film(exposed, h, factor, field(spec["T"], f"{where}.T"), exponent, str(spec.get("name") or ""))


def _factor(spec: Any) -> Property:
    """A factor of h: not negative, and not 0 at all temperatures (a polynomial is checked where it is met)."""
    values = values_of(spec)
    if values is not None and not ((values >= 0.0).all() and values.any()):
        raise ValueError(f"a factor of h must be positive (0 only in parts of a table), not {values.min():g}")
    return property_from(spec)


def values_of(spec: Any) -> NDArray[np.float64] | None:
    """The values a PROPERTY takes, all of them finite; None for a polynomial.  Raises ValueError."""
    polynomial = isinstance(spec, Mapping) and "polynomial" in spec
    values = spec if not isinstance(spec, Mapping) else spec["polynomial" if polynomial else "value"]
    values = np.atleast_1d(np.asarray(values, dtype=float))
    if values.size == 0 or not np.isfinite(values).all():
        raise ValueError(f"finite numbers are needed, not {values.tolist()}")
    return None if polynomial else values


def emissivity(spec: Any, where: str) -> Property:
    """An emissivity in (0, 1]; a polynomial is checked where it is met.  Raises ValueError."""
    def make(spec: Any) -> Property:
        values = values_of(spec)
        if values is not None and not ((values > 0.0) & (values <= 1.0)).all():
            wrong = values[~((values > 0.0) & (values <= 1.0))]
            raise ValueError(f"an emissivity must be greater than 0 and at most 1, not {wrong[0]:g}")
        return property_from(spec)

    return made(make, spec, where)


def field(spec: Any, where: str) -> Field:
    """A Field.  Raises ValueError."""
    return made(field_from, spec, where)


def _gaps(spec: Mapping[str, Any], where: str, low: str, high: str) -> tuple[float | None, float | None]:
    if spec.get(low) is None and spec.get(high) is None:
        return None, None
    near, far = (number(spec.get(key), f"{where}.{key}") for key in (low, high))
    if not 0 <= near < far:
        raise ValueError(f"model.json: {where}: 0 <= {low} < {high} is needed, not {near}, {far}")
    return near, far


def parse_pair(spec: Any, where: str) -> PairLaws:
    """One entry of `pairs`.  Raises ValueError naming key, value and what would do."""
    keys(spec, where, set(), {"closed", "open", "closed_factor", "open_factor", "friction_share", "radiation"})
    closed, open_ = (None if spec.get(k) is None else made(parse_law, spec[k], f"{where}.{k}")
                     for k in ("closed", "open"))
    share = spec.get("friction_share")
    if share is not None and not 0.0 <= number(share, f"{where}.friction_share") <= 1.0:
        raise ValueError(f"model.json: {where}.friction_share must lie from 0 to 1 (null: by effusivities), "
                         f"not {share!r}")
    radiation = None if spec.get("radiation") is None else _near_radiation(spec["radiation"], f"{where}.radiation")
    return PairLaws(closed, open_, signal(spec.get("closed_factor", 1.0), f"{where}.closed_factor"),
                    signal(spec.get("open_factor", 1.0), f"{where}.open_factor"),
                    None if share is None else float(share), radiation)


def _near_radiation(spec: Any, where: str) -> NearRadiation:
    keys(spec, where, {"emissivity_slave", "emissivity_master"}, {"d_near", "d_far"})
    slave, master = (emissivity(spec[key], f"{where}.{key}") for key in ("emissivity_slave", "emissivity_master"))
    return NearRadiation(slave, master, *_gaps(spec, where, "d_near", "d_far"))


# How a half steps in time, as its model.json says it.

MOST_INCREMENTS = 100_000  # a count beyond this is a slip of the pen


@dataclass(frozen=True)
class Adaptive:
    """What the inner steps of a substep must keep to.

    tolerance : of the estimated local error of T, largest over the nodes [K].  max_dT : largest change of T at a node
    [K].  least : the shortest inner step [s]; None: LEAST_SHARE of the substep.
    """

    tolerance: float = inf
    max_dT: float = inf
    least: float | None = None


@dataclass(frozen=True)
class Stepping:
    """method : a name of METHOD_NAMES.  theta : of the method `theta`.  increments : of the method `steady`.

    adaptive : None where a substep is one step.  tolerance : of Newton's method, as a share of the heat that flows.
    """

    method: str
    theta: float
    increments: int
    adaptive: Adaptive | None
    tolerance: float

    def method_of(self, name: str) -> TimeMethod:
        """The method of that name, `theta` with this model's theta."""
        return theta_method(self.theta) if name == "theta" else METHODS[name]


def parse_stepping(spec: Mapping[str, Any]) -> Stepping:
    """The keys method, theta, increments, adaptive and tolerance of a model.json.  Raises ValueError naming the key."""
    method = known(spec.get("method", "midpoint"), "method", METHOD_NAMES)
    theta = number(spec.get("theta", 0.5), "theta")
    if not 0.5 <= theta <= 1.0:
        raise ValueError(f"model.json: theta must be 0.5 to 1, not {theta!r}")
    adaptive = None if spec.get("adaptive") is None else _adaptive(spec["adaptive"])
    if adaptive is not None and method == "steady":
        raise ValueError("model.json: adaptive: the method 'steady' has no steps in time; leave one of them out")
    return Stepping(method, theta, _count(spec.get("increments", 1)), adaptive,
                    number(spec.get("tolerance", 1e-10), "tolerance", 0.0))


def _adaptive(spec: Any) -> Adaptive:
    keys(spec, "adaptive", set(), ("tolerance", "max_dT", "least"))
    if spec.get("tolerance") is None and spec.get("max_dT") is None:
        raise ValueError("model.json: adaptive: needs tolerance or max_dT (or both), in K")
    given = {key: number(value, f"adaptive.{key}", 0.0) for key, value in spec.items() if value is not None}
    return Adaptive(**given)


def _count(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= MOST_INCREMENTS:
        raise ValueError(f"model.json: increments must be a whole number from 1 to {MOST_INCREMENTS}, not {value!r}")
    return value


# Thermal material: what model.json says of it, checked.

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Phased:
    """f_s solid(T) + (1 - f_s) liquid(T); without a change on melting both are the same object."""

    solid: Property
    liquid: Property

    @property
    def is_one(self) -> bool:
        """True where both phases share one property."""
        return self.solid is self.liquid

    @property
    def is_constant(self) -> bool:
        """True where neither temperature nor phase changes the value."""
        return self.is_one and self.solid.is_constant

    def __call__(self, T: Floats, f_s: Floats | None = None) -> Floats:
        """Value at T : any shape [K] and f_s : same shape (None: solid)."""
        if self.is_one or f_s is None:
            return self.solid(T)
        # fault: the liquid conducts like the solid -> return self.solid(T) |
        #   thermal_fmu/test_thermal_phase::test_a9_two_phases
        return f_s * self.solid(T) + (1.0 - f_s) * self.liquid(T)

    def slope(self, T: Floats, f_s: Floats | None = None) -> Floats:
        """Derivative by T."""
        if self.is_one or f_s is None:
            return self.solid.slope(T)
        return f_s * self.solid.slope(T) + (1.0 - f_s) * self.liquid.slope(T)

    def phase_slope(self, T: Floats) -> Floats:
        """Derivative by f_s."""
        return np.zeros(np.shape(T)) if self.is_one else self.solid(T) - self.liquid(T)


@dataclass(frozen=True)
class Conductivity:
    """k [W/mK]: k_1 along axis 1, k_2 across it (None: isotropic).

    angle : of axis 1 to x in the reference [rad].  turns : whether the axes follow the rotation of the material.
    """

    k_1: Phased
    k_2: Phased | None = None
    angle: float = 0.0
    turns: bool = False

    @property
    def is_plain(self) -> bool:
        """True where one function of T says all."""
        return self.k_2 is None and self.k_1.is_one

    @property
    def is_constant(self) -> bool:
        """True where neither temperature nor phase changes it."""
        return self.k_1.is_constant and (self.k_2 is None or self.k_2.is_constant)


@dataclass(frozen=True)
class Material:
    """rho : reference density [kg/m3].  k : conductivity [W/mK].  c : heat capacity [J/kgK].

    phase : the change of phase, None where the material does not melt.
    """

    rho: float
    k: Conductivity
    c: Phased
    phase: PhaseChange | None = None

    def effusivity(self, T: Floats, f_s: Floats | None = None) -> Floats:
        """sqrt(k rho c) [J/(m2 K s^1/2)] at T : any shape [K]; k is the mean of the axes."""
        k = self.k.k_1(T, f_s)
        if self.k.k_2 is not None:
            k = 0.5 * (k + self.k.k_2(T, f_s))
        return np.asarray(np.sqrt(k * self.rho * self.c(T, f_s)))


def parse_material(spec: Any, where: str) -> Material:
    """The material of model.json at `where`.  Raises ValueError naming the key, the value and what would do."""
    keys(spec, where, {"rho", "k", "c"}, {"latent"})
    melts = "latent" in spec
    k = _conductivity(spec["k"], f"{where}.k", melts)
    c = _phased(spec["c"], f"{where}.c", "heat capacity", melts)
    rho = number(spec["rho"], f"{where}.rho", 0.0)
    return Material(rho, k, c, _latent(spec["latent"], f"{where}.latent", c) if melts else None)


def _conductivity(spec: Any, where: str, melts: bool) -> Conductivity:
    if not isinstance(spec, Mapping) or not {"k_1", "k_2", "angle", "turns"} & set(spec):
        return Conductivity(_phased(spec, where, "conductivity", melts))
    keys(spec, where, {"k_1", "k_2", "angle", "turns"})
    if not isinstance(spec["turns"], bool):
        raise ValueError(f"model.json: {where}.turns must be true or false, not {spec['turns']!r}")
    return Conductivity(_phased(spec["k_1"], f"{where}.k_1", "conductivity", melts),
                        _phased(spec["k_2"], f"{where}.k_2", "conductivity", melts),
                        number(spec["angle"], f"{where}.angle"), spec["turns"])


def _phased(spec: Any, where: str, what: str, melts: bool) -> Phased:
    if not isinstance(spec, Mapping) or not {"solid", "liquid"} & set(spec):
        one = _property(spec, where, what)
        return Phased(one, one)
    keys(spec, where, {"solid", "liquid"})
    if not melts:
        raise ValueError(f"model.json: {where} has a solid and a liquid, but the material has no 'latent' "
                         "(L, T_s, T_l) that says when it melts")
    return Phased(_property(spec["solid"], f"{where}.solid", what), _property(spec["liquid"], f"{where}.liquid", what))


def _property(spec: Any, where: str, what: str) -> Property:
    return made(lambda value: positive_property(value, what), spec, where)


def _latent(spec: Any, where: str, c: Phased) -> PhaseChange:
    keys(spec, where, {"L", "T_s", "T_l"})
    L = number(spec["L"], f"{where}.L", 0.0)
    T_s, T_l = (number(spec[key], f"{where}.{key}") for key in ("T_s", "T_l"))
    if T_s > T_l:
        raise ValueError(f"model.json: {where}: T_s <= T_l is needed (equal: one melting point), not {T_s}, {T_l}")
    if not c.solid(np.array(T_s)) > 0.0:
        raise ValueError(f"model.json: {where[:-len('.latent')]}.c is not positive at T_s = {T_s:g} K")
    return PhaseChange(L, T_s, T_l, c.solid, c.liquid)


# model.json of the thermal half, checked: the model as frozen values.

SIGMA_SB = 5.670374419e-8  # W/m2K4


@dataclass(frozen=True)
class Body:
    """material of the body, T0 : initial temperature [K], Q_T : volumetric heat rate [W/m3 of current volume].

    Q_T_factor : of the cell's own temperature; None is 1.
    """

    name: str
    material: Material
    T0: float
    Q_T: Field
    Q_T_factor: Property | None = None


@dataclass(frozen=True)
class Model:
    """All of model.json.  pairs : in the order of interface.pairs, None where no heat is exchanged.

    sigma_SB : Stefan-Boltzmann constant [W/m2K4].
    """

    stepping: Stepping
    sigma_SB: float
    bodies: tuple[Body, ...]
    prescribed: tuple[Prescribed, ...]
    fluxes: tuple[Flux, ...]
    films: tuple[Film, ...]
    radiators: tuple[Radiator, ...]
    pairs: tuple[PairLaws | None, ...]

    @property
    def load_names(self) -> tuple[str, ...]:
        """Names of the factor inputs, each once, in the order of the file."""
        names = [b.name for kind in (self.prescribed, self.fluxes, self.films, self.radiators) for b in kind]
        return tuple(dict.fromkeys(name for name in names if name))

    @property
    def fields(self) -> tuple[Field, ...]:
        """Every field of it."""
        return (*(b.Q_T for b in self.bodies), *(b.value for b in self.prescribed), *(b.value for b in self.fluxes),
                *(s for f in self.films for s in (f.h, f.Te)), *(r.T_inf for r in self.radiators))

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Every signal the half follows by itself."""
        pairs = [p for p in self.pairs if p is not None]
        return (*(s for f in self.fields for s in f.signals),
                *(s for p in pairs for s in (p.closed_factor, p.open_factor)))

    @property
    def radiates(self) -> bool:
        """Whether temperatures must be kelvin."""
        return bool(self.radiators) or any(p is not None and p.radiation is not None for p in self.pairs)


def parse_model(interface: Interface, spec: Mapping[str, Any]) -> Model:
    """The model a model.json describes.  Raises ValueError naming the key, the value and what would do."""
    keys(spec, "", {"half", "format", "materials", "bodies"},
         {"method", "theta", "increments", "adaptive", "tolerance", "sigma_SB", "boundary", "pairs"})
    if spec["half"] != "thermal" or spec["format"] != 1:
        raise ValueError(f"model.json: half {spec['half']!r}, format {spec['format']!r} is not thermal, 1")
    materials = {name: parse_material(m, f"materials.{name}")
                 for name, m in keys(spec["materials"], "materials", set(), spec["materials"]).items()}
    bodies = keys(spec["bodies"], "bodies", set(interface.bodies))
    boundary = [parse_boundary(interface, b, f"boundary[{i}]") for i, b in enumerate(spec.get("boundary", []))]
    pairs = keys(spec.get("pairs", {}), "pairs", set(), [p.name for p in interface.pairs])
    model = Model(parse_stepping(spec), number(spec.get("sigma_SB", SIGMA_SB), "sigma_SB", 0.0),
                  tuple(_body(name, bodies[name], f"bodies.{name}", materials) for name in interface.bodies),
                  tuple(b for b in boundary if isinstance(b, Prescribed)),
                  tuple(b for b in boundary if isinstance(b, Flux)),
                  tuple(b for b in boundary if isinstance(b, Film)),
                  tuple(b for b in boundary if isinstance(b, Radiator)),
                  tuple(parse_pair(pairs[p.name], f"pairs.{p.name}") if p.name in pairs else None
                        for p in interface.pairs))
    if model.radiates:
        _demand_kelvin(model)
    return model


def _demand_kelvin(model: Model) -> None:
    named = [(f"bodies.{b.name}.T0", b.T0) for b in model.bodies]
    named += [(f"T of a {kind}", value.least) for kind, values in (
        ("prescribed temperature", [b.value for b in model.prescribed]), ("convection", [f.Te for f in model.films]),
        ("radiation", [r.T_inf for r in model.radiators])) for value in values if value.least is not None]
    for what, T in named:
        if T < 0:
            raise ValueError(f"model.json: {what} is {T:g}: radiation needs temperatures in kelvin, 0 or more")


def _body(name: str, spec: Any, where: str, materials: Mapping[str, Material]) -> Body:
    keys(spec, where, {"material", "T0"}, {"Q_T", "Q_T_factor"})
    material = materials[known(spec["material"], f"{where}.material", materials)]
    factor = None
    if spec.get("Q_T_factor") is not None:
        made(values_of, spec["Q_T_factor"], f"{where}.Q_T_factor")
        factor = made(property_from, spec["Q_T_factor"], f"{where}.Q_T_factor")
    return Body(name, material, number(spec["T0"], f"{where}.T0"), field(spec.get("Q_T", 0.0), f"{where}.Q_T"), factor)


# model.json of the halves `lumped` and `thermal_rod`: that of the thermal half, less what they have no use for.

def parse_station_model(interface: Interface, spec: Mapping[str, Any], half: str) -> Model:
    """The model a model.json of `half` describes.  Raises ValueError naming key, value and what would do."""
    if spec.get("half") != half:
        raise ValueError(f"model.json: half {spec.get('half')!r} is not {half}")
    model = parse_model(interface, {**spec, "half": "thermal"})
    if model.stepping.adaptive is not None:
        raise ValueError(f"model.json: adaptive: the half {half!r} takes its substeps as they are; leave it out")
    if model.stepping.method == "steady":
        raise ValueError(f"model.json: method: the half {half!r} has no method 'steady'; run it to its end instead")
    for name, field in _fields(model):
        if not field.is_uniform:
            raise ValueError(f"model.json: {name}: the half {half!r} takes data that depend on time alone")
    for body in model.bodies:
        if body.Q_T_factor is not None:
            raise ValueError(f"model.json: bodies.{body.name}.Q_T_factor: the half {half!r} has none")
        if body.material.k.k_2 is not None:
            raise ValueError(f"model.json: bodies.{body.name}: k has two axes, of which the half {half!r} knows one")
    return model


def _fields(model: Model) -> list[tuple[str, Any]]:
    return [*((f"bodies.{b.name}.Q_T", b.Q_T) for b in model.bodies),
            *(("a prescribed temperature", p.value) for p in model.prescribed),
            *(("a flux", q.value) for q in model.fluxes),
            *(("a convection", f) for film in model.films for f in (film.h, film.Te)),
            *(("a radiation", r.T_inf) for r in model.radiators)]
