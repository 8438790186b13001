"""Reads *SURFACE: faces of elements as the deck names them, or the free faces of a set."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from coupler.deck.bodies import DeckBody, Names
from coupler.deck.keywords import Log
from coupler.deck.lexer import DeckLine, KeywordBlock, wrong
from coupler.deck.mesh import DeckMesh, Name
from coupler.deck.outline import Outline, named, scope_of
from coupler.scenario.document import did_you_mean

_FACE = re.compile(r"[A-Z]+([1-4])")
Edge = tuple[int, int]


@dataclass
class DeckSurfaces:
    """The surfaces of a deck.

    edges : name in the scenario -> node pairs.  of_deck : part and name in the deck -> name in the scenario.
    outer : every free edge, lower node first.  names : names the scenario has already.
    """

    mesh: DeckMesh
    names: Names
    outer: frozenset[Edge]
    edges: dict[str, tuple[Edge, ...]] = field(default_factory=dict)
    of_deck: dict[Name, str] = field(default_factory=dict)

    def named(self, reference: str, row: DeckLine) -> str:
        """Return the scenario's name of a surface of the deck.  Raises ScenarioError where there is none."""
        key = scope_of(reference, "", self.mesh.parts, row)
        if key not in self.of_deck:
            raise wrong(row, f"there is no surface {reference[:60]!r}",
                        did_you_mean(reference[:60].upper(), [name for _, name in self.of_deck]))
        return self.of_deck[key]

    def made(self, wanted: str, edges: Iterable[Edge]) -> str:
        """Add a surface and return its name; one with the same edges is used again."""
        wanted_edges = tuple(sorted(edges))
        for name, others in self.edges.items():
            if others == wanted_edges:
                return name
        name = self.names.free(wanted, "_face")
        self.edges[name] = wanted_edges
        return name

    def face(self, cells: Sequence[int], label: str, row: DeckLine) -> list[Edge]:
        """Return face S1 to S4 (F, P, R as well) of cells.  Raises ScenarioError where it is not on the outside."""
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
        """Return the free faces of cells."""
        edges = []
        for i in cells:
            nodes = self.mesh.cells[i].nodes
            edges += [e for a, b in zip(nodes, (*nodes[1:], nodes[0]), strict=True) if (e := _edge(a, b)) in self.outer]
        return edges

    def on(self, name: str, bodies: Sequence[DeckBody]) -> list[str]:
        """Return `body.surface` for every body that the surface lies on."""
        used = {n for edge in self.edges[name] for n in edge}
        return [f"{body.name}.{name}" for body in bodies if used & body.nodes]


def surfaces_of(outline: Outline, mesh: DeckMesh, names: Names, log: Log) -> DeckSurfaces:
    """Read every *SURFACE.  Raises ScenarioError for surfaces of nodes, of inner faces, or of one name."""
    count: dict[Edge, int] = {}
    for cell in mesh.cells:
        for a, b in zip(cell.nodes, (*cell.nodes[1:], cell.nodes[0]), strict=True):
            if a != b:
                edge = _edge(a, b)
                count[edge] = count.get(edge, 0) + 1
    surfaces = DeckSurfaces(mesh, names, frozenset(edge for edge, n in count.items() if n == 1))
    for scoped in outline.mesh:
        if scoped.block.word == "SURFACE":
            _surface(surfaces, scoped.block, scoped.part, log)
    return surfaces


def _surface(surfaces: DeckSurfaces, block: KeywordBlock, part: str, log: Log) -> None:
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
