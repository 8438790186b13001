"""The problem of a thermal half as it is solved: what model.json states, with nodes, edges and functions in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half import checks
from contact.half.functions import Field, Property, Signal, field_from, property_from, signal_from
from contact.half.interface import Interface
from contact.half.start import given_field, start_temperature
from contact.problem import boundary, material, thermal
from contact.problem.curves import Phases
from contact.problem.errors import demand, made, read
from contact.problem.pairs import PairData
from contact.problem.thermal import ThermalProblem
from thermal_fmu.methods import METHODS, TimeMethod, theta_method
from thermal_fmu.phase_change import PhaseChange

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


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
        """Return the value, same shape as T, in the unit of the property.

        T : any shape [K].  f_s : same shape, solid fraction [1]; None: solid.
        """
        if self.is_one or f_s is None:
            return self.solid(T)
        # fault: the liquid conducts like the solid -> return self.solid(T) |
        #   thermal_fmu/test_thermal_phase::test_a9_two_phases
        return f_s * self.solid(T) + (1.0 - f_s) * self.liquid(T)

    def slope(self, T: Floats, f_s: Floats | None = None) -> Floats:
        """Return the derivative by temperature, same shape as T [unit of the property per K].

        T : any shape [K].  f_s : same shape, solid fraction [1]; None: solid.
        """
        if self.is_one or f_s is None:
            return self.solid.slope(T)
        return f_s * self.solid.slope(T) + (1.0 - f_s) * self.liquid.slope(T)

    def phase_slope(self, T: Floats) -> Floats:
        """Return the derivative by the solid fraction, same shape as T, in the unit of the property.

        T : any shape [K].
        """
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
class ThermalMaterial:
    """rho : reference density [kg/m3].  k : conductivity [W/mK].  c : heat capacity [J/kgK].

    phase : the change of phase, None where the material does not melt.
    """

    rho: float
    k: Conductivity
    c: Phased
    phase: PhaseChange | None = None

    def effusivity(self, T: Floats, f_s: Floats | None = None) -> Floats:
        """Return the effusivity sqrt(k rho c), same shape as T [J/(m2 K s^1/2)]; k is the mean of the axes.

        T : any shape [K].  f_s : same shape, solid fraction [1]; None: solid.
        """
        k = self.k.k_1(T, f_s)
        if self.k.k_2 is not None:
            k = 0.5 * (k + self.k.k_2(T, f_s))
        return np.asarray(np.sqrt(k * self.rho * self.c(T, f_s)))


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

    edges : (n, 2).  ends : gaps [m] between which facing pieces of it are uncovered from 0 to 1, Eq. (7); None: it is
    open as a whole, facing something or not.
    """

    surface: str
    edges: Ints
    ends: tuple[float, float] | None


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
class ThermalPair:
    """A contact pair as it is stated, with its curves.

    closed_factor, open_factor : of the conductances, Eqs. (8-10); 1 where none is stated.
    emissivities : of slave and master, Eq. (11); None where they do not radiate to each other.
    """

    stated: PairData
    closed_factor: Signal
    open_factor: Signal
    emissivities: tuple[Property, Property] | None


@dataclass(frozen=True)
class ThermalBody:
    """material of the body, T0 : at the start, as contact.half.start takes it [K], Q_T : volumetric heat rate
    [W/m3 of current volume].

    Q_T_factor : of the cell's own temperature; None is 1.
    """

    name: str
    material: ThermalMaterial
    T0: Any
    Q_T: Field
    Q_T_factor: Property | None = None


@dataclass(frozen=True)
class Model:
    """A scene as it is solved: what model.json states, and what of it has nodes, edges or curves.

    bodies : in the order of interface.bodies.  parts : of interface.parts, the bodies and then their regions.
    pairs : in the order of interface.pairs, None where no heat is exchanged.  elsewhere : nodes (m,) of bodies that
    another half solves for, ascending; solved : (n,) True at the nodes of all others.
    """

    stated: ThermalProblem
    parts: tuple[ThermalBody, ...]
    prescribed: tuple[Prescribed, ...]
    fluxes: tuple[Flux, ...]
    films: tuple[Film, ...]
    radiators: tuple[Radiator, ...]
    pairs: tuple[ThermalPair | None, ...]
    elsewhere: Ints
    solved: NDArray[np.bool_]

    @property
    def bodies(self) -> tuple[ThermalBody, ...]:
        """The bodies alone."""
        return self.parts[:len(self.stated.bodies)]

    def method_of(self, name: str) -> TimeMethod:
        """Return the time method of that name, `theta` with the theta that is stated, else 1/2."""
        if name != "theta":
            return METHODS[name]
        return theta_method(0.5 if self.stated.theta is None else self.stated.theta)

    @property
    def load_names(self) -> tuple[str, ...]:
        """Names of the factor inputs, each once, in the order of the file."""
        names = [b.name for kind in (self.prescribed, self.fluxes, self.films, self.radiators) for b in kind]
        return tuple(dict.fromkeys(name for name in names if name))

    @property
    def fields(self) -> tuple[Field, ...]:
        """Every field of it."""
        return (*(b.Q_T for b in self.parts), *(b.value for b in self.prescribed), *(b.value for b in self.fluxes),
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
        return bool(self.radiators) or any(p is not None and p.emissivities is not None for p in self.pairs)


def parse_model(interface: Interface, spec: Mapping[str, Any], half: str = "thermal") -> Model:
    """Make the model that a model.json of `half` describes.  Raises ValueError naming every key that is wrong."""
    problem = read(ThermalProblem, spec, half)
    demand(checks.thermal_wrongs(problem, interface))
    if half != "thermal":
        demand(checks.station_wrongs(problem, half))
    return _model(interface, problem)


def parse_foreign(interface: Interface, spec: Mapping[str, Any]) -> Model:
    """Make the model that a model.json of a half of another package describes.  Raises ValueError as parse_model."""
    problem = read(thermal.ForeignThermal, spec, str(spec.get("half")))
    used = {part.material for part in problem.parts.values()}
    problem = problem.model_copy(update={"materials": {n: m for n, m in problem.materials.items() if n in used}})
    demand(checks.thermal_wrongs(problem, interface))
    return _model(interface, problem)


def _model(interface: Interface, problem: ThermalProblem) -> Model:
    materials = {name: made_material(m, name) for name, m in problem.materials.items()}
    conditions = [_condition(interface, b) for b in problem.boundary]
    solved = ~np.isin(interface.node_body, [interface.bodies.index(name) for name in problem.elsewhere or ()])
    model = Model(problem,
                  tuple(_body(name, problem.parts[name], materials) for name in interface.parts),
                  tuple(b for b in conditions if isinstance(b, Prescribed)),
                  tuple(b for b in conditions if isinstance(b, Flux)),
                  tuple(b for b in conditions if isinstance(b, Film)),
                  tuple(b for b in conditions if isinstance(b, Radiator)),
                  tuple(_pair(problem.pairs[p.name]) if p.name in problem.pairs else None for p in interface.pairs),
                  np.flatnonzero(~solved).astype(np.int32), solved)
    if model.radiates:
        _demand_kelvin(model, interface)
    return model


def _demand_kelvin(model: Model, interface: Interface) -> None:
    named = [(f"bodies.{b.name}.T0", float(start_temperature(b.T0, interface, nodes).min()))
             for part, b in enumerate(model.parts) if (nodes := interface.part_nodes(part)).size]
    named += [(f"T of a {kind}", value.least) for kind, values in (
        ("prescribed temperature", [b.value for b in model.prescribed]), ("convection", [f.Te for f in model.films]),
        ("radiation", [r.T_inf for r in model.radiators])) for value in values if value.least is not None]
    for what, T in named:
        if T < 0:
            raise ValueError(f"model.json: {what} is {T:g}: radiation needs temperatures in kelvin, 0 or more")


def _body(name: str, body: thermal.BodyHeat | thermal.RegionHeat,
          materials: Mapping[str, ThermalMaterial]) -> ThermalBody:
    # fault: factor of a source dropped -> factor = None | thermal_fmu/test_thermal_fields
    factor = None if body.Q_T_factor is None else property_from(body.Q_T_factor)
    return ThermalBody(name, materials[body.material], body.T0, field_from(body.Q_T), factor)


def parse_material(name: str, spec: Mapping[str, Any]) -> ThermalMaterial:
    """Make the material that an entry of model.json describes.  Raises ValueError naming every key that is wrong."""
    return made_material(made(material.Material, spec, ("model.json:", "materials", name)), name)


def made_material(spec: material.Material, name: str) -> ThermalMaterial:
    """Make a material.  Raises ValueError where its heat capacity is not positive as it melts."""
    assert spec.rho is not None, "asked for by fit"
    c, latent = _phased(spec.c), spec.latent
    phase = None
    if latent is not None:
        T_s, T_l = latent.limits
        if not c.solid(np.array(T_s)) > 0.0:
            raise ValueError(f"model.json: materials.{name}.c is not positive at T_s = {T_s:g} K")
        phase = PhaseChange(latent.L, T_s, T_l, c.solid, c.liquid)
    return ThermalMaterial(spec.rho, _conductivity(spec.k), c, phase)


def _conductivity(spec: Any) -> Conductivity:
    if isinstance(spec, material.Axes):
        return Conductivity(_phased(spec.k_1), _phased(spec.k_2), spec.angle, spec.turns)
    return Conductivity(_phased(spec))


def _phased(spec: Any) -> Phased:
    if isinstance(spec, Phases):
        return Phased(property_from(spec.solid), property_from(spec.liquid))
    one = property_from(spec)
    return Phased(one, one)


def _condition(interface: Interface, b: thermal.ThermalBoundary) -> Prescribed | Flux | Film | Radiator:
    name = b.name or ""
    if b.temperature is not None:
        nodes = nodes_of(interface, b) if b.body is None else np.flatnonzero(
            interface.node_body == interface.bodies.index(b.body)).astype(np.int32)
        return Prescribed(nodes, given_field(b.temperature, interface), name)
    assert b.on is not None
    edges = interface.surfaces[b.on]
    if b.flux is not None:
        return Flux(edges, field_from(b.flux), name)
    if b.radiation is not None:
        # fault: the emissivity of a surface is that of a black one -> return Radiator(Exposed(b.on, edges,
        #   _ends(b.radiation.gap)), property_from(1.0), | thermal_fmu/test_thermal_radiation
        return Radiator(Exposed(b.on, edges, _ends(b.radiation.gap)), property_from(b.radiation.emissivity),
                        field_from(b.radiation.T), name)
    assert b.convection is not None
    film, where = b.convection, Exposed(b.on, edges, _ends(b.convection.gap))
    factor = None if film.h_factor is None else property_from(film.h_factor)
    return Film(where, field_from(film.h), factor, field_from(film.T), film.exponent, name)


def nodes_of(interface: Interface, b: boundary.Supported) -> Ints:
    """Return the nodes (n,) a condition stands on, numbers of the mesh, ascending, each once."""
    sets = interface.surfaces if b.on is not None else interface.node_sets
    return np.unique(sets[b.where]).astype(np.int32)


def _ends(gap: thermal.FilmGap | boundary.RadiationGap | None) -> tuple[float, float] | None:
    return None if gap is None else gap.ends


def _pair(data: PairData) -> ThermalPair:
    laws, near = data.conduction, data.radiation
    closed, open_ = (1.0, 1.0) if laws is None else (laws.closed_factor, laws.open_factor)
    emissivities = None if near is None else (property_from(near.emissivity_slave),
                                              property_from(near.emissivity_master))
    return ThermalPair(data, signal_from(closed), signal_from(open_), emissivities)
