"""Reads conditions at nodes: *BOUNDARY, *CLOAD and initial temperatures, where the last one given holds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from coupler.deck.bodies import DeckBody, Names
from coupler.deck.keywords import Log
from coupler.deck.lexer import DeckLine, KeywordBlock, number, whole, wrong
from coupler.deck.mesh import DeckMesh, Name
from coupler.deck.outline import Outline
from coupler.deck.steps import Amplitude, DeckStep, LoadHistory, Signal, after, amplitude_at

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
