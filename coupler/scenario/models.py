"""model.json of both halves of a scenario, by role."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

import numpy as np

from contact.half.functions import property_from
from coupler.scenario.document import Key, did_you_mean
from coupler.scenario.physics import (
    FORCES,
    MOTIONS,
    SIGMA_SB,
    TRACTIONS,
    WEIGHTS,
    BodyOptions,
    Conduction,
    ContactPair,
    Convection,
    Elastic,
    ElasticBoundary,
    Hardening,
    Held,
    Liquid,
    Material,
    Method,
    NearRadiation,
    Phases,
    Plastic,
    Radiation,
    RadiationGap,
    Rigid,
    Settling,
    Solution,
    State,
    Thermal,
    ThermalBoundary,
)
from coupler.scenario.scene import FORMAT, Context, Model, properties_of
from coupler.scenario.values import OWN, Part, Polynomial, PropertyTable, check_kind, fmu_path

# Thermal boundary conditions that contradict each other, leave a steady temperature open, or fail at the start.

def temperatures_once(c: Context, place: Key) -> None:
    """No place has two prescribed temperatures, of which one would be ignored.  Raises ScenarioError."""
    seen: dict[str, int] = {}
    for i, b in enumerate(c.file.thermal.boundary):
        if b.temperature is None:
            continue
        where = c.where(b, (*place, i))
        # fault: two temperatures on one place, the first ignored -> if seen.setdefault(where, i) > i: |
        #   coupler/test_scenario_thermal
        if seen.setdefault(where, i) != i:
            raise c.document.error(
                (*place, i, "at" if b.on is None else "on"),
                f"the temperature of {where} is already prescribed by entry {seen[where]}",
                "Keep one of the two; a temperature that changes in time is one SIGNAL.")


def steady_is_held(c: Context) -> None:
    """Under `steady` every body is tied to a temperature, by its surfaces or through pairs.  Raises ScenarioError.

    A source that depends on temperature may fix it too; whether it does, only the solution can say.
    """
    if c.file.thermal.method is not Method.STEADY:
        return
    # fault: a flux taken for something that holds a steady temperature -> held = {b.where.split(".")[0] for b in
    #   c.file.thermal.boundary} | coupler/test_scenario_thermal
    held = {b.where.split(".")[0] for b in c.file.thermal.boundary if b.flux is None}
    held |= {name for name, body in c.file.bodies.items() if body.Q_T_factor is not None}
    pairs = [{side.split(".")[0] for side in (p.slave, p.master)} for p in c.file.contact.values()
             if p.conduction is not None or p.radiation is not None]
    while reached := [sides for sides in pairs if sides & held and not sides <= held]:
        held = held.union(*reached)
    for name in c.file.bodies:
        if name not in held:
            raise c.document.error(
                ("bodies", name), f"method steady, but nothing fixes the temperature of body {name!r}",
                "Give a surface of it a temperature, convection or radiation, or choose a method that steps in time.")


def surfaces_work_at_start(c: Context, place: Key) -> None:
    """A polynomial emissivity or h_factor in its range at the T0 of its body: no smaller step could mend it later.

    Numbers and tables are checked where they are read.  Raises ScenarioError.
    """
    for spec, key, surface, most in _polynomials(c, place):
        body = surface.split(".")[0]
        # fault: an emissivity is held against the first body's T0 -> T0 =
        #   c.convert.kelvin(next(iter(c.file.bodies.values())).T0, ("bodies", body, "T0")) |
        #   coupler/test_scenario_thermal
        T0 = c.convert.kelvin(c.file.bodies[body].T0, ("bodies", body, "T0"))
        value = float(property_from(c.convert.property(spec, key))(np.array([T0]))[0])
        if not (0.0 < value <= most or (value == 0.0 and most == inf)):
            needed = "must not be negative" if most == inf else f"must be greater than zero and at most {most:g}"
            raise c.document.error(key, f"is {value:g} at the T0 of body {body!r}, but {needed}",
                                   "Mind T_ref: a polynomial counts temperatures from there.")


def _polynomials(c: Context, place: Key) -> Iterator[tuple[Polynomial, Key, str, float]]:
    """Each polynomial of a surface: where it stands, the surface, the most it may be (inf: a factor)."""
    found: list[tuple[object, Key, str, float]] = []
    for i, b in enumerate(c.file.thermal.boundary):
        if b.radiation is not None:
            found.append((b.radiation.emissivity, (*place, i, "radiation", "emissivity"), b.where, 1.0))
        if b.convection is not None:
            found.append((b.convection.h_factor, (*place, i, "convection", "h_factor"), b.where, inf))
    for name, pair in c.file.contact.items():
        if pair.radiation is not None:
            key: Key = ("contact", name, "radiation")
            found += [(pair.radiation.emissivity_slave, (*key, "emissivity_slave"), pair.slave, 1.0),
                      (pair.radiation.emissivity_master, (*key, "emissivity_master"), pair.master, 1.0)]
    return ((spec, key, surface, most) for spec, key, surface, most in found if isinstance(spec, Polynomial))


# model.json of the thermal half, SI and kelvin (form: docs/design.md).
#
# What the file leaves out is left out here too: the half then does no work for it.

def thermal_model(c: Context) -> Model:
    """The model of the half `thermal`.  Raises ScenarioError."""
    thermal = c.file.thermal
    c.no_options("thermal", thermal.options)
    place: Key = ("thermal", "boundary")
    c.names_once(thermal.boundary, place)
    temperatures_once(c, place)
    steady_is_held(c)
    surfaces_work_at_start(c, place)
    return {
        "half": "thermal",
        "format": FORMAT,
        **_stepping(thermal),
        "materials": c.materials("thermal", ("rho", "k", "c"), also=("latent",)),
        "bodies": {n: _thermal_body(c, n) for n in c.file.bodies},
        "boundary": [_boundary(c, b, (*place, i)) for i, b in enumerate(thermal.boundary)],
        "pairs": {n: _pair(c, n) for n in c.file.contact},
    }


def _stepping(thermal: Thermal) -> Model:
    model: Model = {"method": thermal.method.value, "tolerance": thermal.tolerance}
    for key in ("theta", "increments"):
        if getattr(thermal, key) is not None:
            model[key] = getattr(thermal, key)
    if thermal.adaptive is not None:
        # fault: inner tolerance converted like a temperature -> model["adaptive"] = {k: v + 273.15 for k, v in
        #   thermal.adaptive.model_dump(exclude_none=True).items()} | coupler/test_scenario_thermal
        model["adaptive"] = thermal.adaptive.model_dump(exclude_none=True)
    return model | ({"sigma_SB": thermal.sigma_SB} if thermal.sigma_SB != SIGMA_SB else {})


def _thermal_body(c: Context, name: str) -> Model:
    body, key = c.file.bodies[name], ("bodies", name)
    return {"material": body.material, "T0": c.convert.kelvin(body.T0, (*key, "T0")),
            # fault: factor of a source dropped on its way to the half -> "Q_T": c.convert.field(body.Q_T, (*key,
            #   "Q_T")), **_factor(c, "Q_T_factor", None, key)} | thermal_fmu/test_thermal_fmu
            "Q_T": c.convert.field(body.Q_T, (*key, "Q_T")), **_factor(c, "Q_T_factor", body.Q_T_factor, key)}


def _factor(c: Context, name: str, spec: float | PropertyTable | Polynomial | None, key: Key) -> Model:
    return {} if spec is None else {name: c.convert.property(spec, (*key, name))}


def _boundary(c: Context, boundary: ThermalBoundary, key: Key) -> Model:
    common = c.common(boundary, key)
    on = common["on"]
    if boundary.temperature is not None:
        value = c.temperatures(boundary.temperature, (*key, "temperature"), on)
        return {"kind": "temperature", "value": value, **common}
    if boundary.flux is not None:
        return {"kind": "flux", "value": c.convert.field(boundary.flux, (*key, "flux")), **common}
    if boundary.radiation is not None:
        return {"kind": "radiation", **_radiation(c, boundary.radiation, (*key, "radiation"), on), **common}
    assert boundary.convection is not None
    return {"kind": "convection", **_convection(c, boundary.convection, (*key, "convection"), on), **common}


def _convection(c: Context, film: Convection, key: Key, on: str) -> Model:
    gap = film.gap
    return {"h": c.not_negative(film.h, (*key, "h"), on), **_factor(c, "h_factor", film.h_factor, key),
            "T": c.temperatures(film.T, (*key, "T"), on), "exponent": film.exponent,
            "d_cut": None if gap is None else gap.d_cut, "d_full": None if gap is None else gap.d_full}


def _radiation(c: Context, radiation: Radiation, key: Key, on: str) -> Model:
    # fault: emissivity halved on its way to the half -> return {"emissivity": c.convert.property(0.5 *
    #   radiation.emissivity, (*key, "emissivity")), | thermal_fmu/test_thermal_fmu
    return {"emissivity": c.convert.property(radiation.emissivity, (*key, "emissivity")),
            "T": c.temperatures(radiation.T, (*key, "T"), on), **_blend(radiation.gap)}


def _blend(gap: RadiationGap | None) -> Model:
    return {"d_near": None if gap is None else gap.d_near, "d_far": None if gap is None else gap.d_far}


def _pair(c: Context, name: str) -> Model:
    pair, key = c.file.contact[name], ("contact", name)
    model = _conduction(c, pair.conduction, (*key, "conduction"))
    if pair.radiation is not None:
        model["radiation"] = _near_radiation(c, pair.radiation, (*key, "radiation"))
    if pair.friction is not None and pair.friction.share is not None:
        model["friction_share"] = pair.friction.share
    return model


def _near_radiation(c: Context, radiation: NearRadiation, key: Key) -> Model:
    sides = ("emissivity_slave", "emissivity_master")
    return {**{side: c.convert.property(getattr(radiation, side), (*key, side)) for side in sides},
            **_blend(radiation.gap)}


def _conduction(c: Context, law: Conduction | None, key: Key) -> Model:
    if law is None:
        return {"closed": None, "open": None, "closed_factor": 1.0, "open_factor": 1.0}
    return {"closed": _law(c, law.closed, (*key, "closed")), "open": _law(c, law.open, (*key, "open")),
            "closed_factor": c.convert.signal(law.closed_factor, (*key, "closed_factor"), least=0.0),
            "open_factor": c.convert.signal(law.open_factor, (*key, "open_factor"), least=0.0)}


def _law(c: Context, law: Model | None, key: Key) -> Model | None:
    """A law with the temperatures of its tables in K, those within sums too."""
    if law is None:
        return None
    if law["law"] == "sum":
        return {**law, "of": [_law(c, part, (*key, "of", i)) for i, part in enumerate(law["of"])]}
    # fault: tables of conductance left in degC -> if False: | coupler/test_scenario_laws
    if law.get("variable") == "T":
        return {**law, "x": [c.convert.kelvin(T, (*key, "x", i)) for i, T in enumerate(law["x"])]}
    return law


# Materials of the half `elastic` in model.json: SI and kelvin.

ROOM = 293.15  # K


def mechanical_materials(c: Context, elastic: Elastic) -> Model:
    """What the half needs of every material in use.  Raises ScenarioError where something is missing."""
    inert = elastic.dynamics is not None or elastic.method is Solution.EXPLICIT
    weighed = ("rho",) if inert or elastic.gravity is not None or elastic.adiabatic else ()
    warmed = ("c",) if elastic.adiabatic else ()
    used = dict.fromkeys(b.material for b in c.file.bodies.values())
    melt = any(c.file.materials[name].latent is not None for name in used)
    for name in used:
        if melt and c.file.materials[name].liquid is not None and c.file.materials[name].latent is None:
            raise c.document.error(("materials", name, "liquid"), "the thermal half says what has melted, and it needs "
                                   "latent heat for that", f"Add latent: {{L: ..., T_s: ..., T_l: ...}} to {name}.")
        if elastic.adiabatic and isinstance(c.file.materials[name].c, Phases):
            raise c.document.error(("materials", name, "c"), "frozen entropy needs one heat capacity for all phases",
                                   "Give c as one PROPERTY, or leave mechanical.elastic.adiabatic out.")
    materials = c.materials("elastic", ("E", "nu", "alpha", *weighed, *warmed), also=("T_ref",))
    out: Model = {}
    for name, material in materials.items():
        if material["alpha"] != 0 and "T_ref" not in material:
            raise c.document.error(("materials", name), f"material {name!r} expands, but has no T_ref",
                                   "State the temperature at which it is free of stress.")
        out[name] = {"T_ref": ROOM, **material, **_flow(c, name)}
    return out


def _flow(c: Context, name: str) -> Model:
    material, key = c.file.materials[name], ("materials", name)
    model: Model = {}
    if material.plastic is not None:
        model["plastic"] = _plastic(c, material.plastic, (*key, "plastic"))
    if material.creep is not None:
        model["creep"] = _given(c, material.creep, (*key, "creep"), ("A", "K"), ("n", "m", "Q", "heat"))
    if material.liquid is not None:
        model["liquid"] = _liquid(c, material.liquid, (*key, "liquid"))
    return model


def _plastic(c: Context, plastic: Plastic, key: Key) -> Model:
    model = _given(c, plastic, key, ("s_y", "factor"), ("chi", "softening"))
    if "s_y" in model:
        model["yield"] = model.pop("s_y")
    if plastic.hardening is not None:
        model["hardening"] = _hardening(c, plastic.hardening, (*key, "hardening"))
    if plastic.kinematic is not None:
        model["kinematic"] = _given(c, plastic.kinematic, (*key, "kinematic"), ("C", "gamma"), ())
    if plastic.overstress is not None:
        model["overstress"] = _given(c, plastic.overstress, (*key, "overstress"), ("K",), ("m",))
    return model


def _hardening(c: Context, hardening: Hardening, key: Key) -> Model:
    model = _given(c, hardening, key, ("H", "Q"), ("b",))
    model["law"] = hardening.law.value
    if hardening.strain is not None and hardening.stress is not None:
        model["strain"] = list(hardening.strain)
        model["stress"] = [list(row) if isinstance(row, tuple) else row for row in hardening.stress]
    if hardening.T is not None:
        model["T"] = [c.convert.kelvin(T, (*key, "T", i)) for i, T in enumerate(hardening.T)]
    for choice in ("form", "beyond"):
        if choice in hardening.model_fields_set:
            model[choice] = getattr(hardening, choice).value
    return model


def _liquid(c: Context, liquid: Liquid, key: Key) -> Model:
    model = _given(c, liquid, key, ("eta", "bulk"), ("shrinkage", "heat"))
    # fault: melting range of a scenario not converted to kelvin -> return model | {T: getattr(liquid, T) for T in
    #   ("T_s", "T_l")} | coupler/test_scenario_mechanical
    return model | {T: c.convert.kelvin(getattr(liquid, T), (*key, T)) for T in ("T_s", "T_l")}


def _given(c: Context, part: Part, key: Key, properties: tuple[str, ...],
           plain: tuple[str, ...]) -> Model:
    """The keys that are given: properties of temperature with theirs in K, the rest as they are."""
    model: Model = {}
    for name in properties:
        if (value := getattr(part, name)) is not None:
            model[name] = c.convert.property(value, (*key, name))
    return model | {name: getattr(part, name) for name in plain if name in part.model_fields_set}


# model.json of the mechanical halves `elastic` and `rigid` (form: docs/design.md).

def elastic_model(c: Context) -> Model:
    """The model of the half `elastic`.  Raises ScenarioError."""
    c.no_options("mechanical", c.file.mechanical.options)
    elastic = c.file.mechanical.elastic
    if elastic is None:
        raise c.document.error(
            ("mechanical",),
            "the half `elastic` is chosen, but mechanical.elastic is missing",
            "Say how the bodies are held: mechanical: {elastic: {boundary: [...]}}.",
        )
    for name in c.file.contact:
        if not next(p for p in c.interface.pairs if p.name == name).eps_N:
            raise c.document.error(("contact", name), "no penalty can be found, because a body has no E",
                                   "State E of both bodies' materials, or the penalty [Pa/m].")
    _one_way_to_settle(c)
    place: Key = ("mechanical", "elastic", "boundary")
    c.names_once(elastic.boundary, place)
    c.known_only(elastic.bodies, c.file.bodies, ("mechanical", "elastic", "bodies"), "body")
    boundary = [entry for i, b in enumerate(elastic.boundary) for entry in _condition(c, elastic, b, (*place, i))]
    return {"half": "elastic", "format": FORMAT, "tolerance": elastic.tolerance,
            **_options(c, elastic),
            "materials": mechanical_materials(c, elastic),
            "bodies": {n: {"material": b.material, **_mechanical_body(elastic.bodies.get(n)), **_poured(c, n)}
                       for n, b in c.file.bodies.items()},
            "boundary": boundary + _gravity(c, elastic),
            "pairs": {n: augmented(p) for n, p in c.file.contact.items()}}


def _options(c: Context, elastic: Elastic) -> Model:
    """What is not as the half would have it anyway."""
    if elastic.state is State.PLANE_STRESS and c.interface.axisymmetric:
        raise c.document.error(("mechanical", "elastic", "state"), "plane stress is of plane geometry",
                               "This scene is axisymmetric.")
    model: Model = {}
    for key in ("method", "element", "state"):
        if key in elastic.model_fields_set:
            model[key] = getattr(elastic, key).value
    if "cuts" in elastic.model_fields_set:
        model["cuts"] = int(elastic.cuts)
    if elastic.dynamics is not None:
        model["dynamics"] = elastic.dynamics.model_dump(mode="json", exclude_none=True)
    if elastic.skip is not None:
        model["skip"] = {"u": elastic.skip.u, "most": elastic.skip.most}
    return model | {key: True for key in ("thermoelastic_heat", "adiabatic") if getattr(elastic, key)}


def _mechanical_body(options: BodyOptions | None) -> Model:
    if options is None:
        return {}
    model: Model = {"element": options.element.value} if options.element is not None else {}
    if options.rigid:
        model["rigid"] = True
    if options.reference is not None:
        model["reference"] = list(options.reference)
    if any(options.v0) or options.omega0:
        model["v0"] = [*options.v0, options.omega0]
    return model


def _poured(c: Context, name: str) -> Model:
    """A body that is not all solid at the start was poured: its mesh is the shape it has then."""
    body = c.file.bodies[name]
    liquid = c.file.materials[body.material].liquid
    if liquid is None:
        return {}
    poured_at = c.convert.kelvin(body.T0, ("bodies", name, "T0"))
    solidus = c.convert.kelvin(liquid.T_s, ("materials", body.material, "liquid", "T_s"))
    return {"drawn_at": poured_at} if poured_at > solidus else {}


def _gravity(c: Context, elastic: Elastic) -> list[Model]:
    """One entry a body and component; a name stands for all of them."""
    if elastic.gravity is None:
        return []
    gravity, key = elastic.gravity, ("mechanical", "elastic", "gravity")
    if gravity.name is not None and any(b.name == gravity.name for b in elastic.boundary):
        raise c.document.error((*key, "name"), f"the name {gravity.name!r} is already that of a boundary condition",
                               "Each named condition is one input load.<name>.")
    name = {"name": gravity.name} if gravity.name else {}
    return [{"kind": "gravity", "on": body, "component": i, "value": c.convert.signal(spec, (*key, axis)), **name}
            for i, (axis, spec) in enumerate((("x", gravity.x), ("y", gravity.y))) if spec != 0.0
            for body in c.file.bodies]


def _condition(c: Context, elastic: Elastic, boundary: ElasticBoundary, key: Key) -> list[Model]:
    common = _place(c, elastic, boundary, key)
    if boundary.pressure is not None:
        return [{"kind": "pressure", "value": c.convert.signal(boundary.pressure, (*key, "pressure")), **common}]
    kinds = (("displacement", MOTIONS), ("traction", TRACTIONS), ("force", FORCES), ("body_force", WEIGHTS))
    return [{"kind": kind, "component": i, "value": c.convert.signal(spec, (*key, name)), **common}
            for kind, names in kinds for i, name in enumerate(names)
            if (spec := getattr(boundary, name)) is not None]


def _place(c: Context, elastic: Elastic, boundary: ElasticBoundary, key: Key) -> Model:
    """Where a condition stands, and its name.  Raises ScenarioError where the body is not of the right kind."""
    body = boundary.body
    options = elastic.bodies
    if body is not None:
        c.known_only([body], c.file.bodies, key[:-1], "body")
        weight = boundary.b_x is not None or boundary.b_y is not None
        if not weight and not (body in options and options[body].rigid):
            raise c.document.error((*key, "body"), f"body {body!r} is not rigid",
                                   "Drive its surfaces (on: body.surface), or say mechanical.elastic.bodies."
                                   f"{body}.rigid: true.")
        return {"on": body, **({"name": boundary.name} if boundary.name else {})}
    common = c.common(boundary, key)
    owner = boundary.where.split(".")[0]
    if owner in options and options[owner].rigid and any(getattr(boundary, k) is not None for k in MOTIONS):
        raise c.document.error(key, f"body {owner!r} is rigid: it moves as a whole",
                               f"Write `body: {owner}` with u_x, u_y, angle.")
    return common


def augmented(pair: ContactPair) -> Model:
    """What a half that solves for contact is told beyond interface.h5."""
    if pair.augmented is None:
        return {}
    # fault: rounds asked for, none written -> if False: | coupler/test_scenario_contact
    if pair.augmented.method is Settling.UZAWA:
        return {"augmented": pair.augmented.tolerance}
    # fault: augmentation lost on the way -> return {} | coupler/test_scenario_contact
    return {"augmented": {"share": pair.augmented.tolerance, "method": pair.augmented.method.value}}


def _one_way_to_settle(c: Context) -> None:
    """Raises ScenarioError where augmented pairs, whose pressures hang together, are to settle in different ways."""
    ways = {name: pair.augmented.method for name, pair in c.file.contact.items() if pair.augmented is not None}
    for name, way in ways.items():
        first = next(iter(ways))
        # fault: different ways to settle not seen in a scenario -> if False: | coupler/test_scenario_contact
        if way is not ways[first]:
            raise c.document.error(("contact", name, "augmented", "method"),
                                   f"{way.value} here, {ways[first].value} in contact.{first}: all augmented pairs are "
                                   "solved together",
                                   "Write one method in all of them.")


def rigid_model(c: Context) -> Model:
    """The model of the half `rigid`.  Raises ScenarioError."""
    c.no_options("mechanical", c.file.mechanical.options)
    # fault: the rigid half ignores friction in silence -> pass | coupler/test_scenario_contact
    _nothing_to_solve(c)
    rigid, key = c.file.mechanical.rigid or Rigid(), ("mechanical", "rigid")
    c.known_only(rigid.motion, c.file.bodies, (*key, "motion"), "body")
    c.known_only(rigid.pressure, c.file.contact, (*key, "pressure"), "contact pair")
    return {
        "half": "rigid",
        "format": FORMAT,
        "bodies": {
            n: {u: c.convert.signal(getattr(m, u), (*key, "motion", n, u)) for u in ("u_x", "u_y")}
            for n, m in rigid.motion.items()
        },
        "pairs": {
            n: {"pressure": c.convert.signal(rigid.pressure.get(n, 0.0), (*key, "pressure", n), least=0)}
            for n in c.file.contact
        },
    }


def _nothing_to_solve(c: Context) -> None:
    """Rigid bodies move and press as prescribed.  Raises ScenarioError where contact asks for more."""
    for name, pair in c.file.contact.items():
        if pair.mu > 0.0:
            raise c.document.error(("contact", name, "friction", "mu"), "the half `rigid` has no forces, and so no "
                                   "friction", f"Choose the half `elastic`, or set contact.{name}.friction=null.")
        if pair.augmented is not None:
            raise c.document.error(("contact", name, "augmented"), "the half `rigid` presses as prescribed: there is "
                                   "no penetration to drive out",
                                   f"Choose the half `elastic`, or set contact.{name}.augmented=null.")


# model.json of the small halves: thermal `lumped` and `rod`, mechanical `rod` (form: docs/design.md).

def lumped_model(c: Context) -> Model:
    """The model of the thermal half `lumped`.  Raises ScenarioError."""
    return _small(c, "lumped")


def thermal_rod_model(c: Context) -> Model:
    """The model of the thermal half `rod`.  Raises ScenarioError."""
    _rectangles(c, "thermal")
    return _small(c, "thermal_rod")


def _small(c: Context, half: str) -> Model:
    thermal = c.file.thermal
    if thermal.adaptive is not None:
        raise c.document.error(("thermal", "adaptive"), f"the half {thermal.half!r} has no inner steps",
                               "Leave it out, or take more substeps.")
    if thermal.method is Method.STEADY:
        raise c.document.error(("thermal", "method"), f"the half {thermal.half!r} has no method 'steady'",
                               "Let it run until nothing changes.")
    for name, body in c.file.bodies.items():
        if body.Q_T_factor is not None:
            raise c.document.error(("bodies", name, "Q_T_factor"), f"the half {thermal.half!r} has no such factor")
    model = {**thermal_model(c), "half": half}
    _demand_uniform(c, model)
    return model


def _demand_uniform(c: Context, model: Model) -> None:
    for i, boundary in enumerate(model["boundary"]):
        if any(isinstance(boundary.get(key), dict) and "terms" in boundary[key] for key in ("value", "h", "T")):
            raise c.document.error(("thermal", "boundary", i), f"the half {c.file.thermal.half!r} takes data that "
                                   "depend on time alone", "Write a number or a signal.")
    for name, body in model["bodies"].items():
        if isinstance(body["Q_T"], dict) and "terms" in body["Q_T"]:
            raise c.document.error(("bodies", name, "Q_T"), f"the half {c.file.thermal.half!r} takes data that depend "
                                   "on time alone", "Write a number or a signal.")


def _rectangles(c: Context, role: str) -> None:
    for name, body in c.file.bodies.items():
        if body.mesh.rectangle is None:
            raise c.document.error((role, "half"), f"a rod is a rectangle along x, but body {name!r} is meshed from a "
                                   "file")


def mechanical_rod_model(c: Context) -> Model:
    """The model of the mechanical half `rod`.  Raises ScenarioError."""
    c.no_options("mechanical", c.file.mechanical.options)
    _rectangles(c, "mechanical")
    rod = c.file.mechanical.rod
    if rod is None:
        raise c.document.error(("mechanical",), "the half `rod` is chosen, but mechanical.rod is missing",
                               "Say which ends are held: mechanical: {rod: {held: {BODY: {left: 0}}}}.")
    if c.interface.axisymmetric:
        raise c.document.error(("geometry",), "the mechanical half `rod` is straight", "Write `geometry: plane`.")
    c.known_only(rod.held, c.file.bodies, ("mechanical", "rod", "held"), "body")
    for name in c.file.bodies:
        if name not in rod.held:
            raise c.document.error(("mechanical", "rod", "held"), f"nothing holds body {name!r}",
                                   f"Add {name}: {{left: 0}}, or right.")
    return {"half": "mechanical_rod", "format": FORMAT, "materials": _materials(c),
            "bodies": {n: {"material": b.material, **_held(c, n, rod.held[n])} for n, b in c.file.bodies.items()},
            "pairs": {n: {} for n in c.file.contact}}


def _held(c: Context, name: str, held: Held) -> Model:
    key = ("mechanical", "rod", "held", name)
    return {end: c.convert.signal(spec, (*key, end)) for end, spec in (("left", held.left), ("right", held.right))
            if spec is not None}


def _materials(c: Context) -> Model:
    materials = c.materials("rod", ("alpha",), also=("T_ref", "E"))
    for name, model in materials.items():
        if model["alpha"] != 0 and "T_ref" not in model:
            raise c.document.error(("materials", name), f"material {name!r} expands, but has no T_ref",
                                   "State the temperature at which it has its length.")
        liquid = c.file.materials[name].liquid
        if liquid is not None:
            model["shrinkage"] = liquid.shrinkage
    return materials


WRITERS = {"thermal": thermal_model, "lumped": lumped_model, "thermal_rod": thermal_rod_model,
           "elastic": elastic_model, "rigid": rigid_model, "mechanical_rod": mechanical_rod_model}


def models(c: Context) -> dict[str, Model]:
    """role -> model.json.  Raises ScenarioError."""
    for name, body in c.file.bodies.items():
        if body.material not in c.file.materials:
            raise c.document.error(("bodies", name, "material"), f"there is no material {body.material!r}",
                                   did_you_mean(body.material, c.file.materials))
    kinds = {"thermal": c.file.thermal.half, "mechanical": c.file.mechanical.half}
    for role, kind in kinds.items():
        check_kind(c.document, role, kind)
    _positive_at_start(c)
    return {
        role: WRITERS[OWN[role][kind]](c) if kind in OWN[role] else _foreign(c, role, kind)
        for role, kind in kinds.items()
    }


def _foreign(c: Context, role: str, kind: str) -> Model:
    """What a half of another package is told: everything the scene states, and its own options unchanged.

    An FMU that lies ready was built before and is told nothing; its `half` is where it lies.
    """
    fmu = fmu_path(kind, c.document.path.parent)
    options = (c.file.thermal if role == "thermal" else c.file.mechanical).options
    return {"half": kind if fmu is None else str(fmu), "format": FORMAT, "options": options,
            "materials": {n: c.material(n, Material.model_fields) for n in c.file.materials},
            "bodies": {n: {"material": b.material, "T0": c.convert.kelvin(b.T0, ("bodies", n, "T0"))}
                       for n, b in c.file.bodies.items()},
            "pairs": {n: augmented(p) if role == "mechanical" else {} for n, p in c.file.contact.items()}}


def _positive_at_start(c: Context) -> None:
    """A polynomial may turn negative somewhere; where a body begins, and where it melts, it must not."""
    for name, body in c.file.bodies.items():
        T0 = c.convert.kelvin(body.T0, ("bodies", name, "T0"))
        data = c.material(body.material, ("k", "c", "E", "latent"))
        latent = data.pop("latent", None)
        for key, spec in (found for datum in data for found in properties_of(data[datum], (datum,))):
            for T in _met(T0, latent, str(key[-1])):
                if (value := float(property_from(spec)(np.array([T]))[0])) <= 0:
                    where = "T0" if T == T0 else "melting point"
                    raise c.document.error(
                        ("materials", body.material, *key),
                        f"is {value:g} at the {where} of body {name!r}, but must be greater than zero",
                    )


def _met(T0: float, latent: Model | None, phase: str) -> tuple[float, ...]:
    """Temperatures [K] that a property is sure to meet, or near to it: of a phase only where there is some of it."""
    if latent is None:
        return (T0,)
    T_s, T_l = latent["T_s"], latent["T_l"]
    return {"solid": (min(T0, T_s), T_s), "liquid": (max(T0, T_l), T_l)}.get(phase, (T0, T_s, T_l))
