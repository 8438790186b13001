"""The two files: the mesh as gmsh text, and the scenario with what was not understood at its top."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ruamel.yaml.comments import CommentedMap, CommentedSeq

from coupler.deck.bodies import Body
from coupler.deck.lexer import printable
from coupler.deck.mesh import Mesh
from coupler.deck.surfaces import Edge
from coupler.scenario.writing import dumped, layout

MOST_TOLD = 200  # lines of the head; all are printed
GMSH = {1: 15, 2: 1, 3: 2, 4: 3}  # corners -> gmsh's kind of element


@dataclass(frozen=True)
class Groups:
    """What has a name in the mesh file: bodies, surfaces (edges) and sets of nodes."""

    bodies: Sequence[Body]
    surfaces: Mapping[str, Sequence[Edge]]
    node_sets: Mapping[str, Sequence[int]]


def mesh_text(mesh: Mesh, groups: Groups) -> str:
    """gmsh 2.2: cells by body, lines by surface, points by set of nodes.  Nodes no cell has are left out."""
    used = sorted({n for body in groups.bodies for n in body.nodes})
    number = {n: i for i, n in enumerate(used, start=1)}
    names: list[str] = []
    elements: list[str] = []
    for dim, name, members in _members(mesh, groups):
        kept = [m for m in members if all(n in number for n in m)]
        if not kept:
            continue
        names.append(f'{dim} {len(names) + 1} "{name}"')
        tag = len(names)
        for nodes in kept:
            corners = " ".join(str(number[n]) for n in nodes)
            elements.append(f"{len(elements) + 1} {GMSH[len(nodes)]} 2 {tag} {tag} {corners}")
    points = [f"{i} {float(mesh.points[n, 0])!r} {float(mesh.points[n, 1])!r} 0" for n, i in number.items()]
    return "\n".join(["$MeshFormat", "2.2 0 8", "$EndMeshFormat",
                      "$PhysicalNames", str(len(names)), *names, "$EndPhysicalNames",
                      "$Nodes", str(len(points)), *points, "$EndNodes",
                      "$Elements", str(len(elements)), *elements, "$EndElements", ""])


def _members(mesh: Mesh, groups: Groups) -> Iterator[tuple[int, str, list[tuple[int, ...]]]]:
    """Dimension, name and cells of every group."""
    for body in groups.bodies:
        yield 2, body.name, [tuple(dict.fromkeys(mesh.cells[i].nodes)) for i in body.cells]
    for name, edges in groups.surfaces.items():
        yield 1, name, [tuple(edge) for edge in edges]
    for name, nodes in groups.node_sets.items():
        yield 0, name, [(n,) for n in nodes]


def scenario_text(tree: Mapping[str, Any], head: Sequence[str]) -> str:
    """The scenario as YAML under a comment; a mapping or list of plain values stands on one line."""
    lines = [*head[:MOST_TOLD], *([f"... and {len(head) - MOST_TOLD} lines more"] if len(head) > MOST_TOLD else [])]
    # fault: decks: a name leaves the comment it stands in -> return "".join(f"# {line}".rstrip() + "\n" for line in
    #   lines) + dumped(_laid_out(tree), layout()) | coupler/test_deck_hostile
    return "".join(f"# {printable(line)}".rstrip() + "\n" for line in lines) + dumped(_laid_out(tree), layout())


def _laid_out(value: Any, level: int = 0) -> Any:
    """The value as ruamel's own containers, those that hold little in flow style.  level : below the top."""
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
    """How deep containers nest, 0 for a plain value."""
    inner = value.values() if isinstance(value, Mapping) else value if isinstance(value, list | tuple) else None
    return 0 if inner is None else 1 + max((_depth(v) for v in inner), default=0)
