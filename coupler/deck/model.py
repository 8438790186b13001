"""Nodes, cells and their sets, out of *NODE, *ELEMENT, *NSET and *ELSET."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, count

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from coupler.deck.lexer import Block, Log, Row, is_whole, number, whole, wrong
from coupler.scenario.document import did_you_mean

# What belongs to what: parts and their instance, materials, interactions, steps.

MATERIAL = ("ELASTIC", "EXPANSION", "CONDUCTIVITY", "SPECIFIC HEAT", "DENSITY", "PLASTIC", "LATENT HEAT",
            "INELASTIC HEAT FRACTION")
INTERACTION = ("SURFACE BEHAVIOR", "GAP CONDUCTANCE", "GAP RADIATION", "GAP HEAT GENERATION", "FRICTION")
SCOPED = ("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "SOLID SECTION")
MAX_STEPS = 1000


@dataclass(frozen=True)
class Scoped:
    """A block and the part it stands in, empty outside of parts."""

    block: Block
    part: str


@dataclass(frozen=True)
class Owner:
    """A *MATERIAL, *SURFACE INTERACTION or *STEP, and the blocks that are its own."""

    block: Block
    own: list[Block] = field(default_factory=list)


@dataclass(frozen=True)
class Outline:
    """mesh : blocks of meshes.  parts : instance -> part, in capitals.  spelled : part -> instance as written.
    shifts : part -> translation.  model : blocks outside of all that.  materials, interactions : name -> owner."""

    title: str
    mesh: Sequence[Scoped]
    parts: Mapping[str, str]
    spelled: Mapping[str, str]
    shifts: Mapping[str, tuple[float, float]]
    materials: Mapping[str, Owner]
    interactions: Mapping[str, Owner]
    steps: Sequence[Owner]
    model: Sequence[Block]


@dataclass
class _Sorting:
    """Where the walk through the blocks stands."""

    part: str = ""
    material: Owner | None = None
    interaction: Owner | None = None
    step: Owner | None = None
    title: str = ""
    mesh: list[Scoped] = field(default_factory=list)
    parts: dict[str, str] = field(default_factory=dict)
    spelled: dict[str, str] = field(default_factory=dict)
    shifts: dict[str, tuple[float, float]] = field(default_factory=dict)
    materials: dict[str, Owner] = field(default_factory=dict)
    interactions: dict[str, Owner] = field(default_factory=dict)
    steps: list[Owner] = field(default_factory=list)
    model: list[Block] = field(default_factory=list)

    def take(self, block: Block) -> None:
        """Put one block where it belongs."""
        word = block.word
        if word in ("PART", "INSTANCE", "END PART", "END INSTANCE"):
            self._scope(block)
        elif word in ("MATERIAL", "SURFACE INTERACTION"):
            self._owner(block)
        elif word in MATERIAL + INTERACTION:
            owner = self.material if word in MATERIAL else self.interaction
            if owner is None:
                need = "*MATERIAL" if word in MATERIAL else "*SURFACE INTERACTION"
                raise wrong(block.row, f"*{word} belongs to a {need}, and there is none before it")
            owner.own.append(block)
        elif word == "STEP":
            self.step = Owner(block)
            self.steps.append(self.step)
            if len(self.steps) > MAX_STEPS:
                raise wrong(block.row, f"more than {MAX_STEPS} steps")
        elif word == "END STEP":
            self.step = None
        elif word in SCOPED:
            self.mesh.append(Scoped(block, self.part))
        elif word == "HEADING":
            self.title = self.title or (block.data[0].shown if block.data else "")
        elif word not in ("ASSEMBLY", "END ASSEMBLY"):
            (self.step.own if self.step else self.model).append(block)

    def _owner(self, block: Block) -> None:
        kept = self.materials if block.word == "MATERIAL" else self.interactions
        name = named(block, "NAME")
        if name in kept:
            raise wrong(block.row, f"*{block.word} {name} is there twice", "Give each a name of its own.")
        kept[name] = Owner(block)
        if block.word == "MATERIAL":
            self.material = kept[name]
        else:
            self.interaction = kept[name]

    def _scope(self, block: Block) -> None:
        if block.word.startswith("END"):
            self.part = ""
        elif block.word == "PART":
            self.part = named(block, "NAME")
        else:
            self.part = self._instance(block)

    def _instance(self, block: Block) -> str:
        part, name = named(block, "PART"), named(block, "NAME")
        if part in self.parts.values():
            raise wrong(block.row, f"part {part} has two instances", "Write the deck flat, or copy the part.")
        if len(block.data) > 1:
            raise wrong(block.data[1], "an instance may be moved, but not turned", "Turn the part's own mesh.")
        self.parts[name], self.spelled[part] = part, block.options["NAME"]
        if block.data:
            x, y, z = (number(block.data[0], i, "a translation", 0.0) for i in range(3))
            if z:
                raise wrong(block.data[0], "an instance leaves the plane", "All bodies lie in the x-y plane.")
            self.shifts[part] = (x, y)
        return part


def named(block: Block, option: str) -> str:
    """The name a keyword line must give, in capitals.  Raises ScenarioError."""
    name = block.option(option)
    if not name or len(name) > 200:
        raise wrong(block.row, f"*{block.word} needs {option}=...")
    return name


def outline_of(blocks: Sequence[Block]) -> Outline:
    """Sort a deck's blocks.  Raises ScenarioError where one stands where it means nothing."""
    s = _Sorting()
    for block in blocks:
        s.take(block)
    for scoped in s.mesh:
        if scoped.part and scoped.part not in s.parts.values():
            raise wrong(scoped.block.row, f"part {scoped.part} has no instance",
                        "Add *INSTANCE to the assembly, or take the part out.")
    return Outline(s.title, s.mesh, s.parts, s.spelled, s.shifts, s.materials, s.interactions, s.steps, s.model)


def scope_of(reference: str, part: str, parts: Mapping[str, str], row: Row) -> tuple[str, str]:
    """(part, name in capitals) of a reference, which may say INSTANCE.NAME.  Raises ScenarioError."""
    name = reference.strip('"').upper()
    instance, dot, inner = name.partition(".")
    if dot and parts:
        if instance not in parts:
            raise wrong(row, f"there is no instance {instance}", f"Known here: {', '.join(parts)}.")
        return parts[instance], inner
    return part, name


PLANE = re.compile(r"(CPE|CPS|CAX)([34])([RHIT]*)")
HEAT = re.compile(r"(DC2D|DCAX)([34])")
Key = tuple[str, int]  # part, number in the deck
Name = tuple[str, str]  # part, name in capitals


@dataclass(frozen=True)
class Kind:
    """family : CPE, CPS, CAX, DC2D, DCAX.  corners : 3 or 4.  letters : what follows, such as RT."""

    family: str
    corners: int
    letters: str


@dataclass(frozen=True)
class Cell:
    """nodes : corners as the deck gives them, by row of Mesh.points.  row : its line."""

    nodes: tuple[int, ...]
    kind: Kind
    row: Row


@dataclass
class Mesh:
    """points : (n, 2), as written.  node_of, cell_of : part and number -> row.  node_sets, cell_sets : rows, sorted;
    spelled : a set's name as the deck has it.  parts : instance -> part."""

    parts: Mapping[str, str]
    points: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    node_of: dict[Key, int] = field(default_factory=dict)
    cells: list[Cell] = field(default_factory=list)
    cell_of: dict[Key, int] = field(default_factory=dict)
    node_sets: dict[Name, tuple[int, ...]] = field(default_factory=dict)
    cell_sets: dict[Name, tuple[int, ...]] = field(default_factory=dict)
    spelled: dict[Name, str] = field(default_factory=dict)

    def nodes_at(self, reference: str, row: Row, part: str = "") -> tuple[int, ...]:
        """Nodes of a set or of one number.  Raises ScenarioError where there are none of that name."""
        return self._at(reference, row, part, self.node_of, self.node_sets, "node")

    def cells_at(self, reference: str, row: Row, part: str = "") -> tuple[int, ...]:
        """Cells of a set or of one number.  Raises ScenarioError where there are none of that name."""
        return self._at(reference, row, part, self.cell_of, self.cell_sets, "element")

    def _at(self, reference: str, row: Row, part: str, one: Mapping[Key, int], sets: Mapping[Name, tuple[int, ...]],
            what: str) -> tuple[int, ...]:
        scope, name = scope_of(reference, part, self.parts, row)
        if is_whole(name):
            if (scope, int(name)) not in one:
                raise wrong(row, f"there is no {what} {int(name)}")
            return (one[scope, int(name)],)
        if (scope, name) not in sets:
            known = [n for s, n in sets if s == scope]
            raise wrong(row, f"there is no set of {what}s {name[:60]!r}", did_you_mean(name[:60], known))
        return sets[scope, name]


def mesh_of(outline: Outline, log: Log) -> Mesh:
    """Read the mesh blocks in order.  Raises ScenarioError, naming the line."""
    mesh = Mesh(outline.parts)
    points: list[tuple[float, float]] = []
    depths: list[tuple[float, Row]] = []
    for word in ("NODE", "ELEMENT", "SETS"):  # sets may stand before what they hold
        for scoped in outline.mesh:
            block, part = scoped.block, scoped.part
            if word == "NODE" == block.word:
                _nodes(mesh, block, part, outline.shifts.get(part, (0.0, 0.0)), (points, depths))
            elif word == "ELEMENT" == block.word:
                _cells(mesh, block, part, log)
            elif word == "SETS" and block.word in ("NSET", "ELSET"):
                _set(mesh, block, part, log)
    if not points or not mesh.cells:
        row = outline.mesh[0].block.row if outline.mesh else Row("", 0, "", ())
        raise wrong(row, "the deck has no mesh", "It needs *NODE and *ELEMENT.")
    mesh.points = np.array(points)
    slack = 1e-9 * max(float(np.ptp(mesh.points, axis=0).max()), 1e-300)
    for z, row in depths:
        if abs(z - depths[0][0]) > slack:
            raise wrong(row, "the mesh does not lie in a plane z = constant", "Only plane and axisymmetric decks.")
    return mesh


def _nodes(mesh: Mesh, block: Block, part: str, shift: tuple[float, float],
           out: tuple[list[tuple[float, float]], list[tuple[float, Row]]]) -> None:
    points, depths = out
    rows = []
    for row in block.data:
        key = (part, whole(row, 0, "the number of a node"))
        x, y, z = (number(row, i, "a coordinate", 0.0) for i in (1, 2, 3))
        at = (x + shift[0], y + shift[1])
        if key in mesh.node_of:
            if points[mesh.node_of[key]] != at:
                raise wrong(row, f"node {key[1]} is there twice", "Give each node a number of its own.")
        else:
            mesh.node_of[key] = len(points)
            points.append(at)
            depths.append((z, row))
        rows.append(mesh.node_of[key])
    if block.option("NSET"):
        _add(mesh, mesh.node_sets, (part, block.option("NSET")), block.options["NSET"], rows)


def kind_of(block: Block) -> Kind:
    """The kind of cell an *ELEMENT asks for.  Raises ScenarioError naming what is not plane and of first order."""
    word = named(block, "TYPE")
    match = PLANE.fullmatch(word) or HEAT.fullmatch(word)
    if match is None:
        second = re.match(r"(CPE|CPS|CAX|DC2D|DCAX)(6|8)", word)
        remedy = ("Mesh with elements of first order: CPE4, CAX4, DC2D4 and their like." if second else
                  "Only plane and axisymmetric solids are solved for: CPE3/4, CPS3/4, CAX3/4, DC2D3/4, DCAX3/4.")
        raise wrong(block.row, f"elements of type {word[:40]} are not understood", remedy)
    return Kind(match[1], int(match[2]), match[3] if match.re is PLANE else "")


def _cells(mesh: Mesh, block: Block, part: str, log: Log) -> None:
    kind, rows = kind_of(block), []
    lines = iter(block.data)
    for row in lines:
        fields = row.fields
        while len([f for f in fields if f]) < kind.corners + 1 and (more := next(lines, None)) is not None:
            fields = (*(f for f in fields if f), *more.fields)  # a cell may go on in the next line
        whole_row = Row(row.file, row.line, row.text, tuple(f for f in fields if f))
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
        mesh.cells.append(Cell(nodes, kind, row))
    if block.option("ELSET"):
        _add(mesh, mesh.cell_sets, (part, block.option("ELSET")), block.options["ELSET"], rows)


def _node(mesh: Mesh, row: Row, i: int, part: str) -> int:
    key = (part, whole(row, i, "a node"))
    if key not in mesh.node_of:
        raise wrong(row, f"there is no node {key[1]}")
    return mesh.node_of[key]


def _set(mesh: Mesh, block: Block, part: str, log: Log) -> None:
    """An *NSET or *ELSET: numbers, names of earlier sets, ranges."""
    name = named(block, block.word)
    scope = part
    if block.option("INSTANCE"):
        scope = scope_of(f"{block.option('INSTANCE')}.X", part, mesh.parts, block.row)[0]
    at: Callable[[str, Row, str], tuple[int, ...]] = mesh.nodes_at if block.word == "NSET" else mesh.cells_at
    sets = mesh.node_sets if block.word == "NSET" else mesh.cell_sets
    known = mesh.node_of if block.word == "NSET" else mesh.cell_of
    rows: set[int] = set()
    for row in block.data:
        if "GENERATE" in block.options:
            rows.update(_range(known, row, scope, log))
        else:
            rows.update(member for text in row.fields if text for member in at(text, row, scope))
    if block.word == "NSET" and "ELSET" in block.options:
        rows.update(n for c in mesh.cells_at(block.options["ELSET"], block.row, scope) for n in mesh.cells[c].nodes)
    _add(mesh, sets, (part, name), block.options[block.word], rows)


def _range(known: Mapping[Key, int], row: Row, scope: str, log: Log) -> list[int]:
    first, last = whole(row, 0, "first"), whole(row, 1, "last", whole(row, 0, "first"))
    step = whole(row, 2, "the step", 1)
    if step < 1 or last < first:
        raise wrong(row, "a range goes from first to last by a step of 1 or more")
    asked = range(first, last + 1, step)
    # A range may name more numbers than the deck has: the shorter of the two is gone through.
    there = ([known[scope, i] for i in asked if (scope, i) in known] if len(asked) < len(known)
             # fault: decks: a range finds numbers of other steps -> else [n for (part, i), n in known.items() if part
             #   == scope]) | coupler/test_deck_hostile
             else [n for (part, i), n in known.items() if part == scope and i in asked])
    if len(there) < len(asked):
        log.miss(row, f"{len(asked) - len(there)} numbers of this range do not exist; the others are taken")
    return there


def _add(mesh: Mesh, sets: dict[Name, tuple[int, ...]], key: Name, spelled: str, rows: Iterable[int]) -> None:
    sets[key] = tuple(sorted({*sets.get(key, ()), *rows}))
    mesh.spelled.setdefault(key, spelled)


# Bodies: pieces of mesh that hang together, with the one material of their sections.

MAX_BODIES = 200


@dataclass(frozen=True)
class Body:
    """name : as the scenario has it.  material : in capitals, as the deck has it.  cells, nodes : rows.
    thickness : of plane sections, as written; row : the section's line."""

    name: str
    material: str
    cells: tuple[int, ...]
    nodes: frozenset[int]
    thickness: float
    row: Row


@dataclass(frozen=True)
class _Section:
    label: str
    material: str
    thickness: float
    row: Row


class Names:
    """Names of the scenario that are given once; `taken` is asked and added to."""

    def __init__(self) -> None:
        self.taken: set[str] = set()
        # Each begins where it ended: many of one name are not all counted from 2.
        self._numbers: defaultdict[str, Iterator[int]] = defaultdict(lambda: count(2))

    def free(self, wanted: str, suffix: str = "") -> str:
        """`wanted` in letters the scenario takes; with the suffix, then numbered, where that is taken already."""
        base = re.sub(r"[^A-Za-z0-9_-]", "_", wanted)[:50] or "_"
        base = base if re.match(r"[A-Za-z_]", base) else f"_{base}"
        numbered = (f"{base}{suffix}_{i}" for i in self._numbers[f"{base}{suffix}"])
        name = next(name for name in chain((base, f"{base}{suffix}"), numbered) if name not in self.taken)
        self.taken.add(name)
        return name


def bodies_of(outline: Outline, mesh: Mesh, names: Names, log: Log) -> list[Body]:
    """The bodies, in the order of their first cells.

    Raises ScenarioError where a cell has no section, or a piece has sections of several materials.
    """
    section_of = _sections(outline, mesh, log)
    for i, cell in enumerate(mesh.cells):
        if i not in section_of:
            raise wrong(cell.row, "this element has no section", "Put it in the set of a *SOLID SECTION.")
    piece = _pieces(mesh)
    pieces = [np.flatnonzero(piece == i) for i in range(int(piece.max()) + 1)]
    if len(pieces) > MAX_BODIES:
        raise wrong(mesh.cells[0].row, f"the mesh falls into {len(pieces)} pieces, more than {MAX_BODIES}",
                    "Merge the nodes of cells that hang together.")
    labels = Counter(section_of[int(cells[0])].label for cells in pieces)
    out: list[Body] = []
    seen: Counter[str] = Counter()
    for cells in pieces:
        first = section_of[int(cells[0])]
        for other in (section_of[int(i)] for i in cells):
            if other.material != first.material:
                raise wrong(other.row, f"a piece of the mesh is of {first.material} and of {other.material}",
                            "A body has one material: give each its own nodes along the seam, and a contact pair.")
            if other.thickness != first.thickness:
                raise wrong(other.row, "a piece of the mesh has two thicknesses", "A body has one.")
        seen[first.label] += 1
        label = first.label if labels[first.label] == 1 else f"{first.label}_{seen[first.label]}"
        nodes = frozenset(n for i in cells for n in mesh.cells[int(i)].nodes)
        out.append(Body(names.free(label), first.material, tuple(int(i) for i in cells), nodes, first.thickness,
                        first.row))
    return out


def _sections(outline: Outline, mesh: Mesh, log: Log) -> dict[int, _Section]:
    found: dict[int, _Section] = {}
    for scoped in outline.mesh:
        block, part = scoped.block, scoped.part
        if block.word != "SOLID SECTION":
            continue
        material = named(block, "MATERIAL")
        if material not in outline.materials:
            raise wrong(block.row, f"there is no *MATERIAL {material[:60]}",
                        did_you_mean(material[:60], outline.materials))
        thickness = number(block.data[0], 0, "the thickness", 1.0) if block.data else 1.0
        if thickness <= 0.0:
            raise wrong(block.data[0], "a thickness is greater than zero")
        cells = mesh.cells_at(named(block, "ELSET"), block.row, part)
        elset = block.option("ELSET")
        label = outline.spelled[part] if part else mesh.spelled.get((part, elset), elset)
        for i in cells:
            if i in found and found[i].material != material:
                raise wrong(block.row, "elements of this section have another section already")
            found[i] = _Section(label, material, thickness, block.row)
        if not cells:
            log.miss(block, "the set has no elements")
    return found


def _pieces(mesh: Mesh) -> NDArray[np.int32]:
    """(n_cells,) the number of the piece each cell is in, counted from the first cell on."""
    pairs = np.array([(cell.nodes[0], n) for cell in mesh.cells for n in cell.nodes[1:]])
    n = len(mesh.points)
    graph = coo_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, of_node = connected_components(graph, directed=False)
    of_cell = of_node[[cell.nodes[0] for cell in mesh.cells]]
    _, first, inverse = np.unique(of_cell, return_index=True, return_inverse=True)
    order = np.argsort(np.argsort(first))
    return order[inverse].astype(np.int32)


# Surfaces: faces of cells as the deck names them, or the free ones of a set.

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
