"""What is read of both halves while a run goes on: recorded, and judged whether it can be trusted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupler.control.loop import Tried
from coupler.control.spare import Window
from coupler.fmu.half import Half
from coupler.record.checkpoint import RunRecord
from coupler.record.frames import frame_choice
from coupler.record.look import Look, together
from coupler.record.observe import ConditionReader, ExtraOutputs, ProbeReader, friction, friction_names
from coupler.record.recorder import Recorder, WindowRecord
from coupler.running.moved_probes import MovedProbes
from coupler.scenario import Scenario
from coupler.scenario.options import Scheme
from coupler.scenario.scales import slight_errors
from coupler.scenario.timing import Frames
from coupler.schemes.ledger import Ledger
from coupler.schemes.levels import Level
from coupler.schemes.state import PLACES_OFF, CoupledState, Halves
from coupler.trust.checks import Check
from coupler.trust.in_space import cell_probes, contact_ends, probed
from coupler.trust.in_space.extremes import extreme_outputs
from coupler.trust.in_space.fronts import front_outputs
from coupler.trust.in_space.heat_mesh import heat_mesh_outputs
from coupler.trust.in_space.mesh import mesh_outputs
from coupler.trust.in_space.moved import MovedLog
from coupler.trust.in_space.peak_stress import stress_outputs
from coupler.trust.in_time.errors import Looked
from coupler.trust.laws.equilibrium import OUTPUT as STABLE
from coupler.trust.laws.equilibrium import SOFT
from coupler.trust.table.log import TrustLog
from coupler.trust.table.watch import TrustWatch

Array = NDArray[np.float64]


class Observer:
    """Reads both halves at the end of a window, writes what is recorded of it, and keeps the log of trust.

    probes, conditions, outputs : the readers, whose names and units the header tells.
    trust, choice, framed : what of it a checkpoint holds (RunRecord).  recorder : open once `open` was called.
    Raises ScenarioError for a probe that the halves cannot answer.
    """

    def __init__(self, scenario: Scenario, halves: Halves, adaptive: bool) -> None:
        """adaptive : whether windows find their own size."""
        interface = scenario.interface
        self._scenario, self._interface = scenario, interface
        self._both: Mapping[str, Half] = {"thermal": halves.thermal, "mechanical": halves.mechanical}
        self.probes = ProbeReader(scenario.probes, interface, self._both, scenario.file)
        units = {n: a["unit"] for n, a in self.probes.about.items()}
        self._watch = TrustWatch(interface, scenario.models, units, adaptive, scenario.own_meshes,
                                 () if scenario.stated is None else scenario.stated.thermal.ignore,
                                 scenario.coupling.substeps["mechanical"],
                                 scenario.coupling.scheme is Scheme.ITERATED, _fits(scenario),
                                 scenario.coupling.substeps["thermal"],
                                 slight_errors(interface, scenario.models, scenario.coupling),
                                 self.probes.mechanical, scenario.probes, scenario.rules)
        self.watched = self.probes.measurable if units else self._watch.means
        self.conditions = ConditionReader(scenario.conditions, self._both)
        self.outputs = ExtraOutputs(halves, interface)
        self._each_window = together(self.probes.names, self.conditions.names, self.outputs.names,
                                     friction_names(halves.mechanical))
        self._of_mesh = {"mechanical": mesh_outputs(halves.mechanical.blocks),
                         "thermal": heat_mesh_outputs(halves.thermal.blocks)}
        stress = stress_outputs(halves.mechanical.blocks, interface, scenario.own_meshes)
        # fault: nobody asks what has flowed -> flowed: list[str] = [] | coupler/test_trust_contact_ends
        flowed = contact_ends.outputs(halves.mechanical.blocks, stress)
        # fault: nobody asks the strains that are probed -> strain: list[str] = [] | coupler/test_trust_cell_probes
        strain = cell_probes.STRAIN.outputs(halves.mechanical.blocks, scenario.probes) if stress else []
        self._of_stress = {"mechanical": list(dict.fromkeys([*stress, *flowed, *strain]))}
        # fault: nobody asks the fluxes that are probed -> fluxes: list[str] = [] | coupler/test_trust_cell_probes
        fluxes = cell_probes.FLUX.outputs(halves.thermal.blocks, scenario.probes)
        self._of_fluxes = {"thermal": [] if "thermal" in scenario.own_meshes else fluxes}
        # fault: nobody asks what the mesh does to displacements -> places = [] | coupler/test_trust_displaced
        places = self._watch.displaced.outputs(halves.mechanical.blocks)
        self._of_places = [] if "mechanical" in scenario.own_meshes else places
        self._of_extremes = extreme_outputs(halves.thermal.blocks)
        # Nobody else needs to know in every window.
        of_T = any(probe.quantity == "T" for probe in scenario.probes.values())
        self._of_fronts = front_outputs(halves.thermal.blocks, interface, scenario.own_meshes) if of_T else []
        self._probed = probed.Probed({} if "thermal" in scenario.own_meshes else scenario.probes, halves.thermal.blocks,
                                    interface.node_body)
        self._moved = MovedProbes(scenario, halves)
        self._looked: MovedLog | None = None  # of the window that is to be judged
        self.choice = frame_choice(scenario.output.most, scenario.coupling.end, len(interface.nodes),
                                   self.outputs.fields)
        self.trust = TrustLog()
        self.framed = -1.0  # s, the time of the last frame
        self._frames: Frames = scenario.output.frames()

    def begin(self, now: Level) -> None:
        """Begin to watch a run at its start."""
        self.trust = self._watch.begun(now, self.watched(now))

    def open(self, out: Path, header: Mapping[str, Any], since: RunRecord | None) -> None:
        """Open the journal.  since : go on behind what was recorded then."""
        self.recorder = Recorder(out, header, self._interface, None if since is None else since.mark)
        self.recorder.rows = 0 if since is None else since.rows

    def put_back(self, record: RunRecord) -> None:
        """Go on from what was remembered once."""
        self.trust, self.choice = record.trust, record.choice

    def rewind(self, to: RunRecord, t: float) -> None:
        """Take what was recorded after the time t [s] out of the results."""
        self.put_back(to)
        self.recorder.rewind(t, to.rows)
        self.framed = min(self.framed, to.framed)

    def frames_from(self, number: int, t: float) -> None:
        """Note that frames up to the time t [s], of so many windows, have been asked for."""
        self._frames = self._scenario.output.frames()
        self._frames.due(number, t)

    def start(self, now: Level, at_end: bool) -> None:
        """Record the state before the first window.  at_end : there will be none."""
        look = self._look(framed=True)
        self.recorder.start(now, self.probes.values(now, look), friction(self._both["mechanical"], look),
                            self.conditions.read(look), self.outputs.ranges(now, self._interface, look))
        self.frame(now, look)
        self._look_at_mesh(look, now)
        self.choice = self.choice.begun(now)
        self._look_at_equilibrium(look, now, at_end)
        if self._of_fronts:
            self.trust = self._watch.with_fronts(self.trust, None, now)
        self.trust = replace(self.trust, probed=probed.begun(self._values(now, look), len(now.T)),
                             moved=self._moved.begun(now, self.watched(now)))

    def look_again(self, window: Window, seen: Looked, *, kink: bool, at_end: bool) -> None:
        """Look at what temperatures move, in a window that stands and may be solved again; then it is judged."""
        self._looked = self._moved.after(self.trust.moved, window, seen.values, kink=kink, at_end=at_end)

    def judge(self, tried: Tried, before: Level, fresh: bool) -> None:
        """Note what an accepted window says of whether the run can be trusted.

        before : at its start.  fresh : it begins at a kink of the data.
        """
        self.trust = self._watch.after(
            self.trust, (before, tried.solved.state.now), Ledger().after(tried.solved.terms).everything,
            fresh=fresh, forced=tried.forced, looked=tried.looked,
            inputs=tried.before.settings.inputs.get("thermal", {}), monitors=tried.solved.monitors, reads=tried.reads)
        if self._looked is not None:
            self.trust, self._looked = replace(self.trust, moved=self._looked), None
        # fault: nobody holds drives to their targets -> if False: | coupler/test_trust_drives
        if self._scenario.rules:
            self.trust = self._watch.acted(self.trust, tried.acted)

    def judge_rejected(self, tried: Tried) -> None:
        """Note of a rejected window whether the exchange rang in it."""
        if tried.mended is not None:
            self.trust = self._watch.mended(self.trust, tried.mended, tried.t + tried.H, tried.H)

    def accepted(self, tried: Tried, now: Level, ledger: Ledger, monitors: Mapping[str, float], *,
                 kink: bool, at_end: bool) -> None:
        """Record an accepted window; both halves are at its end.

        monitors : those that rules look at.  kink : it ends at one of the data.  at_end : it is the last one.
        """
        asked = self._frames.due(tried.number + 1, now.t) or kink
        self.choice, due, thin = self.choice.after(now, bool(tried.event), asked)
        # fault: a window is recorded before its frame is read -> look = self._look(framed=False) |
        #   coupler/test_look
        look = self._look(framed=due)
        # Of a frame, and of the end: in every window it would cost what stress costs.
        # fault: what the mesh misses is not asked for -> if False: | coupler/test_trust_mesh
        if due or at_end:
            self._look_at_mesh(look, now)
        record = replace(_record_of(tried, monitors), friction=friction(self._both["mechanical"], look),
                         conditions=self.conditions.read(look),
                         ranges=self.outputs.ranges(tried.solved.state.now, self._interface, look))
        self._write(tried, now, ledger, record, look)
        if thin:
            self.recorder.thin()
        if due:
            self.frame(now, look, chosen=not asked)
        self._look_at_equilibrium(look, now, at_end)
        # fault: nobody asks what fronts put temperatures off by -> if False: | coupler/test_trust_fronts
        if self._of_fronts:
            off = np.asarray(look.read("thermal", self._of_fronts)[self._of_fronts[0]])
            self.trust = self._watch.with_fronts(self.trust, off, now)
        event, end = tried.span.clock.seconds(tried.after.control.event), self._scenario.coupling.end
        # fault: nobody asks how far extremes are off -> if False: | coupler/test_trust_extremes
        if self._of_extremes and self._watch.wants_extremes(self.trust, at_end, now.t, event, end):
            told = {n: float(v) for n, v in look.read("thermal", self._of_extremes).items()}
            self.trust = self._watch.with_extremes(self.trust, told, now)
        self._look_at_probed(look, now, kink=kink, at_end=at_end)

    def rejected(self, tried: Tried, now: Level, ledger: Ledger) -> None:
        """Record a rejected window.  now : at its start, where both halves are again."""
        self._write(tried, now, ledger, _record_of(tried, {}), Look(self._both, {}))

    def frame(self, now: Level, look: Look | None = None, chosen: bool = False) -> None:
        """Record the fields as they are now, once.  look : at them; None: none was taken yet.

        chosen : as in Recorder.frame.
        """
        if now.t == self.framed:
            return
        self.framed = now.t
        look = Look(self._both, self.outputs.frame_names) if look is None else look
        self.recorder.frame(now, self.outputs.read(look), chosen)

    def judged(self, state: CoupledState, ledger: Ledger, rules_act: bool) -> tuple[Check, ...]:
        """Return the trust table of what both halves and the exchange did."""
        delivered = {block: account.delivered for block, account in state.accounts.items()}
        left = {block: account.left for block, account in state.accounts.items()}
        return self._watch.judged(self.trust, ledger.everything, delivered, left, rules=rules_act)

    @property
    def errors(self) -> dict[str, Any]:
        """What was estimated of the errors of probes, and what that cost, for the totals of the run."""
        # fault: what looks at gaps cost is not told -> solves = self.trust.errors.solves | coupler/test_trust_moved
        solves = self.trust.errors.solves + self.trust.moved.solves
        return {"probe_errors": self._watch.probe_errors(self.trust),
                "looks": {"windows": self.trust.errors.looked, "solves": solves}}

    def _look(self, framed: bool) -> Look:
        """Read what is recorded of a window, and of a frame if there is one."""
        more = (self.outputs.frame_names, self._of_mesh, self._of_stress, self._of_fluxes) if framed else ()
        return Look(self._both, together(self._each_window, *more))

    def _look_at_mesh(self, look: Look, now: Level) -> None:
        """Note what the meshes miss now."""
        told, of_heat = ({n: float(v) for n, v in look.read(role, self._of_mesh[role]).items()}
                         for role in ("mechanical", "thermal"))
        self.trust = self._watch.looked_at_mesh(self.trust, told, of_heat, now.t)
        stress = self._of_stress["mechanical"]
        # fault: nobody holds the stress of cells against that at nodes -> if False: | coupler/test_trust_peak_stress
        if stress:
            self.trust = self._watch.looked_at_stress(self.trust, look.read("mechanical", stress), now)
        if fluxes := self._of_fluxes["thermal"]:
            self.trust = self._watch.looked_at_fluxes(self.trust, look.read("thermal", fluxes), now.t)

    def _look_at_equilibrium(self, look: Look, now: Level, at_end: bool) -> None:
        """Ask mechanics now and then whether their equilibrium is stable, and what their mesh leaves out of it."""
        t = now.t
        if STABLE not in self._both["mechanical"].blocks or not self._watch.wants_equilibrium(
                self.trust, t, self._scenario.coupling.end, at_end=at_end):
            return
        told = look.read("mechanical", [n for n in (STABLE, SOFT) if n in self._both["mechanical"].blocks])
        self.trust = self._watch.with_equilibrium(self.trust, float(told[STABLE]), t)
        # fault: nobody asks how soft the bodies are -> if False: | coupler/test_trust_equilibrium
        if SOFT in told and float(told[STABLE]) >= 0.0:
            self.trust = self._watch.with_softness(self.trust, float(told[SOFT]), t)
        if self._of_places:
            du = look.read("mechanical", self._of_places)[PLACES_OFF]
            self.trust = self._watch.with_displaced(self.trust, du, now)

    def _look_at_probed(self, look: Look, now: Level, *, kink: bool, at_end: bool) -> None:
        """Ask now and then how far what is probed is off by the mesh."""
        before, end = self.trust.probed, self._scenario.coupling.end
        log, speeds = probed.after(before, self._values(now, look), now.t, end)
        # fault: nobody asks how far probes are off by the mesh -> if False: | coupler/test_trust_probed
        if probed.due(log, speeds, now.t - before.t, kink=kink, at_end=at_end):
            told = look.read("thermal", self._probed.outputs)
            log = probed.looked(log, speeds, self._probed.off(now, told))
        # fault: a kink late in a run is not seen -> self.trust = replace(self.trust, probed=log) |
        #   coupler/test_trust_probed
        self.trust = replace(self.trust, probed=probed.kinked(log) if kink else log)

    def _values(self, now: Level, look: Look) -> dict[str, float]:
        return self._probed.values(now, look.read("thermal", self._probed.read))

    def _write(self, tried: Tried, now: Level, ledger: Ledger, record: WindowRecord, look: Look) -> None:
        facts: dict[str, float | str] = {"t": tried.t, "H": tried.H, "seconds": tried.seconds}
        facts["scheme"] = tried.solved.scheme.value
        # Read once more only where the halves went on from there.
        followed = tried.looked if self._scenario.probes else None
        probes = self.probes.values(now, look) if followed is None else followed.values
        if followed is not None and self.probes.of_a_step.any():
            probes = np.where(self.probes.of_a_step, self.probes.values(now, look), probes)
        self.recorder.window(tried.solved, facts, ledger, probes, record)


def _record_of(tried: Tried, monitors: Mapping[str, float]) -> WindowRecord:
    return WindowRecord(tried.reason, tried.event, tried.fired, tried.error, monitors)


def _fits(scenario: Scenario) -> dict[str, Any]:
    """Pair -> its clearance or interference, of those that state one."""
    stated = {} if scenario.stated is None else scenario.stated.contact
    return {name: pair.clearance if pair.interference is None else pair.interference for name, pair in stated.items()
            if not (pair.clearance is None and pair.interference is None)}
