"""ROLES: which side of a pair is called slave, and which is called master, is a choice of method, not of nature.

Both choices discretise one problem (Puso & Laursen 2004 for segment-to-segment contact), so what they give tends to
one answer as meshes are refined: totals are heat stored in each body, heat that crossed contact and gaps, heat of
friction, and the force of each pair at the end.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial import cKDTree

from random_scenes.change import Changed, sides_swapped
from random_scenes.compare import JUMPS, agreement, on_a_jump
from random_scenes.declared import NotApplicable
from random_scenes.invariant import Finding, Invariant
from random_scenes.refine import finer_mesh
from random_scenes.scene import Scene
from random_scenes.shapes import Floats
from random_scenes.story import COMPLETED, Story, told

MOST_NODES = 2500  # of the refined meshes
SETTLED = 5.3  # a difference of order h^p is 1/(2^p - 1) times what the last halving took off it: p = 1/4 or better
EVEN = 0.1  # of a gap: sides this parallel, or concentric, see one mean conductance
AT_EVEN_GAPS = 0.01  # of the heat that crosses them
OTHER = {"slave": "master", "master": "slave"}


def totals(story: Story, swapped: bool = False) -> dict[str, float]:
    """Name -> what a whole run or its end adds up to.

    swapped : of a run whose slaves are the other's masters; names are the other's then.
    """
    found = {name: float(values[-1]) for name, values in story.ledger.items() if name.startswith("stored.")}
    for kind in (("contact", "gap"), ("near_radiation",), ("friction",)):
        for side in OTHER:
            own = OTHER[side] if swapped else side
            parts = [float(story.ledger[f"{k}.{own}"][-1]) for k in kind if f"{k}.{own}" in story.ledger]
            found[f"{' and '.join(kind)}, into the {side}"] = sum(parts)
    found["friction, into both"] = sum(found.pop(f"friction, into the {side}") for side in OTHER)
    return found | {f"force of {pair.name}": force_on(story, pair.name, pair.slave) for pair in story.interface.pairs}


def force_on(story: Story, pair: str, surface: str) -> float:
    """The integral of a pair's pressure over what a surface of it faces at the end [N]; a node's is its mean over that.
    """
    edges = story.interface.surfaces[surface]
    x = story.x[-1][edges]
    areas = np.repeat(0.5 * np.linalg.norm(x[:, 1] - x[:, 0], axis=1)[:, None], 2, axis=1)
    if story.scene.axisymmetric:
        r = x[:, :, 0]
        areas *= 2.0 * np.pi * (2.0 * r + r[:, ::-1]) / 3.0
    side = story.interface.side_of(pair, surface)
    at = side.at.start + np.searchsorted(side.nodes, edges)
    return float(-(areas * story.levels[-1].covered[at] * story.t_N[-1][at]).sum())


def tilt_of(story: Story) -> float:
    """1 - cos of the largest angle between the sides of pairs where they face each other, at the end.

    Across a wedge heat has no one area: that of either side is as good, and they differ by so much.
    """
    worst, x = 0.0, story.x[-1]
    for pair in story.interface.pairs:
        slave, master = (story.interface.surfaces[name] for name in (pair.slave, pair.master))
        side = story.interface.side_of(pair.name, pair.slave)
        slave = slave[story.levels[-1].covered[side.at][np.searchsorted(side.nodes, slave)].min(axis=1) > 0.0]
        if len(slave):
            along_s, along_m = (x[edges[:, 1]] - x[edges[:, 0]] for edges in (slave, master))
            _, faced = cKDTree(x[master].mean(axis=1)).query(x[slave].mean(axis=1))
            lengths = np.linalg.norm(along_s, axis=1) * np.linalg.norm(along_m[faced], axis=1)
            worst = max(worst, float((1.0 - np.abs((along_s * along_m[faced]).sum(axis=1)) / lengths).max()))
    return worst


def scales(*runs: Mapping[str, float]) -> dict[str, float]:
    """What a total is measured by: the largest heat, or the largest force, of the runs."""
    heat = max([abs(v) for names in runs for n, v in names.items() if not n.startswith("force")], default=0.0)
    force = max([abs(v) for names in runs for n, v in names.items() if n.startswith("force")], default=0.0)
    return {n: force if n.startswith("force") else heat for n in runs[0]}


def disagreements(scene: Scene, changed: Changed, story: Story) -> Sequence[tuple[str, float]]:
    """Sentence and size of each total that does not come together as meshes are refined."""
    pairs: list[tuple[dict[str, float], dict[str, float]]] = []
    suspect: list[tuple[str, float]] = []
    for times in (1, 2, 4):
        a = story if times == 1 else told(finer_mesh(scene, times))
        b = told(finer_mesh(changed.scene, times) if times > 1 else changed.scene)
        if a.outcome != COMPLETED or b.outcome != COMPLETED:
            return []  # told, and left out
        pairs.append((totals(a), totals(b, swapped=True)))
        scale, solved, tilt = scales(*pairs[-1]), agreement(scene), tilt_of(a)
        floor = {n: max(solved.heat, tilt, solved.t_N if n.startswith("force") else 0.0) * scale[n] for n in scale}
        apart = {n: [p[n] - q[n] for p, q in pairs] for n in scale}
        suspect = []
        for n, d in apart.items():
            allowed = floor[n] + (SETTLED * abs(d[-1] - d[-2]) if times > 1 else 0.0)
            if abs(d[-1]) > allowed:
                rows = " and ".join(f"{p[n]:.6g} against {q[n]:.6g}" for p, q in pairs)
                suspect.append((f"{n} with meshes refined {times} times, {changed.what}: {rows}", abs(d[-1]) / allowed))
        if not suspect:
            return []
    return suspect


def _swappable(scene: Scene) -> bool:
    """Whether sides can be swapped and meshes refined, and answers have a limit."""
    if scene.moved is not None or scene.doc.get("rules"):
        return False
    softens = any(m.get("plastic", {}).get("softening") for m in scene.doc["materials"].values())
    rod = "rod" in (scene.doc["thermal"].get("half", "thermal"), scene.doc["mechanical"]["half"])
    if softens or rod or sum(len(s.nodes) for s in finer_mesh(scene, 4).shapes.values()) > MOST_NODES:
        return False
    try:
        sides_swapped(scene)
    except NotApplicable:
        return False
    return True


# A stated pressure acts on the whole pair, each of whose sides has its own length where they lie apart.
STATED = ("rigid.pressure presses lies apart",)


def _same_totals(scene: Scene, story: Story, rng: np.random.Generator) -> Sequence[Finding]:
    found = sorted(disagreements(scene, sides_swapped(scene), story), key=lambda f: -f[1])
    if not found:
        return []
    named_by = (*STATED, *(JUMPS if on_a_jump(story) else ()))
    return [Finding("; ".join(what for what, _ in found), found[0][1], named_by)]


SIDES = Invariant("roles: slave and master", _swappable, _same_totals, runs=5)
"""Totals with slave and master changed over come together as meshes are refined.

What is left between the two is at most 5.3 times what the last halving of both meshes took off it, on meshes as they
are, halved and halved again: a difference that tends to nothing as h^p leaves 1/(2^p - 1) times that, 1 for p = 1, 2.4
for the square root of a punch's edge, and 5.3 for h^(1/4): edges of unlike bodies that rub are no better (Comninou
1976).  Bulk errors are the same in both and fall out.  Where the two agree to the solvers' tolerance nothing is
refined.  Sides that stand aslant to each other have no one area and no one normal: 1 - cos of the angle is allowed.
"""


# Gaps that are the same everywhere


def even_gaps(story: Story) -> float | None:
    """The share of the sides that faces nothing, where all pairs are open throughout over gaps that are even; or None.

    Even: the same to EVEN wherever all of a node's edges face the other side.  At most the two ends of a side may not:
    normals of an arc that is cut there go past the other's end.
    """
    if story.t_N.any() or not len(story.interface.pairs):
        return None
    bare = 0.0
    for side in story.interface.pair_sides:
        for level in story.levels:
            covered: Floats = level.covered[side.at]
            whole = covered >= 1.0 - 1e-6
            gap: Floats = level.gap[side.at][whole]
            if whole.sum() < max(2, len(covered) - 2) or np.ptp(gap) > EVEN * gap.mean():
                return None
            bare = max(bare, float((1.0 - covered).sum()) / (len(covered) - 1))
    return bare


def _same_heat(scene: Scene, story: Story, rng: np.random.Generator) -> Sequence[Finding]:
    bare = even_gaps(story)
    if bare is None:
        return []
    other = told(sides_swapped(scene).scene)
    if other.outcome != COMPLETED:
        return []
    a, b = totals(story), totals(other, swapped=True)
    found = []
    for n in a:
        if not n.startswith(("contact", "near")):
            continue
        apart = abs(a[n] - b[n])
        allowed = (AT_EVEN_GAPS + bare) * max(abs(a[n]), abs(b[n])) + agreement(scene).heat * scales(a)[n]
        if apart > allowed:
            found.append(Finding(f"{n}: {a[n]:.6g} J, slave and master changed over {b[n]:.6g} J, across a gap that is "
                                 f"the same everywhere", apart / allowed, ()))
    return sorted(found, key=lambda f: -f.size)[:1]


def _has_gaps(scene: Scene) -> bool:
    try:
        sides_swapped(scene)
    except NotApplicable:
        return False
    return all(pair["gap_max"] > 0.0 for pair in scene.pairs.values())


EVEN_GAPS = Invariant("roles: heat across even gaps", _has_gaps, _same_heat, weight=4.0)
"""Across parallel or concentric gaps that stay open the heat agrees to 1 % with slave and master changed over.

There the conductance is one number for both sides, so what is left is one area for the flow; meshes of parallel sides
have the same area, those of concentric arcs differ from it by their chords, (pi/2n)^2/6 of it for n edges a quarter:
below 1 % from n = 7 on.  A gap uneven by e has a mean conductance off by e^2/12, 0.1 % for 10 %.  What faces nothing at
the ends of an arc is allowed besides.
"""
ROLES = (SIDES, EVEN_GAPS)
