"""All bodies in one numbering, the Interface that halves and coupler share; and the scenario while it is checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface, Pair
from contact.half.start import START_T
from contact.problem.pairs import ContactForm, ContactPair
from contact.problem.values import no_such_surface
from coupler.scenario.bodies import FromRun, MeshedBody
from coupler.scenario.document import Document, DocumentErrors, Key
from coupler.scenario.earlier_bodies import EarlierRuns
from coupler.scenario.fits import offsets_of
from coupler.scenario.mesh import BodyMesh, Floats, Ints, MeshError, file_mesh, rectangle_mesh
from coupler.scenario.penalties import largest_penalty, stiffness_of
from coupler.scenario.regions import regions_of
from coupler.scenario.schema import Geometry, ScenarioFile
from coupler.scenario.si import ToSI
from coupler.scenario.starts import TakenCourse, TakenStart, courses_of, starts_of
from coupler.scenario.stated import NEAREST, ROOM
from coupler.scenario.ties import refuse_loose_ties
from coupler.scenario.warm import TakenMechanics, mechanics_of, start_arrays


@dataclass(frozen=True)
class Scene:
    """interface : the mesh.  points : name -> (body, (2,) [m]), named places with or without a node.

    starts, mechanics : what bodies took over from other runs, by body; courses : what they are given over time.
    """

    interface: Interface
    points: Mapping[str, tuple[str, Floats]]
    starts: Mapping[str, TakenStart]
    courses: Mapping[str, TakenCourse]
    mechanics: Mapping[str, TakenMechanics]


def scene_of(document: Document, file: ScenarioFile, found: DocumentErrors) -> Scene:
    """Mesh every body, join them, pair their surfaces.  file : materials, bodies in SI.  Raises ScenarioError."""
    meshes: dict[str, BodyMesh] = {}
    for name in file.bodies:
        with found.each():
            meshes[name] = _mesh(document, name, file.bodies[name])
    if len(meshes) < len(file.bodies):
        found.stop()
    start = np.concatenate([[0], np.cumsum([len(m.nodes) for m in meshes.values()])])
    surfaces: dict[str, Ints] = {}
    node_sets: dict[str, Ints] = {}
    points: dict[str, tuple[str, Floats]] = {}
    for (body, mesh), first in zip(meshes.items(), start[:-1], strict=True):
        surfaces |= {f"{body}.{s}": (edges + first).astype(np.int32) for s, edges in mesh.surfaces.items()}
        node_sets |= {f"{body}.{s}": (ids + first).astype(np.int32) for s, ids in mesh.node_sets.items()}
        points |= {f"{body}.{s}": (body, at) for s, at in mesh.points.items()}
        for s, at in mesh.points.items():
            if s not in mesh.node_sets:
                distance = np.linalg.norm(mesh.nodes - at, axis=1)
                node_sets[f"{body}.{s}{NEAREST}"] = np.array([first + int(distance.argmin())], dtype=np.int32)
    nodes = np.concatenate([m.nodes for m in meshes.values()])
    _check_radius(document, file, nodes, start)
    regions = regions_of(document, file.bodies, meshes, found)
    runs = EarlierRuns(document)
    starts = starts_of(runs, file, meshes, found)
    courses = courses_of(runs, file, meshes, found)
    bare = Interface(
        geometry=file.geometry.value,
        nodes=nodes,
        bodies=tuple(meshes),
        materials=tuple(part.material for _, part in parts_of(file)),
        quads=_joined([m.quads for m in meshes.values()], start),
        quad_body=_owner([m.quads for m in meshes.values()]),
        triangles=_joined([m.triangles for m in meshes.values()], start),
        triangle_body=_owner([m.triangles for m in meshes.values()]),
        surfaces=surfaces,
        node_sets=node_sets,
        start=_nodal(file, starts, meshes) | {f"{n}.{body}": getattr(one, n) for body, one in courses.items()
                                              for n in ("t", "T")},
    )
    if regions is not None:
        bare = replace(bare, regions=regions.names, quad_region=regions.quads, triangle_region=regions.triangles)
    bare = replace(bare, stiffness=stiffness_of(file, bare, dict(parts_of(file))))
    bare = replace(bare, pairs=_pairs(document, file, bare, found))
    refuse_loose_ties(document, bare, found)
    bare = replace(bare, offset=offsets_of(document, file, bare, found))
    arrays, mechanics = start_arrays(mechanics_of(document, runs, file, meshes, found), bare)
    return Scene(replace(bare, start=bare.start | arrays), points, starts, courses, mechanics)


def parts_of(file: ScenarioFile) -> list[tuple[str, MeshedBody]]:
    """Every part (Interface.parts) by its name, in full: the bodies, then their regions."""
    return [*file.bodies.items(), *((f"{name}.{region}", part) for name, body in file.bodies.items()
                                    for region, part in body.parts.items() if region)]


def _nodal(file: ScenarioFile, starts: Mapping[str, TakenStart], meshes: Mapping[str, BodyMesh]) -> dict[str, Floats]:
    """Interface.start: the temperatures of all bodies that took some over, NaN at the nodes of the others."""
    wanted = {name for name, body in file.bodies.items()
              if any(isinstance(part.T0, FromRun) for part in body.parts.values())}
    if not wanted:
        return {}
    # What could not be taken over has a stand-in, so that all else that is wrong is found too.
    return {START_T: np.concatenate([starts[name].T if name in starts else
                                     np.full(len(mesh.nodes), ROOM if name in wanted else np.nan)
                                     for name, mesh in meshes.items()])}


def surface_key(document: Document, known: Mapping[str, Any], name: str, key: Key) -> str:
    """The name if such a surface exists.  Raises ScenarioError saying which do."""
    if name not in known:
        raise document.error(key, f"there is no surface {name!r}",
                             no_such_surface(name, known, document.value(("bodies",)) or ()))
    return name


def _mesh(document: Document, name: str, body: MeshedBody) -> BodyMesh:
    try:
        if body.mesh.rectangle is not None:
            return rectangle_mesh(body.mesh.rectangle)
        assert body.mesh.file is not None
        return file_mesh(body.mesh.file, document.path.parent, with_regions=bool(body.regions))
    except MeshError as exc:
        raise document.error(("bodies", name, "mesh", *exc.at), f"body {name!r}: {exc}", exc.remedy) from exc


def _joined(parts: list[Ints], start: NDArray[np.integer]) -> Ints:
    return np.concatenate([p + first for p, first in zip(parts, start[:-1], strict=True)]).astype(np.int32)


def _owner(parts: list[Ints]) -> Ints:
    return np.repeat(np.arange(len(parts)), [len(p) for p in parts]).astype(np.int32)


def _check_radius(document: Document, file: ScenarioFile, nodes: Floats, start: NDArray[np.integer]) -> None:
    if file.geometry is not Geometry.AXISYMMETRIC:
        return
    for name, a, b in zip(file.bodies, start[:-1], start[1:], strict=True):
        if (nodes[a:b, 0] < 0).any():
            raise document.error(
                ("bodies", name, "mesh"),
                f"body {name!r} reaches to the left of the axis r = 0",
                "In axisymmetric geometry x is the radius.",
            )


def _pairs(
    document: Document,
    file: ScenarioFile,
    interface: Interface,
    found: DocumentErrors,
) -> tuple[Pair, ...]:
    pairs: list[Pair] = []
    for name in file.contact:
        with found.each():
            pairs.append(_pair(document, file, name, interface, pairs))
    return tuple(pairs)


def _pair(document: Document, file: ScenarioFile, name: str, interface: Interface, pairs: Sequence[Pair]) -> Pair:
    pair, surfaces = file.contact[name], interface.surfaces
    slave = surface_key(document, surfaces, pair.slave, ("contact", name, "slave"))
    master = surface_key(document, surfaces, pair.master, ("contact", name, "master"))
    if slave != master and np.intersect1d(surfaces[slave], surfaces[master]).size:
        raise document.error(("contact", name, "master"), f"{slave} and {master} have nodes in common",
                             "The two sides of a pair must not meet in a node; a surface that folds onto itself "
                             "is both its slave and its master.")
    for other in pairs:
        if {other.slave, other.master} == {slave, master}:
            raise document.error(
                ("contact", name), f"the pair {other.name!r} already joins {slave} and {master}",
                f"Leave {name!r} out, or write its keys into {other.name!r}.",
            )
    local = pair.penalty == "auto"
    eps_N = largest_penalty(interface, slave, master) if local else float(pair.penalty)
    if local and not eps_N > 0.0 and {slave, master} <= interface.stiffness.keys():
        raise document.error(("contact", name, "penalty"), "E is not positive at T0, so there is no penalty",
                             "State the penalty as a number [Pa/m].")
    return Pair(name, slave, master, pair.gap_max, eps_N, mu=pair.mu, eps_T=_stick(pair),
                two_pass=pair.two_pass, by_node=pair.form is ContactForm.NODES, local=local and eps_N > 0.0,
                tied=pair.tied, smooth=pair.smooth)


def _stick(pair: ContactPair) -> float:
    """eps_T [Pa/m], 0 for that which goes with the penalty."""
    return 0.0 if pair.friction is None or pair.friction.stick == "auto" else float(pair.friction.stick)


# One scenario while it is checked.

@dataclass(frozen=True)
class Context:
    """One scenario, checked for its form, in SI and meshed.  found : what is wrong with it so far."""

    document: Document
    file: ScenarioFile
    convert: ToSI
    scene: Scene
    found: DocumentErrors

    @property
    def interface(self) -> Interface:
        return self.scene.interface
