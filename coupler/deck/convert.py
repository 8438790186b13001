"""Converts a deck of another program into a scenario file with its mesh beside it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from typing import Any

from ruamel.yaml.comments import CommentedMap, CommentedSeq

from coupler.deck.bodies import DeckBody, DeckSurfaces, Edge, Names, bodies_of, surfaces_of
from coupler.deck.contact import Analysis, pairs_of
from coupler.deck.lexer import Converted, DeckLine, Log, blocks_of, printable, understood, wrong
from coupler.deck.loads import (
    FORCES,
    PRESCRIBED,
    Load,
    NodeSets,
    conditions_at,
    conditions_of,
    first_temperature,
    forces_of,
    loads_of,
    prescribed_of,
    temperatures_of,
)
from coupler.deck.materials import expansion_from, material_of, merged, physics_of
from coupler.deck.mesh import DeckMesh, mesh_of
from coupler.deck.outline import Outline, outline_of
from coupler.deck.steps import DeckStep, Signal, amplitudes_of, steps_of
from coupler.deck.units import in_units, units_given, units_seen
from coupler.errors import ScenarioError
from coupler.record.paths import check_free, new_files
from coupler.running.setup import plan_of
from coupler.scenario import load_scenario
from coupler.scenario.document import dumped, layout

# The scenario of a deck, as the tree its YAML file will hold.

FRAMES = 50  # fields kept of a run, about
IDLE = 1e12  # J/m3K, rho c: where nothing heats, as little as this moves nothing
TOGETHER = ({"CPE", "DC2D"}, {"CPS", "DC2D"}, {"CAX", "DCAX"})  # families of one geometry
Tree = dict[str, Any]


@dataclass(frozen=True)
class Deck:
    """The mesh of a deck with its names: all that is read before the conditions."""

    outline: Outline
    mesh: DeckMesh
    bodies: Sequence[DeckBody]
    surfaces: DeckSurfaces
    sets: NodeSets


def tree_of(deck: Deck, mesh_file: str, title: str, log: Log, given: str = "") -> Tree:
    """Build the whole scenario.  given : units of the deck, "": as its materials say.

    Raises ScenarioError, naming the deck's line.
    """
    units = units_given(given) if given else units_seen(
        {name: material_of(owner, Log()) for name, owner in deck.outline.materials.items()}, log)
    outline, bodies = deck.outline, deck.bodies
    steps = steps_of(outline, log)
    analysis = Analysis(moves=any(s.procedure != "HEAT TRANSFER" for s in steps),
                  heats=any(s.procedure != "STATIC" for s in steps))
    amplitudes = amplitudes_of(outline, log)
    T = temperatures_of(outline, deck.mesh, log)
    T0 = {body.name: first_temperature(body, T, body.row, log) for body in bodies}
    prescribed = prescribed_of(outline, steps, deck.mesh, amplitudes, T, log)
    forces = forces_of(outline, steps, deck.mesh, amplitudes, log)
    loads = loads_of(steps, outline.model, deck.surfaces, amplitudes, log)
    temperatures = [*T0.values(), *(v for (_, dof), c in prescribed.items() if dof == 11 for _, v in c.points),
            *(v for load in loads if load.T for _, v in load.T.points)]
    physics = physics_of(outline, temperatures, _radiates(outline, loads), log)
    assigned = _materials(deck, T0, _Filling(steps, analysis, units), log)
    materials, of_body = assigned.trees, assigned.of_body
    rho = {name: materials[material]["rho"] for name, material in of_body.items() if "rho" in materials[material]}
    entries = conditions_of(loads, bodies, deck.surfaces, rho, log)
    thermal = [*conditions_at(prescribed, {11: PRESCRIBED[11]}, bodies, deck.sets, log), *entries.thermal]
    mechanical = [*conditions_at(prescribed, {1: PRESCRIBED[1], 2: PRESCRIBED[2]}, bodies, deck.sets, log),
                  *conditions_at(forces, FORCES, bodies, deck.sets, log), *entries.mechanical]
    _note_dropped(analysis, thermal or entries.Q_T, mechanical or entries.gravity, log)
    pairs = pairs_of(outline, bodies, deck.surfaces, analysis, log)
    return {
        "slideline": 2, "title": title, "units": {"temperature": physics.temperature_unit, **units},
        "geometry": "axisymmetric" if _families(deck) & {"CAX", "DCAX"} else "plane",
        "materials": materials,
        "bodies": {name: {"mesh": {"file": {"path": mesh_file, "region": name}}, "material": of_body[name],
                          "T0": T0[name], **_source(name, entries.Q_T, analysis)}
                   for name in of_body},
        **({"contact": pairs} if pairs else {}),
        "thermal": {"method": "steady" if any(s.steady for s in steps) else "backward_euler",
                    **({"sigma_SB": physics.sigma_SB} if physics.sigma_SB else {}),
                    **({"boundary": thermal} if thermal and analysis.heats else {})},
        "mechanical": _mechanical(deck, analysis, mechanical, entries.gravity, log),
        "coupling": _coupling(steps),
        "probes": _probes(bodies, pairs, analysis),
        "output": {"fields": {"every": max(1, ceil(sum(step.count for step in steps) / FRAMES))}},
    }


def _source(body: str, Q_T: Mapping[str, Signal], analysis: Analysis) -> Tree:
    return {"Q_T": Q_T[body]} if analysis.heats and body in Q_T else {}


def _families(deck: Deck) -> set[str]:
    """Return the families of the elements.  Raises ScenarioError where they are not of one geometry."""
    row_of: dict[str, DeckLine] = {cell.kind.family: cell.row for cell in deck.mesh.cells}
    for family, row in row_of.items():
        if not any({family, *row_of} <= together for together in TOGETHER):
            raise wrong(row, f"elements of {' and '.join(row_of)} in one deck",
                        "A scenario is plane strain, plane stress or axisymmetric, all of it.")
    return set(row_of)


def _radiates(outline: Outline, loads: Sequence[Load]) -> bool:
    return any(load.kind == "radiation" for load in loads) or any(
        block.word == "GAP RADIATION" for owner in outline.interactions.values() for block in owner.own)


@dataclass(frozen=True)
class _Materials:
    """trees : `materials` of the scenario.  of_body : body -> name of its material."""

    trees: Tree
    of_body: dict[str, str]


@dataclass(frozen=True)
class _Filling:
    """What stands in for data that a deck leaves out follows from its steps, in its units."""

    steps: Sequence[DeckStep]
    analysis: Analysis
    units: Mapping[str, str]


def _materials(deck: Deck, T0: dict[str, float], filling: _Filling, log: Log) -> _Materials:
    """Build the materials, one for each first temperature where a material expands."""
    names, made, trees, of_body = Names(), dict[tuple[str, float], str](), Tree(), dict[str, str]()
    read = {}
    for body in deck.bodies:
        owner = deck.outline.materials[body.material]
        if body.material not in read:
            read[body.material] = _filled(material_of(owner, log), owner.block.row, filling, log)
        base = read[body.material]
        alpha = base.get("alpha", 0.0)
        key = (body.material, T0[body.name] if alpha != 0.0 else 0.0)
        if key not in made:
            made[key] = names.free(owner.block.options["NAME"])
            if alpha == 0.0:
                trees[made[key]] = merged(base, **({"alpha": 0.0} if filling.analysis.moves else {}))
            else:
                log.note("a body is free of stress at its first temperature, as in a deck; so a material that expands "
                         "is there once for each")
                trees[made[key]] = merged(base, alpha=expansion_from(alpha, base["zero"], key[1]), T_ref=key[1])
        of_body[body.name] = made[key]
    for name, owner in deck.outline.materials.items():
        if name not in read:
            log.miss(owner.block, "no section is of this material")
    return _Materials(trees, of_body)


def _filled(tree: Tree, row: DeckLine, filling: _Filling, log: Log) -> Tree:
    """Fill in what a material lacks where it has no effect.  Raises ScenarioError where it has one."""
    steps, analysis, units = filling.steps, filling.analysis, filling.units
    if not analysis.heats:
        rho = tree.get("rho", in_units(1.0, "kg/m3", units))
        log.note("a deck of *STATIC alone has no heat: c is so large that nothing warms, k stands in")
        # fault: decks in mm: what stands in for heat is in SI -> idle = IDLE | coupler/test_deck_units
        idle = in_units(IDLE, "J/m3K", units)
        return {"k": in_units(1.0, "W/mK", units), **tree, "rho": rho, "c": idle / rho}
    if all(step.steady or step.procedure == "STATIC" for step in steps) and not {"rho", "c"} <= set(tree):
        log.note("a steady solution stores no heat: missing rho and c are 1 in SI")
        tree = {"rho": in_units(1.0, "kg/m3", units), "c": in_units(1.0, "J/kgK", units), **tree}
    needed = {"k": "*CONDUCTIVITY", "rho": "*DENSITY", "c": "*SPECIFIC HEAT", "E": "*ELASTIC"}
    missing = [word for key, word in needed.items() if key not in tree and (key != "E" or analysis.moves)]
    if missing:
        raise wrong(row, f"the material lacks {', '.join(missing)}", "Add what the steps of this deck need.")
    return tree


def _note_dropped(analysis: Analysis, thermal: object, mechanical: object, log: Log) -> None:
    if thermal and not analysis.heats:
        log.note("no step solves for temperatures: conditions on them are left out")
    if mechanical and not analysis.moves:
        log.note("no step solves for displacements: conditions on them are left out")


def _mechanical(deck: Deck, analysis: Analysis, boundary: Sequence[Tree], gravity: Any, log: Log) -> Tree:
    if not analysis.moves:
        return {"half": "rigid"}
    letters = {cell.kind.letters for cell in deck.mesh.cells}
    if any(set(word) & set("RH") for word in letters):
        log.note("reduced and hybrid elements are full ones of mean dilatation, which neither lock nor fold")
    elastic: Tree = {}
    if "CPS" in _families(deck):
        elastic["state"] = "plane_stress"
    if all("I" in word for word in letters):
        elastic["element"] = "enhanced"
    if gravity is not None:
        elastic["gravity"] = {key: part for key, part in zip("xy", gravity, strict=True) if part != 0.0}
    return {"half": "elastic", "elastic": elastic | ({"boundary": list(boundary)} if boundary else {})}


def _coupling(steps: Sequence[DeckStep]) -> Tree:
    coupled = any(step.procedure == "COUPLED TEMPERATURE-DISPLACEMENT" for step in steps)
    return {"scheme": "iterated", "iteration": {"level": "end"}, "end": steps[-1].end,
            "windows": [step.windows for step in steps]} if coupled else {
            "scheme": "staggered", "end": steps[-1].end, "windows": [step.windows for step in steps]}


def _probes(bodies: Sequence[DeckBody], pairs: Tree, analysis: Analysis) -> Tree:
    """Build probes: temperatures and displacements of bodies, pressures and gaps of pairs."""
    heat = {f"{b.name}.T_{what}": {"T": {what: b.name}} for b in bodies for what in ("max", "mean", "min")}
    touch = {f"{name}.{what}_{how}": {what: {how: pair["slave"]}} for name, pair in pairs.items()
             for what, how in (("p", "max"), ("gap", "max"))}
    moved = {f"{b.name}.{u}_{what}": {u: {what: b.name}}
             for b in bodies for u in ("u_x", "u_y") for what in ("max", "min")}
    return (heat if analysis.heats else {}) | (touch | moved if analysis.moves else {})


# The two files: the mesh as gmsh text, and the scenario with what was not understood at its top.

MAX_HEAD_LINES = 200  # lines of the head; all are printed
GMSH = {1: 15, 2: 1, 3: 2, 4: 3}  # corners -> gmsh's kind of element


@dataclass(frozen=True)
class Groups:
    """The named groups of the mesh file: bodies, surfaces (edges) and sets of nodes."""

    bodies: Sequence[DeckBody]
    surfaces: Mapping[str, Sequence[Edge]]
    node_sets: Mapping[str, Sequence[int]]


def mesh_text(mesh: DeckMesh, groups: Groups) -> str:
    """Write the mesh as gmsh 2.2: elements by body, lines by surface, points by node set; without unused nodes."""
    used = sorted({n for body in groups.bodies for n in body.nodes})
    number = {n: i for i, n in enumerate(used, start=1)}
    names: list[str] = []
    elements: list[str] = []
    for group in _members(mesh, groups):
        cells = [m for m in group.members if all(n in number for n in m)]
        if not cells:
            continue
        names.append(f'{group.dimension} {len(names) + 1} "{group.name}"')
        tag = len(names)
        for nodes in cells:
            corners = " ".join(str(number[n]) for n in nodes)
            elements.append(f"{len(elements) + 1} {GMSH[len(nodes)]} 2 {tag} {tag} {corners}")
    points = [f"{i} {float(mesh.points[n, 0])!r} {float(mesh.points[n, 1])!r} 0" for n, i in number.items()]
    return "\n".join(["$MeshFormat", "2.2 0 8", "$EndMeshFormat",
                      "$PhysicalNames", str(len(names)), *names, "$EndPhysicalNames",
                      "$Nodes", str(len(points)), *points, "$EndNodes",
                      "$Elements", str(len(elements)), *elements, "$EndElements", ""])


@dataclass(frozen=True)
class _Group:
    """members : nodes of each element, line or point."""

    dimension: int
    name: str
    members: list[tuple[int, ...]]


def _members(mesh: DeckMesh, groups: Groups) -> Iterator[_Group]:
    for body in groups.bodies:
        yield _Group(2, body.name, [tuple(dict.fromkeys(mesh.cells[i].nodes)) for i in body.cells])
    for name, edges in groups.surfaces.items():
        yield _Group(1, name, [tuple(edge) for edge in edges])
    for name, nodes in groups.node_sets.items():
        yield _Group(0, name, [(n,) for n in nodes])


def scenario_text(tree: Mapping[str, Any], head: Sequence[str]) -> str:
    """Write the scenario as YAML under a comment; a mapping or list of plain values takes one line."""
    lines = list(head[:MAX_HEAD_LINES])
    if len(head) > MAX_HEAD_LINES:
        lines.append(f"... and {len(head) - MAX_HEAD_LINES} lines more")
    # fault: decks: a name leaves the comment it stands in -> return "".join(f"# {line}".rstrip() + "\n" for line in
    #   lines) + dumped(_laid_out(tree), layout()) | coupler/test_deck_hostile
    return "".join(f"# {printable(line)}".rstrip() + "\n" for line in lines) + dumped(_laid_out(tree), layout())


def _laid_out(value: Any, level: int = 0) -> Any:
    """Convert a value to ruamel's containers, small ones in flow style.  level : below the top."""
    if isinstance(value, Mapping):
        made = CommentedMap((key, _laid_out(inner, level + 1)) for key, inner in value.items())
        if level and _depth(value) <= (3 if level > 1 else 1):
            made.fa.set_flow_style()
        return made
    if isinstance(value, list | tuple):
        listed = CommentedSeq(_laid_out(inner, level + 1) for inner in value)
        if _depth(value) <= 1:
            listed.fa.set_flow_style()
        return listed
    return value


def _depth(value: Any) -> int:
    """Return how deep containers nest, 0 for a plain value."""
    inner = value.values() if isinstance(value, Mapping) else value if isinstance(value, list | tuple) else None
    return 0 if inner is None else 1 + max((_depth(v) for v in inner), default=0)


def convert(path: Path, out: Path, units: str = "") -> Converted:
    """Write the scenario `out` (.yaml), and its mesh beside it (same stem, .msh), of the deck `path`.

    units : of the deck's numbers, such as "mm,MPa" or "SI"; "": those in which its materials are usual ones.
    Raises ScenarioError, naming the deck's file, line, text and what to do, where a deck cannot be read, holds what no
    scenario can express (3-D elements, surfaces of nodes), makes a scenario that does not pass its check, or where a
    file to be written exists already.  Then no file is written.
    """
    check_free(out)
    beside = out.with_suffix(".msh")
    if beside == out:
        raise ScenarioError("this is the name of the mesh beside the scenario", file=str(out),
                            remedy="End the scenario in .yaml")
    check_free(beside)
    log = Log()
    deck = _read(path, log)
    title = deck.outline.title or printable(path.stem)
    tree = tree_of(deck, beside.name, title, log, units)
    converted = Converted((out, beside), tuple(log.missed), tuple(log.notes))
    head = [f"From the deck {path.name}.", *(f"- {note}" for note in log.notes),
            "Not understood:" if log.missed else "All of the deck was understood.", *(f"  {m}" for m in log.missed)]
    mesh = mesh_text(deck.mesh, Groups(deck.bodies, deck.surfaces.edges, deck.sets.named))
    with new_files({beside: mesh, out: scenario_text(tree, head)}):
        try:
            plan_of(load_scenario(out))
        except ScenarioError as exc:
            raise ScenarioError(f"the deck makes a scenario that does not pass its check: {exc}",
                                file=str(path)) from exc
    return converted


def _read(path: Path, log: Log) -> Deck:
    """Read the mesh of a deck with its names."""
    outline = outline_of(understood(blocks_of(path), log))
    mesh, names = mesh_of(outline, log), Names()
    bodies = bodies_of(outline, mesh, names, log)
    return Deck(outline, mesh, bodies, surfaces_of(outline, mesh, names, log), NodeSets(mesh, names))
