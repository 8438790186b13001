"""The answer of a changed scene carried back and held against that of the scene itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from contact.problem.mechanical import Solution
from contact.problem.pairs import Augmented
from random_scenes.change import Changed
from random_scenes.declared import form_of
from random_scenes.invariant import Finding
from random_scenes.scene import Scene
from random_scenes.shapes import Floats, Ints
from random_scenes.story import COMPLETED, Story

LEAST = 1e-9  # of a range: no answer is asked to agree better
SOLVED = 10.0  # times the tolerance of a solver: two runs stop on either side of it, and what they leave adds up
BOTH = 2.0  # runs are wrong by what their windows may be
ROUND_OFF = 1e-14  # of the largest number that took part, some fifty times the machine's


JUMPS = ("conductance jumps",)  # a warning that the answer turns on whether two surfaces touch
UNSTABLE = ("would leave their equilibrium by themselves",)  # a warning that there are other answers beside this one


@dataclass(frozen=True)
class Agreement:
    """How nearly two runs of one scene agree: of the range of each quantity, and beside that in its unit.

    T, x, t_N, heat : of the range.  K, m, J : what absolute tolerances of the document allow.
    """

    T: float
    x: float
    t_N: float
    heat: float
    K: float = 0.0
    m: float = 0.0
    J: float = 0.0


def agreement(scene: Scene, same_windows: bool = True, iterated: bool = False) -> Agreement:
    """What the tolerances of a scene allow: of solvers and iterations ten times, of adaptive windows twice.

    An iteration ends where a window's change is met to rtol, so what two runs end with differs by rtol of the range at
    most.  Adaptive windows tell nothing as long as they are the same ones; where one run takes a window that the other
    refuses, each is wrong by what its windows may be.  iterated : a run that was unstable came to iterate its windows.
    """
    file = form_of(scene.doc)
    elastic = file.mechanical.elastic if file.mechanical.half == "elastic" else None
    solved = max(LEAST, SOLVED * file.thermal.tolerance)
    augmented, K, m, J = 0.0, 0.0, 0.0, 0.0
    if elastic is not None:
        # Explicit steps solve nothing.
        solved = max(solved, SOLVED * elastic.tolerance if elastic.method is not Solution.EXPLICIT else 0.0)
        m += SOLVED * elastic.skip.u if elastic.skip is not None else 0.0
        by_default = Augmented().tolerance if not elastic.inert else 0.0
        tolerances = (p.augmented.tolerance if p.augmented else by_default if "augmented" not in p.model_fields_set
                      else 0.0 for p in file.contact.values())
        augmented = SOLVED * max(tolerances, default=0.0)
    if file.thermal.adaptive is not None:
        K += SOLVED * (file.thermal.adaptive.tolerance or 0.0)
    coupling = file.coupling
    with TemporaryDirectory() as folder:
        options = scene.checked(Path(folder)).coupling  # with what the file leaves out of tolerances
    if (iterated or coupling.scheme.value in ("iterated", "auto") or coupling.on_cycle is not None
            or coupling.adaptive is not None):
        ends = options.iteration.tolerance
        solved = max(solved, SOLVED * max(ends.temperature.rtol, ends.gap.rtol, ends.pressure.rtol))
        K, m = K + SOLVED * ends.temperature.atol, m + SOLVED * ends.gap.atol
    T = x = heat = solved
    if options.adaptive is not None and not same_windows:
        error = options.adaptive.tolerance
        T, x, heat = (max(solved, BOTH * e.rtol) for e in (error.temperature, error.displacement, error.heat))
        K, m, J = (a + BOTH * e.atol for a, e in ((K, error.temperature), (m, error.displacement), (J, error.heat)))
    return Agreement(T, x, max(x, augmented), heat, K, m, J)


@dataclass(frozen=True)
class Difference:
    """What is not the same: words with numbers, and the difference over what is allowed."""

    what: str
    size: float


def differences(old: Story, changed: Changed, new: Story) -> list[Difference]:
    """Every quantity of two completed runs that differs by more than is allowed: T, x, t_N, probes, ledger."""
    return [d for d in all_differences(old, changed, new) if d.size > 1.0]


def findings(old: Story, changed: Changed, new: Story) -> list[Finding]:
    """The same as findings, the worst alone; and one where only the changed scene does not end well."""
    named_by = (*UNSTABLE, *(JUMPS if on_a_jump(old) else ()))
    if new.outcome != COMPLETED:
        # What is refused or fails has told it: its message is its warning.
        failed = replace(new, words=(*new.words, new.message))
        return [Finding(f"{changed.what} it is {new.outcome}: {new.message}", float("inf"),
                        (new.message.lower(), *named_by), failed)]
    found = differences(old, changed, new)
    if not found:
        return []
    worst = max(found, key=lambda d: d.size)
    return [Finding(f"{changed.what}: " + "; ".join(d.what for d in found), worst.size, named_by)]


def on_a_jump(story: Story) -> bool:
    """Whether two surfaces just touch somewhere, so that round-off says whether they do."""
    size = float(np.ptp(story.interface.nodes, axis=0).max())
    if not story.t_N.size:
        return False
    gap = np.array([level.gap for level in story.levels])
    return bool(((np.abs(gap) <= 1e-9 * size) & (np.abs(story.t_N) <= 1e-9 * np.abs(story.t_N).max())).any())


def numbers_of(old: Story, changed: Changed, new: Story) -> Ints:
    """(n_nodes,) number in the new run of each node of the old one, body by body: the one where it should lie."""
    number = np.empty(old.T.shape[1], dtype=np.int64)
    for body in old.interface.bodies:
        mine, theirs = old.nodes_of(body), new.nodes_of(body)
        X = changed.units.m * (old.interface.nodes[mine] @ changed.turn.T + changed.shift)
        distance, nearest = cKDTree(new.interface.nodes[theirs]).query(X)
        assert distance.max() <= 1e-9 * np.abs(X).max(), "the meshes are not the same"
        number[mine] = theirs[nearest]
    return number


def all_differences(old: Story, changed: Changed, new: Story) -> Iterator[Difference]:
    """Every quantity with its difference, allowed or not."""
    number = numbers_of(old, changed, new)
    a, b = _common(old, changed, new)
    allowed = agreement(old.scene, same_windows=len(a) == len(old.t), iterated=old.says("iterated from here on"))
    # Temperatures
    T = new.T[b][:, number] / changed.units.K
    yield _worst("T", "K", old.T[a], T, allowed.T * float(np.ptp(old.T)) + allowed.K
                 + ROUND_OFF * float(np.abs(old.T).max()) * len(old.t), old.t[a])
    # Displacements, turned back
    x = (new.x[b][:, number] / changed.units.m - changed.shift) @ changed.turn
    u, moved = old.x - old.x[0], float(np.abs(old.x - old.interface.nodes).max())
    far = max(float(np.abs(old.x).max()), float(np.abs(new.x).max()) / changed.units.m)
    yield _worst("x", "m", old.x[a], x, allowed.x * max(float(np.abs(u).max()), moved) + allowed.m
                 + ROUND_OFF * far, old.t[a])
    # Pressures: what round-off of a place does, its penalty makes a pressure of
    if old.t_N.size:
        there = [new.interface.side_of(side.pair, side.surface) for side in old.interface.pair_sides]
        place = np.concatenate([to.at.start + np.searchsorted(to.nodes, number[side.nodes])
                                for side, to in zip(old.interface.pair_sides, there, strict=True)])
        eps_N = max((p.eps_N for p in old.interface.pairs), default=0.0)
        yield _worst("t_N", "Pa", old.t_N[a], new.t_N[b][:, place] / changed.units.of("Pa"),
                     allowed.t_N * float(np.abs(old.t_N).max()) + eps_N * (allowed.m + ROUND_OFF * far), old.t[a])
    # Probes that mean the same
    if len(a) == len(old.t):
        for name in old.probes.keys() & new.probes.keys() & changed.probes.keys():
            yield from _probe(name, old, changed, new, a, b, allowed, far)
    yield from _ledger(old, changed, new, a, b, allowed)


def _common(old: Story, changed: Changed, new: Story) -> tuple[Ints, Ints]:
    """Numbers of levels of both runs at the same times; where windows differ, the last ones alone."""
    late = np.flatnonzero(new.t >= changed.lead * (1.0 - 1e-12))
    same = len(late) == len(old.t) and np.allclose((new.t[late] - changed.lead) / changed.units.s, old.t, rtol=0.0,
                                                   atol=1e-9 * old.t[-1])
    if same:
        return np.arange(len(old.t)), late
    return np.array([len(old.t) - 1]), np.array([len(new.t) - 1])


def _worst(name: str, unit: str, old: Floats, new: Floats, allowed: float, t: Floats) -> Difference:
    off = np.abs(new - old)
    at = np.unravel_index(int(off.argmax()), off.shape)
    worst, scale = float(off[at]), float(np.abs(old).max())
    return Difference(f"{name} differs by {worst:.3g} {unit} at t = {t[at[0]]:.6g} s (largest {scale:.4g} {unit}, "
                      f"allowed {allowed:.2g})", worst / allowed if allowed > 0.0 else np.inf * worst if worst else 0.0)


def _probe(name: str, old: Story, changed: Changed, new: Story, a: Ints, b: Ints, allowed: Agreement,
           far: float) -> Iterator[Difference]:
    p, q = old.probes[name], new.probes[name] * changed.probes[name]
    assert old.scenario is not None
    unit = old.scenario.probes[name].unit
    if not unit or unit == "1" or not (np.isfinite(p).all() and np.isfinite(q).all()):
        return  # of a half's own output the scale is not known: it may be round-off alone
    eps_N = max((pair.eps_N for pair in old.interface.pairs), default=0.0)
    room = {"K": allowed.T * float(np.ptp(old.T)) + allowed.K + ROUND_OFF * float(np.abs(old.T).max()) * len(p),
            "m": allowed.x * float(np.abs(old.x - old.interface.nodes).max()) + allowed.m + ROUND_OFF * far,
            "Pa": allowed.t_N * (float(np.abs(old.t_N).max()) if old.t_N.size else 0.0)
            + eps_N * (allowed.m + ROUND_OFF * far)}[unit]
    if old.scenario.probes[name].quantity == "gap":
        return  # beside a corner a node faces something or nothing by round-off
    yield _worst(f"probe {name}", unit, p[a], q[b], room, old.t[a])


def _ledger(old: Story, changed: Changed, new: Story, a: Ints, b: Ints, allowed: Agreement) -> Iterator[Difference]:
    """Heat by mechanism [J]; in plane geometry per metre of depth."""
    per = changed.units.of("J") / (1.0 if old.scene.axisymmetric else changed.units.m)
    mine, theirs = _terms(old, a), _terms(new, b)
    if not mine:
        return
    scale = max(float(np.abs(heat).max()) for heat in mine.values())
    room = allowed.heat * scale + allowed.J + ROUND_OFF * _content(old) * len(old.t)
    off = {name: np.abs(theirs[name] / per - heat) for name, heat in mine.items()}
    worst = max(off, key=lambda name: float(off[name].max()))
    t = int(off[worst].argmax())
    by = float(off[worst][t])
    yield Difference(f"{worst} differs by {by:.3g} J at t = {old.t[a][t]:.6g} s (it is {mine[worst][t]:.4g} J, "
                     f"allowed {room:.2g})", by / room if room > 0.0 else 0.0)


def _terms(story: Story, at: Ints) -> dict[str, Floats]:
    """Heat since the first of some levels, or since the start for one alone.

    Heat through contact and through the gap are one: two surfaces that just touch do either by round-off.
    """
    found: dict[str, Floats] = {}
    for name, values in story.ledger.items():
        one = f"contact and gap, into the {name.partition('.')[2]}" if name.startswith(("contact.", "gap.")) else name
        heat = _at_levels(values, story, at)
        found[one] = found.get(one, 0.0) + (heat - heat[0] if len(at) > 1 else heat)
    return found


def _at_levels(values: Floats, story: Story, at: Ints) -> Floats:
    """The history of a ledger term, whose rows are window ends, at levels."""
    if len(values) == len(story.t):
        return np.asarray(values[at])
    return np.concatenate([[0.0], values])[-len(story.t):][at]


def _content(story: Story) -> float:
    """Heat in all bodies above 0 K [J], roughly: what the round-off of an enthalpy is of."""
    total = 0.0
    for body, spec in story.scene.doc["bodies"].items():
        material: Any = story.scene.doc["materials"][spec["material"]]
        x = story.scene.shapes[body].nodes
        depth = 2.0 * np.pi * float(np.abs(x[:, 0]).max()) if story.scene.axisymmetric else 1.0
        c = material.get("c", 0.0)
        each = c if isinstance(c, int | float) else 1000.0
        total += float(material.get("rho", 0.0)) * each * float(np.ptp(x[:, 0]) * np.ptp(x[:, 1])) * depth
    return total * float(np.abs(story.T).max())


