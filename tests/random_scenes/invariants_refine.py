"""Answers settle where windows and meshes are refined, and an error that was estimated is the error that there is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from random_scenes.invariant import Finding, Invariant
from random_scenes.invariants_thermal import slowest_cell_time
from random_scenes.refine import finer_mesh, finer_windows, windows_along
from random_scenes.scene import Scene
from random_scenes.story import COMPLETED, Story, told

Floats = NDArray[np.float64]

# The error that was estimated
TIMES_ESTIMATED = 3.0
SHARE_OF_WINDOWS = 0.98
SHARES = (1, 4, 16)  # by which the tolerances of what is judged are divided
MOST_WINDOWS = 40  # of a run that is compared: its reference has eight times as many
FIELDS = {"temperature": "T", "displacement": "x"}
SOLVED_TO = 1e-6  # of the range of a field: what Newton's tolerances leave, 1e-8 of the forces, times some windows

# Meshes and windows
LEVELS = 4
MOST_NODES = 600  # on the mesh of cells halved twice
MOST_REFINED = 120  # windows of one run
FLOOR = 0.02  # of the range of a measure in time
ROUND_OFF = 1e-7  # of what a measure is made of, hundreds of times what Newton's tolerances leave


def _apart(a: Floats, b: Floats) -> Floats:
    """(n,) largest difference at the end of each of n windows."""
    return np.abs(a - b)[1:].reshape(len(a) - 1, -1).max(axis=1)


def _ratios(story: Story) -> dict[str, Floats]:
    """Quantity -> error of each window end over the sum of all errors estimated up to there.

    Left out: ends at which the reference has not settled (its windows halved again change it by more than half of the
    error that is judged), those below what the solvers leave, and all behind a window whose error is not known.
    """
    finer, finest = (told(windows_along(story.scene, story.t, n), most=10 * MOST_WINDOWS) for n in (4, 8))
    if finer.outcome != COMPLETED or finest.outcome != COMPLETED:
        return {}
    at, of = (np.searchsorted(s.t, story.t * (1 - 1e-9)) for s in (finest, finer))
    if max(at.max() - len(finest.t), of.max() - len(finer.t)) >= 0:
        return {}
    found = {}
    for quantity, name in FIELDS.items():
        own, fine, finer_field = (np.asarray(getattr(s, name))[k] for s, k in (
            (story, slice(None)), (finest, at), (finer, of)))
        error, unsettled = _apart(own, fine), _apart(finer_field, fine)
        floor = SOLVED_TO * float(np.abs(own - own[0]).max() + np.ptp(own[0], axis=0).max())
        estimated = np.cumsum(story.errors[quantity]) + floor
        good = np.isfinite(estimated) & (unsettled <= 0.5 * error) & (error > floor)
        if good.any():
            found[quantity] = np.where(good, error / np.where(good, estimated, 1.0), 0.0)[np.isfinite(estimated)]
    return found


def check_estimate(scene: Scene, story: Story, rng: np.random.Generator) -> Sequence[Finding]:
    """What a run says of its errors, against runs along its own windows cut in four and in eight; three tolerances."""
    ratios: dict[str, list[Floats]] = {}
    for share in SHARES:
        run = story if share == 1 else told(finer_windows(scene, share), most=MOST_WINDOWS)
        if run.outcome != COMPLETED or not 2 < len(run.levels) <= MOST_WINDOWS:
            break
        for quantity, found in _ratios(run).items():
            ratios.setdefault(quantity, []).append(found)
    findings = []
    for quantity, rows in ratios.items():
        worst = float(np.quantile(np.concatenate(rows), SHARE_OF_WINDOWS))
        if worst > TIMES_ESTIMATED:
            findings.append(Finding(
                f"the error of {quantity} is {worst:.3g} times what was estimated up to there in the worst "
                f"{100 * (1 - SHARE_OF_WINDOWS):.0f} % of windows; by tolerance "
                + ", ".join(f"{np.quantile(r, SHARE_OF_WINDOWS):.3g}" for r in rows),
                worst / TIMES_ESTIMATED, ("error of", "too large", "tolerance")))
    return findings


def measures(story: Story) -> Mapping[str, Floats]:
    """Name -> (n,) at the start and the end of every window: what has a limit on ever finer meshes.

    Mean temperature, mean displacement and stored heat of each body; no pressures and no largest values, which
    have none at a corner.
    """
    assert story.scenario is not None
    shapes, found = story.scene.shapes, {}
    for body in story.interface.bodies:
        nodes = story.nodes_of(body)
        w = _share_of_nodes(shapes[body].nodes, shapes[body].quads, shapes[body].triangles)
        found[f"mean T of {body}"] = story.T[:, nodes] @ w
        for j, axis in enumerate("xy"):
            found[f"mean {axis} of {body}"] = story.x[:, nodes, j] @ w
        if (stored := story.ledger.get(f"stored.{body}")) is not None and len(stored) == len(story.t):
            found[f"heat stored in {body}"] = stored
    return found


def _made_of(name: str, story: Story) -> float:
    """The size of what a measure is a sum or a difference of [K, m, J]."""
    if "heat" in name:
        return max(float(np.abs(values).max()) for values in story.ledger.values())
    return float(np.abs(story.T).max()) if " T " in name else float(np.ptp(story.x[0], axis=0).max())


def _share_of_nodes(nodes: Floats, *cells: NDArray[np.integer]) -> Floats:
    """(n,) the share of the area that is a node's: that of its cells, in equal parts to their corners."""
    w = np.zeros(len(nodes))
    for rows in cells:
        if not len(rows):
            continue
        x, y = nodes[rows, 0], nodes[rows, 1]
        area = 0.5 * np.abs((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1))
        np.add.at(w, rows.ravel(), np.repeat(area / rows.shape[1], rows.shape[1]))
    return w / w.sum()


def _on(t: Floats, story: Story, name: str) -> Floats:
    return np.interp(t, story.t, measures(story)[name])


def check_settles(scene: Scene, story: Story, rng: np.random.Generator) -> Sequence[Finding]:
    """Cells and windows halved two times, and a third time where the second change is larger than the first."""
    if scene.doc["thermal"]["half"] == "thermal" and slowest_cell_time(story) / 4**(LEVELS - 2) > story.t[-1]:
        return []
    runs, refined = [story], scene
    changes: dict[str, list[float]] = {}
    for level in range(1, LEVELS):
        refined = finer_windows(finer_mesh(refined))
        run = told(refined, most=MOST_REFINED)
        if run.outcome != COMPLETED or abs(run.t[-1] - story.t[-1]) > 1e-9 * story.t[-1]:
            return []  # told, and left out
        runs.append(run)
        for name in measures(story):
            a, b = _on(story.t, runs[-2], name), _on(story.t, run, name)
            change = float(np.sqrt(np.mean((b - a) ** 2)))
            scale = max(float(np.ptp(_on(story.t, s, name))) for s in runs)
            floor = FLOOR * scale + ROUND_OFF * _made_of(name, story)
            changes.setdefault(name, []).append(change if change > floor else 0.0)
        if level > 1:
            grown = {n: c for n, c in changes.items() if _grows(c)}
            if not grown:
                return []
    return [Finding(f"{name} changes by {', '.join(f'{c:.3g}' for c in rows)} as cells and windows are halved again "
                    "and again: it has no limit", rows[-1] / max(rows[-2], 1e-300), ("mesh", "depends on", "cycle"),
                    run) for name, rows in grown.items()]


def _grows(changes: Sequence[float]) -> bool:
    """Whether each change is larger than the one before; those below the floor are none."""
    return all(b > a for a, b in pairwise(changes)) and changes[-1] > 0.0


def _estimates(scene: Scene) -> bool:
    return "adaptive" in scene.doc["coupling"] and not scene.doc.get("rules")


def _refines(scene: Scene) -> bool:
    """Whether cells and windows may be halved and the problem stays the same.

    Flow stress that falls localises in a row of cells, whatever their size; rules count windows.
    """
    if scene.moved is not None or scene.doc.get("rules"):
        return False
    softens = any(m.get("plastic", {}).get("softening") for m in scene.doc["materials"].values())
    nodes = sum(len(s.nodes) for s in finer_mesh(scene, 2 ** 2).shapes.values())
    return not softens and nodes <= MOST_NODES


ESTIMATE = Invariant("estimated error", _estimates, check_estimate, runs=8)
"""The error at a window's end is at most 3 times the sum of those estimated up to there, in 98 % of windows.

What a window adds is at most its local error where the problem is one of diffusion: what was wrong before decays.
Estimates come from the difference of a window and its two halves (coupler.control.error_estimate), which tells the
local error of a scheme to its leading order; 3 is what the doubling factors of late geometry are unsure by (LATE).
The true error is the difference to runs along the same windows cut in eight, wherever those have settled.
"""

SETTLES = Invariant("settles", _refines, check_settles, runs=2)
"""Halving cells and windows changes means, displacements and stored heat less and less.

Linear elements, cut contact edges and every scheme converge in these measures (Cea; Lax and Richtmyer), if not from the
coarsest mesh on: only what grows three times running has no limit.  Changes below 2 % of a measure's way in time are
none: a first contact that falls in another window moves as much.  Nothing is asked where heat goes less far in the run
than cells halved twice are long, h^2/a > t: a layer is then inside one cell on all meshes but the last, and what it
takes grows with every halving until cells see it.
"""

INVARIANTS = (ESTIMATE, SETTLES)
