"""model.json of the mechanical halves `elastic` and `rigid` (form: docs/design.md)."""

from __future__ import annotations

from coupler.scenario.context import FORMAT, Context, Model
from coupler.scenario.document import Key
from coupler.scenario.schema_halves import ElasticBoundary, Rigid

ROOM = 293.15  # K


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
    place: Key = ("mechanical", "elastic", "boundary")
    c.names_once(elastic.boundary, place)
    return {"half": "elastic", "format": FORMAT, "tolerance": elastic.tolerance,
            "materials": _materials(c),
            "bodies": {n: {"material": b.material} for n, b in c.file.bodies.items()},
            "boundary": [entry for i, b in enumerate(elastic.boundary) for entry in _held(c, b, (*place, i))],
            "pairs": {n: {} for n in c.file.contact}}


def _held(c: Context, boundary: ElasticBoundary, key: Key) -> list[Model]:
    common = c.common(boundary, key)
    if boundary.pressure is not None:
        value = c.convert.signal(boundary.pressure, (*key, "pressure"))
        return [{"kind": "pressure", "value": value, **common}]
    held = [(0, "u_x", boundary.u_x), (1, "u_y", boundary.u_y)]
    return [{"kind": "displacement", "component": i, "value": c.convert.signal(spec, (*key, name)), **common}
            for i, name, spec in held if spec is not None]


def rigid_model(c: Context) -> Model:
    """The model of the half `rigid`.  Raises ScenarioError."""
    c.no_options("mechanical", c.file.mechanical.options)
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


def _materials(c: Context) -> Model:
    """E, nu, alpha and the temperature alpha counts from; without expansion nothing depends on it."""
    materials = c.materials("elastic", ("E", "nu", "alpha"), also=("T_ref",))
    for name, material in materials.items():
        if material["alpha"] != 0 and "T_ref" not in material:
            raise c.document.error(("materials", name), f"material {name!r} expands, but has no T_ref",
                                   "State the temperature at which it is free of stress.")
    return {name: {"T_ref": ROOM, **material} for name, material in materials.items()}
