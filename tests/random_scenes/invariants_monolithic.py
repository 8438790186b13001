"""Windows that were iterated to the end are those of one system of both fields; large ones end in the steady state."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupler.running.setup import plan_of
from coupler.scenario.options import Tolerances
from random_scenes.direct_half import launch_directly
from random_scenes.invariant import Finding, Invariant
from random_scenes.one_newton import Both, End, NoAnswerError, Window, begun, windows_of
from random_scenes.refine import tightly_iterated, windows_along, with_scheme
from random_scenes.scene import Scene
from random_scenes.story import COMPLETED, Story, told

Floats = NDArray[np.float64]

# One system
MOST_UNKNOWNS = 200
WINDOWS = 5
TIGHT = 1e-2  # of the default tolerances of iteration: 1e-6 K and 1e-6 of the change in a window
NEWTON = {"thermal": 1e-12, "elastic": 1e-10}  # a hundredth of the default, so that it is far below TIGHT
WITHIN = 10.0  # tolerances: what iterating leaves is the tolerance over 1 less the slope of the iteration

# What a run says of the window from which on its exchange is another; times in words have six digits.
AT_END = re.compile(r"window \d+ \(to t = (\S+) s\): .* iterated from here on, given x and t_N of their end")

# Steady
HUGE = 1e4  # times the slowest time of conduction
STILL = 1e-4  # of the range of T


class Allowed:
    """Quantity -> what iterating the windows so far may have left of it, in its unit: their tolerances add up."""

    def __init__(self) -> None:
        self._of = dict.fromkeys(("T", "x", "t_N", "f_s"), 0.0)

    def __getitem__(self, name: str) -> float:
        return self._of[name]

    def add(self, start: End, end: End) -> None:
        """A window from start to end, iterated to the tolerances, tight."""
        of = Tolerances()
        for name, tolerance in (("T", of.temperature), ("x", of.gap), ("t_N", of.pressure), ("f_s", of.solid_fraction)):
            a, b = getattr(start, name), getattr(end, name)
            if a is not None and b is not None and b.size:
                self._of[name] += TIGHT * (tolerance.atol + tolerance.rtol * float(np.abs(b - a).max()))

    def misfits(self, a: End, b: End) -> dict[str, float]:
        """Quantity -> largest difference of two ends over what is allowed."""
        found = {}
        for name, allowed in self._of.items():
            p, q = getattr(a, name), getattr(b, name)
            found[name] = float(np.abs(p - q).max()) / allowed if p is not None and p.size else 0.0
        return found


def _slopes(after: End, own: End, coupled: End, allowed: Allowed) -> dict[str, float]:
    """Quantity -> by how many of its tolerances it moves where what is put into an iterate is off by its tolerance.

    own came of the coupler's T and f_s, after of own's: the second step of the power method, so near the largest slope.
    Nearer than a tolerance it is what the halves leave over, melts for example, whose places hardly resist.
    """
    put_in, came = allowed.misfits(own, coupled), allowed.misfits(after, own)
    off = max(put_in["T"], put_in["f_s"], 1.0)
    return {name: size / off for name, size in came.items()}


def iterated_tightly(scene: Scene, story: Story) -> Scene:
    """The scene along its windows, iterated to a hundredth of the tolerances, and both halves' Newton likewise."""
    along = tightly_iterated(windows_along(scene, story.t, 1), TIGHT)
    doc = along.copied_doc()
    doc["thermal"]["tolerance"] = NEWTON["thermal"]
    if doc["mechanical"]["half"] == "elastic":
        doc["mechanical"].setdefault("elastic", {})["tolerance"] = NEWTON["elastic"]
    return replace(along, doc=doc)


def seen_at_end_from(run: Story) -> float:
    """The end [s] of the first window that a run, unstable or ringing, came to iterate by x and t_N of its end; inf."""
    ends = [found.group(1) for word in run.words if (found := AT_END.match(word)) is not None]
    return min(map(float, ends), default=np.inf) * (1.0 - 1e-5)


def check_one_system(scene: Scene, story: Story, rng: np.random.Generator) -> Sequence[Finding]:
    """The first windows iterated tightly, against Newton's method on both fields from the same start."""
    tight = iterated_tightly(scene, story)
    run = told(tight, until=float(story.t[min(WINDOWS, len(story.t) - 1)]))
    if run.outcome != COMPLETED or run.scenario is None:
        return []
    coupling = run.scenario.coupling
    schedule = plan_of(run.scenario).schedule
    restarts = sorted(schedule.clock.seconds(k) for k in schedule.events)
    substeps = (coupling.substeps["thermal"], coupling.substeps["mechanical"])
    at_end = coupling.iteration.level.value == "end"
    with TemporaryDirectory(prefix="slideline-random-") as scratch:
        scenario = tight.checked(Path(scratch))
        with launch_directly(scenario, processes=False) as launched:
            both = begun(launched, scenario.interface, coupling.end)
            allowed = Allowed()
            turned = seen_at_end_from(run)
            for k, planned in enumerate(windows_of(run.t, restarts, substeps, at_end), 1):
                window, level = replace(planned, at_end=at_end or planned.t1 >= turned), run.levels[k]
                found = _compared(both, window, End(level.T, level.x, level.t_N, level.f_s), allowed, run)
                if found is None:
                    break
                if found:
                    return found
    return []


def _compared(both: Both, window: Window, coupled: End, allowed: Allowed, run: Story) -> list[Finding] | None:
    """What is wrong with a window; None where it has several answers, or none was found."""
    start = both.now
    about = f"at t = {window.t1:.6g} s the iterated window"
    allowed.add(start, coupled)
    with both:
        try:
            own = both.outcome(window, coupled.T, coupled.f_s)
            wrong = allowed.misfits(own, coupled)
            if max(wrong.values()) > WITHIN:
                slope = _slopes(both.outcome(window, own.T, own.f_s), own, coupled, allowed)
                name = max(wrong, key=lambda n: wrong[n] / (1.0 + slope[n]))
                most = WITHIN * (1.0 + slope[name])
                if wrong[name] > most:
                    return [Finding(f"{about} does not solve the system of both fields: {name} is off by "
                                    f"{wrong[name]:.3g} tolerances of iteration, where {most:.3g} are allowed",
                                    wrong[name] / most, ("iteration", "converge"), run)]
            tolerance = allowed["T"]
            solved = both.solve(window, start, 0.1 * tolerance)
            apart = float(np.abs(solved.T - coupled.T).max()) / tolerance
            if apart > WITHIN:
                nearest = both.solve(window, coupled, 0.1 * tolerance)
                if np.abs(nearest.T - coupled.T).max() <= WITHIN * tolerance:
                    return None  # two answers, each as good
                return [Finding(f"{about} is {apart:.3g} tolerances of iteration from the answer of Newton's method "
                                "on both fields", apart / WITHIN, ("iteration", "converge"), run)]
        except NoAnswerError:
            return None
        both.take(window, coupled.T, coupled.f_s)
    return []


def _halves_are_plain(scene: Scene) -> bool:
    """Whether a window of its halves is a smooth function: no inner steps that are chosen, none that are left out."""
    elastic = scene.doc["mechanical"].get("elastic", {})
    return ("adaptive" not in scene.doc["thermal"] and not elastic.get("skip") and not elastic.get("adiabatic")
            and elastic.get("method", "newton") != "explicit" and not scene.doc.get("rules"))


def _is_small(scene: Scene) -> bool:
    return _halves_are_plain(scene) and sum(len(s.nodes) for s in scene.shapes.values()) <= MOST_UNKNOWNS


def slowest(scene: Scene) -> float:
    """The time [s] a body takes to be of one temperature, or a wall between films: size^2 rho c/k, at the most."""
    def number(value: Any, of: Any, otherwise: float) -> float:
        return float(value) if isinstance(value, (int, float)) else otherwise

    slow = 0.0
    for body, shape in scene.shapes.items():
        m = scene.doc["materials"][scene.doc["bodies"][body]["material"]]
        k, c = number(m.get("k"), min, 1.0), number(m.get("c"), max, 1000.0)
        slow = max(slow, shape.size**2 * float(m["rho"]) * c / k)
    return slow


def check_steady(scene: Scene, story: Story, rng: np.random.Generator) -> Sequence[Finding]:
    """The scene to its end in one window, then two huge ones, iterated, by backward Euler or sdirk2."""
    end, method = float(story.t[-1]), str(rng.choice(["backward_euler", "sdirk2"]))
    huge = HUGE * max(slowest(scene), end)
    settled = with_scheme(scene, "iterated", method, level="end", max_iterations=60)
    doc = settled.copied_doc()
    doc["thermal"].pop("adaptive", None)
    for key in ("adaptive", "events", "stop", "on_cycle", "substeps"):
        doc["coupling"].pop(key, None)
    windows = [{"until": end, "size": end / 4}, *({"until": end + n * huge, "size": huge} for n in (1, 2, 3))]
    # Behind a breakpoint the first guess is what is there: of several steady states the one that was found is kept.
    kinks = [*doc["coupling"].get("kinks", ()), end + huge, end + 2 * huge]
    doc["coupling"] |= {"end": end + 3 * huge, "windows": windows, "kinks": kinks}
    doc.get("output", {}).pop("fields", None)
    run = told(replace(settled, doc=doc))
    if run.outcome != COMPLETED or run.t[-3] < end + 0.99 * huge:
        return []  # it says what stopped it, or windows had to be cut
    scale = float(np.ptp(run.T)) + 1e-3
    moved = float(np.abs(run.T[-1] - run.T[-2]).max()) / scale
    if moved <= STILL:
        return []
    return [Finding(f"with {method} T moves by {moved:.3g} of its range from one window of {huge:.3g} s to the next of "
                    "as much", moved / STILL, ("cycle", "up and down", "alternat", "unstable"), run)]


def _has_steady_state(scene: Scene) -> bool:
    """Whether T must come to rest: each body is held by a temperature or a film, and nothing flows, melts or moves."""
    if not _halves_are_plain(scene) or scene.doc["thermal"].get("half", "thermal") != "thermal":
        return False
    used = {scene.doc["bodies"][b]["material"] for b in scene.doc["bodies"]}
    if any(key in scene.doc["materials"][m] for m in used for key in ("plastic", "creep", "liquid", "latent")):
        return False
    if scene.doc["mechanical"].get("elastic", {}).get("dynamics") is not None:
        return False
    boundary = scene.doc["thermal"].get("boundary", ())
    held = {str(entry.get("on", entry.get("at", ""))).split(".")[0] for entry in boundary
            if "temperature" in entry or ("convection" in entry and "gap" not in entry["convection"])}
    return held >= set(scene.doc["bodies"])


ONE_SYSTEM = Invariant("one system", _is_small, check_one_system, runs=2)
"""A window iterated to a tolerance is the solution of one system of both fields with the same stages, to 10 of these.

The stages and what one half sees of the other inside a window are those of docs/theory.md (table of schemes); the
system is asked whether the coupler's answer solves it, to 10 times the tolerances of the windows so far and what an
iterate makes of one (the iteration ends where what was put in is right to its tolerance), and solved by Newton's method
with Krylov directions from the window's start (Knoll and Keyes 2004).  A window with two answers is left out: where
Newton's method, begun at the coupler's, stays there.
"""

STEADY = Invariant("steady", _has_steady_state, check_steady)
"""Two windows of 1e4 times the slowest time of conduction end in the same T, by methods that damp.

An L-stable method (Hairer and Wanner 1996, IV.3) maps any start to the steady state as the window grows, but for
1/(window/time scale) of the way: 1e-4 of the range is that.  Iterated and given x and t_N of the end of each substep,
nothing is late between the halves.  Contact may have several steady states, touching and apart; so each huge window
begins its iteration where the last one ended, and what is steady stays.
"""

INVARIANTS = (ONE_SYSTEM, STEADY)
