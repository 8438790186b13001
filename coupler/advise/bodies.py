"""Rungs of mechanics: bodies that keep their shape, bodies at rest, bodies that heat does not move."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from coupler.advise.edit import Edit, Tree, at
from coupler.advise.rung import Kind, Rung
from coupler.scenario.document import Key

RIGID_MISSES = ("bodies keep their shape: no spring-back, no gap that opens by expansion or shrinkage, no stress, no "
                "slip; pressures are those prescribed, the same along a surface, so nothing of corners")
REST_MISSES = "bodies stay where they are meshed; contact is that of the start, without pressure"
ONE_WAY_MISSES = "heat moves nothing: no expansion, no shrinkage"
REST, RIGID_REST = "bodies at rest (uncoupled)", "rigid bodies, at rest as nothing drives them (uncoupled)"
AXES = ("u_x", "u_y")


def mechanics(tree: Tree) -> Iterator[Rung]:
    """Uncoupled first, then one-way, then cheaper mechanics."""
    half, own = at(tree, ("mechanical", "half")), at(tree, ("mechanical", "rigid"))
    told = own if own is not None else motion_of(tree)
    if half != "rigid" or told:
        yield Rung(REST if told else RIGID_REST, Kind.MECHANICS, _rigid(tree, {}), misses=REST_MISSES)
    if half != "rigid" and told:
        yield Rung("rigid bodies (one-way)", Kind.MECHANICS, _rigid(tree, None if own is not None else told),
                   misses=RIGID_MISSES)
    if half == "elastic" and at(tree, ("mechanical", "rod")) is not None:
        yield Rung("deformation along x only", Kind.MECHANICS, Edit({("mechanical", "half"): "rod"}),
                   misses="bending and shear")
    if half != "rigid" and (still := _still(tree)):
        yield Rung("heat moves no body (one-way)", Kind.EFFECT, Edit(still), deforms=True, misses=ONE_WAY_MISSES)


def _rigid(tree: Tree, told: dict[str, Any] | None) -> Edit:
    """The half `rigid`, with this motion, or as the scenario has it; it refuses what asks for forces."""
    put: dict[Key, Any] = {("mechanical", "half"): "rigid"}
    if told is not None:
        put["mechanical", "rigid"] = told
    return Edit(put, tuple(("contact", name, key) for name in tree.get("contact", {}) for key in
                           ("friction", "augmented")))


def motion_of(tree: Tree) -> dict[str, Any]:
    """The part `mechanical.rigid` of a scenario that has none: each body moves as it is driven; {} where none is.

    The first drive of a body along an axis that is not zero counts.
    """
    motion: dict[str, dict[str, Any]] = {}
    for entry in at(tree, ("mechanical", "elastic", "boundary")) or ():
        body = entry.get("body") or str(entry.get("on") or entry.get("at")).partition(".")[0]
        for axis in AXES:
            if entry.get(axis) not in (None, 0, 0.0):
                motion.setdefault(body, {}).setdefault(axis, entry[axis])
    for body, held in (at(tree, ("mechanical", "rod", "held")) or {}).items():
        for end in ("left", "right"):
            if held.get(end) not in (None, 0, 0.0):
                motion.setdefault(body, {}).setdefault("u_x", held[end])
    return {"motion": motion} if motion else {}


def _still(tree: Tree) -> dict[Key, Any]:
    """No expansion and no shrinkage of any material; nothing where there is one material that does one of them:
    that is a rung of its own."""
    still: dict[Key, Any] = {}
    for name, material in tree["materials"].items():
        if material.get("alpha"):
            still["materials", name, "alpha"] = 0
        if at(material, ("liquid", "shrinkage")):
            still["materials", name, "liquid", "shrinkage"] = 0
    return still if len(still) > 1 else {}
