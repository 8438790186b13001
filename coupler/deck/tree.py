"""The scenario of a deck, as the tree its YAML file will hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any

from coupler.deck.bodies import Body, Names
from coupler.deck.boundary import (
    HELD,
    PUSHED,
    NodeSets,
    conditions_at,
    first_temperature,
    held_of,
    pushed_of,
    temperatures_of,
)
from coupler.deck.contact import Asked, pairs_of
from coupler.deck.course import amplitudes_of
from coupler.deck.lexer import Row, wrong
from coupler.deck.loads import Load, conditions_of, loads_of
from coupler.deck.log import Log
from coupler.deck.materials import expansion_from, material_of, merged
from coupler.deck.mesh import Mesh
from coupler.deck.outline import Outline
from coupler.deck.steps import Step, steps_of
from coupler.deck.surfaces import Surfaces
from coupler.deck.units import physics_of

FRAMES = 50  # fields kept of a run, about
IDLE = 1e12  # J/kgK: where nothing heats, as little as this moves nothing
TOGETHER = ({"CPE", "DC2D"}, {"CPS", "DC2D"}, {"CAX", "DCAX"})  # families of one geometry
Tree = dict[str, Any]


@dataclass(frozen=True)
class Deck:
    """What was read before the conditions."""

    outline: Outline
    mesh: Mesh
    bodies: Sequence[Body]
    surfaces: Surfaces
    sets: NodeSets


def tree_of(deck: Deck, mesh_file: str, title: str, log: Log) -> Tree:
    """The whole scenario.  Raises ScenarioError, naming the deck's line."""
    outline, bodies = deck.outline, deck.bodies
    steps = steps_of(outline, log)
    asked = Asked(moves=any(s.procedure != "HEAT TRANSFER" for s in steps),
                  heats=any(s.procedure != "STATIC" for s in steps))
    known = amplitudes_of(outline, log)
    T = temperatures_of(outline, deck.mesh, log)
    T0 = {body.name: first_temperature(body, T, body.row, log) for body in bodies}
    held = held_of(outline, steps, deck.mesh, known, T, log)
    pushed = pushed_of(outline, steps, deck.mesh, known, log)
    loads = loads_of(steps, outline.model, deck.surfaces, known, log)
    seen = [*T0.values(), *(v for (_, dof), c in held.items() if dof == 11 for _, v in c.points),
            *(v for load in loads if load.T for _, v in load.T.points)]
    unit, sigma = physics_of(outline, seen, _radiates(outline, loads), log)
    materials, of_body = _materials(deck, T0, steps, asked, log)
    rho = {name: materials[material]["rho"] for name, material in of_body.items() if "rho" in materials[material]}
    found = conditions_of(loads, bodies, deck.surfaces, rho, log)
    thermal = [*conditions_at(held, {11: HELD[11]}, bodies, deck.sets, log), *found.thermal]
    mechanical = [*conditions_at(held, {1: HELD[1], 2: HELD[2]}, bodies, deck.sets, log),
                  *conditions_at(pushed, PUSHED, bodies, deck.sets, log), *found.mechanical]
    _left_out(asked, thermal or found.Q_T, mechanical or found.gravity, log)
    pairs = pairs_of(outline, bodies, deck.surfaces, asked, log)
    return {
        "slideline": 1, "title": title, "units": {"temperature": unit},
        "geometry": "axisymmetric" if _families(deck) & {"CAX", "DCAX"} else "plane",
        "materials": materials,
        "bodies": {name: {"mesh": {"file": {"path": mesh_file, "region": name}}, "material": of_body[name],
                          "T0": T0[name], **({"Q_T": found.Q_T[name]} if asked.heats and name in found.Q_T else {})}
                   for name in of_body},
        **({"contact": pairs} if pairs else {}),
        "thermal": {"method": "steady" if any(s.steady for s in steps) else "backward_euler",
                    **({"sigma_SB": sigma} if sigma else {}),
                    **({"boundary": thermal} if thermal and asked.heats else {})},
        "mechanical": _mechanical(deck, asked, mechanical, found.gravity, log),
        "coupling": _coupling(steps),
        "probes": _probes(bodies, pairs, asked),
        "output": {"fields": {"every": max(1, ceil(sum(step.count for step in steps) / FRAMES))}},
    }


def _families(deck: Deck) -> set[str]:
    """Families of the cells.  Raises ScenarioError where they do not go together."""
    found: dict[str, Row] = {cell.kind.family: cell.row for cell in deck.mesh.cells}
    for family, row in found.items():
        if not any({family, *found} <= together for together in TOGETHER):
            raise wrong(row, f"elements of {' and '.join(found)} in one deck",
                        "A scenario is plane strain, plane stress or axisymmetric, all of it.")
    return set(found)


def _radiates(outline: Outline, loads: Sequence[Load]) -> bool:
    return any(load.kind == "radiation" for load in loads) or any(
        block.word == "GAP RADIATION" for owner in outline.interactions.values() for block in owner.own)


def _materials(deck: Deck, T0: dict[str, float], steps: Sequence[Step], asked: Asked,
               log: Log) -> tuple[Tree, dict[str, str]]:
    """`materials`, and body -> its material: one for each first temperature where a material expands."""
    names, made, trees, of_body = Names(), dict[tuple[str, float], str](), Tree(), dict[str, str]()
    read = {}
    for body in deck.bodies:
        owner = deck.outline.materials[body.material]
        if body.material not in read:
            read[body.material] = _filled(material_of(owner, log), owner.block.row, steps, asked, log)
        base = read[body.material]
        alpha = base.get("alpha", 0.0)
        key = (body.material, T0[body.name] if alpha != 0.0 else 0.0)
        if key not in made:
            made[key] = names.free(owner.block.options["NAME"])
            if alpha == 0.0:
                trees[made[key]] = merged(base, **({"alpha": 0.0} if asked.moves else {}))
            else:
                log.note("a body is free of stress at its first temperature, as in a deck; so a material that expands "
                         "is there once for each")
                trees[made[key]] = merged(base, alpha=expansion_from(alpha, base["zero"], key[1]), T_ref=key[1])
        of_body[body.name] = made[key]
    for name, owner in deck.outline.materials.items():
        if name not in read:
            log.miss(owner.block, "no section is of this material")
    return trees, of_body


def _filled(tree: Tree, row: Row, steps: Sequence[Step], asked: Asked, log: Log) -> Tree:
    """A material with stand-ins where what is missing has no effect.  Raises ScenarioError where it has one."""
    if not asked.heats:
        rho = tree.get("rho", 1.0)
        log.note("a deck of *STATIC alone has no heat: c is so large that nothing warms, k stands in")
        return {"k": 1.0, **tree, "rho": rho, "c": IDLE / rho}
    if all(step.steady or step.procedure == "STATIC" for step in steps) and not {"rho", "c"} <= set(tree):
        log.note("a steady solution stores no heat: missing rho and c are 1")
        tree = {"rho": 1.0, "c": 1.0, **tree}
    needed = {"k": "*CONDUCTIVITY", "rho": "*DENSITY", "c": "*SPECIFIC HEAT", "E": "*ELASTIC"}
    missing = [word for key, word in needed.items() if key not in tree and (key != "E" or asked.moves)]
    if missing:
        raise wrong(row, f"the material lacks {', '.join(missing)}", "Add what the steps of this deck need.")
    return tree


def _left_out(asked: Asked, thermal: object, mechanical: object, log: Log) -> None:
    if thermal and not asked.heats:
        log.note("no step solves for temperatures: conditions on them are left out")
    if mechanical and not asked.moves:
        log.note("no step solves for displacements: conditions on them are left out")


def _mechanical(deck: Deck, asked: Asked, boundary: Sequence[Tree], gravity: Any, log: Log) -> Tree:
    if not asked.moves:
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


def _coupling(steps: Sequence[Step]) -> Tree:
    coupled = any(step.procedure == "COUPLED TEMPERATURE-DISPLACEMENT" for step in steps)
    return {"scheme": "iterated", "iteration": {"level": "end"}, "end": steps[-1].end,
            "windows": [step.windows for step in steps]} if coupled else {
            "scheme": "staggered", "end": steps[-1].end, "windows": [step.windows for step in steps]}


def _probes(bodies: Sequence[Body], pairs: Tree, asked: Asked) -> Tree:
    """What one would look at first: temperatures of bodies, pressures and gaps of pairs."""
    heat = {f"{b.name}.T_{what}": {"T": {what: b.name}} for b in bodies for what in ("max", "mean", "min")}
    touch = {f"{name}.{what}_{how}": {what: {how: pair["slave"]}} for name, pair in pairs.items()
             for what, how in (("p", "max"), ("gap", "max"))}
    moved = {f"{b.name}.{u}_{what}": {u: {what: b.name}}
             for b in bodies for u in ("u_x", "u_y") for what in ("max", "min")}
    return (heat if asked.heats else {}) | (touch | moved if asked.moves else {})
