"""What is held at nodes: *BOUNDARY, *CLOAD and initial temperatures, node by node, so that the last word holds."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from coupler.deck.lexer import NUMBER, Block, Log, Row, number, whole, wrong
from coupler.deck.model import Body, Edge, Mesh, Name, Names, Outline, Surfaces
from coupler.deck.steps import Amplitude, Course, Signal, Step, after, amplitude_at

HELD = {1: "u_x", 2: "u_y", 11: "temperature"}
PUSHED = {1: "f_x", 2: "f_y"}
TYPED = {"ENCASTRE": (1, 2), "PINNED": (1, 2), "XSYMM": (1,), "YSYMM": (2,), "ZSYMM": (), "XASYMM": (2,),
         "YASYMM": (1,)}
Tree = dict[str, Any]
Held = dict[tuple[int, int], Course]  # (node, degree of freedom) -> its course


@dataclass
class NodeSets:
    """named : name in the scenario -> nodes; of deck sets in use, and of others made here."""

    mesh: Mesh
    names: Names
    named: dict[str, tuple[int, ...]] = field(default_factory=dict)
    given: dict[frozenset[int] | Name, str] = field(default_factory=dict)

    def on(self, nodes: frozenset[int], body: Body, wanted: str) -> str:
        """`body.set` of these nodes of one body: a set of the deck where one fits, else a new one."""
        fits = (key for key, rows in self.mesh.node_sets.items() if body.nodes.intersection(rows) == nodes)
        key = next(fits, nodes)
        if key not in self.given:
            spelled = wanted if isinstance(key, frozenset) else self.mesh.spelled[key]
            members = nodes if isinstance(key, frozenset) else self.mesh.node_sets[key]
            self.given[key] = self.names.free(spelled, "_nodes")
            self.named[self.given[key]] = tuple(sorted(members))
        return f"{body.name}.{self.given[key]}"


def temperatures_of(outline: Outline, mesh: Mesh, log: Log) -> dict[int, float]:
    """Node -> first temperature, of *INITIAL CONDITIONS; the last given holds.  Raises ScenarioError."""
    T: dict[int, float] = {}
    for block in (b for b in outline.model if b.word == "INITIAL CONDITIONS"):
        if (kind := block.option("TYPE")) != "TEMPERATURE":
            log.miss(block, f"initial conditions of type {kind[:30]} are not understood")
            continue
        for row in block.data:
            value = number(row, 1, "the temperature")
            T |= dict.fromkeys(mesh.nodes_at(row.field(0), row), value)
            if any(row.fields[2:]):
                log.miss(row, "one temperature a node is understood, gradients are not")
    return T


def held_of(outline: Outline, steps: Sequence[Step], mesh: Mesh, known: Mapping[str, Amplitude],
            rest: Mapping[int, float], log: Log) -> Held:
    """All of *BOUNDARY.  rest : node -> its first temperature, from where ramps start.  Raises ScenarioError."""
    held: Held = {}
    for step, block in _given(outline, steps, "BOUNDARY"):
        if step is None and (block.option("OP") or block.option("AMPLITUDE")):
            log.miss(block, "before the first step a condition simply holds")
        amplitude = amplitude_at(block, "AMPLITUDE", known) if step is not None else None
        fresh = [(node, dof, value, row) for row in block.data for node, dof, value in _conditions(row, mesh, log)]
        if block.option("OP") == "NEW" and not {(n, d) for n, d, _, _ in fresh} >= set(held):
            log.miss(block, "OP=NEW: what is not held again cannot be let go, it stays as it was")
        for node, dof, value, row in fresh:
            key, first = (node, dof), rest.get(node, 0.0) if dof == 11 else 0.0
            if key not in held and step is not None and step.start > 0.0:
                log.miss(row, f"begins at {step.start:g} s; a place that is held is held from time 0 on")
            held[key] = after(held.get(key), step, value, amplitude, first)
    return held


def pushed_of(outline: Outline, steps: Sequence[Step], mesh: Mesh, known: Mapping[str, Amplitude], log: Log) -> Held:
    """All of *CLOAD.  Raises ScenarioError."""
    pushed: Held = {}
    for step, block in _given(outline, steps, "CLOAD"):
        if step is None:
            log.miss(block, "a load stands in a step")
            continue
        amplitude, fresh = amplitude_at(block, "AMPLITUDE", known), set()
        for row in block.data:
            dof, value = whole(row, 1, "the degree of freedom"), number(row, 2, "the force")
            if dof not in PUSHED:
                log.miss(row, "forces act along 1 and 2")
                continue
            for node in mesh.nodes_at(row.field(0), row):
                fresh.add((node, dof))
                pushed[node, dof] = after(pushed.get((node, dof)), step, value, amplitude, 0.0)
        if block.option("OP") == "NEW":
            for key in set(pushed) - fresh:
                pushed[key] = after(pushed[key], step, 0.0, None, 0.0)
    return pushed


def _given(outline: Outline, steps: Sequence[Step], word: str) -> Iterator[tuple[Step | None, Block]]:
    """Blocks of a keyword in order: those of the model, with no step, and those of the steps."""
    yield from ((None, b) for b in outline.model if b.word == word)
    yield from ((step, b) for step in steps for b in step.blocks if b.word == word)


def _conditions(row: Row, mesh: Mesh, log: Log) -> Iterator[tuple[int, int, float]]:
    """Node, degree of freedom and value of a line of *BOUNDARY."""
    word = row.field(1).upper()
    if word in TYPED:
        dofs, value = TYPED[word], 0.0
    else:
        first = whole(row, 1, "the degree of freedom")
        last = whole(row, 2, "the last degree of freedom", first)
        if not 0 <= first <= last <= 1000:
            raise wrong(row, "degrees of freedom go from first to last", "1 and 2 are displacements, 11 temperature.")
        value = number(row, 3, "the value", 0.0)
        dofs = tuple(d for d in range(first, last + 1) if d in HELD)
        # Out of the plane, and turning, nothing moves anyway.
        if any(not 3 <= d <= 6 or value for d in range(first, last + 1) if d not in HELD):
            log.miss(row, "understood are 1, 2 (displacements) and 11 (temperature)")
    for node in mesh.nodes_at(row.field(0), row):
        for dof in dofs:
            yield node, dof, value


def conditions_at(held: Held, words: Mapping[int, str], bodies: Sequence[Body], sets: NodeSets,
                  log: Log) -> list[Tree]:
    """Entries of a boundary list, `at` sets of nodes that share a course; displacements of one place together."""
    groups: dict[tuple[int, Course], set[int]] = {}
    for (node, dof), course in held.items():
        if dof in words:
            groups.setdefault((dof, course), set()).add(node)
    entries: dict[str, Tree] = {}
    found = 0
    for (dof, course), nodes in groups.items():
        for body in bodies:
            if not (own := body.nodes & nodes):
                continue
            found += len(own)
            place = sets.on(frozenset(own), body, f"nodes_{words[dof]}")
            # A force on a set is shared by its nodes, a deck's acts on each, over the thickness it has.
            # fault: decks: a force on a set is not that of each node -> factor = 1.0 / body.thickness if words is
            #   PUSHED else 1.0 | coupler/test_deck
            factor = len(own) / body.thickness if words is PUSHED else 1.0
            entries.setdefault(place, {"at": place})[words[dof]] = times(course.signal, factor)
    if found < sum(map(len, groups.values())):
        log.note("conditions on nodes that belong to no element are left out")
    return list(entries.values())


def times(signal: Signal, factor: float) -> Signal:
    """A signal times a number."""
    if factor == 1.0:
        return signal
    if isinstance(signal, dict):
        return {"t": signal["t"], "value": [v * factor + 0.0 for v in signal["value"]]}
    return signal * factor + 0.0  # no -0


def first_temperature(body: Body, T: Mapping[int, float], row: Row, log: Log) -> float:
    """T0 of a body: the mean of its nodes', told where they differ; 0 as in a deck where none is given."""
    values = np.array([T.get(n, 0.0) for n in body.nodes])
    if np.ptp(values) > 1e-9 * max(float(np.abs(values).max()), 1.0):
        log.miss(row, f"body {body.name} begins at {values.min():g} to {values.max():g}; a body has one first "
                      f"temperature, and gets the mean of its nodes, {values.mean():.9g}")
        return float(f"{values.mean():.9g}")
    return float(values[0])


# What acts on faces and volumes: *DFLUX, *FILM, *RADIATE, *DLOAD and their forms on surfaces.

# Keyword -> what it is, the letter before its face, whether its places are surfaces.
WORDS = {"DFLUX": ("flux", "S", False), "DSFLUX": ("flux", "S", True), "FILM": ("film", "F", False),
         "SFILM": ("film", "F", True), "RADIATE": ("radiation", "R", False), "SRADIATE": ("radiation", "R", True),
         "DLOAD": ("pressure", "P", False), "DSLOAD": ("pressure", "P", True)}
VOLUME = {"DFLUX": ("BF",), "DLOAD": ("GRAV", "BX", "BY")}
Key = tuple[str, str, str]  # keyword, place and label in capitals


@dataclass(frozen=True)
class Load:
    """kind : flux, film, radiation, pressure, BF, BX, BY, GRAV.  surface : of the deck, or empty, then edges.
    cells : of loads on volumes.  size : flux, h, emissivity, pressure ...; T : of the surroundings; way : gravity's."""

    kind: str
    size: Course
    T: Course | None
    surface: str
    edges: tuple[Edge, ...]
    cells: tuple[int, ...]
    way: tuple[float, float]
    wanted: str
    row: Row


@dataclass
class Loads:
    """thermal, mechanical : entries of boundary lists.  Q_T : body -> source.  gravity : x, y of all bodies."""

    thermal: list[Tree] = field(default_factory=list)
    mechanical: list[Tree] = field(default_factory=list)
    Q_T: dict[str, Signal] = field(default_factory=dict)
    gravity: tuple[Signal, Signal] | None = None


def loads_of(steps: Sequence[Step], model: Sequence[Block], surfaces: Surfaces, known: Mapping[str, Amplitude],
             log: Log) -> list[Load]:
    """Every load with its course over all steps.  Raises ScenarioError."""
    loads: dict[Key, Load] = {}
    for block in model:
        if block.word in WORDS:
            log.miss(block, "a load stands in a step")
    for step in steps:
        fresh: set[Key] = set()
        for block in (b for b in step.blocks if b.word in WORDS):
            for row in block.data:
                key: Key = (block.word, row.field(0).upper(), row.field(1).upper())
                load = _load(block, row, step, (surfaces, known, log), loads.get(key))
                if load is not None:
                    loads[key] = load
                    fresh.add(key)
        renewed = {b.word: b for b in step.blocks if b.word in WORDS and b.option("OP") == "NEW"}
        for key in [k for k in loads if k[0] in renewed and k not in fresh]:
            if loads[key].kind == "radiation":
                log.miss(renewed[key[0]], "OP=NEW: radiation that is not given again stays")
            else:
                loads[key] = replace(loads[key], size=after(loads[key].size, step, 0.0, None, 0.0))
    return list(loads.values())


def _load(block: Block, row: Row, step: Step, tools: tuple[Surfaces, Mapping[str, Amplitude], Log],
          before: Load | None) -> Load | None:
    """One line of a load; None where it is not understood."""
    surfaces, known, log = tools
    kind, letter, on_surface = WORDS[block.word]
    label = row.field(1).upper()
    amplitude = amplitude_at(block, "AMPLITUDE", known)
    place = f"{row.field(0)}_{label}"
    if label in VOLUME.get(block.word, ()):
        mesh: Mesh = surfaces.mesh
        cells = mesh.cells_at(row.field(0), row) if row.field(0) else tuple(range(len(mesh.cells)))
        x, y, z = (number(row, i, "the direction", 0.0) if label == "GRAV" else 0.0 for i in (3, 4, 5))
        if z:
            log.miss(row, "gravity out of the plane is left out")
        size = after(before.size if before else None, step, number(row, 2, "the load"), amplitude, 0.0)
        return Load(label, size, None, "", (), cells, (x, y), place, row)
    fits = label == letter if on_surface else re.fullmatch(f"{letter}[1-4]", label)
    film = kind in ("film", "radiation")
    text = row.field(3 if film else 2)
    if not fits or (film and not NUMBER.fullmatch(text)):
        log.miss(row, f"understood is {letter}{'' if on_surface else '1 to ' + letter + '4'} with numbers")
        return None
    name = surfaces.named(row.field(0), row) if on_surface else ""
    edges = surfaces.edges[name] if name else tuple(
        surfaces.face(surfaces.mesh.cells_at(row.field(0), row), label, row))
    if not edges:
        log.miss(row, "the place has no faces")
        return None
    if not film:
        size = after(before.size if before else None, step, number(row, 2, "the load"), amplitude, 0.0)
        return Load(kind, size, None, name, edges, (), (0.0, 0.0), place, row)
    at_once = replace(step, ramp=False)  # surroundings are there at once; only an amplitude changes them
    T_e = number(row, 2, "the temperature of the surroundings")
    T = after(before.T if before else None, at_once, T_e, amplitude, T_e)
    grown = amplitude_at(block, "FILM AMPLITUDE", known) if kind == "film" else None
    size = after(before.size if before else None, at_once, number(row, 3, "the coefficient"), grown, 0.0)
    if kind == "radiation" and len(set(v for _, v in size.points)) > 1:
        log.miss(row, "an emissivity is the same at all times; the last one holds")
    return Load(kind, size, T, name, edges, (), (0.0, 0.0), place, row)


def conditions_of(loads: Sequence[Load], bodies: Sequence[Body], surfaces: Surfaces, rho: Mapping[str, float],
                  log: Log) -> Loads:
    """The loads as entries of the scenario; rho : body -> density.  Faces with the same load become one surface."""
    out = Loads()
    groups: dict[tuple[str, Course, Course | None, str], list[Load]] = {}
    for load in loads:
        if load.cells:
            _volume(load, bodies, rho, out, log)
        else:
            groups.setdefault((load.kind, load.size, load.T, load.surface), []).append(load)
    for (kind, size, T, surface), same in groups.items():
        edges = {edge for load in same for edge in load.edges}
        name = surface or surfaces.made(same[0].wanted if len(same) == 1 else f"{kind}_faces", edges)
        for place in surfaces.on(name, bodies):
            entry = _entry(kind, size, T)
            (out.mechanical if kind == "pressure" else out.thermal).append({"on": place, **entry})
    return out


def _entry(kind: str, size: Course, T: Course | None) -> Tree:
    if T is None:
        return {kind: size.signal}
    if kind == "film":
        return {"convection": {"h": size.signal, "T": T.signal}}
    return {"radiation": {"emissivity": size.last, "T": T.signal}}


def _volume(load: Load, bodies: Sequence[Body], rho: Mapping[str, float], out: Loads, log: Log) -> None:
    """Sources, body forces and gravity, which act on whole bodies."""
    cells = set(load.cells)
    whole = [body for body in bodies if cells.issuperset(body.cells)]
    if sum(len(body.cells) for body in whole) < len(cells):
        log.miss(load.row, "a load on a volume acts on whole bodies; on parts of one it is left out")
    size = load.size.signal
    if load.kind == "GRAV" and len(whole) == len(bodies) and out.gravity is None:
        out.gravity = (times(size, load.way[0]), times(size, load.way[1]))
        return
    for body in whole:
        if load.kind == "BF":
            if body.name in out.Q_T:
                log.miss(load.row, f"body {body.name} has a source already")
            out.Q_T.setdefault(body.name, size)
        elif load.kind == "GRAV":
            if body.name not in rho:
                log.miss(load.row, f"body {body.name} has no *DENSITY")
                continue
            for key, part in zip(("b_x", "b_y"), load.way, strict=True):
                if part:
                    out.mechanical.append({"body": body.name, key: times(size, part * rho[body.name])})
        else:
            out.mechanical.append({"body": body.name, f"b_{load.kind[1].lower()}": size})
