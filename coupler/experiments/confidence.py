"""How far a run is from that of finer windows, and of a finer mesh: companions in coarser ones beside it.

With f(H) a probe in windows of H, a run and its companions in windows of 2 H and 4 H give the observed order

    p = log2(|f(2H) - f(4H)| / |f(H) - f(2H)|)

and Richardson's estimate of the error of the run, (f(H) - f(2H))/(2^p - 1), at every time (Roache, Verification and
Validation in Computational Science and Engineering, chapter 5).  Where p is not what the scheme should have, windows
are not yet in the range in which errors fall as they should, and it is said.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from coupler.errors import ScenarioError
from coupler.experiments.grid import setting_at
from coupler.experiments.trial import LEAN, TrialResult, probe_of, run_trial
from coupler.record.results import Results
from coupler.scenario import Scenario
from coupler.scenario.document import document_from
from coupler.scenario.load import scenario_from
from coupler.scenario.options import Scheme
from coupler.scenario.quantities import with_overrides
from coupler.schemes.accounts import AHEAD, HEATS
from coupler.schemes.schemes import scheme_of
from coupler.trust.in_time.confidence import MESH, WINDOWS, ProbeConfidence
from coupler.verify.verdicts import Verify

Array = NDArray[np.float64]

# Tolerances of adaptive windows for windows of about twice the size: a local error goes with H^3.
LOOSER = 8.0
# Probes that differ by less of their range than this between all runs are as they are: there is no order in round-off
# and in what iterating leaves.
SAME = 1e-6
# The order by which an error is told is at most that of the scheme and at least this: 1/3 to 2.4 times the difference.
LEAST_ORDER = 0.5


def confidence(scenario: Scenario, results: Results, *, mesh: bool = False,
               companions: Sequence[Scenario] | None = None,
               on_trial: Callable[[str], Callable[[float], object]] = lambda name: lambda fraction: None,
               ) -> dict[str, ProbeConfidence]:
    """Return the error of each probe of a run that completed, by companions in windows of 2 and 4 times the size.

    Of none that tells what one step moved.

    mesh : and by one on a mesh of half as many cells along each edge, whose error is added.
    companions : of `check_companions`, where they were built before the run.
    on_trial : called with the name of each companion; returns what is called with the share of it that is done.
    Raises ScenarioError where the scenario has no probes, or a mesh that is a file.
    """
    jobs = _jobs(scenario, mesh=mesh)
    companions = check_companions(scenario, mesh=mesh) if companions is None else companions
    # The run itself was checked, or left unchecked.
    trials = [run_trial(c, on_window=on_trial(f"companion, {name} {factor:g}"), verify=Verify.KNOWN)
              for c, (name, factor) in zip(companions, jobs, strict=True)]
    order = _order(scenario, results)
    found = {}
    # fault: what one step moved is held against coarser windows -> for name in results.probe_names: |
    #   coupler/test_probes_of_a_step
    for name in (n for n in results.probe_names if not scenario.probes[n].of_a_step):
        error = by_windows(name, results, trials[:2], order)
        if mesh:
            error = with_mesh(error, name, results, trials[2])
        found[name] = error
    return found


def check_companions(scenario: Scenario, *, mesh: bool) -> list[Scenario]:
    """Return the companions of a run, before anything runs.

    Raises ScenarioError where the scenario has no probes, or what cannot be made coarser.
    """
    if not scenario.probes:
        raise ScenarioError("there is no probe whose error could be told", key="probes",
                            remedy="Give probes, for example {hottest: {T: {max: BODY}}}.")
    return [_companion(scenario, name, factor) for name, factor in _jobs(scenario, mesh=mesh)]


def _jobs(scenario: Scenario, *, mesh: bool) -> list[tuple[str, float]]:
    adaptive = scenario.coupling.adaptive is not None
    axis, factors = ("tolerance", (LOOSER, LOOSER**2)) if adaptive else ("windows", (2.0, 4.0))
    return [(axis, f) for f in factors] + ([("mesh", 0.5)] if mesh else [])


def _companion(scenario: Scenario, axis: str, factor: float) -> Scenario:
    document = with_overrides(document_from(scenario.file, scenario.text), scenario.overrides)
    sets = dict(setting_at(document, {axis: factor}).sets)
    return scenario_from(scenario.text, scenario.file, {**scenario.overrides, **sets, **LEAN})


def _order(scenario: Scenario, results: Results) -> int:
    """The order in the window that a run should have: the least of the schemes by which its windows were solved."""
    made = {n for n, words in HEATS.items() if results.totals.get(words.replace(" ", "_"), {}).get("made", 0.0)}
    level = scenario.coupling.iteration.level
    exchanges = [scheme_of(Scheme(s)).exchange_at(level) for s in {*results.windows.scheme[results.windows.taken]}]
    return min(e.order(heat=bool(made - AHEAD), friction=bool(made & AHEAD)) for e in exchanges)


def by_windows(name: str, results: Results, coarser: Sequence[TrialResult], order: int) -> ProbeConfidence:
    """Return what companions in windows of 2 H and 4 H tell of a probe.  order : that it should have."""
    t, fine = probe_of(results, name)
    span = float(fine.max() - fine.min())
    failed = next((c.failed for c in coarser if c.failed), "")
    if failed:
        return ProbeConfidence(WINDOWS, np.full(len(t), math.nan), math.nan, order, span, results.unit(name), failed)
    (t2, twice), (t4, four) = ((np.array(c.t), np.array(c.probes[name])) for c in coarser)
    # Two runs are compared at the ends of the coarser one's windows: between them it is not on its chord, and of the
    # finer one the chord is near.
    at_t4 = np.interp(t4, t2, twice)
    near, far = np.interp(t2, t, fine) - twice, at_t4 - four
    small, large = float(np.linalg.norm(np.interp(t4, t, fine) - at_t4)), float(np.linalg.norm(far))
    scale = max(span, SAME * float(np.abs(fine).max()))
    if max(np.abs(near).max(), np.abs(far).max()) <= SAME * scale:
        observed, error = math.nan, np.abs(near)
    else:
        # fault: the order is taken from the wrong pair of companions -> observed = math.log2(small / large) if small >
        #   0.0 and large > 0.0 else 0.0 | coupler/test_confidence
        observed = math.log2(large / small) if small > 0.0 and large > 0.0 else 0.0
        error = np.abs(near) / (2.0 ** min(max(observed, LEAST_ORDER), float(order)) - 1.0)
    return ProbeConfidence(WINDOWS, _between(t, t2, error), observed, order, span, results.unit(name))


def _between(t: Array, ends: Array, error: Array) -> Array:
    """Return the error (n,) at t, known at the ends of windows: inside of one the larger of those at its two ends.

    What a first window did may have died out at the end of the next.
    """
    near = SAME * (ends[-1] - ends[0])
    after = np.clip(np.searchsorted(ends, t - near), 0, len(ends) - 1)
    before = np.clip(np.searchsorted(ends, t + near, side="right") - 1, 0, len(ends) - 1)
    # fault: an error that is made and dies out between ends is not told -> return np.interp(t, ends, error) |
    #   coupler/test_confidence
    return np.maximum(error[before], error[after])


def with_mesh(error: ProbeConfidence, name: str, results: Results, coarser: TrialResult) -> ProbeConfidence:
    """Return the error with that of the mesh added: the whole difference, as if it were of first order."""
    t, fine = probe_of(results, name)
    if coarser.failed:
        return ProbeConfidence(f"{error.by} and {MESH}", np.full(len(t), math.nan), error.order, error.expected,
                               error.range, error.unit, coarser.failed)
    apart = np.abs(fine - np.interp(t, coarser.t, coarser.probes[name]))
    return ProbeConfidence(f"{error.by} and {MESH}", error.error + apart, error.order, error.expected, error.range,
                           error.unit, error.failed)
