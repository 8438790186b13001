"""Reports the findings of an advice in sentences."""

from __future__ import annotations

import math
from collections.abc import Iterator
from textwrap import shorten

import numpy as np
from numpy.typing import NDArray

from coupler.experiments.findings import (
    Deviations,
    Findings,
    Goal,
    SimplificationTrial,
    at_common_times,
    largest_ratio,
    range_of,
    worst_probe,
)
from coupler.experiments.trial import TrialResult
from coupler.experiments.variants import OWN, Aspect, Simplification

# unit -> (below this, times this, is called this), the first that fits
READABLE = {"m": ((1e-3, 1e6, "um"), (1.0, 1e3, "mm")), "Pa": ((1e3, 1.0, "Pa"), (1e6, 1e-3, "kPa"),
                                                              (float("inf"), 1e-6, "MPa"))}
# A probe is reported that deviates by this fraction of its range, a largest pressure this much above the mean.
REPORTED, UNEVEN = 0.01, 1.05
STILL = 1e-9  # m
HEADINGS = {Aspect.MECHANICS: "mechanics", Aspect.HEAT: "heat flow", Aspect.SCHEME: "coupling scheme",
            Aspect.EFFECT: "effects", Aspect.WINDOWS: "windows", Aspect.MESH: "mesh"}
REASON = 120  # letters of why a trial failed
NONE = Simplification("", Aspect.EFFECT)
# A deviation below this fraction of a quantity's range is none.
NOTHING = 1e-6
# Processor times of runs shorter than this [s] are not compared, and differences below this fraction are noise.
SHORTEST, NOISE = 0.5, 0.05
AT_REST = 0.5  # a probe at rest: its own range is less than this of the range that is used


def amount(value: float, unit: str) -> str:
    """Format a number with its unit: 3.5 um, 12.1 MPa, 1 K."""
    for below, factor, name in READABLE.get(unit, ()):
        if abs(value) < below:
            return f"{value * factor:.3g} {name}"
    return f"{value:.3g} {unit}" if unit != "1" else f"{value:.3g}"


def percent(fraction: float) -> str:
    """Format a fraction in percent with two digits: 20 %."""
    return f"{100 * fraction:.2g} %" if abs(fraction) < 0.995 else f"{100 * fraction:.0f} %"


def of_range(fraction: float) -> str:
    """Format a fraction of a range: 20 % of its range, 2.1 times its range."""
    return f"{fraction:.2g} times its range" if fraction > 2.0 else f"{percent(fraction)} of its range"


def misses(findings: Findings) -> Iterator[str]:
    """Yield a line for each thing that the advised model does not show, measured against the full model.

    Only pairs and probes that the combination has.
    """
    full, simple = findings.reference, findings.combined
    assert simple is not None
    own = [n.removeprefix(OWN) for n in full.probes if n.startswith(OWN)]
    pairs = [n.removesuffix(".p.max") for n in own if n.endswith(".p.max")]
    for pair in pairs:
        yield from _pressure(pair, full, simple)
        yield from _spring_back(pair, full, simple)
    asked = {goal.probe for goal in findings.goals}
    for name in full.probes:
        if not name.startswith(OWN) and name not in asked:
            yield from _probe(name, full, simple)


def _pressure(pair: str, full: TrialResult, simple: TrialResult) -> Iterator[str]:
    """Report the largest pressure, and how much of it is that of corners and edges."""
    name = f"{OWN}{pair}.p.max"
    if name not in simple.probes or max(full.probes[name]) <= 0.0:
        return
    t, p, other = at_common_times(full, simple, name)
    k = int(p.argmax())
    mean = float(np.interp(t[k], full.t, full.probes[f"{OWN}{pair}.p.mean"]))
    text = f"pressure at {pair}: up to {amount(float(p[k]), 'Pa')} at t = {t[k]:.5g} s"
    if p[k] > UNEVEN * mean > 0.0:
        text += f", {p[k] / mean:.2g} times the mean (corners and edges)"
    if abs(other[k] - p[k]) > REPORTED * p[k]:
        yield f"{text}; the advised model gives {amount(float(other[k]), 'Pa')}"


def _spring_back(pair: str, full: TrialResult, simple: TrialResult) -> Iterator[str]:
    """Report how far the slave side is off, and how much of that springs back when contact is lost."""
    for axis in ("u_x", "u_y"):
        name = f"{OWN}{pair}.{axis}"
        if name not in simple.probes:
            continue
        t, u, other = at_common_times(full, simple, name)
        off = u - other
        if np.abs(off).max() <= STILL:
            continue
        k = int(np.abs(off).argmax())
        text = f"the slave side of {pair} is off by {amount(float(off[k]), 'm')} along {axis[-1]} at t = {t[k]:.5g} s"
        lost = _lost(np.interp(t, full.t, full.probes[f"{OWN}{pair}.p.max"]))
        back = float(abs(off[k] - off[lost])) if lost > k else 0.0
        if back > REPORTED * abs(off[k]):
            text += f"; it springs back by {amount(back, 'm')} when contact is lost, at t = {t[lost]:.5g} s"
        yield text


def _lost(p: NDArray[np.float64]) -> int:
    """Return the last index at which a pressure p, (n,) [Pa], falls to zero; 0 where it never does."""
    ends = np.flatnonzero((p[:-1] > 0.0) & (p[1:] <= 0.0))
    return int(ends[-1]) + 1 if len(ends) else 0


def _probe(name: str, full: TrialResult, simple: TrialResult) -> Iterator[str]:
    if name not in simple.probes:
        yield f"{name}: the advised model does not have it"
        return
    t, a, b = at_common_times(full, simple, name)
    off, unit = np.abs(a - b), full.units[name]
    k, scale = int(off.argmax()), range_of(name, full)
    if off[k] > REPORTED * scale:
        yield f"{name}: by {amount(float(off[k]), unit)} at t = {t[k]:.5g} s ({of_range(float(off[k]) / scale)})"


def summary(findings: Findings) -> list[str]:
    """Return the goals, the advice, and what the advised model does not show."""
    return [*_goals(findings), *_conclusion(findings, ""), *_not_shown(findings)]


def advice(findings: Findings, written: str = "") -> list[str]:
    """Return every line of the advice.  written : the file of the advised scenario; empty where there is none."""
    if findings.full is None:
        return [f"no result: {findings.stopped}"] if findings.stopped else []
    return [*_goals(findings), *_coupling(findings), *_trials(findings), *_errors(findings), *_not_shown(findings),
            *_conclusion(findings, written)]


def _goals(findings: Findings) -> Iterator[str]:
    full = findings.full
    assert full is not None
    for goal in findings.goals:
        rests = float(np.ptp(full.probes[goal.probe])) < AT_REST * goal.scale
        scale = amount(goal.scale, goal.unit)
        own = f"it hardly changes; {scale} is used as its range" if rests else f"its range is {scale}"
        yield f"goal: {goal.probe} within {amount(goal.tolerance, goal.unit)} ({own})"
    yield f"full model: {cost(full)}{_coarse(findings)}"


def _coarse(findings: Findings) -> str:
    if findings.mesh == 1.0:
        return ""
    longer = f", windows {findings.windows:g} times as long" if findings.windows > 1.0 else ""
    return f", on a mesh of {findings.mesh:.2g} times the cells along an edge{longer}"


def cost(trial: TrialResult) -> str:
    """Format the cost of a trial: solver calls and processor time."""
    return f"{trial.solver_calls} solver calls, {trial.processor:.2g} s of processor time"


def _coupling(findings: Findings) -> Iterator[str]:
    if findings.iterated is None:
        yield "it cannot be iterated, so the error of its coupling scheme is unknown"
    elif findings.full is not None and findings.iterated.scenario == findings.full.scenario:
        yield "it is iterated already"
    elif findings.full is not None:
        calls = findings.iterated.solver_calls / max(findings.full.solver_calls, 1)
        yield (f"iterating {changes(findings.coupling_error, findings.goals)} and takes {calls:.2g} times the solver "
               "calls: " + ("the scheme is outside the tolerance, so iterate"
                            if largest_ratio(findings.coupling_error) > 1.0 else "the scheme is within the tolerance"))


def _trials(findings: Findings) -> Iterator[str]:
    aspect = None
    for trial in findings.trials:
        if trial.simplification.aspect is not aspect:
            aspect = trial.simplification.aspect
            base = " and ".join(s.name for s in findings.base_simplifications)
            yield f"{HEADINGS[aspect]}{f' (on {base})' if aspect is Aspect.EFFECT and base else ''}:"
        yield f"  {_trial(trial, findings)}"


def _trial(trial: SimplificationTrial, findings: Findings) -> str:
    name = trial.simplification.name
    name = f"dropping {name}" if trial.simplification.aspect is Aspect.EFFECT else name
    if trial.trial.failed:
        return f"{name}: cannot be tried ({shorten(trial.trial.failed, REASON, placeholder=' ...')})"
    return f"{name} {changes(trial.deviations, findings.goals)} and {_saves(trial)}: {_verdict(trial)}"


def _verdict(trial: SimplificationTrial) -> str:
    if trial.ratio > 1.0:
        return "outside the tolerance"
    if trial.acceptable:
        return "within the tolerance"
    removes = trial.simplification.removes_physics
    return f"within the tolerance, but {'more expensive' if removes else 'it saves too little'}"


def _saves(trial: SimplificationTrial) -> str:
    saved = [f"{percent(fraction)} of the {what}" for fraction, what in (
        (trial.saving, "solver calls"), (_time_saved(trial), "time")) if fraction > 0.0]
    return f"saves {', '.join(saved)}" if saved else "saves nothing"


def _time_saved(trial: SimplificationTrial) -> float:
    """Return the fraction of the processor time that is saved; 0 where that is noise."""
    base = trial.base.processor
    fraction = 1.0 - trial.trial.processor / base if base > SHORTEST else 0.0
    return fraction if fraction > NOISE else 0.0


def _errors(findings: Findings) -> Iterator[str]:
    if findings.window_error:
        yield f"halving the windows {changes(findings.window_error, findings.goals)}" + (
            ": outside the tolerance, so no result above is accurate enough for these goals"
            if largest_ratio(findings.window_error) > 1.0 else "")
    if findings.mesh_error:
        yield f"the scenario's own mesh and windows: {changes(findings.mesh_error, findings.goals)}, " + (
            "outside the tolerance, so they stay" if largest_ratio(findings.mesh_error) > 1.0
            else "within the tolerance, so the mesh of the trials will do")
    elif findings.mesh < 1.0:
        yield "the scenario's own mesh was not run, so it stays as written"


def _not_shown(findings: Findings) -> Iterator[str]:
    """Report what the advised model does not show beside the goals."""
    reported = [s for s in findings.accepted if s.misses]
    if not reported or findings.combined is None:
        return
    yield "the advised model does not show:"
    for simplification in reported:
        yield f"  {simplification.name}: {simplification.misses}"
    for line in misses(findings):
        yield f"  {line}"


def _conclusion(findings: Findings, written: str) -> Iterator[str]:
    for name in findings.untried:
        yield f"not tried, for lack of time: {name}"
    if findings.stopped:
        yet = "" if findings.combined else "no advice yet; "
        yield f"{findings.stopped}; {yet}finished trials are stored, and the same command continues"
    if findings.combined is None or findings.full is None:
        return
    if findings.combined_ratio > 1.0:
        why = findings.combined.failed or f"it {changes(findings.combined_error, findings.goals)}"
        yield f"no model within the tolerances was found: {why}"
        return
    yield f"advised: {together(findings)}"
    yield _size(findings)
    mesh = "" if findings.own_mesh or findings.mesh == 1.0 else " with the mesh"
    who = "all together, it" if len(findings.accepted) + findings.iterate > 1 else "it"
    saves = _saves(SimplificationTrial(NONE, findings.combined, findings.full))
    yield (f"{who} {changes(findings.combined_error, findings.goals)}, {findings.combined_ratio:.2g} of the "
           f"tolerance{mesh}, and {saves}: {cost(findings.combined)}")
    if written:
        yield f"written to {written}"


def _size(findings: Findings) -> str:
    """Report mesh and windows of the advised scenario, and why they are no coarser."""
    mesh, windows = findings.mesh_factor, findings.windows_factor
    cells = "the scenario's own mesh" if mesh == 1.0 else f"{mesh:.2g} times the scenario's cells along an edge"
    ends = "its own windows" if windows == 1.0 else f"windows {windows:g} times as long"
    if mesh != 1.0 and windows == 1.0:
        ends = "the scenario's own windows"
    why = ""
    if findings.own_mesh and findings.mesh < 1.0:
        why = (": the coarser mesh of the trials is outside the tolerance" if findings.mesh_error else
               ": the error of the coarser mesh of the trials is unknown")
        if any(t.acceptable for t in findings.trials if t.simplification.aspect is Aspect.WINDOWS):
            why += "; longer windows were within the tolerance there only"
    return f"it has {cells} and {ends}{why}"


def together(findings: Findings) -> str:
    """Describe the advised scenario."""
    without = [s.name for s in findings.accepted if s.aspect is Aspect.EFFECT]
    simpler = [s.name for s in findings.accepted if s.aspect is not Aspect.EFFECT]
    if findings.iterate:
        simpler.append("scheme iterated")
    if not findings.own_mesh and findings.mesh < 1.0:
        simpler.append(f"a mesh of {findings.mesh:.2g} times the cells along an edge")
    return "; ".join(filter(None, (", ".join(simpler), f"without {', '.join(without)}" if without else ""))) or (
        f"as it is; {'nothing that was tried' if findings.untried else 'nothing'} can be left out")


def changes(deviations: Deviations, goals: tuple[Goal, ...]) -> str:
    """Report the probe that deviates most for its tolerance, by how much and when: `changes T by 0.2 K at t = 6 s`."""
    if not deviations:
        return "changes the goals by an unknown amount"
    name = worst_probe(deviations)
    goal, d = next(g for g in goals if g.probe == name), deviations[name]
    if not math.isfinite(d.largest):
        return f"removes {name}"
    if d.largest <= NOTHING * goal.scale:
        return "changes nothing"
    size = of_range(d.largest / goal.scale)
    return f"changes {name} by {amount(d.largest, goal.unit)} at t = {d.when:.5g} s ({size})"
