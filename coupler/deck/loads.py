"""Reads boundary conditions and loads."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from coupler.deck.bodies import DeckBody, DeckSurfaces, Edge, Names
from coupler.deck.lexer import NUMBER, DeckLine, KeywordBlock, Log, number, whole, wrong
from coupler.deck.mesh import DeckMesh, Name
from coupler.deck.outline import Outline
from coupler.deck.steps import Amplitude, DeckStep, LoadHistory, Signal, after, amplitude_at

# Conditions at nodes: *BOUNDARY, *CLOAD and initial temperatures, where the last one given holds.

PRESCRIBED = {1: "u_x", 2: "u_y", 11: "temperature"}
FORCES = {1: "f_x", 2: "f_y"}
TYPED = {"ENCASTRE": (1, 2), "PINNED": (1, 2), "XSYMM": (1,), "YSYMM": (2,), "ZSYMM": (), "XASYMM": (2,),
         "YASYMM": (1,)}
Tree = dict[str, Any]
NodalHistories = dict[tuple[int, int], LoadHistory]  # (node, degree of freedom) -> its history


@dataclass
class NodeSets:
    """The node sets of the scenario: those of the deck that are used, and new ones.

    named : name in the scenario -> nodes.  given : nodes, or the deck's set -> name in the scenario.
    """

    mesh: DeckMesh
    names: Names
    named: dict[str, tuple[int, ...]] = field(default_factory=dict)
    given: dict[frozenset[int] | Name, str] = field(default_factory=dict)

    def on(self, nodes: frozenset[int], body: DeckBody, wanted: str) -> str:
        """Return `body.set` of these nodes of one body: a set of the deck where one fits, else a new one."""
        fits = (key for key, rows in self.mesh.node_sets.items() if body.nodes.intersection(rows) == nodes)
        key = next(fits, nodes)
        if key not in self.given:
            spelled = wanted if isinstance(key, frozenset) else self.mesh.spelled[key]
            members = nodes if isinstance(key, frozenset) else self.mesh.node_sets[key]
            self.given[key] = self.names.free(spelled, "_nodes")
            self.named[self.given[key]] = tuple(sorted(members))
        return f"{body.name}.{self.given[key]}"


def temperatures_of(outline: Outline, mesh: DeckMesh, log: Log) -> dict[int, float]:
    """Read *INITIAL CONDITIONS: node -> first temperature, in the deck's unit; the last given holds.

    Raises ScenarioError for unknown nodes and for what is not a number.
    """
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


def prescribed_of(outline: Outline, steps: Sequence[DeckStep], mesh: DeckMesh, amplitudes: Mapping[str, Amplitude],
            rest: Mapping[int, float], log: Log) -> NodalHistories:
    """Read every *BOUNDARY.  rest : node -> its first temperature, where ramps start.

    Raises ScenarioError for unknown nodes, sets and amplitudes.
    """
    prescribed: NodalHistories = {}
    for step, block in _given(outline, steps, "BOUNDARY"):
        if step is None and (block.option("OP") or block.option("AMPLITUDE")):
            log.miss(block, "before the first step a condition simply holds")
        amplitude = amplitude_at(block, "AMPLITUDE", amplitudes) if step is not None else None
        fresh = [(row, c) for row in block.data for c in _conditions(row, mesh, log)]
        if block.option("OP") == "NEW" and not {(c.node, c.dof) for _, c in fresh} >= set(prescribed):
            log.miss(block, "OP=NEW: what is not held again cannot be let go, it stays as it was")
        for row, c in fresh:
            key, first = (c.node, c.dof), rest.get(c.node, 0.0) if c.dof == 11 else 0.0
            if key not in prescribed and step is not None and step.start > 0.0:
                log.miss(row, f"begins at {step.start:g} s; a place that is held is held from time 0 on")
            prescribed[key] = after(prescribed.get(key), step, c.value, amplitude, first)
    return prescribed


def forces_of(outline: Outline, steps: Sequence[DeckStep], mesh: DeckMesh, amplitudes: Mapping[str, Amplitude],
              log: Log) -> NodalHistories:
    """Read every *CLOAD.  Raises ScenarioError for unknown nodes, sets and amplitudes."""
    forces: NodalHistories = {}
    for step, block in _given(outline, steps, "CLOAD"):
        if step is None:
            log.miss(block, "a load stands in a step")
            continue
        amplitude, fresh = amplitude_at(block, "AMPLITUDE", amplitudes), set()
        for row in block.data:
            dof, value = whole(row, 1, "the degree of freedom"), number(row, 2, "the force")
            if dof not in FORCES:
                log.miss(row, "forces act along 1 and 2")
                continue
            for node in mesh.nodes_at(row.field(0), row):
                fresh.add((node, dof))
                forces[node, dof] = after(forces.get((node, dof)), step, value, amplitude, 0.0)
        if block.option("OP") == "NEW":
            for key in set(forces) - fresh:
                forces[key] = after(forces[key], step, 0.0, None, 0.0)
    return forces


def _given(outline: Outline, steps: Sequence[DeckStep], word: str) -> Iterator[tuple[DeckStep | None, KeywordBlock]]:
    """Yield the blocks of a keyword in order: those of the model, with no step, and those of the steps."""
    yield from ((None, b) for b in outline.model if b.word == word)
    yield from ((step, b) for step in steps for b in step.blocks if b.word == word)


@dataclass(frozen=True)
class _NodeValue:
    node: int
    dof: int
    value: float


def _conditions(row: DeckLine, mesh: DeckMesh, log: Log) -> Iterator[_NodeValue]:
    """Yield node, degree of freedom and value of a line of *BOUNDARY."""
    word = row.field(1).upper()
    if word in TYPED:
        dofs, value = TYPED[word], 0.0
    else:
        first = whole(row, 1, "the degree of freedom")
        last = whole(row, 2, "the last degree of freedom", first)
        if not 0 <= first <= last <= 1000:
            raise wrong(row, "degrees of freedom go from first to last", "1 and 2 are displacements, 11 temperature.")
        value = number(row, 3, "the value", 0.0)
        dofs = tuple(d for d in range(first, last + 1) if d in PRESCRIBED)
        # Out of the plane, and turning, nothing moves anyway.
        if any(not 3 <= d <= 6 or value for d in range(first, last + 1) if d not in PRESCRIBED):
            log.miss(row, "understood are 1, 2 (displacements) and 11 (temperature)")
    for node in mesh.nodes_at(row.field(0), row):
        for dof in dofs:
            yield _NodeValue(node, dof, value)


def conditions_at(histories: NodalHistories, quantities: Mapping[int, str], bodies: Sequence[DeckBody], sets: NodeSets,
                  log: Log) -> list[Tree]:
    """Build the entries of a boundary list, one for each set of nodes with one history.

    quantities : degree of freedom -> key of the scenario.  Displacements of one set are one entry.
    """
    groups: dict[tuple[int, LoadHistory], set[int]] = {}
    for (node, dof), course in histories.items():
        if dof in quantities:
            groups.setdefault((dof, course), set()).add(node)
    entries: dict[str, Tree] = {}
    count = 0
    for (dof, course), nodes in groups.items():
        for body in bodies:
            if not (own := body.nodes & nodes):
                continue
            count += len(own)
            place = sets.on(frozenset(own), body, f"nodes_{quantities[dof]}")
            # A force on a set is shared by its nodes, a deck's acts on each, over the thickness it has.
            # fault: decks: a force on a set is not that of each node -> factor = 1.0 / body.thickness if quantities is
            #   FORCES else 1.0 | coupler/test_deck
            factor = len(own) / body.thickness if quantities is FORCES else 1.0
            entries.setdefault(place, {"at": place})[quantities[dof]] = times(course.signal, factor)
    if count < sum(map(len, groups.values())):
        log.note("conditions on nodes that belong to no element are left out")
    return list(entries.values())


def times(signal: Signal, factor: float) -> Signal:
    """Multiply a signal by a number."""
    if factor == 1.0:
        return signal
    if isinstance(signal, dict):
        return {"t": signal["t"], "value": [v * factor + 0.0 for v in signal["value"]]}
    return signal * factor + 0.0  # no -0


def first_temperature(body: DeckBody, T: Mapping[int, float], row: DeckLine, log: Log) -> float:
    """Return T0 of a body: the mean of its nodes', reported where they differ; 0 where the deck gives none."""
    values = np.array([T.get(n, 0.0) for n in body.nodes])
    if np.ptp(values) > 1e-9 * max(float(np.abs(values).max()), 1.0):
        log.miss(row, f"body {body.name} begins at {values.min():g} to {values.max():g}; a body has one first "
                      f"temperature, and gets the mean of its nodes, {values.mean():.9g}")
        return float(f"{values.mean():.9g}")
    return float(values[0])


# Loads on faces and volumes: *DFLUX, *FILM, *RADIATE, *DLOAD and their forms on surfaces.

@dataclass(frozen=True)
class _LoadForm:
    """letter : before the number of its face.  on_surface : it names surfaces, not elements."""

    kind: str
    letter: str
    on_surface: bool


FORMS = {"DFLUX": _LoadForm("flux", "S", False), "DSFLUX": _LoadForm("flux", "S", True),
         "FILM": _LoadForm("film", "F", False), "SFILM": _LoadForm("film", "F", True),
         "RADIATE": _LoadForm("radiation", "R", False), "SRADIATE": _LoadForm("radiation", "R", True),
         "DLOAD": _LoadForm("pressure", "P", False), "DSLOAD": _LoadForm("pressure", "P", True)}
VOLUME = {"DFLUX": ("BF",), "DLOAD": ("GRAV", "BX", "BY")}
Key = tuple[str, str, str]  # keyword, place and label in capitals


@dataclass(frozen=True)
class Load:
    """One load with its history.

    kind : flux, film, radiation, pressure, BF, BX, BY, GRAV.  size : flux, h, emissivity, pressure ...
    T : of the surroundings.  surface : of the deck; where it is empty, edges.  cells : of loads on volumes.
    direction : of gravity.  label : of the surface that is made for it.
    """

    kind: str
    size: LoadHistory
    T: LoadHistory | None
    surface: str
    edges: tuple[Edge, ...]
    cells: tuple[int, ...]
    direction: tuple[float, float]
    label: str
    row: DeckLine


@dataclass
class BoundaryEntries:
    """The loads as the scenario has them.

    thermal, mechanical : entries of boundary lists.  Q_T : body -> heat source.  gravity : x, y, of all bodies.
    """

    thermal: list[Tree] = field(default_factory=list)
    mechanical: list[Tree] = field(default_factory=list)
    Q_T: dict[str, Signal] = field(default_factory=dict)
    gravity: tuple[Signal, Signal] | None = None


def loads_of(steps: Sequence[DeckStep], model: Sequence[KeywordBlock], surfaces: DeckSurfaces,
             amplitudes: Mapping[str, Amplitude], log: Log) -> list[Load]:
    """Read every load with its history over all steps.

    Raises ScenarioError for unknown surfaces, sets, faces and amplitudes.
    """
    reader = _LoadReader(surfaces, amplitudes, log)
    loads: dict[Key, Load] = {}
    for block in model:
        if block.word in FORMS:
            log.miss(block, "a load stands in a step")
    for step in steps:
        fresh: set[Key] = set()
        for block in (b for b in step.blocks if b.word in FORMS):
            for row in block.data:
                key: Key = (block.word, row.field(0).upper(), row.field(1).upper())
                load = reader.read(block, row, step, loads.get(key))
                if load is not None:
                    loads[key] = load
                    fresh.add(key)
        renewed = {b.word: b for b in step.blocks if b.word in FORMS and b.option("OP") == "NEW"}
        for key in [k for k in loads if k[0] in renewed and k not in fresh]:
            if loads[key].kind == "radiation":
                log.miss(renewed[key[0]], "OP=NEW: radiation that is not given again stays")
            else:
                loads[key] = replace(loads[key], size=after(loads[key].size, step, 0.0, None, 0.0))
    return list(loads.values())


@dataclass(frozen=True)
class _LoadReader:
    surfaces: DeckSurfaces
    amplitudes: Mapping[str, Amplitude]
    log: Log

    def read(self, block: KeywordBlock, row: DeckLine, step: DeckStep, before: Load | None) -> Load | None:
        """Read one line of a load; None where it is not understood.  before : the load in the steps before."""
        surfaces, log = self.surfaces, self.log
        form = FORMS[block.word]
        kind, letter, on_surface = form.kind, form.letter, form.on_surface
        label = row.field(1).upper()
        amplitude = amplitude_at(block, "AMPLITUDE", self.amplitudes)
        place = f"{row.field(0)}_{label}"
        if label in VOLUME.get(block.word, ()):
            mesh: DeckMesh = surfaces.mesh
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
        grown = amplitude_at(block, "FILM AMPLITUDE", self.amplitudes) if kind == "film" else None
        size = after(before.size if before else None, at_once, number(row, 3, "the coefficient"), grown, 0.0)
        if kind == "radiation" and len(set(v for _, v in size.points)) > 1:
            log.miss(row, "an emissivity is the same at all times; the last one holds")
        return Load(kind, size, T, name, edges, (), (0.0, 0.0), place, row)


def conditions_of(loads: Sequence[Load], bodies: Sequence[DeckBody], surfaces: DeckSurfaces, rho: Mapping[str, float],
                  log: Log) -> BoundaryEntries:
    """Build the entries of the scenario; faces with the same load become one surface.

    rho : body -> density, in the deck's unit.
    """
    out = BoundaryEntries()
    groups: dict[tuple[str, LoadHistory, LoadHistory | None, str], list[Load]] = {}
    for load in loads:
        if load.cells:
            _volume(load, bodies, rho, out, log)
        else:
            groups.setdefault((load.kind, load.size, load.T, load.surface), []).append(load)
    for (kind, size, T, surface), same in groups.items():
        edges = {edge for load in same for edge in load.edges}
        name = surface or surfaces.made(same[0].label if len(same) == 1 else f"{kind}_faces", edges)
        for place in surfaces.on(name, bodies):
            entry = _entry(kind, size, T)
            (out.mechanical if kind == "pressure" else out.thermal).append({"on": place, **entry})
    return out


def _entry(kind: str, size: LoadHistory, T: LoadHistory | None) -> Tree:
    if T is None:
        return {kind: size.signal}
    if kind == "film":
        return {"convection": {"h": size.signal, "T": T.signal}}
    return {"radiation": {"emissivity": size.last, "T": T.signal}}


def _volume(load: Load, bodies: Sequence[DeckBody], rho: Mapping[str, float], out: BoundaryEntries, log: Log) -> None:
    """Add sources, body forces and gravity, which act on whole bodies."""
    cells = set(load.cells)
    whole = [body for body in bodies if cells.issuperset(body.cells)]
    if sum(len(body.cells) for body in whole) < len(cells):
        log.miss(load.row, "a load on a volume acts on whole bodies; on parts of one it is left out")
    size = load.size.signal
    if load.kind == "GRAV" and len(whole) == len(bodies) and out.gravity is None:
        out.gravity = (times(size, load.direction[0]), times(size, load.direction[1]))
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
            for key, part in zip(("b_x", "b_y"), load.direction, strict=True):
                if part:
                    out.mechanical.append({"body": body.name, key: times(size, part * rho[body.name])})
        else:
            out.mechanical.append({"body": body.name, f"b_{load.kind[1].lower()}": size})
