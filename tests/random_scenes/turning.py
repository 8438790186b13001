"""A plane scene that goes on after its end: at rest in space, or turned rigidly with all that holds and loads it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from math import cos, pi, sin
from typing import Any

import numpy as np

from random_scenes.change import corner_points
from random_scenes.declared import NotApplicable, restated, value_at
from random_scenes.scene import Scene
from random_scenes.shapes import Floats
from random_scenes.story import Story

QUARTER = 0.5 * pi
LONGER = 0.125  # of the run, is what the turn takes
HELD, LOADS = ("u_x", "u_y"), (("t_x", "t_y"), ("f_x", "f_y"), ("b_x", "b_y"))


def rotation(angle: float) -> Floats:
    """(2, 2), anticlockwise by an angle [rad]."""
    return np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])


def centre_of(scene: Scene) -> Floats:
    """(2,) [m] middle of the box around a scene."""
    nodes = np.concatenate([shape.nodes for shape in scene.shapes.values()])
    return 0.5 * (nodes.min(axis=0) + nodes.max(axis=0))


def continued(scene: Scene, story: Story, windows: int) -> tuple[Scene, Scene, Floats]:
    """The scene with `windows` more windows, once as it stands and once turned by 90 degrees in them; their ends [s].

    Both have the windows of the story first, and a kink at every end behind it.  Each held node has its own prescribed
    displacement; dead loads and weight turn too.  Raises NotApplicable where something else has a direction in space.
    """
    doc = check_directions(scene)
    end = float(story.t[-1])
    ends = end * (1.0 + LONGER * np.arange(1, windows + 1) / windows)
    coupling = doc["coupling"]
    for key in ("adaptive", "events", "on_cycle", "stop"):
        coupling.pop(key, None)
    coupling["windows"] = [{"until": float(b), "size": float(b - a)} for a, b in pairwise(story.t)]
    coupling["windows"] += [{"until": float(b), "size": float(b - a)} for a, b in pairwise([end, *ends])]
    coupling["end"], coupling["kinks"] = float(ends[-1]), sorted({*coupling["kinks"], end, *(float(t) for t in ends)})
    coupling["substeps"]["mechanical"] = 1
    doc.pop("output", None)
    doc["probes"] = {}
    # Of both the meshes come from files: rectangles number their nodes otherwise.
    still = replace(scene, doc=doc, moved={body: corner_points(shape) for body, shape in scene.shapes.items()})
    angles = [(float(t), QUARTER * (k + 1) / windows) for k, t in enumerate(ends)]
    return still, _turned(still, end, angles), ends


def check_directions(scene: Scene) -> dict[str, Any]:
    """The document of a scene, written out.  Raises NotApplicable unless all directions are of held nodes and loads."""
    doc = restated(scene)
    if doc["geometry"] != "plane":
        raise NotApplicable("an axis does not turn")
    if doc["mechanical"]["half"] != "elastic" or doc["thermal"]["half"] == "rod" or doc.get("rules"):
        raise NotApplicable("only elastic bodies are held node by node")
    elastic = doc["mechanical"]["elastic"]
    if "dynamics" in elastic or elastic["method"] == "explicit" or "skip" in elastic:
        raise NotApplicable("with inertia a turn is felt")
    if any(body["rigid"] for body in elastic["bodies"].values()):
        raise NotApplicable("a rigid body turns by its angle")
    if any("name" in b for b in elastic["boundary"]):
        raise NotApplicable("a named condition has one component")
    if any(isinstance(k := m.get("k"), dict) and k.get("turns") is False for m in doc["materials"].values()):
        raise NotApplicable("conductivity keeps its direction in space")
    if any(_over_place(part) for part in (doc["bodies"], doc["thermal"]["boundary"])):
        raise NotApplicable("a profile stands still in space")
    list(_held_nodes(scene, elastic["boundary"]))
    return doc


def _over_place(part: Any) -> bool:
    if isinstance(part, Mapping):
        if "terms" in part:
            return any({"x", "y"} & term.keys() for term in part["terms"])
        return any(_over_place(value) for value in part.values())
    return isinstance(part, list) and any(_over_place(value) for value in part)


def _held_nodes(scene: Scene, boundary: list[Any]) -> Iterator[tuple[str, int, tuple[Any, Any]]]:
    """Body, node and its two signals [m], the later condition on a component holding."""
    signals: dict[tuple[str, int], dict[str, Any]] = {}
    for b in boundary:
        given = {name: b[name] for name in HELD if name in b}
        if not given:
            continue
        body, _, place = str(b.get("on", b.get("at", ""))).partition(".")
        shape = corner_points(scene.shapes[body]) if body in scene.shapes else None
        if shape is None or not (place in shape.surfaces or place in shape.points):
            raise NotApplicable("a place that no node of the mesh has")
        nodes = np.unique(shape.surfaces[place]) if "on" in b else np.array([shape.points[place]])
        for node in nodes:
            signals.setdefault((body, int(node)), {}).update(given)
    for (body, node), held in signals.items():
        if len(held) < len(HELD):
            raise NotApplicable("a node is held in one direction")
        yield body, node, (held["u_x"], held["u_y"])


def _turned(scene: Scene, end: float, angles: list[tuple[float, float]]) -> Scene:
    """The scene turned by angles [rad] at times [s] behind its `end`."""
    doc, c = scene.copied_doc(), centre_of(scene)
    elastic = doc["mechanical"]["elastic"]
    shapes = dict(scene.shapes)
    moved = []
    for body, node, signals in _held_nodes(scene, elastic["boundary"]):
        X = shapes[body].nodes[node]
        name = f"held_{node}"
        shapes[body] = replace(shapes[body], points={**shapes[body].points, name: node})
        u_x, u_y = followed(signals, end, angles, X - c)
        moved.append({"at": f"{body}.{name}", "u_x": u_x, "u_y": u_y})
    elastic["boundary"] = [b for b in elastic["boundary"] if not any(n in b for n in HELD)] + moved
    for b in elastic["boundary"]:
        for names in LOADS:
            if any(n in b for n in names):
                b.update(zip(names, followed((b.get(names[0], 0.0), b.get(names[1], 0.0)), end, angles), strict=True))
    if "gravity" in elastic:
        gravity = elastic["gravity"]
        gravity["x"], gravity["y"] = followed((gravity["x"], gravity["y"]), end, angles)
    return replace(scene, doc=doc, moved=shapes)


def followed(signals: tuple[Any, Any], end: float, angles: list[tuple[float, float]],
             arm: Floats | None = None) -> tuple[Any, Any]:
    """Two components of a vector that turns by angles [rad] at times [s] behind `end`, as plain tables.

    arm : (2,) [m] from the centre to the place that is moved, where the vector is a displacement.
    """
    times = sorted({t for s in signals if isinstance(s, Mapping) for t in s["t"] if t < end})
    rows = []
    for t in times:
        before, after = ([value_at(s, t, side) for s in signals] for side in (-1, 1))
        rows += [(t, after)] if before == after else [(t, before), (t, after)]
    rows.append((end, [value_at(s, end) for s in signals]))
    start = np.zeros(2) if arm is None else arm
    for t, angle in angles:
        v = rotation(angle) @ (start + [value_at(s, t) for s in signals]) - start
        rows.append((t, [float(v[0]), float(v[1])]))
    t_s = [t for t, _ in rows]
    return tuple({"t": t_s, "value": [v[k] for _, v in rows]} for k in range(2))  # type: ignore[return-value]
