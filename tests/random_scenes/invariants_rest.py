"""Laws of rest: what nothing drives does not change, and what nothing touches or pulls carries no stress."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from random_scenes.data_bounds import property_span
from random_scenes.invariant import Finding, Invariant
from random_scenes.invariants_contact import clearance, size_of
from random_scenes.scene import Scene
from random_scenes.story import COMPLETED, Story, told

Floats = NDArray[np.float64]

WARM = 1e-9  # of the temperature: Newton's tolerance is 1e-10 of the terms, and all terms are round-off here
STILL = 1e-10  # of the size: a residual of 1e-8 of the least force, 1e-4 E L, moves a body by 1e-12 L
STRESS = 1e-8  # of E: the same residual on one cell of a small mesh
LOADS = ("pressure", "t_x", "t_y", "f_x", "f_y", "moment", "b_x", "b_y")
HELD = ("u_x", "u_y", "angle")
RESTLESS = ("does not rest", "spurious", "out of balance", "overlap", "start inside")


def undriven(scene: Scene) -> Scene:
    """The same scene with nothing that drives it: one temperature, the bodies' own, everywhere; no load, no motion."""
    doc = scene.copied_doc()
    T = 300.0 if doc["units"]["temperature"] == "K" else 26.85
    for material in doc["materials"].values():
        if "T_ref" in material:
            material["T_ref"] = T
    for body in doc["bodies"].values():
        body["T0"] = T
        for key in ("Q_T", "Q_T_factor"):
            body.pop(key, None)
    for entry in doc["thermal"].get("boundary", ()):
        for key, rest in (("temperature", T), ("flux", 0.0)):
            if key in entry:
                entry[key] = rest
        for key in ("convection", "radiation"):
            if key in entry:
                entry[key]["T"] = T
    mechanical = doc["mechanical"]
    for key in ("rigid", "options"):
        mechanical.pop(key, None)
    elastic = mechanical.get("elastic", {})
    elastic.pop("gravity", None)
    elastic["boundary"] = [{k: 0.0 if k in HELD else v for k, v in entry.items()}
                           for entry in elastic.get("boundary", ()) if not any(k in entry for k in LOADS)]
    for body in elastic.get("bodies", {}).values():
        for key in ("v0", "omega0"):
            body.pop(key, None)
    for body in mechanical.get("rod", {}).get("held", {}).values():
        body.update({side: 0.0 for side in body})
    if mechanical["half"] != "elastic":
        mechanical.pop("elastic", None)
    for key in ("rules", "study"):
        doc.pop(key, None)
    return Scene(doc, scene.recipes, scene.moved)


def stiffest(story: Story) -> float:
    """The largest E of a scene [Pa]; 0 where no half has one."""
    assert story.scenario is not None
    span = (float(story.T.min()), float(story.T.max()))
    materials = story.scenario.models["mechanical"].get("materials", {}).values()
    return max((property_span(m["E"], *span)[1] for m in materials if "E" in m), default=0.0)


def moved_at_rest(story: Story) -> list[Finding]:
    """What changes in the story of an undriven scene."""
    findings = []
    X, size, E = story.interface.nodes, size_of(story), stiffest(story)
    apart = min((clearance(story, pair) for pair in story.interface.pairs if pair.slave != pair.master), default=1.0)
    overlaps = apart < -STILL * size
    if overlaps and any(pair.mu > 0.0 for pair in story.interface.pairs):
        return []  # they press from the start, and rub as they settle
    checks = [("temperature", "K", story.T - story.T[0], WARM * float(story.T[0].max()))]
    if not overlaps:
        checks.append(("place", "m", story.x - X, STILL * size))
        if E:
            checks.append(("pressure", "Pa", story.t_N, STRESS * E))
        if "mechanical.sigma" in story.extra:
            checks.append(("stress", "Pa", np.array(story.extra["mechanical.sigma"]), STRESS * E))
    for name, unit, change, allowed in checks:
        if change.size and np.abs(change).max() > allowed:
            k, i = np.unravel_index(int(np.abs(change).argmax()), change.shape)[:2]
            findings.append(Finding(
                f"undriven, {name} {i} is {np.abs(change).max():.4g} {unit} off at t = {story.t[k]:.6g} s, where "
                f"{allowed:.2g} {unit} are round-off", float(np.abs(change).max() / allowed), RESTLESS, story))
    return findings


def _rests(scene: Scene, story: Story, rng: np.random.Generator) -> list[Finding]:
    other = told(undriven(scene))
    return moved_at_rest(other) if other.outcome == COMPLETED else []


def _solid(scene: Scene) -> bool:
    return not any("liquid" in material for material in scene.doc["materials"].values())


REST = Invariant("rest", _solid, _rests)
"""A scene at one temperature, that of its surroundings and of its materials free of stress, without loads and motion,
stays as it is: temperature to 1e-9, places to 1e-10 of its size, stress and pressure to 1e-8 of E, all far above what
the solvers' tolerances leave.  Of bodies that overlap in the mesh only temperature is looked at.  Melts are left out:
they shrink by themselves.
"""


# A body that nothing touches or pulls carries no stress.

def _moved_as_whole(model: Mapping[str, Any], body: str, axisymmetric: bool) -> bool:
    """Whether all that is prescribed of a body moves it as a whole, and nothing loads it."""
    seen: dict[str, Any] = {}
    for entry in model["boundary"]:
        place = str(entry.get("on", entry.get("at", entry.get("body"))))
        if place.split(".")[0] != body:
            continue
        if any(entry.get(k) is not None for k in (*LOADS, "angle")) or entry.get("name"):
            return False
        for key in ("u_x", "u_y"):
            if entry.get(key) is not None and seen.setdefault(key, entry[key]) != entry[key]:
                return False
    return not (axisymmetric and seen.get("u_x", 0.0) != 0.0)


def untouched(scene: Scene) -> Scene:
    """The same scene with bodies that do not grow with temperature."""
    doc = scene.copied_doc()
    for material in doc["materials"].values():
        material["alpha"] = 0.0
    doc.pop("rules", None)
    return Scene(doc, scene.recipes, scene.moved)


def stress_of_nothing(story: Story) -> list[Finding]:
    """Stress in bodies before anything presses on them; the materials do not grow with temperature."""
    assert story.scenario is not None
    findings = []
    interface, model = story.interface, story.scenario.models["mechanical"]
    sigma, E = np.array(story.extra["mechanical.sigma"]), stiffest(story)
    of_cell = np.concatenate([interface.quad_body, interface.triangle_body])
    for number, body in enumerate(interface.bodies):
        if not _moved_as_whole(model, body, interface.axisymmetric):
            continue
        q = np.flatnonzero(interface.node_body[interface.pair_nodes] == number)
        pressed = (story.t_N[:, q] < 0.0).any(axis=1)
        until = int(pressed.argmax()) if pressed.any() else len(pressed)
        most = np.abs(sigma[:until, of_cell == number]).max(initial=0.0)
        if most > STRESS * E:
            findings.append(Finding(
                f"nothing touches or pulls {body} up to t = {story.t[until - 1]:.6g} s, but its stress is "
                f"{most:.4g} Pa, {most / E:.2g} of E", float(most / (STRESS * E)), RESTLESS, story))
    return findings


def _free_of_stress(scene: Scene, story: Story, rng: np.random.Generator) -> list[Finding]:
    other = told(untouched(scene))
    return stress_of_nothing(other) if other.outcome == COMPLETED else []


def _elastic(scene: Scene) -> bool:
    mechanical = scene.doc["mechanical"]
    elastic = mechanical.get("elastic", {})
    bodies = elastic.get("bodies", {}).values()
    return (mechanical["half"] == "elastic" and _solid(scene) and not {"dynamics", "gravity", "skip"} & elastic.keys()
            and not any(b.get("rigid") for b in bodies))


FREE = Invariant("free of stress", _elastic, _free_of_stress)
"""A body that does not grow with temperature, is held or moved as a whole, bears no load and is not pressed on has no
stress: to 1e-8 of E.  The scene is run with alpha = 0.
"""

INVARIANTS: Sequence[Invariant] = (REST, FREE)
