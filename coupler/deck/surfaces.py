"""Surfaces: faces of cells as the deck names them, or the free ones of a set."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from coupler.deck.bodies import Body, Names
from coupler.deck.lexer import Block, Row, wrong
from coupler.deck.log import Log
from coupler.deck.mesh import Mesh, Name
from coupler.deck.outline import Outline, named, scope_of
from coupler.scenario.quantity import did_you_mean

_FACE = re.compile(r"[A-Z]+([1-4])")
Edge = tuple[int, int]


@dataclass
class Surfaces:
    """edges : name in the scenario -> node pairs.  of_deck : part and name in the deck -> name in the scenario.
    outer : every free edge, lower node first.  names : the store of names."""

    mesh: Mesh
    names: Names
    outer: frozenset[Edge]
    edges: dict[str, tuple[Edge, ...]] = field(default_factory=dict)
    of_deck: dict[Name, str] = field(default_factory=dict)

    def named(self, reference: str, row: Row) -> str:
        """The scenario's name of a surface of the deck.  Raises ScenarioError where there is none."""
        key = scope_of(reference, "", self.mesh.parts, row)
        if key not in self.of_deck:
            raise wrong(row, f"there is no surface {reference[:60]!r}",
                        did_you_mean(reference[:60].upper(), [name for _, name in self.of_deck]))
        return self.of_deck[key]

    def made(self, wanted: str, edges: Iterable[Edge]) -> str:
        """A surface of its own; one with the same edges is used again."""
        found = tuple(sorted(edges))
        for name, known in self.edges.items():
            if known == found:
                return name
        name = self.names.free(wanted, "_face")
        self.edges[name] = found
        return name

    def face(self, cells: Sequence[int], label: str, row: Row) -> list[Edge]:
        """The face S1 to S4 (F, P, R as well) of cells.  Raises ScenarioError where it is not on the outside."""
        match = _FACE.fullmatch(label)
        out = []
        for i in cells:
            nodes = self.mesh.cells[i].nodes
            k = int(match[1]) if match else 0
            if not 1 <= k <= len(nodes):
                raise wrong(row, f"an element of {len(nodes)} nodes has no face {label[:10]!r}",
                            f"Its faces are 1 to {len(nodes)}.")
            edge = _edge(nodes[k - 1], nodes[k % len(nodes)])
            if edge[0] == edge[1]:
                continue
            if edge not in self.outer:
                raise wrong(row, f"face {k} of an element lies inside its body",
                            "Surfaces are made of outer faces; leave the face out, then the free ones are taken.")
            out.append(edge)
        return out

    def free(self, cells: Sequence[int]) -> list[Edge]:
        """The free faces of cells."""
        found = []
        for i in cells:
            nodes = self.mesh.cells[i].nodes
            found += [e for a, b in zip(nodes, (*nodes[1:], nodes[0]), strict=True) if (e := _edge(a, b)) in self.outer]
        return found

    def on(self, name: str, bodies: Sequence[Body]) -> list[str]:
        """`body.surface` for every body the surface lies on."""
        used = {n for edge in self.edges[name] for n in edge}
        return [f"{body.name}.{name}" for body in bodies if used & body.nodes]


def surfaces_of(outline: Outline, mesh: Mesh, names: Names, log: Log) -> Surfaces:
    """Every *SURFACE.  Raises ScenarioError."""
    count: dict[Edge, int] = {}
    for cell in mesh.cells:
        for a, b in zip(cell.nodes, (*cell.nodes[1:], cell.nodes[0]), strict=True):
            if a != b:
                edge = _edge(a, b)
                count[edge] = count.get(edge, 0) + 1
    surfaces = Surfaces(mesh, names, frozenset(edge for edge, n in count.items() if n == 1))
    for scoped in outline.mesh:
        if scoped.block.word == "SURFACE":
            _surface(surfaces, scoped.block, scoped.part, log)
    return surfaces


def _surface(surfaces: Surfaces, block: Block, part: str, log: Log) -> None:
    kind = block.option("TYPE") or "ELEMENT"
    if kind != "ELEMENT":
        raise wrong(block.row, f"surfaces of type {kind[:20]} are not understood",
                    "Write TYPE=ELEMENT: a set of elements and its face S1 to S4, or no face for the free ones.")
    mesh, edges = surfaces.mesh, []
    for row in block.data:
        if not row.field(0):
            edges += surfaces.free(range(len(mesh.cells)))
            continue
        cells, label = mesh.cells_at(row.field(0), row, part), row.field(1).upper()
        edges += surfaces.face(cells, label, row) if label else surfaces.free(cells)
    name = named(block, "NAME")
    if (part, name) in surfaces.of_deck:
        raise wrong(block.row, f"surface {name[:60]} is there twice", "Give each a name of its own.")
    if not edges:
        log.miss(block, "the surface has no faces")
    surfaces.of_deck[part, name] = surfaces.names.free(block.options["NAME"], "_surface")
    surfaces.edges[surfaces.of_deck[part, name]] = tuple(sorted(set(edges)))


def _edge(a: int, b: int) -> Edge:
    return (a, b) if a < b else (b, a)
