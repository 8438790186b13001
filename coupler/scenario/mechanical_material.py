"""Materials of the half `elastic` in model.json: SI and kelvin."""

from __future__ import annotations

from coupler.scenario.base import Part
from coupler.scenario.context import Context, Model
from coupler.scenario.document import Key
from coupler.scenario.schema_flow import Hardening, Liquid, Plastic
from coupler.scenario.schema_material import Phases
from coupler.scenario.schema_mechanical import Elastic, Solution

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
