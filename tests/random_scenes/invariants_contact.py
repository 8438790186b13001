"""Laws of contact: bodies do not go through each other in any windows, and what is open does not press."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Pair
from random_scenes.compare import agreement
from random_scenes.invariant import Finding, Invariant
from random_scenes.outlines import depth, jumped, nearest_edge, outline_of
from random_scenes.scene import Scene
from random_scenes.story import COMPLETED, ERROR_BAR, FAILED, REFUSED, Story, told

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

MARGIN = 1.5  # of what is told: nodes are deeper than the mean over what they face
BULGE = 0.1  # of an edge: how far the middle of one may lie in what is drawn round; no circle has fewer than 8 edges
TIP = 0.2114  # (1 - 1/sqrt 3)/2 of an edge: from a tip to the first Gauss point (docs/contact.md)
TIED_TIP = 1.0 / 3.0  # of what a flank rises: of it the mean by its tip's shape function is nothing
ROUND_OFF = 1e-9  # of a body's size
THROUGH = ("went through", "passed through", "pass through", "goes through", "passes through", "start inside",
           "jumped", "crossed", "penetrat", "skipped over")
CORNER = ("corner", "shared", "shares", "several pairs", "two pairs")
LONGER = 10.0


def body_of(surface: str) -> str:
    """The body of a surface."""
    return surface.split(".")[0]


def size_of(story: Story) -> float:
    """Of the scene: the diagonal of the box around it [m]."""
    return float(np.linalg.norm(np.ptp(story.interface.nodes, axis=0)))


# PASSING: no node deeper in another body than is told.

def told_depth(story: Story, pair: Pair, k: int) -> float:
    """What a run says the sides of a pair overlap at level k [m]: by pressure, or by the gap where no force acts.

    A joint that is pulled everywhere, as a tied pair may be, does not overlap.
    """
    assert story.scenario is not None
    sides, level = [side for side in story.interface.pair_sides if side.pair == pair.name], story.levels[k]
    if story.scenario.mechanical_half == "elastic":
        return max(0.0, *(float(-level.t_N[side.at].min()) for side in sides)) / pair.eps_N
    return max(0.0, *(float(-level.gap[side.at].min()) for side in sides))


def tip_depths(story: Story, pair: Pair, nodes: Ints, x: Floats, other: Ints, told_m: float) -> Floats:
    """How far (n,) [m] tips at nodes (n,) may sink in beyond what is told, against the outline (m, 2) of the other.

    Of a flank of length h in a surface of the pair that rises by s against what it meets, the flatter of two: contact
    between Gauss points is not felt, 0.21 h s (docs/contact.md); and of a tip d < h s deep its node is told the mean of
    max(d - s y, 0) by its shape function, m = d^2/(h s) - d^3/(3 h^2 s^2) >= 2/3 d^2/(h s), so d <= (1.5 m h s)^(1/2).
    What is tied holds the mean of d - s y itself, 2/h int (1 - y/h)(d - s y) = d - h s/3 in the mean of both flanks, so
    at most that of the steeper one.
    """
    a, b = x[other[:, 0]], x[other[:, 1]]
    _, e = nearest_edge(x[nodes], a, b)
    t = (b - a)[e] / np.maximum(np.linalg.norm((b - a)[e], axis=1), 1e-300)[:, None]
    own = np.concatenate([story.interface.surfaces[pair.slave], story.interface.surfaces[pair.master]])
    h = max(float(np.linalg.norm(b - a, axis=1).max()), 0.0)
    depths = np.zeros(len(nodes))
    for i, node in enumerate(nodes):
        rises = []
        for edge in own[(own == node).any(axis=1)]:
            d = x[edge[1]] - x[edge[0]]
            length = float(np.linalg.norm(d))
            rises.append(max(length, h) * abs(float(d[0] * t[i, 1] - d[1] * t[i, 0])) / length)
        rise = max(rises, default=0.0) if pair.tied else min(rises, default=0.0)
        depths[i] = (TIED_TIP if pair.tied else TIP) * rise + np.sqrt(1.5 * told_m * rise)
    return depths


def overlap_as_drawn(story: Story, pair: Pair, nodes: Ints, line: Ints) -> Floats:
    """How deep (n,) [m] nodes (n,) of a tied pair were drawn inside the outline (m, 2) of the other: what is tied keeps
    gaps and overlaps as drawn (docs/contact.md); 0 of pairs that may part.
    """
    x = story.interface.nodes
    return np.maximum(depth(x[nodes], x[line[:, 0]], x[line[:, 1]]), 0.0) if pair.tied else np.zeros(len(nodes))


def passing(story: Story, about: str = "") -> list[Finding]:
    """Nodes deeper inside another body than told at the end of a window, and nodes that went across one in a window."""
    findings = []
    interface = story.interface
    lines = {b: outline_of(interface, b) for b in interface.bodies}
    places = [interface.nodes, *story.x]
    times = [0.0, *story.t]
    floor = ROUND_OFF * size_of(story)
    for pair in interface.pairs:
        sides = (body_of(pair.slave), body_of(pair.master))
        if sides[0] == sides[1]:
            continue
        worst: dict[str, tuple[float, str]] = {}
        for own, other in (sides, sides[::-1]):
            nodes, line, ends = np.unique(lines[own]), lines[other], lines[own]
            drawn = overlap_as_drawn(story, pair, nodes, line)
            for k, x in enumerate(places):
                level = max(k - 1, 0)
                allowed = MARGIN * told_depth(story, pair, level) + floor
                a, b = x[line[:, 0]], x[line[:, 1]]
                limits = allowed + drawn
                deep = depth(x[nodes], a, b)
                if (deep > limits).any():
                    limits += tip_depths(story, pair, nodes, x, line, told_depth(story, pair, level))
                if k and (excess := deep / limits).max() > 1.0:
                    i = int(excess.argmax())
                    what = (f"{about}pair {pair.name}: node {nodes[i]} of {own} lies {deep[i]:.4g} m deep in {other} "
                            f"at t = {times[k]:.6g} s, where {limits[i] - floor:.4g} m are told")
                    worst["deep"] = max(worst.get("deep", (0.0, "")), (float(excess[i]), what))
                if k and np.abs(x - places[k - 1]).max() > allowed:
                    before = places[k - 1]
                    for found in jumped((before[nodes], x[nodes]), (before[line[:, 0]], a), (before[line[:, 1]], b)):
                        limit = limits[found.point] + floor
                        if found.depth > 2.0 * limit and max(deep[found.point], 0.0) <= limits[found.point]:
                            what = (f"{about}pair {pair.name}: node {nodes[found.point]} of {own} went across {other} "
                                    f"between t = {times[k - 1]:.6g} and {times[k]:.6g} s, {found.depth:.4g} m deep on "
                                    "its way")
                            worst["jump"] = max(worst.get("jump", (0.0, "")), (found.depth / limit, what))
                    middle, there = (0.5 * (y[ends[:, 0]] + y[ends[:, 1]]) for y in (before, x))
                    length = np.linalg.norm(x[ends[:, 1]] - x[ends[:, 0]], axis=1)
                    for found in jumped((middle, there), (before[line[:, 0]], a), (before[line[:, 1]], b)):
                        limit = allowed + drawn.max() + BULGE * length[found.point]
                        if found.depth > limit:
                            what = (f"{about}pair {pair.name}: the edge of nodes {ends[found.point]} of {own} went "
                                    f"across {other} between t = {times[k - 1]:.6g} and {times[k]:.6g} s, "
                                    f"{found.depth:.4g} m deep on its way")
                            worst["edge"] = max(worst.get("edge", (0.0, "")), (found.depth / limit, what))
        findings += [Finding(what, size, THROUGH, story) for size, what in worst.values()]
    return findings


def _pairs(scene: Scene) -> bool:
    return bool(scene.pairs)


PASSING = Invariant("no passing through", _pairs, lambda scene, story, rng: passing(story), runs=0)
"""Bodies that a pair joins do not overlap by more than is told: p/penalty of the pair's largest pressure (the gap where
no force acts), half more since it is a mean over what a node faces, and for tips what tip_depths derives.  Sides that
are tied lie no deeper in each other than they were drawn, by more than that; where all of a joint is pulled nothing is
told.  Nor does the straight way of a node, or of the middle of an edge, lead through a body, out of which both of its
ends lie.  From the coordinates alone, by the crossing number of polygons.
"""


# LONGER: the same scene in long windows.

def presses(story: Story) -> dict[str, NDArray[np.bool_]]:
    """Pair -> whether (n,) it presses at each level; tied pairs, which press and pull, are left out."""
    tied = {pair.name for pair in story.interface.pairs if pair.tied}
    return {side.pair: (story.t_N[:, side.at] < 0.0).any(axis=1) for side in story.interface.pair_sides
            if side.own and side.pair not in tied}


def longer(scene: Scene, factor: float = LONGER) -> Scene:
    """The same scene in windows that many times as long, no longer than a range of them."""
    doc = scene.copied_doc()
    coupling = doc["coupling"]
    for key in ("rules", "study", "output"):
        doc.pop(key, None)
    windows, begin = [], 0.0
    for w in coupling["windows"]:
        span = min(float(w["until"]), float(coupling["end"])) - begin
        if span <= 0.0:
            break
        begin += span
        windows.append({"until": w["until"], "size": min(span, factor * max(v for k, v in w.items() if k != "until"))})
    coupling["windows"] = windows
    return Scene(doc, scene.recipes, scene.moved)


def _same_order(scene: Scene, story: Story, rng: np.random.Generator) -> list[Finding]:
    other = told(longer(scene))
    if other.outcome in (FAILED, REFUSED):
        return []
    findings = passing(other, "in windows ten times as long, ")
    step = float(np.diff(other.t).max())
    true, coarse = presses(story), presses(other)
    for name, states in coarse.items():
        for k, t in enumerate(other.t):
            near = (story.t >= t - step) & (story.t <= t + step)
            if near.sum() > 2 and len(set(true[name][near])) == 1 and states[k] != true[name][near][0]:
                does, should = ("presses", "is apart") if states[k] else ("is apart", "presses")
                # Whether a pair touches is no more sure than the coordinates of either run.
                unsure = (ERROR_BAR,) if "m" in other.may_be_off or "m" in story.may_be_off else ()
                findings.append(Finding(
                    f"in windows ten times as long pair {name} {does} at t = {t:.6g} s; in short ones it {should} from "
                    f"{max(t - step, 0.0):.6g} to {t + step:.6g} s", 2.0,
                    (*THROUGH, *unsure, "up and down", "missed a touch", "did not notice"),
                    story if "m" in story.may_be_off else other))
                break
    return findings


def _pairs_in_windows(scene: Scene) -> bool:
    coupling = scene.doc["coupling"]
    return bool(scene.pairs) and "windows" in coupling and not scene.doc.get("rules")


LONGER_WINDOWS = Invariant("long windows tell the same", _pairs_in_windows, _same_order)
"""In windows ten times as long bodies do not pass through each other either, and what touches, presses and parts does
so in the same order: at the end of a long window a pair is in the state in which the short windows have it for a long
window on either side.  A run that fails says why, and that is right.
"""


# OPEN: a pair that is apart takes no part.

def clearance(story: Story, pair: Pair) -> float:
    """The least distance of a pair's sides at any level [m], below 0 where a node lies behind its nearest edge."""
    interface = story.interface
    least = np.inf
    for own, other in ((pair.slave, pair.master), (pair.master, pair.slave)):
        nodes, edges = np.unique(interface.surfaces[own]), interface.surfaces[other]
        for x in story.x:
            a, b = x[edges[:, 0]], x[edges[:, 1]]
            distance, e = nearest_edge(x[nodes], a, b)
            t, r = (b - a)[e], x[nodes] - a[e]
            outside = r[:, 0] * t[:, 1] - r[:, 1] * t[:, 0] > 0.0  # the body is on the left
            least = min(least, float(np.where(outside, distance, -distance).min()))
    return least


def _open_does_not_press(scene: Scene, story: Story, rng: np.random.Generator) -> list[Finding]:
    findings = []
    floor = ROUND_OFF * size_of(story)
    for pair in story.interface.pairs:
        spec: Any = scene.pairs[pair.name].get("conduction")
        apart = clearance(story, pair) if spec else 0.0
        if not spec or apart <= 10.0 * floor or spec.get("closed") is None:
            continue
        other = told(scene.edited(**{f"contact__{pair.name}__conduction__closed": {"law": "constant", "h": 1e6},
                                     f"contact__{pair.name}__conduction__closed_factor": None}))
        if other.outcome != COMPLETED or other.T.shape != story.T.shape:
            continue
        off = np.abs(other.T - story.T)
        # Windows may touch in an iterate and be apart at their end: what is left of that is the iteration's tolerance.
        same = agreement(scene, iterated=story.says("iterated from here on"))
        allowed = 1e-9 * float(story.T.max()) + same.K + same.T * float(np.ptp(story.T))
        if off.max() > allowed:
            k, i = np.unravel_index(int(off.argmax()), off.shape)
            findings.append(Finding(
                f"pair {pair.name} is {apart:.4g} m apart at least, but its closed law moves node {i} by "
                f"{off[k, i]:.4g} K at t = {story.t[k]:.6g} s", float(off[k, i] / allowed), CORNER))
    return findings


def _several(scene: Scene) -> bool:
    return any(pair.get("conduction") for pair in scene.pairs.values())


OPEN = Invariant("what is open does not press", _several, _open_does_not_press, weight=4.0)
"""A pair whose sides never meet, by their coordinates, conducts by its `open` law only: with any other `closed` law the
scene is the same to round-off.  Red where a node of two pairs lends the pressure of the one to the other.
"""

INVARIANTS: Sequence[Invariant] = (PASSING, LONGER_WINDOWS, OPEN)
