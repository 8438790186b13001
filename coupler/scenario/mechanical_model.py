"""model.json of the mechanical halves `elastic` and `rigid` (form: docs/design.md)."""

from __future__ import annotations

from coupler.scenario.context import FORMAT, Context, Model
from coupler.scenario.document import Key
from coupler.scenario.mechanical_material import mechanical_materials
from coupler.scenario.schema_contact import ContactPair, Settling
from coupler.scenario.schema_mechanical import (
    FORCES,
    MOTIONS,
    TRACTIONS,
    WEIGHTS,
    BodyOptions,
    Elastic,
    ElasticBoundary,
    Rigid,
    State,
)


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
            "bodies": {n: {"material": b.material, **_body(elastic.bodies.get(n)), **_poured(c, n)}
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


def _body(options: BodyOptions | None) -> Model:
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
