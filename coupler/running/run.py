"""Runs a scenario window by window, from the checked scenario to the results file."""

from __future__ import annotations

import shlex
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from contact.rpc.calls import LinkError
from coupler.control import events
from coupler.control.loop import Tried, finished, step
from coupler.control.spare import Window
from coupler.control.state import Committed, first
from coupler.errors import CouplingError, HalfError, SlidelineError
from coupler.fmu.half import Half
from coupler.fmu.launch import launch
from coupler.fmu.metered import Meter, MeteredHalf
from coupler.record.checkpoint import Checkpoint, Keeper, RunRecord, header_of, memory_of, put_back
from coupler.record.observe import ContactWarnings
from coupler.record.paths import check_target
from coupler.record.results import Results
from coupler.rules import engine as rules
from coupler.running.damping import DampingNotes
from coupler.running.interactive import Changes, Snapshot, Snapshots, changed
from coupler.running.interrupts import Interrupts
from coupler.running.observer import Observer
from coupler.running.progress import Progress, RemainingTime, RunStatus, progress
from coupler.running.setup import (
    check_halves,
    first_state,
    halves_of,
    heat_of_the_start,
    held_halves,
    not_told,
    plan_of,
    what_is_missing,
    without_checkpoints,
)
from coupler.running.standing import Standing
from coupler.scenario import Scenario
from coupler.scenario.notes import crossing_at_reach, mean_T0
from coupler.scenario.timing import SAME_TIME
from coupler.schemes.accounts import HEATS
from coupler.schemes.ledger import Ledger
from coupler.schemes.mapped import joined
from coupler.schemes.state import CoupledState
from coupler.trust.in_time.errors import Looked
from coupler.verify.verdicts import HalfVerdict, Verify, trust_rows, verdicts_of

Array = NDArray[np.float64]


class Run:
    """Runs a scenario window by window.

    >>> with Run(load_scenario("scenarios/sliding_blocks.yaml"), out="run.h5") as r:
    ...     for w in r.windows():
    ...         print(w.t, w.max_T)

    scenario : a checked Scenario.  out : the results file; made when the block is left, however it is left.
    processes : each half and the contact service in a process of its own.
    hosts : a file that says on which machines the halves and contact run (docs/hosts.md).
    since : the checkpoint to go on from (coupler.running.resume.resumed finds it).
    verify : whether halves of other packages are checked first (docs/verify_half.md): "once", if no verdict on them
    is known, "anew" or "never".  on_verify : called with what is checked, and with the outcome.
    Ctrl-C ends the run after the current window; a second one at once.

    Between windows: `monitors()` returns those of the last one tried, `change(...)` changes how the next ones are
    solved, `keep()` takes a snapshot and `rewind(snapshot)` goes back to it.
    """

    def __init__(self, scenario: Scenario, out: str | Path, *, processes: bool = False,
                 since: Checkpoint | None = None, hosts: str | Path | None = None,
                 verify: Verify | str = Verify.ONCE, on_verify: Callable[[str], None] = lambda text: None) -> None:
        self.scenario = scenario
        self.out = Path(out)
        self.processes = processes
        self.hosts = None if hosts is None else Path(hosts)
        # A run that goes on was checked where it began, or was not.
        self._verify, self._on_verify = Verify(verify) if since is None else Verify.KNOWN, on_verify
        self._verdicts: tuple[HalfVerdict, ...] = ()
        self.notes: list[str] = list(scenario.notes)
        self.noticed: list[str] = []
        self.ledger = Ledger()
        self._stack = ExitStack()
        self._interrupts = Interrupts()
        self._begun = self._finished = False
        self._time_to_go = RemainingTime()
        self._tried: Tried | None = None
        self._since = since
        self._until = float("inf")
        self._spent = self.setup_seconds = 0.0
        self._resumed: tuple[float, ...] = ()
        self._restarts: list[str] = []
        self._told = 0  # of the restarts of this process

    def __enter__(self) -> Run:
        check_target(self.out)
        self._started = started = time.perf_counter()
        with ExitStack() as stack:
            stack.enter_context(self._interrupts)
            loaded = stack.enter_context(launch(self.scenario, processes=self.processes, hosts=self.hosts, join=joined,
                                                built=self._verified))
            self._launched = held = held_halves(loaded, self.scenario)
            self._meter = Meter(self._since.record.seconds if self._since is not None else 0.0)
            launched = replace(held, thermal=MeteredHalf(held.thermal, "thermal", self._meter),
                               mechanical=MeteredHalf(held.mechanical, "mechanical", self._meter))
            # As in processes of their own: BLAS rounds otherwise on more threads, and on matrices of this size waits
            # for them more than it gains.  After the launch, for it holds for libraries that are loaded.
            # fault: halves in the caller's process run on as many threads of BLAS as there are -> pass |
            #   coupler/test_threads
            stack.enter_context(threadpool_limits(1))
            self.plan, interface = plan_of(self.scenario), self.scenario.interface
            self.halves = halves_of(launched.thermal, launched.mechanical, self.plan, interface)
            check_halves(launched.thermal, launched.mechanical, self.scenario)
            both = {"thermal": launched.thermal, "mechanical": launched.mechanical}
            self._observer = seen = Observer(self.scenario, self.halves, self.plan.adaptive is not None)
            self.plan = replace(self.plan, probed=seen.probes.named, watched=seen.watched,
                                mechanical=seen.probes.mechanical)
            self.notes += what_is_missing(launched.thermal, launched.mechanical, bool(interface.pairs))
            self._asked = launched.asked
            self.notes += without_checkpoints(both, self.scenario.output.checkpoint)
            self._snapshots = Snapshots(self.halves)
            thermal = self.scenario.models["thermal"]
            self._warnings = ContactWarnings(interface, self.halves.mechanical_outputs, crossing_at_reach(
                thermal, interface.pairs, mean_T0(thermal, interface)), self.plan.torn.pairs)
            self._damping = DampingNotes()
            self.notes += seen.outputs.notes
            self._at = first(first_state(launched, self.halves, interface, self.scenario.coupling.end,
                                         rules.first_loads(self.plan.rules)), self.plan)
            self.notes += not_told(held, self.scenario.foreign)
            self.notes += heat_of_the_start(launched.mechanical)
            seen.begin(self.state.now)
            if self._since is not None:
                self._continue_from(self._since, both)
            header = {**header_of(self.scenario, self.plan, seen.outputs.fields, seen.probes.about,
                                  seen.conditions.outputs), "processes": self.processes, "notes": self.notes,
                      "ranges": seen.outputs.range_names,
                      "monitors": rules.units(self.plan.rules, {role: half.blocks for role, half in both.items()})}
            seen.open(self.out, header, None if self._since is None else self._since.record)
            keeper = Keeper(self.scenario, seen.recorder, both, _places_option(self.processes, self.hosts))
            self._standing = Standing(keeper, held, tuple(both.values()), len(self.scenario.halves))
            self._stand()
            self._stack = stack.pop_all()
        self.setup_seconds += time.perf_counter() - started
        self._started = time.perf_counter()
        return self

    def _verified(self, fmus: Mapping[str, Path]) -> None:
        """Check halves of other packages.  Raises HalfError where one breaks the interface specification."""
        self._verdicts = verdicts_of(self.scenario, fmus, self._verify, elsewhere=self.hosts is not None,
                                     tell=self._on_verify)
        # fault: a half that was not checked is run without a word -> pass | coupler/test_run_verified
        self.notes += [v.text for v in self._verdicts if v.why_not]

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        outcome, message = ("failed", _in_full(error)) if error is not None else ("completed", self._at.control.stop)
        if kind is KeyboardInterrupt or (error is None and self._interrupts.asked):
            outcome, message = "interrupted", f"stopped at t = {self.state.now.t:.9g} s on request"
        elif error is None and not self._finished and self.state.now.t >= self._until:
            outcome, message = "stopped", f"stopped at t = {self.state.now.t:.9g} s as asked"
        elif error is None and not self._finished:
            outcome, message = "stopped", f"left at t = {self.state.now.t:.9g} s by its caller"
        memory: Mapping[str, Array] = {}
        late: Exception | None = None
        try:
            try:
                memory = self._kept_at_end(error)
            # fault: a half that dies at the very end takes the results along -> except TypeError as exc: |
            #   coupler/test_last_words::test_a_half_that_dies_at_the_very_end_leaves_results
            except (SlidelineError, LinkError) as exc:
                late = exc
                if error is None:
                    outcome, message = "failed", _in_full(exc)
                else:
                    error.add_note(f"the end of the run could not be kept: {exc}")
                    message = _in_full(error)
            self._restarted()
            self._observer.recorder.end(outcome, message, self._totals(), self.state.now.t, memory)
            if (told := error or late) is not None and self._standing.remedy:
                told.add_note(self._standing.remedy)
        finally:
            self._stack.close()
        if error is None and late is not None:
            raise late

    def _kept_at_end(self, error: BaseException | None) -> Mapping[str, Array]:
        """Keep where the run stands for a resume, the last frame, and what another run may start from: returned."""
        at_end = error is None or isinstance(error, CouplingError)
        if not (at_end or self._standing.recovered(error)):
            return {}
        # fault: a run that ends early leaves the checkpoint it had written last, not one of its end -> if
        #   False: | coupler/test_resume::test_ctrl_c_and_resume
        if not self._finished and self._standing.can_be_kept:
            self._restarted()
            self._standing.keep_at_end(self._restarts)
        if not (at_end or self._standing.broken_by(error)):
            return {}
        # Where the run stopped; both halves are at the end of the last accepted window.
        self._observer.frame(self.state.now)
        return self._memory()

    @property
    def state(self) -> CoupledState:
        """What the halves have exchanged, at the end of the last accepted window."""
        return self._at.state

    @property
    def start(self) -> float:
        """The time from which it runs [s]: 0, or that of the checkpoint."""
        return self._since.committed.state.now.t if self._since is not None else 0.0

    def windows(self, until: float | None = None) -> Iterator[Progress]:
        """Solve the windows; yields after every window tried, rejected ones too.

        until : stop at the first window end at or after this time [s]; `slideline resume` goes on from there.
        Raises CouplingError when a window cannot be solved, HalfError when a half died.
        """
        kinks = {self.plan.schedule.clock.seconds(k) for k in self.plan.schedule.kinks}
        self._observer.frames_from(self._at.control.number, self.state.now.t)
        self._until = float("inf") if until is None else until * (1 - SAME_TIME)
        self._finished = finished(self._at, self.plan)
        if not self._begun:
            self._begun = True
            self._observer.start(self.state.now, self._finished)
        self._commit()
        while not (self._finished or self._interrupts.asked or self.state.now.t >= self._until):
            self._meter.begin()
            tried = self._tried = self._step()
            self._meter.solved()
            notes = (*tried.notes, *self._restarted())
            if tried.accepted:
                notes = (*notes, *self._warnings.after(self.state.now, tried.solved.state.now),
                         *self._noticed_of(tried))
                self._observer.judge(tried, self.state.now, self.state.now.t in kinks)
                self.ledger = self.ledger.after(tried.solved.terms)
            else:
                self._observer.judge_rejected(tried)
            self._at = tried.after
            self._finished = finished(self._at, self.plan)
            self.noticed += tried.notes
            if tried.accepted:
                self._observer.accepted(tried, self.state.now, self.ledger, self._monitors_of_rules(),
                                        kink=self.state.now.t in kinks, at_end=self._finished)
                self._commit()
            else:
                # fault: a checkpoint in the middle of a rejected window keeps the record of the try ->
                #   self._observer.rejected(tried, self.state.now, self.ledger);
                #   self._standing.note(Committed(self.state, tried.before), self._run_record()) |
                #   coupler/test_resume_in_a_try
                self._observer.rejected(tried, self.state.now, self.ledger)
            self._observer.recorder.timed(self._meter.end())
            elapsed = time.perf_counter() - self._started
            status = RunStatus(self.scenario.coupling.end, self._total, elapsed, self.ledger)
            yield progress(tried, status, self._time_to_go, notes)

    def monitors(self) -> dict[str, float]:
        """Return the monitors of the last window tried, and the probes as they are now; SI.  Empty before the first."""
        return {} if self._tried is None else {**self._tried.monitors, **self.plan.probed(self.state.now)}

    def change(self, **changes: Unpack[Changes]) -> None:
        """Change how the run is solved from the next window on; see coupler.running.interactive.Changes.

        >>> r.change(scheme="iterated", substeps={"mechanical": 4}, inputs={"mechanical": {"load.press": 1.2}})

        A rewind undoes changes with the windows.  A resumed run has them too.
        Raises ScenarioError for a change that cannot be made.
        """
        control = changed(self._at.control, self.halves, **changes)
        if "rules" in changes:
            self.plan = replace(self.plan, rules=tuple(changes["rules"]))
            self.halves = halves_of(self.halves.thermal, self.halves.mechanical, self.plan, self.scenario.interface)
            memory = rules.first_memory(self.plan.rules, {"t": self.state.now.t, **self.plan.probed(self.state.now)})
            control = replace(control, rules=memory, settings=rules.first_settings(self.plan.rules, control.settings),
                              events=events.Memory())
        self._at = Committed(self.state, replace(control, stop=""))
        texts = ", ".join(f"{n} {getattr(v, 'value', v)}" for n, v in changes.items() if n != "rules")
        self.noticed.append(f"changed at t = {self.state.now.t:.9g} s by its caller: "
                            + "; ".join(x for x in (texts, "rules" if "rules" in changes else "") if x))
        self._stand()

    def keep(self) -> Snapshot:
        """Take a snapshot to go back to: both halves and the state of the control.

        Raises CouplingError where a half cannot save its state.
        """
        return self._snapshots.take(self._at, self._run_record(), self.plan)

    def rewind(self, to: Snapshot) -> None:
        """Go back to a snapshot: windows after it are taken out of the results, their cost stays counted.

        A snapshot can be used again and again.  Raises CouplingError for one that is later than one gone back to.
        """
        self._snapshots.restore(to)
        record = to.record
        self._at, self.plan = to.committed, to.plan
        # fault: the ledger is not rewound -> self.noticed = list(record.noticed) | coupler/test_interactive
        self.ledger, self.noticed = record.ledger, list(record.noticed)
        self.halves = halves_of(self.halves.thermal, self.halves.mechanical, self.plan, self.scenario.interface)
        self._warnings.put_back(record.seen, record.said)
        self._observer.rewind(record, to.t)
        self._observer.frames_from(self._at.control.number, self.state.now.t)
        self._tried, self._finished = None, finished(self._at, self.plan)
        self._stand()

    def _monitors_of_rules(self) -> dict[str, float]:
        """Return what rules look at, as it is now; empty where there are none."""
        if not self.plan.rules:
            return {}
        all_of_them = self.monitors()
        return {n: all_of_them[n] for n in rules.wanted(self.plan.rules) if n in all_of_them}

    @property
    def _total(self) -> int:
        return len(self.plan.schedule.bounds) - 1 if self.plan.adaptive is None else 0

    def _step(self) -> Tried:
        """Try one window.  An error that ends it is marked as one from which there is a way back."""
        try:
            return step(self.halves, self._at, self.plan, self._ask)
        except (HalfError, LinkError) as exc:
            self._standing.broke(exc)
            raise

    def _ask(self, window: Window, seen: Looked, at_end: bool) -> None:
        """Look at a window that stands while it can be solved again."""
        self._observer.look_again(window, seen, kink=window.span.k1 in self.plan.schedule.kinks, at_end=at_end)

    def _noticed_of(self, tried: Tried) -> tuple[str, ...]:
        """Return the notes on bodies that were damped, and note them."""
        damped = self._damping.after(self.state.now.t, tried.solved.monitors)
        # fault: the results do not hold that a body was damped -> pass | coupler/test_first_contact_run
        self.noticed += damped
        return damped

    def _restarted(self) -> list[str]:
        """Return who was started anew since this was asked last, and note it."""
        news = [f"at t = {self.state.now.t:.9g} s: {text}" for text in self._launched.restarts[self._told:]]
        self._restarts += news
        self._told += len(news)
        return news

    def _stand(self) -> None:
        """Note where the run stands: what a checkpoint of it holds, and where the halves are."""
        self._standing.note(self._at, self._run_record())

    def _commit(self) -> None:
        """Note where the run can be resumed from; write a checkpoint where one is due."""
        self._stand()
        if (trouble := self._standing.keep_if_due()) and trouble not in self.noticed:
            self.noticed.append(trouble)

    def _run_record(self) -> RunRecord:
        """Return what was recorded and reported up to now."""
        (contact, warned), seen = self._warnings.memory, self._observer
        return RunRecord(seen.recorder.mark, self.ledger, contact, warned, tuple(self.noticed), seen.framed,
                         self._seconds(), self.setup_seconds, self._resumed, seen.recorder.rows,
                         tuple(self.plan.rules), seen.trust, seen.choice, tuple(self._restarts))

    def _continue_from(self, since: Checkpoint, halves: Mapping[str, Half]) -> None:
        """Restore everything from a checkpoint."""
        put_back(halves, since, str(self.out))
        record = since.record
        # fault: rules the user changed are forgotten by a resume -> pass |
        #   coupler/test_resume::test_what_a_user_changed_goes_along
        self.plan = replace(self.plan, rules=record.rules)
        self.halves = halves_of(halves["thermal"], halves["mechanical"], self.plan, self.scenario.interface)
        # fault: the coupled state is not taken from the checkpoint -> self.ledger, self.noticed = record.ledger,
        #   list(record.noticed) | coupler/test_resume::test_stopped_twice_and_resumed_it_is_the_undisturbed_run
        # fault: the ledger begins anew when a run is resumed -> self._at, self.noticed = since.committed,
        #   list(record.noticed) | coupler/test_resume::test_stopped_twice_and_resumed_it_is_the_undisturbed_run
        # fault: what is left of a window cut in two is not in the checkpoint -> self._at, self.ledger, self.noticed =
        #   Committed(since.committed.state, replace(since.committed.control, ends=())), record.ledger,
        #   list(record.noticed) | coupler/test_resume::test_cut_and_iterated_windows_resume_anywhere
        self._at, self.ledger, self.noticed = since.committed, record.ledger, list(record.noticed)
        # fault: frames that were kept are kept again after a resume -> self._begun = False |
        #   coupler/test_resume::test_stopped_twice_and_resumed_it_is_the_undisturbed_run
        self._begun = True
        self._observer.framed = record.framed
        self._warnings.put_back(record.seen, record.said)
        self._observer.put_back(record)
        number = since.committed.control.number
        t = self.state.now.t
        self._time_to_go = RemainingTime(number / self._total if self._total else t / self.scenario.coupling.end)
        self._spent, self.setup_seconds = record.seconds, record.setup_seconds
        self._resumed = (*record.resumed, self.state.now.t)
        # fault: a resume forgets who was started anew before -> pass |
        #   coupler/test_last_words::test_who_was_started_anew_is_told_of_a_resumed_run_too
        self._restarts = list(record.restarts)

    def _seconds(self) -> float:
        """Return the wall time spent on windows [s], before this run was resumed too."""
        # fault: the seconds of a run follow the clock of the machine -> return self._spent + time.time() |
        #   coupler/test_clock
        return self._spent + (time.perf_counter() - self._started)

    def _memory(self) -> Mapping[str, Array]:
        """Return what another run may start from; what stands in the way is a note, for it ends no run."""
        try:
            return memory_of(self.halves.mechanical, self.scenario.interface)
        except (HalfError, ValueError) as exc:
            self.noticed.append(f"no other run can start from the displacements of this one: {exc}")
            return {}

    def _totals(self) -> dict[str, Any]:
        checks = self._observer.judged(self.state, self.ledger, bool(self.plan.instants))
        heats = {HEATS[n].replace(" ", "_"): {"made": a.made, "delivered": a.delivered, "carried": float(a.carry.sum())}
                 for n, a in self.state.accounts.items()}
        return {"seconds": self._seconds(), "setup_seconds": self.setup_seconds, "resumed_at": list(self._resumed),
                "made": {n: a.made for n, a in self.state.accounts.items()}, "restarts": list(self._restarts),
                "notes": [*self._warnings.at_end(self.state.now), *self.noticed],
                "trust": [c.as_dict() for c in (*checks, *trust_rows(self._verdicts))], **self._observer.errors,
                # fault: what contact was asked is not in the totals -> "contact": {}, **heats} |
                #   coupler/test_killed_in_traction
                "contact": self._asked(), **heats}


def _places_option(processes: bool, hosts: Path | None) -> str:
    """Return the options of the command line that say where a run's halves are."""
    return f" --hosts {shlex.quote(str(hosts))}" if hosts is not None else " --processes" if processes else ""


def _in_full(error: BaseException) -> str:
    """Return what is said of an error, with what was found besides."""
    return "\n".join((str(error), *getattr(error, "__notes__", ())))


def run(scenario: Scenario, out: str | Path = "run.h5", *, processes: bool = False,
        hosts: str | Path | None = None, until: float | None = None,
        on_window: Callable[[Progress], None] | None = None,
        verify: Verify | str = Verify.ONCE, on_verify: Callable[[str], None] = lambda text: None) -> Results:
    """Run a scenario to its end, and return its results, which are in `out`.

    hosts : a file that says on which machines the halves and contact run (docs/hosts.md).
    verify, on_verify : as of Run.
    until : stop at the first window end at or after this time [s]; `slideline resume` goes on from there.
    on_window : called after every window tried.
    Raises CouplingError, HalfError; the results file then holds all accepted windows.
    """
    with Run(scenario, out, processes=processes, hosts=hosts, verify=verify, on_verify=on_verify) as r:
        for progress in r.windows(until):
            if on_window is not None:
                on_window(progress)
    return Results(out)
