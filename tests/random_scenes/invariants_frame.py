"""FRAME: an answer does not depend on where a scene lies, how it is turned, numbered, measured, or when it begins.

Laws of nature have no origin, no direction, no handedness (linear elasticity, Fourier's and Coulomb's laws of isotropic
bodies have none; what has a direction is turned too), no unit and no zero of time; and numbers of nodes are no data.
So temperatures, displacements (turned back), pressures, probes and the ledger agree to what the solvers leave over:
the larger of 1e-9 of their range and ten times the tolerances of the document (random_scenes.compare.agreement).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from random_scenes.change import (
    Changed,
    bodies_reversed,
    in_other_unit,
    in_other_units,
    later,
    mirrored,
    pairs_reversed,
    renumbered,
    resting,
    shifted,
    turned,
)
from random_scenes.compare import ROUND_OFF, findings
from random_scenes.declared import NotApplicable, Units
from random_scenes.invariant import Finding, Invariant
from random_scenes.scene import Scene
from random_scenes.story import COMPLETED, Story, told

STILL = 1e-12  # of the whole way, in the lead: no tolerance sees it
Change = Callable[[Scene, np.random.Generator], Changed]


def law(name: str, change: Change) -> Invariant:
    """The law that a changed scene has the same answer."""

    def applies(scene: Scene) -> bool:
        try:
            change(scene, np.random.default_rng(0))
        except NotApplicable:
            return False
        return True

    def check(scene: Scene, story: Story, rng: np.random.Generator) -> Sequence[Finding]:
        changed = change(scene, rng)
        return findings(story, changed, told(changed.scene))

    return Invariant(name, applies, check)


def _some_shift(scene: Scene, rng: np.random.Generator) -> Changed:
    """By up to three times the size of the scene: farther away round-off of coordinates grows."""
    size = max(shape.size for shape in scene.shapes.values())
    dx, dy = (float(v) for v in size * rng.uniform(-3.0, 3.0, 2))
    return shifted(scene, 0.0 if scene.axisymmetric else dx, dy)


def _some_turn(scene: Scene, rng: np.random.Generator) -> Changed:
    """By any angle where the scene can be turned by it, else by a right angle or two or three."""
    angle, right = float(rng.uniform(5.0, 355.0)), 90.0 * float(rng.integers(1, 4))
    try:
        return turned(scene, angle)
    except NotApplicable:
        return turned(scene, right)


def _some_length(scene: Scene, rng: np.random.Generator) -> Changed:
    """In mm, cm, or half metres: fixed numbers of metres in the code would show."""
    return in_other_units(scene, Units(m=float(rng.choice([2.0, 100.0, 1000.0]))))


def _some_units(scene: Scene, rng: np.random.Generator) -> Changed:
    """A micrometre or a kilometre wide, in microseconds or years, as soft as jelly or ten times as hard as diamond.

    By powers of two, so that no number is rounded otherwise: what differs is a fixed number in the code.
    """
    m, s, K, Pa = (2.0 ** float(rng.integers(*ends)) for ends in ((-16, 13), (-20, 25), (-10, 4), (-24, 7)))
    K = K if scene.doc["units"]["temperature"] == "K" else 1.0
    try:
        return in_other_units(scene, Units(m, Pa * m * s**2, s, K))
    except NotApplicable:  # layers of gas that are too thin
        m = max(m, 1.0)
        return in_other_units(scene, Units(m, Pa * m * s**2, s, K))


SHIFT = law("frame: shift", _some_shift)
TURN = law("frame: turn", _some_turn)
MIRROR = law("frame: mirror", lambda scene, rng: mirrored(scene))
RENUMBER = law("frame: renumber", renumbered)
BODIES = law("frame: order of bodies", lambda scene, rng: bodies_reversed(scene))
PAIRS = law("frame: order of pairs", lambda scene, rng: pairs_reversed(scene))
KELVIN = law("frame: unit of temperature", lambda scene, rng: in_other_unit(scene))
LENGTH = law("frame: unit of length", _some_length)
SIMILAR = law("frame: physically similar", _some_units)


def _lead(scene: Scene) -> float:
    return 0.125 * float(scene.doc["coupling"]["end"])


def _can_wait(scene: Scene) -> bool:
    try:
        later(scene, _lead(scene))
    except NotApplicable:
        return False
    return True


def _begun_later(scene: Scene, story: Story, rng: np.random.Generator) -> Sequence[Finding]:
    """Nothing is said of a scene that does not rest while its data do: found by a run of the lead alone."""
    lead = _lead(scene)
    rest = told(resting(scene, lead))
    if rest.outcome != COMPLETED or not at_rest(story, rest):
        return []
    changed = later(scene, lead)
    return findings(story, changed, told(changed.scene))


def at_rest(story: Story, rest: Story) -> bool:
    """Whether nothing changes in a run, measured by what the whole run does."""
    T, u = float(np.ptp(story.T)), float(np.abs(story.x - story.interface.nodes).max())
    T_most, x_most = float(np.abs(story.T).max()), float(np.abs(story.x).max())
    still_T = float(np.abs(rest.T - story.T[0]).max()) <= STILL * T + ROUND_OFF * T_most
    return still_T and float(np.abs(rest.x - story.x[0]).max()) <= STILL * u + ROUND_OFF * x_most


LATER = Invariant("frame: start of time", _can_wait, _begun_later, runs=2)
FRAME = (SHIFT, TURN, MIRROR, RENUMBER, BODIES, PAIRS, KELVIN, LENGTH, SIMILAR, LATER)
