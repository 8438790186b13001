"""ROLES: which side of a pair is called slave, and which is called master, is a choice of method, not of nature.

Both choices discretise one problem (Puso & Laursen 2004 for segment-to-segment contact), so what they give tends to
one answer as meshes are refined: totals (heat stored in each body, heat that crossed contact and gaps, heat of
friction, the force of each pair at the end) agree to the error of either mesh.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from random_scenes.change import Changed, sides_swapped
from random_scenes.compare import JUMPS, agreement, on_a_jump
from random_scenes.declared import NotApplicable
from random_scenes.invariant import Finding, Invariant
from random_scenes.refine import finer_mesh
from random_scenes.scene import Scene
from random_scenes.shapes import Floats, Ints
from random_scenes.story import COMPLETED, Story, told

MOST_NODES = 1200  # of the refined meshes
SETTLED = 2.0  # a method of first order is as far from its limit as one halving moves it; both are not straight yet
EVEN = 0.01  # of a gap: two sides this parallel, or concentric, see one conductance everywhere
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
    for pair in story.interface.pairs:
        sides = {name: force_on(story, name) for name in (pair.slave, pair.master)}
        found[f"force of {pair.name}"] = sides[pair.slave]
    return found


def force_on(story: Story, surface: str) -> float:
    """The integral of the pressure over a surface at the end [N], by the areas its nodes have then."""
    edges = story.interface.surfaces[surface]
    x = story.x[-1][edges]
    length = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
    if story.scene.axisymmetric:
        length = length * np.pi * x[:, :, 0].sum(axis=1)
    t_N = story.t_N[-1][np.searchsorted(story.interface.contact_nodes, edges)]
    return float(-(length * t_N.mean(axis=1)).sum())


def scales(story: Story, names: Mapping[str, float]) -> dict[str, float]:
    """What a total is measured by: the largest heat, or the largest force, of the run."""
    heat = max([abs(v) for n, v in names.items() if not n.startswith("force")], default=0.0)
    force = max([abs(v) for n, v in names.items() if n.startswith("force")], default=0.0)
    return {n: force if n.startswith("force") else heat for n in names}


def disagreements(scene: Scene, story: Story, changed: Changed) -> Iterator[tuple[str, float]]:
    """Sentence and size of each total that is not the same to the error of the meshes."""
    other = told(changed.scene)
    if other.outcome != COMPLETED:
        return
    a, b = totals(story), totals(other, swapped=True)
    scale = scales(story, a)
    solved = agreement(scene)
    apart = {n: abs(a[n] - b[n]) for n in a}
    floor = {n: max(solved.T, solved.heat, solved.t_N if n.startswith("force") else 0.0) * scale[n] for n in a}
    if all(apart[n] <= floor[n] for n in a):
        return
    runs = [told(finer_mesh(s)) for s in (scene, changed.scene)]
    if any(run.outcome != COMPLETED for run in runs):
        return
    fine = [totals(runs[0]), totals(runs[1], swapped=True)]
    for n in a:
        moved = abs(fine[0][n] - a[n]) + abs(fine[1][n] - b[n])
        allowed = SETTLED * moved + floor[n]
        if apart[n] > allowed:
            yield (f"{n}: {a[n]:.6g}, {changed.what} {b[n]:.6g} (meshes refined once {fine[0][n]:.6g} and "
                   f"{fine[1][n]:.6g})", apart[n] / allowed)


def _swappable(scene: Scene) -> bool:
    """Whether sides can be swapped and meshes refined, and answers have a limit."""
    if scene.moved is not None or scene.doc.get("rules"):
        return False
    softens = any(m.get("plastic", {}).get("softening") for m in scene.doc["materials"].values())
    rod = "rod" in (scene.doc["thermal"].get("half", "thermal"), scene.doc["mechanical"]["half"])
    if softens or rod or sum(len(s.nodes) for s in finer_mesh(scene).shapes.values()) > MOST_NODES:
        return False
    try:
        sides_swapped(scene)
    except NotApplicable:
        return False
    return True


def _same_totals(scene: Scene, story: Story, rng: np.random.Generator) -> Sequence[Finding]:
    found = sorted(disagreements(scene, story, sides_swapped(scene)), key=lambda f: -f[1])
    if not found:
        return []
    return [Finding("; ".join(what for what, _ in found), found[0][1], JUMPS if on_a_jump(story) else ())]


SIDES = Invariant("roles: slave and master", _swappable, _same_totals, runs=3)
"""Totals with slave and master changed over agree to twice what one refinement of both moves them.

A total of a method of order p is off its limit by its change under one refinement over 1 - 2^-p, for p = 1 twice the
change; each of the two runs is allowed that.  Where both agree to the solvers' tolerance nothing is refined.
"""


# Gaps that are the same everywhere


def even_gaps(story: Story) -> bool:
    """Whether all pairs are open throughout, over the same gap to 1 % wherever they face each other, on whole sides."""
    contact = story.interface.contact_nodes
    if story.t_N.any() or not len(story.interface.pairs):
        return False
    for pair in story.interface.pairs:
        for surface in (pair.slave, pair.master):
            at: Ints = np.searchsorted(contact, np.unique(story.interface.surfaces[surface]))
            for level in story.levels:
                gap: Floats = level.gap[at]
                if level.covered[at].min() < 1.0 - 1e-6 or np.ptp(gap) > EVEN * gap.mean():
                    return False
    return True


def _same_heat(scene: Scene, story: Story, rng: np.random.Generator) -> Sequence[Finding]:
    if not even_gaps(story):
        return []
    other = told(sides_swapped(scene).scene)
    if other.outcome != COMPLETED:
        return []
    a, b = totals(story), totals(other, swapped=True)
    found = []
    for n in a:
        if not n.startswith(("contact", "near")):
            continue
        apart, allowed = abs(a[n] - b[n]), AT_EVEN_GAPS * max(abs(a[n]), abs(b[n])) + agreement(scene).heat * scales(
            story, a)[n]
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


EVEN_GAPS = Invariant("roles: heat across even gaps", _has_gaps, _same_heat)
"""Across parallel or concentric gaps that stay open the heat agrees to 1 % with slave and master changed over.

There the conductance is one number for both sides, so what is left is one area for the flow; meshes of parallel sides
have the same area, those of concentric arcs differ from it by their chords, (pi/2n)^2/6 of it for n edges a quarter:
below 1 % from n = 7 on.
"""
ROLES = (SIDES, EVEN_GAPS)
