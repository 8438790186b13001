"""Which cells of a body are a region's: named groups of a mesh file, rectangles of a rectangle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from contact.problem.values import did_you_mean
from coupler.scenario.bodies import Block, MeshedBody, Region
from coupler.scenario.document import Document, DocumentErrors, Key
from coupler.scenario.mesh import BodyMesh, Floats, Ints

ON_A_LINE = 1e-9  # of the body's side: a side this near to a line of the mesh lies on it


@dataclass(frozen=True)
class CellRegions:
    """names : "body.region".  quads, triangles : (n_quads,), (n_triangles,) index into names, -1 for none."""

    names: tuple[str, ...]
    quads: Ints
    triangles: Ints


def regions_of(document: Document, bodies: Mapping[str, MeshedBody], meshes: Mapping[str, BodyMesh],
               found: DocumentErrors) -> CellRegions | None:
    """Find the cells of every region of a scene, bodies in order; what is wrong is noted.  None without regions."""
    names: list[str] = []
    quads, triangles = [], []
    for body, mesh in meshes.items():
        of_quads, of_triangles = np.full(len(mesh.quads), -1), np.full(len(mesh.triangles), -1)
        for name, region in (bodies[body].regions or {}).items():
            key: Key = ("bodies", body, "regions", name)
            with found.each():
                cells = _cells(document, bodies[body], mesh, region, key)
                taken = np.concatenate([of_quads[cells[0]], of_triangles[cells[1]]])
                # fault: regions that overlap are taken in silence -> if False: |
                #   coupler/test_regions::test_what_is_wrong_with_regions_is_told_all_at_once
                if (taken >= 0).any():
                    other = names[int(taken.max())].split(".", 1)[1]
                    raise document.error(key, f"{int((taken >= 0).sum())} of its cells are already those of the region "
                                         f"{other!r}", "A cell has one region.")
                of_quads[cells[0]], of_triangles[cells[1]] = len(names), len(names)
            names.append(f"{body}.{name}")
        quads.append(of_quads)
        triangles.append(of_triangles)
    if not names:
        return None
    return CellRegions(tuple(names), np.concatenate(quads).astype(np.int32),
                       np.concatenate(triangles).astype(np.int32))


def _cells(document: Document, body: MeshedBody, mesh: BodyMesh, region: Region, key: Key) -> tuple[Ints, Ints]:
    """Rows of quads and of triangles.  Raises ScenarioError where there are none, or the mesh does not conform."""
    if region.group is not None:
        if body.mesh.file is None:
            raise document.error((*key, "group"), "a rectangle has no named groups of cells",
                                 "Write rectangle: {origin: [x, y], size: [x, y]}.")
        if region.group not in mesh.groups:
            raise document.error((*key, "group"), f"the mesh has no group of cells {region.group!r}",
                                 did_you_mean(region.group, mesh.groups))
        cells = mesh.groups[region.group]
        if not (len(cells[0]) + len(cells[1])):
            raise document.error((*key, "group"), f"the group {region.group!r} has no cell of this body",
                                 "Name a group of cells that lie in this body's `mesh.file.region`.")
        return cells
    assert region.rectangle is not None
    if body.mesh.rectangle is None:
        raise document.error((*key, "rectangle"), "only a body that is a rectangle has rectangles of cells",
                             "Write group: NAME, a named group of cells of the mesh file.")
    box = np.array([region.rectangle.origin, np.add(region.rectangle.origin, region.rectangle.size)])
    _conforms(document, region.rectangle, mesh.nodes, box, (*key, "rectangle"))

    def inside(cells: Ints) -> Ints:
        middle = mesh.nodes[cells].mean(axis=1)
        return np.flatnonzero(((middle > box[0]) & (middle < box[1])).all(axis=1)).astype(np.int32)

    return inside(mesh.quads), inside(mesh.triangles)


def _conforms(document: Document, block: Block, nodes: Floats, box: Floats, key: Key) -> None:
    """Raises ScenarioError where a side of the box lies on no line of the mesh, naming the nearest lines."""
    for axis, word in ((0, "x"), (1, "y")):
        lines = np.unique(nodes[:, axis])
        near = ON_A_LINE * (lines[-1] - lines[0])
        for end, at in enumerate((box[0, axis], box[1, axis])):
            # fault: a region cuts through cells -> if False: |
            #   coupler/test_regions::test_what_is_wrong_with_regions_is_told_all_at_once
            if np.abs(lines - at).min() > near:
                k = int(np.searchsorted(lines, at))
                beside = [f"{line:.6g}" for line in lines[max(k - 1, 0):k + 1]]
                which = "from" if end == 0 else "to"
                raise document.error((*key, "origin" if end == 0 else "size", axis),
                                     f"the region reaches {which} {word} = {at:.6g} m, where no line of the mesh is",
                                     f"The nearest: {' and '.join(beside)} m. Move the region there, or choose cells "
                                     "so that a line falls on it.")
