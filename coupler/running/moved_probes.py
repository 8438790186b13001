"""Asks now and then what gaps and displacements would be with the temperatures of smaller cells (trust.in_space.moved).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from coupler.control.spare import Window
from coupler.control.warmed import Answer, Warmed, as_it_ended, can_warm, warmed
from coupler.record.look import Look
from coupler.record.observe import ProbeReader
from coupler.scenario import Scenario
from coupler.scenario.probes import OF_MECHANICS, Probe
from coupler.scenario.scales import slight_temperature
from coupler.scenario.timing import has_inertia
from coupler.schemes.levels import Level
from coupler.schemes.state import HALVED, Halves
from coupler.trust.in_space import moved, probed
from coupler.trust.in_space.moved import MovedLog

Array = NDArray[np.float64]

MEANS, SOLID = f"{HALVED}T_mean", f"{HALVED}f_s"
SLIGHT = 1e-4  # of a solid fraction
SEEN = 0.01  # of the range of a probe
# Of outputs without a place those that are forces or motions; others count, or add up what windows did.
MOTION, FORCES = "motion.", ("N", "N.m", "Pa", "m")


class MovedProbes:
    """The probes that the mechanical half makes, where the thermal half tells what smaller cells would do to T."""

    def __init__(self, scenario: Scenario, halves: Halves) -> None:
        """Raises ScenarioError for a probe that the halves cannot answer."""
        both = {"thermal": halves.thermal, "mechanical": halves.mechanical}
        own, warm = scenario.probes, MEANS in halves.thermal.blocks and "thermal" not in scenario.own_meshes
        units = {n: a["unit"] for n, a in ProbeReader(own, scenario.interface, both, scenario.file).about.items()}
        takes = "T" in halves.mechanical.blocks and halves.mechanical.blocks["T"].causality == "input"
        self._at = {n: k for k, n in enumerate(own) if warm and takes and _is_moved(own[n], units[n])}
        self._reader = ProbeReader({n: own[n] for n in self._at}, scenario.interface, both, scenario.file)
        self._halves, self._both, self._end = halves, both, scenario.coupling.end
        self._told = [name for name in (MEANS, SOLID) if name in halves.thermal.blocks]
        # What windows may err by moves nothing that is told.
        self._slight = {"T": slight_temperature(scenario.interface, scenario.models, scenario.coupling), "f_s": SLIGHT}
        self._why_not = ""
        # fault: bodies with inertia are told what would have flung them -> if False: | coupler/test_trust_moved
        if has_inertia(scenario.models["mechanical"]):
            self._why_not = "with inertia temperatures that differ for one window alone would fling the bodies"
        elif not can_warm(halves):
            self._why_not = f"half {halves.mechanical.name} keeps no states, so no window can be solved once more"

    def begun(self, now: Level, values: Array) -> MovedLog:
        """Return the log at the start.  values : (n,) of all probes in SI, as Plan.watched tells them."""
        if not self._at:
            return MovedLog()
        if self._why_not:
            return MovedLog(why_not=self._why_not)
        return moved.begun(self._known(values), len(now.T))

    def after(self, log: MovedLog, window: Window, values: Array, *, kink: bool, at_end: bool) -> MovedLog:
        """Return the log after a window that was taken, at whose end the halves are, then as before.

        values : as of begun, at its end.  kink : it ends at one of the data.  at_end : the run ends with it.
        Raises HalfError.
        """
        if not self._at or self._why_not:
            return log
        now = window.solved.state.now
        h = now.t - log.probed.t
        log, speeds = moved.after(log, self._known(values), now.t, self._end)
        # fault: nobody asks what smaller cells do to gaps -> if False: | coupler/test_trust_moved
        if probed.due(log.probed, speeds, h, kink=kink, at_end=at_end):
            off, done = self._off(window, {n: one.high - one.low for n, one in log.probed.of.items()})
            log = moved.looked(log, speeds, off, done.times, done.solves, done.why)
        return moved.kinked(log) if kink else log

    def _off(self, window: Window, wide: Mapping[str, float]) -> tuple[dict[str, float], Warmed]:
        """Probe -> by how much it is off, where it is known, and what that took.  wide : its range so far."""
        told = Look(self._both, {"thermal": self._told}).read("thermal", self._told)
        change = {name.removeprefix(HALVED).replace("T_mean", "T"): np.asarray(of) for name, of in told.items()}
        if not all(np.isfinite(of).all() for of in change.values()):
            return {}, Warmed(why="the scene with halved cells was not solved")
        # fault: what nobody feels is solved for -> if False: | coupler/test_trust_moved
        if all(np.abs(of).max(initial=0.0) <= self._slight[name] for name, of in change.items()):
            return dict.fromkeys(self._at, 0.0), Warmed()
        # fault: a window that was not solved in one is held against its end -> again = False |
        #   coupler/test_trust_moved
        again = not as_it_ended(window)
        done = self._solved(window, change, (1.0, 0.0) if again else (1.0,))
        if done.why:
            return {}, done
        now = window.solved.state.now
        end = self._probes(done.answers[1]) if again else self._reader.measurable(now)
        off = np.abs(self._probes(done.answers[0]) - end)
        # What flows goes on with ease and comes back with its whole stiffness, which it would not in a run of other
        # temperatures.
        # fault: bodies that flow are told to be off by what would unload them -> flows = False |
        #   coupler/test_trust_moved
        flows = now.elastic_strain is not None
        if flows and any(by > SEEN * wide.get(n, 0.0) for n, by in zip(self._at, off, strict=True)):
            back = self._solved(window, change, (-1.0,))
            done = done.then(back)
            if back.why:
                return {}, done
            off = np.fmin(off, np.abs(self._probes(back.answers[0]) - end))
        return {n: float(by) for n, by in zip(self._at, off, strict=True) if np.isfinite(by)}, done

    def _solved(self, window: Window, change: Mapping[str, Array], times: tuple[float, ...]) -> Warmed:
        """The window with so many times the change."""
        changes = [{name: by * of for name, of in change.items()} for by in times]
        return warmed(self._halves, window, changes, self._reader.names["mechanical"])

    def _probes(self, answer: Answer) -> Array:
        return self._reader.measurable(answer.level, Look.of({"mechanical": answer.read}))

    def _known(self, values: Array) -> dict[str, float]:
        return {n: float(values[k]) for n, k in self._at.items() if np.isfinite(values[k])}


def _is_moved(probe: Probe, unit: str) -> bool:
    """Whether temperatures move what a probe shows by way of mechanics, and it is of no single step."""
    if probe.quantity in OF_MECHANICS:
        return True
    if probe.half != "mechanical" or probe.of_a_step:
        return False
    return not probe.placeless or unit in FORCES or probe.output.startswith(MOTION)
