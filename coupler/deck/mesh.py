"""Reads the mesh of a deck: nodes, elements and their sets (*NODE, *ELEMENT, *NSET, *ELSET)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from contact.problem.values import did_you_mean
from coupler.deck.lexer import DeckLine, KeywordBlock, Log, is_whole, number, whole, wrong
from coupler.deck.outline import Outline, named, scope_of

PLANE = re.compile(r"(CPE|CPS|CAX)([34])([RHIT]*)")
HEAT = re.compile(r"(DC2D|DCAX)([34])")
LINE = "T3D2"
Key = tuple[str, int]  # part, number in the deck
Name = tuple[str, str]  # part, name in capitals


@dataclass(frozen=True)
class ElementType:
    """An element type of the deck.

    family : CPE, CPS, CAX, DC2D, DCAX.  corners : 3 or 4.  letters : what follows, such as RT.
    """

    family: str
    corners: int
    letters: str


@dataclass(frozen=True)
class DeckCell:
    """An element.  nodes : its corners in the deck's order, rows of DeckMesh.points.  row : its line."""

    nodes: tuple[int, ...]
    kind: ElementType
    row: DeckLine


@dataclass
class DeckMesh:
    """The mesh of a deck.

    points : (n, 2) coordinates in the deck's length unit.  node_of, cell_of : part and number -> row.
    node_sets, cell_sets : rows, sorted.  spelled : a set's name as the deck has it.  parts : instance -> part.
    lines, line_sets : numbers and sets of lines that stand beside the cells; they are no cells.
    """

    parts: Mapping[str, str]
    points: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    node_of: dict[Key, int] = field(default_factory=dict)
    cells: list[DeckCell] = field(default_factory=list)
    cell_of: dict[Key, int] = field(default_factory=dict)
    node_sets: dict[Name, tuple[int, ...]] = field(default_factory=dict)
    cell_sets: dict[Name, tuple[int, ...]] = field(default_factory=dict)
    spelled: dict[Name, str] = field(default_factory=dict)
    lines: set[Key] = field(default_factory=set)
    line_sets: set[Name] = field(default_factory=set)

    def nodes_at(self, reference: str, row: DeckLine, part: str = "") -> tuple[int, ...]:
        """Return the nodes of a set or of one number.  Raises ScenarioError where there are none of that name."""
        return self._at(reference, row, part, self.node_of, self.node_sets, "node")

    def cells_at(self, reference: str, row: DeckLine, part: str = "") -> tuple[int, ...]:
        """Return the cells of a set or of one number.  Raises ScenarioError where there are none of that name."""
        return self._at(reference, row, part, self.cell_of, self.cell_sets, "element")

    def _at(self, reference: str, row: DeckLine, part: str, one: Mapping[Key, int],
            sets: Mapping[Name, tuple[int, ...]], what: str) -> tuple[int, ...]:
        scope, name = scope_of(reference, part, self.parts, row)
        if is_whole(name):
            if one is self.cell_of and (scope, int(name)) in self.lines:
                return ()
            if (scope, int(name)) not in one:
                raise wrong(row, f"there is no {what} {int(name)}")
            return (one[scope, int(name)],)
        if (scope, name) not in sets:
            names = [n for s, n in sets if s == scope]
            raise wrong(row, f"there is no set of {what}s {name[:60]!r}", did_you_mean(name[:60], names))
        return sets[scope, name]


def mesh_of(outline: Outline, log: Log) -> DeckMesh:
    """Read the mesh blocks in order.  Raises ScenarioError, naming the line."""
    mesh = DeckMesh(outline.parts)
    placed = _Placed()
    for word in ("NODE", "ELEMENT", "SETS"):  # sets may stand before what they hold
        for scoped in outline.mesh:
            block, part = scoped.block, scoped.part
            if word == "NODE" == block.word:
                _nodes(mesh, block, part, outline.shifts.get(part, (0.0, 0.0)), placed)
            elif word == "ELEMENT" == block.word:
                _cells(mesh, block, part, log)
            elif word == "SETS" and block.word in ("NSET", "ELSET"):
                _set(mesh, block, part, log)
    if not placed.points or not mesh.cells:
        row = outline.mesh[0].block.row if outline.mesh else DeckLine("", 0, "", ())
        raise wrong(row, "the deck has no mesh", "It needs *NODE and *ELEMENT.")
    mesh.points = np.array(placed.points)
    slack = 1e-9 * max(float(np.ptp(mesh.points, axis=0).max()), 1e-300)
    for z, row in zip(placed.depths, placed.rows, strict=True):
        if abs(z - placed.depths[0]) > slack:
            raise wrong(row, "the mesh does not lie in a plane z = constant", "Only plane and axisymmetric decks.")
    return mesh


@dataclass
class _Placed:
    """The nodes so far.  points : x, y.  depths : z.  rows : their lines."""

    points: list[tuple[float, float]] = field(default_factory=list)
    depths: list[float] = field(default_factory=list)
    rows: list[DeckLine] = field(default_factory=list)


def _nodes(mesh: DeckMesh, block: KeywordBlock, part: str, shift: tuple[float, float], placed: _Placed) -> None:
    rows = []
    for row in block.data:
        key = (part, whole(row, 0, "the number of a node"))
        x, y, z = (number(row, i, "a coordinate", 0.0) for i in (1, 2, 3))
        at = (x + shift[0], y + shift[1])
        if key in mesh.node_of:
            if placed.points[mesh.node_of[key]] != at:
                raise wrong(row, f"node {key[1]} is there twice", "Give each node a number of its own.")
        else:
            mesh.node_of[key] = len(placed.points)
            placed.points.append(at)
            placed.depths.append(z)
            placed.rows.append(row)
        rows.append(mesh.node_of[key])
    if block.option("NSET"):
        _add(mesh, mesh.node_sets, (part, block.option("NSET")), block.options["NSET"], rows)


def kind_of(block: KeywordBlock) -> ElementType:
    """Return the element type of an *ELEMENT.  Raises ScenarioError for one that is not plane and of first order."""
    word = named(block, "TYPE")
    match = PLANE.fullmatch(word) or HEAT.fullmatch(word)
    if match is None:
        second = re.match(r"(CPE|CPS|CAX|DC2D|DCAX)(6|8)", word)
        remedy = ("Mesh with elements of first order: CPE4, CAX4, DC2D4 and their like." if second else
                  "Only plane and axisymmetric solids are solved for: CPE3/4, CPS3/4, CAX3/4, DC2D3/4, DCAX3/4.")
        raise wrong(block.row, f"elements of type {word[:40]} are not understood", remedy)
    return ElementType(match[1], int(match[2]), match[3] if match.re is PLANE else "")


def _lines(mesh: DeckMesh, block: KeywordBlock, part: str, log: Log) -> None:
    """Leave out lines, as gmsh writes them beside the cells: without a section they carry nothing."""
    mesh.lines.update((part, whole(row, 0, "the number of an element")) for row in block.data)
    if block.option("ELSET"):
        mesh.line_sets.add((part, block.option("ELSET")))
        _add(mesh, mesh.cell_sets, (part, block.option("ELSET")), block.options["ELSET"], ())
    log.miss(block, "lines without a section, as mesh generators write them beside the cells: left out")


def _cells(mesh: DeckMesh, block: KeywordBlock, part: str, log: Log) -> None:
    # fault: decks: the lines that gmsh writes are an error -> if False: | coupler/test_deck
    if named(block, "TYPE") == LINE:
        _lines(mesh, block, part, log)
        return
    kind, rows = kind_of(block), []
    lines = iter(block.data)
    for row in lines:
        fields = row.fields
        while len([f for f in fields if f]) < kind.corners + 1 and (more := next(lines, None)) is not None:
            fields = (*(f for f in fields if f), *more.fields)  # a cell may go on in the next line
        whole_row = DeckLine(row.file, row.line, row.text, tuple(f for f in fields if f))
        if len(whole_row.fields) != kind.corners + 1:
            raise wrong(row, f"an element of this type has its number and {kind.corners} nodes")
        key = (part, whole(whole_row, 0, "the number of an element"))
        if key in mesh.cell_of:
            raise wrong(row, f"element {key[1]} is there twice", "Give each element a number of its own.")
        nodes = tuple(_node(mesh, whole_row, i, part) for i in range(1, kind.corners + 1))
        if len(set(nodes)) < kind.corners:
            log.note("quadrilaterals that fall together in a corner are triangles")
        if len(set(nodes)) < 3 or (len(set(nodes)) < kind.corners and nodes[0] == nodes[2]):
            raise wrong(row, "this element has no area: a node of it is there twice")
        mesh.cell_of[key] = len(mesh.cells)
        rows.append(len(mesh.cells))
        mesh.cells.append(DeckCell(nodes, kind, row))
    if block.option("ELSET"):
        _add(mesh, mesh.cell_sets, (part, block.option("ELSET")), block.options["ELSET"], rows)


def _node(mesh: DeckMesh, row: DeckLine, i: int, part: str) -> int:
    key = (part, whole(row, i, "a node"))
    if key not in mesh.node_of:
        raise wrong(row, f"there is no node {key[1]}")
    return mesh.node_of[key]


def _set(mesh: DeckMesh, block: KeywordBlock, part: str, log: Log) -> None:
    """Read an *NSET or *ELSET: numbers, names of earlier sets, ranges."""
    name = named(block, block.word)
    scope = part
    if block.option("INSTANCE"):
        scope = scope_of(f"{block.option('INSTANCE')}.X", part, mesh.parts, block.row)[0]
    at: Callable[[str, DeckLine, str], tuple[int, ...]] = mesh.nodes_at if block.word == "NSET" else mesh.cells_at
    sets = mesh.node_sets if block.word == "NSET" else mesh.cell_sets
    rows_of = mesh.node_of if block.word == "NSET" else mesh.cell_of
    rows: set[int] = set()
    for row in block.data:
        if "GENERATE" in block.options:
            rows.update(_range(rows_of, row, scope, log))
        else:
            rows.update(member for text in row.fields if text for member in at(text, row, scope))
    if block.word == "NSET" and "ELSET" in block.options:
        rows.update(n for c in mesh.cells_at(block.options["ELSET"], block.row, scope) for n in mesh.cells[c].nodes)
    _add(mesh, sets, (part, name), block.options[block.word], rows)


def _range(rows_of: Mapping[Key, int], row: DeckLine, scope: str, log: Log) -> list[int]:
    first, last = whole(row, 0, "first"), whole(row, 1, "last", whole(row, 0, "first"))
    step = whole(row, 2, "the step", 1)
    if step < 1 or last < first:
        raise wrong(row, "a range goes from first to last by a step of 1 or more")
    numbers = range(first, last + 1, step)
    # A range may name more numbers than the deck has: the shorter of the two is gone through.
    rows = ([rows_of[scope, i] for i in numbers if (scope, i) in rows_of] if len(numbers) < len(rows_of)
             # fault: decks: a range finds numbers of other steps -> else [n for (part, i), n in rows_of.items() if part
             #   == scope]) | coupler/test_deck_hostile
             else [n for (part, i), n in rows_of.items() if part == scope and i in numbers])
    if len(rows) < len(numbers):
        log.miss(row, f"{len(numbers) - len(rows)} numbers of this range do not exist; the others are taken")
    return rows


def _add(mesh: DeckMesh, sets: dict[Name, tuple[int, ...]], key: Name, spelled: str, rows: Iterable[int]) -> None:
    sets[key] = tuple(sorted({*sets.get(key, ()), *rows}))
    mesh.spelled.setdefault(key, spelled)
