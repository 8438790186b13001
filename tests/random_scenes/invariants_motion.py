"""SUPERPOSED MOTION: what turns as a whole, with all that holds and loads it, feels nothing of it.

Objectivity (Truesdell & Noll 1965, sec. 17): stresses, contact pressures, shear along a surface, friction heat and
temperatures do not change under a superposed rigid motion; positions turn.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from contact.problem.mechanical import Solution
from contact.problem.pairs import Settling
from random_scenes.compare import JUMPS, UNSTABLE, agreement, on_a_jump
from random_scenes.declared import NotApplicable, form_of
from random_scenes.invariant import Finding, Invariant
from random_scenes.scene import Scene
from random_scenes.shapes import Floats
from random_scenes.story import COMPLETED, Story, told
from random_scenes.turning import QUARTER, centre_of, check_directions, continued, rotation

WINDOWS = (1, 3, 9)  # of the turn
ROUND_OFF = 1e-12  # of the largest coordinate or temperature, after some turns and solves
EXACT = 1e-6  # of the scale of each quantity: solvers' tolerances, 1e-8 of the forces, over some windows
SLENDER = 1e-2  # of the tolerance of forces: what they leave of 1e-4 E, as a strain, in bodies a hundred times as soft


def apart(scene: Scene, still: Story, turned: Story, windows: int) -> Iterator[tuple[str, float]]:
    """Quantity with numbers, and its difference over what is allowed, at the ends of the windows of the turn."""
    share, strain = _exact(scene)
    T, t_N = np.ptp(still.T), np.abs(still.t_N).max(initial=0.0)
    u = np.abs(still.x - still.interface.nodes).max()
    last = slice(-windows, None)
    c = centre_of(scene)
    there = np.array([(x - c) @ rotation(QUARTER * (k + 1) / windows).T + c for k, x in enumerate(still.x[last])])
    far = (ROUND_OFF + strain) * float(np.abs(still.x).max())
    press = far * max((p.eps_N for p in still.interface.pairs), default=0.0)
    yield from _row("temperature", "K", turned.T[last] - still.T[last], T, ROUND_OFF * float(still.T.max()))
    yield from _row("place", "m", turned.x[last] - there, u, far, share)
    yield from _row("pressure", "Pa", turned.t_N[last] - still.t_N[last], t_N, press, share)
    for name, unit in (("mechanical.contact.t_T", "Pa"), ("mechanical.contact.E_friction", "J")):
        if name in still.extra:
            a, b = (np.array(story.extra[name]) for story in (still, turned))
            scale = t_N if unit == "Pa" else np.abs(a).max()
            words = "shear" if unit == "Pa" else "friction heat"
            yield from _row(words, unit, b[last] - a[last], scale if scale > 0.0 else float(np.abs(b).max()),
                            press if unit == "Pa" else 0.0, share)
    ledger = [name for name in still.ledger if name in turned.ledger]
    if ledger:
        a, b = (np.array([story.ledger[name] for name in ledger]) for story in (still, turned))
        yield from _row("heat of the ledger", "J", (b - a)[:, last], float(np.abs(a).max()))


def _exact(scene: Scene) -> tuple[float, float]:
    """Share of its scale that a mechanical quantity may differ by, and the strain that solvers leave where none is.

    Pressures that are corrected in rounds of equilibria end where they change by less than a tolerance of their own.
    """
    file = form_of(scene.doc)
    elastic = file.mechanical.elastic
    if elastic is None:
        return EXACT, 0.0
    rounds = elastic.method is not Solution.NEWTON or any(
        p.augmented is not None and p.augmented.method is Settling.UZAWA for p in file.contact.values())
    return (agreement(scene).t_N if rounds else EXACT), SLENDER * elastic.tolerance


def _row(name: str, unit: str, off: Floats, scale: float, floor: float = 0.0,
         share: float = EXACT) -> Iterator[tuple[str, float]]:
    """floor : what round-off of coordinates makes of a quantity, in its unit.  share : of the scale, may be off."""
    worst = float(np.abs(off).max(initial=0.0))
    if worst > 0.0:
        allowed = share * scale + floor
        size = worst / allowed if allowed > 0.0 else np.inf
        yield f"{name} by {worst:.3g} {unit} (of {scale:.3g} {unit})", size


def _turns(scene: Scene) -> bool:
    try:
        check_directions(scene)
    except NotApplicable:
        return False
    return True


def felt(scene: Scene, story: Story, windows: int) -> list[Finding]:
    """What is felt of a turn by 90 degrees in so many windows, behind the end of the story.

    Nothing is said where a run fails, for that is told, or where a window is put back or cut inside the half: supports
    go along a chord then, which squeezes the bodies on the way.
    """
    still_scene, turned_scene, _ = continued(scene, story, windows)
    still, turned = told(still_scene), told(turned_scene)
    if still.outcome != COMPLETED or turned.outcome != COMPLETED or not np.array_equal(still.t, turned.t):
        return []
    if max(float(np.max(cuts)) for cuts in turned.extra["mechanical.cuts"][-windows:]) > 0.0:
        return []
    rows = sorted((row for row in apart(scene, still, turned, windows) if row[1] > 1.0), key=lambda r: -r[1])
    if not rows:
        return []
    return [Finding(f"turned by 90 degrees in {windows} windows: " + ", ".join(what for what, _ in rows), rows[0][1],
                    (*UNSTABLE, *(JUMPS if on_a_jump(still) else ())), turned)]


def _unfelt(scene: Scene, story: Story, rng: np.random.Generator) -> Sequence[Finding]:
    return [finding for windows in WINDOWS for finding in felt(scene, story, windows)]


TURNING = Invariant("superposed turn", _turns, _unfelt, runs=6, weight=4.0)
"""Behind the end of a plane quasi-static scene it is turned by 90 degrees in 1, 3 and 9 windows; supports, dead loads
and weight turn with it.  Against the same scene with the same windows and no turn, temperatures, pressures, shear, heat
and places turned back agree to 1e-6 of their scales.
"""
MOTION = (TURNING,)
