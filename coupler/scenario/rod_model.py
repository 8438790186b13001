"""model.json of the small halves: thermal `lumped` and `rod`, mechanical `rod` (form: docs/design.md)."""

from __future__ import annotations

from coupler.scenario.context import FORMAT, Context, Model
from coupler.scenario.schema_mechanical import Held
from coupler.scenario.schema_thermal import Method
from coupler.scenario.thermal_model import thermal_model


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
