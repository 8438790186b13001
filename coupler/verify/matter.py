"""What a scene says of the physics of its bodies, as far as a half can be held against it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import field_from, property_from
from contact.half.interface import Interface, read_interface, write_interface
from contact.problem.errors import read
from contact.problem.material import Material
from contact.problem.mechanical import ElasticBoundary, ElasticProblem, ForeignMechanical, State
from contact.problem.thermal import ForeignThermal, ThermalBoundary, ThermalProblem
from coupler.fmu.bounds import BorderScene, border_scene
from coupler.fmu.half import Array

SAME_LINE = 1e-9  # of the span: nodes so near one coordinate have it in common


@dataclass(frozen=True, kw_only=True)
class KnownScene(BorderScene):
    """A scene whose physics is known too.

    rho_c : (n_cells,) heat capacity at the start [J/m3K]; NaN where it is not known, or melts.  hot : (n_nodes,) a
    temperature above T_ref [K] and stretch : (n_bodies,) what a free body then is longer by [1]; cold : (n_nodes,)
    T_ref itself.  All three NaN for bodies not free to expand.  modulus : (n_bodies,) E at T_ref and
    WARMER [Pa], NaN where it is not known.
    """

    rho_c: Array
    hot: Array
    cold: Array
    stretch: Array
    modulus: Array

    @property
    def cells(self) -> list[NDArray[np.int32]]:
        """The nodes of each cell, anticlockwise: quads first, then triangles."""
        return [*self.interface.quads, *self.interface.triangles]

    @property
    def cell_body(self) -> NDArray[np.int32]:
        """The body (n_cells,) of each cell."""
        return np.concatenate([self.interface.quad_body, self.interface.triangle_body])

    def areas(self, x: Array) -> Array:
        """Return the areas (n_cells,) [m2] of the cells at coordinates x : (n_nodes, 2) [m]."""
        return np.array([_area(x[cell]) for cell in self.cells])

    @property
    def volumes(self) -> Array:
        """Return the volumes (n_cells,) [m3]: of a metre of depth, or of the whole turn."""
        X = self.interface.nodes
        if not self.interface.axisymmetric:
            return self.areas(X)
        return np.array([2.0 * np.pi * _moment(X[cell]) for cell in self.cells])


def _area(p: Array) -> float:
    q = np.roll(p, -1, axis=0)
    return 0.5 * float(np.sum(p[:, 0] * q[:, 1] - q[:, 0] * p[:, 1]))


def _moment(p: Array) -> float:
    """The integral of the first coordinate over a polygon [m3]."""
    q = np.roll(p, -1, axis=0)
    return float(np.sum((p[:, 0] + q[:, 0]) * (p[:, 0] * q[:, 1] - q[:, 0] * p[:, 1]))) / 6.0


WARMER = 50.0  # K above T_ref
ROOM = 293.15  # K, where no T_ref is stated


def known_scene(interface: Interface, thermal: Mapping[str, Any], mechanical: Mapping[str, Any],
                stated: Iterable[ThermalBoundary] = ()) -> KnownScene:
    """Return the scene of an interface and the two models (model.json), all in SI.

    stated : as of border_scene.
    """
    border = border_scene(interface, thermal, stated, mechanical)
    values: dict[str, Any] = {f.name: getattr(border, f.name) for f in fields(border)}
    return KnownScene(**values, rho_c=_capacity(border, thermal), **_expansion(interface, mechanical))


def _capacity(border: BorderScene, thermal: Mapping[str, Any]) -> Array:
    i, kind = border.interface, str(thermal["half"])
    part = np.concatenate([i.quad_part, i.triangle_part])
    found = np.full(len(part), np.nan)
    problem = read(ForeignThermal if "options" in thermal else ThermalProblem, thermal, kind)
    for k, name in enumerate(i.parts):
        material = problem.materials.get(problem.parts[name].material)
        if material is None or material.rho is None or material.c is None or material.latent is not None:
            continue
        T = border.T_low[i.part_nodes(k)]
        if np.isfinite(T).any():
            c = property_from(material.c)  # type: ignore[arg-type]  # phases need a latent heat
            found[part == k] = material.rho * float(np.mean(c(T[np.isfinite(T)])))
    return found


def _expansion(i: Interface, model: Mapping[str, Any]) -> dict[str, Any]:
    found = {name: np.full(len(i.nodes if name in ("hot", "cold") else i.bodies), np.nan)
             for name in ("hot", "cold", "stretch", "modulus")}
    if "options" not in model and model.get("half") != "elastic":
        return found
    problem = read(ForeignMechanical if "options" in model else ElasticProblem, model, str(model["half"]))
    for b, name in enumerate(i.bodies):
        m = problem.materials.get(problem.bodies[name].material)
        if m is not None and m.E is not None:
            found["modulus"][b] = property_from(m.E)(np.array([(ROOM if m.T_ref is None else m.T_ref) + WARMER]))[0]
    if problem.gravity is not None or problem.dynamics is not None or problem.skip is not None:
        return found
    for b, name in enumerate(i.bodies):
        body, nodes = problem.bodies[name], np.flatnonzero(i.node_body == b)
        material = problem.materials.get(body.material)
        whole = body.regions is None and body.drawn_at is None and not body.rigid
        if material is None or not whole or not _is_free(i, b, problem.boundary):
            continue
        e = _free_stretch(material, problem.state is State.PLANE_STRAIN and not i.axisymmetric)
        if e is not None and material.T_ref is not None:
            found["hot"][nodes], found["cold"][nodes], found["stretch"][b] = material.T_ref + WARMER, material.T_ref, e
    return found


def _free_stretch(m: Material, strain: bool) -> float | None:
    """What a free body is longer by at WARMER above T_ref; strain : whether its depth stays."""
    if m.alpha is None or m.T_ref is None or (strain and m.nu is None):
        return None
    T = np.array([m.T_ref + WARMER])
    e = WARMER * float(property_from(m.alpha)(T)[0])
    return e * (1.0 + float(property_from(m.nu)(T)[0])) if strain and m.nu is not None else e


def _is_free(i: Interface, b: int, conditions: Iterable[ElasticBoundary]) -> bool:
    """Whether nothing loads a body, and what is prescribed lets it expand: u_x along one line x = c, u_y one y = c."""
    held: dict[int, list[NDArray[np.integer]]] = {0: [], 1: []}
    for c in conditions:
        place = c.body if c.body is not None else c.where
        nodes = np.flatnonzero(i.node_body == b) if place == i.bodies[b] else np.unique(
            i.surfaces[place] if place in i.surfaces else i.node_sets.get(place, np.arange(len(i.nodes))))
        nodes = nodes[i.node_body[nodes] == b]
        if not nodes.size:
            continue
        if (c.u_x is None and c.u_y is None) or c.rotation is not None:
            return False
        for axis, u in enumerate((c.u_x, c.u_y)):
            if u is not None:
                if not field_from(u).is_uniform:
                    return False
                held[axis].append(nodes)
    span = float(np.ptp(i.nodes, axis=0).max())
    lines = (i.nodes[np.concatenate(found), axis] for axis, found in held.items() if found)
    return all(float(np.ptp(line)) <= SAME_LINE * span for line in lines)


def write_scene(scene: BorderScene, folder: Path) -> Path:
    """Write a scene for another process into a new folder; returns it."""
    folder.mkdir(parents=True)
    write_interface(scene.interface, folder / "interface.h5")
    numbers = {f.name: getattr(scene, f.name) for f in fields(scene) if f.name != "interface"}
    np.savez(folder / "scene.npz", **numbers)
    return folder


def read_scene(folder: Path) -> BorderScene:
    """Return the scene that write_scene wrote."""
    interface = read_interface(folder / "interface.h5")
    with np.load(folder / "scene.npz") as kept:
        values: dict[str, Any] = {name: float(kept[name]) if name == "least_T" else kept[name] for name in kept}
    return (KnownScene if "rho_c" in values else BorderScene)(interface, **values)
