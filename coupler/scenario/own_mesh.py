"""A half's own mesh of the scene's bodies: how it is made, whether it covers the same, how it is told of."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.outlines import cross
from contact.problem.boundary import Supported
from contact.problem.errors import Wrong
from contact.problem.values import did_you_mean
from coupler.errors import ScenarioError
from coupler.scenario.document import Document, DocumentErrors, Key
from coupler.scenario.kinds import REPLAY
from coupler.scenario.mesh import Mesh
from coupler.scenario.mesh_maps import MeshMaps, NodeMap, mesh_maps
from coupler.scenario.scene import Scene, scene_of
from coupler.scenario.schema import ScenarioFile
from coupler.scenario.stated import NEAREST

Floats = NDArray[np.float64]

# Sixteen edges around a circle and very many differ by 2.6 % in area, twenty-four by 1.1 %.
MOST_OFF = 0.02  # of a body's area or a surface's length: what coarser edges of a curve make, and no more
MOST_OUTSIDE = 0.25  # of an edge: so far a node lies off the other mesh where that cuts a curve short
WORTH_TELLING = 1e-9  # of an area


@dataclass(frozen=True)
class OwnMesh:
    """A mesh of a half's own.  interface : what the half is built from.  maps : between it and the scene's.

    notes : what a user should know of it, a sentence each.
    """

    interface: Interface
    maps: MeshMaps
    notes: tuple[str, ...]


def own_mesh_of(document: Document, file: ScenarioFile, scene: Scene, role: str,
                found: DocumentErrors) -> OwnMesh | None:
    """Mesh the bodies of the half of a role; None where it has the scene's mesh, and where something is wrong, which is
    noted.

    file : materials and bodies in SI.  What is played from a record is on the mesh of the scene.
    """
    meshes = _stated(file, role)
    if not meshes or getattr(file, role).half == REPLAY or found:
        return None
    for wrong in _impossible(file, role):
        found.wrong(wrong.key, wrong.text, wrong.remedy)
    if found:
        return None
    bodies = {name: body.model_copy(update={"mesh": meshes.get(name, body.mesh)})
              for name, body in file.bodies.items()}
    with found.each():
        own = _meshed(document, file.model_copy(update={"bodies": bodies}), scene.interface, role)
        for wrong in _missing(file, scene.interface, own, role):
            found.wrong(wrong.key, wrong.text, wrong.remedy)
        if found:
            return None
        for wrong in _covers_less(scene.interface, own, role):
            found.wrong(wrong.key, wrong.text, wrong.remedy)
        if found:
            return None
        maps = mesh_maps(scene.interface, own)
        for wrong in (*_apart(maps.to_own, own, role, f"the {role} half's mesh of", "outside of the scene's"),
                      *_apart(maps.to_scene, scene.interface, role, "the scene's mesh of",
                              f"outside of the {role} half's")):
            found.wrong(wrong.key, wrong.text, wrong.remedy)
        return OwnMesh(own, maps, (_note(scene.interface, own, maps, role),))
    return None


def _stated(file: ScenarioFile, role: str) -> Mapping[str, Mesh]:
    return file.thermal.meshes if role == "thermal" else file.mechanical.meshes


def _impossible(file: ScenarioFile, role: str) -> Iterator[Wrong]:
    """Meshes of no body; and what no half on a mesh of its own can start from."""
    for name in _stated(file, role):
        if name not in file.bodies:
            yield Wrong((role, "meshes", name), f"there is no body {name!r}", did_you_mean(name, file.bodies))
    for name, body in file.bodies.items():
        # What a results file keeps of a run's mechanics is on the mesh of its scene.
        # fault: mechanics of another run are taken to an own mesh -> if False: |
        #   coupler/test_own_mechanical_meshes::test_mechanics_of_another_run_are_refused
        if role == "mechanical" and body.u0 is not None:
            yield Wrong(("bodies", name, "u0"), "a mechanical half on a mesh of its own starts from no other run",
                        "Leave mechanical.meshes out, or u0.")


@dataclass(frozen=True)
class _OwnDocument(Document):
    """The scenario as it reads with the meshes of the half of a role in the place of the bodies' own."""

    role: str = ""

    def error(self, key: Key, message: str, remedy: str = "") -> ScenarioError:
        """As of Document, at the key where the mesh stands."""
        if key[:1] == ("bodies",) and key[2:3] == ("mesh",) and self.value((self.role, "meshes", key[1])) is not None:
            key = (self.role, "meshes", key[1], *key[3:])
        return super().error(key, f"with the {self.role} half's own mesh: {message}", remedy)


def _meshed(document: Document, file: ScenarioFile, scene: Interface, role: str) -> Interface:
    """The interface of the bodies with other meshes.  Raises ScenarioError."""
    own = _OwnDocument(**{f.name: getattr(document, f.name) for f in fields(Document)}, role=role)
    # What a pair has no surface for is told by the mesh that lacks it.
    bare = scene_of(own, file.model_copy(update={"contact": {}}), DocumentErrors(own)).interface
    missing = {side for pair in scene.pairs for side in (pair.slave, pair.master)} - bare.surfaces.keys()
    if missing:
        return bare
    found = DocumentErrors(own)
    # fault: a thermal mesh of its own is in the plane -> whole = scene_of(own, file.model_copy(update={"geometry":
    #   type(file.geometry)("plane")}), found).interface |
    #   coupler/test_own_meshes::test_around_an_axis_it_is_the_run_of_that_mesh
    whole = scene_of(own, file, found).interface
    found.stop()
    return whole


def _conditions(file: ScenarioFile, role: str) -> tuple[str, Sequence[Supported]]:
    """Conditions of a half, and the key where they stand."""
    if role == "thermal":
        return "thermal.boundary", file.thermal.boundary
    elastic = file.mechanical.elastic
    return "mechanical.elastic.boundary", () if elastic is None else elastic.boundary


def _missing(file: ScenarioFile, scene: Interface, own: Interface, role: str) -> Iterator[Wrong]:
    """Names of surfaces and points that the scene gives a meaning and a mesh does not have."""
    places = {side: f"contact.{pair.name}" for pair in scene.pairs for side in (pair.slave, pair.master)}
    key, conditions = _conditions(file, role)
    for i, condition in enumerate(conditions):
        for name in (condition.on, condition.at):
            if name is not None:
                places.setdefault(name, f"{key}.{i}")
    had = {*scene.surfaces, *scene.node_sets}
    has = {*own.surfaces, *own.node_sets}
    for name, user in places.items():
        body, _, short = name.partition(".")
        if {name, name + NEAREST} & had and not {name, name + NEAREST} & has:
            named = [n.partition(".")[2] for n in has if n.partition(".")[0] == body and not n.endswith(NEAREST)]
            yield Wrong((role, "meshes", body), f"this mesh of body {body!r} has no {short!r}, which {user} names",
                        did_you_mean(short, named))


def _covers_less(scene: Interface, own: Interface, role: str) -> Iterator[Wrong]:
    """Bodies and surfaces that are not the same size in both meshes."""
    for name in scene.bodies:
        one, other = _area(scene, name), _area(own, name)
        # fault: a mesh may cover less than the body -> if False: |
        #   coupler/test_own_meshes::test_a_mesh_that_covers_less_is_refused
        if abs(other - one) > MOST_OFF * one:
            yield _off((role, "meshes", name), f"body {name!r}", one, other, "m2")
    for name in {side: None for pair in scene.pairs for side in (pair.slave, pair.master)}:
        one, other = (float(np.linalg.norm(np.diff(i.nodes[i.surfaces[name]], axis=1), axis=2).sum())
                      for i in (scene, own))
        if abs(other - one) > MOST_OFF * one:
            yield _off((role, "meshes", name.partition(".")[0]), f"surface {name!r}", one, other, "m")


def _off(key: Key, what: str, one: float, other: float, unit: str) -> Wrong:
    return Wrong(key, f"this mesh does not cover the same: {what} has {other:.6g} {unit} in it and {one:.6g} {unit} in "
                 "the scene", "Both meshes are of one shape; along a curve they may differ by "
                 f"{100 * MOST_OFF:g} %, which finer edges lessen.")


def _apart(to: NodeMap, target: Interface, role: str, whose: str, outside: str) -> Iterator[Wrong]:
    """Nodes of one mesh that lie too far off the other: the worst of each body."""
    off = to.outside - MOST_OUTSIDE * to.edge
    for body, name in enumerate(target.bodies):
        own = np.flatnonzero(target.node_body == body)
        node = own[np.argmax(off[own])]
        # fault: a mesh that lies beside the body is taken -> if False: |
        #   coupler/test_own_meshes::test_a_mesh_in_another_place_is_refused
        if off[node] > 0.0:
            x, y = target.nodes[node]
            yield Wrong((role, "meshes", name), f"{whose} {name!r} has a node at ({x:.6g}, {y:.6g}) m, which is "
                        f"{to.outside[node]:.3g} m {outside}", "Both meshes are of one shape in one place.")


def _note(scene: Interface, own: Interface, maps: MeshMaps, role: str) -> str:
    counts = (f"{len(i.nodes)} nodes and {len(i.quads) + len(i.triangles)} cells" for i in (own, scene))
    said = "the {} half has a mesh of its own, {} (the scene's: {})".format(role, *counts)
    off = {name: _area(own, name) / _area(scene, name) - 1.0 for name in scene.bodies}
    worst = max(off, key=lambda name: abs(off[name]))
    apart = max(float(to.outside.max(initial=0.0)) for to in (maps.to_own, maps.to_scene))
    if abs(off[worst]) > WORTH_TELLING:
        said += (f"; where it follows a curve otherwise the two lie up to {apart:.3g} m apart, and its {worst} is "
                 f"{100 * abs(off[worst]):.2g} % {'larger' if off[worst] > 0 else 'smaller'}")
    return said


def _area(interface: Interface, name: str) -> float:
    """The area of a body's mesh [m2]."""
    body = interface.bodies.index(name)
    corners: Mapping[int, Floats] = {
        k: interface.nodes[cells[of == body]] for k, cells, of in (
            (4, interface.quads, interface.quad_body), (3, interface.triangles, interface.triangle_body))}
    return float(sum(0.5 * cross(x - x[:, :1], np.roll(x - x[:, :1], -1, axis=1)).sum() for x in corners.values()))
