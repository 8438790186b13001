"""A run: from a checked scenario to a results file."""

from __future__ import annotations

import platform
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupler.account import HEATS, EnergyAccount
from coupler.control import Plan, Tried, windows
from coupler.errors import CouplingError, HalfError
from coupler.half import Half
from coupler.launch import Launched, launch
from coupler.ledger import Ledger
from coupler.level import Level, Scheme
from coupler.measure import measure
from coupler.recorder import Recorder
from coupler.results import Results
from coupler.scenario import Scenario
from coupler.schedule import schedule
from coupler.target import check_target
from coupler.watched import Watched
from coupler.window import CoupledState, Verdict, wanted_outputs

Array = NDArray[np.float64]
PACKAGES = ("slideline", "numpy", "scipy", "fmpy", "pythonfmu", "eclipse-zenoh", "h5py", "numba")

# The time left is told from the pace of this many windows: some windows cost ten times others.
PACE = 50

@dataclass(frozen=True)
class Progress:
    """Where a run stands after a window.  t, t_end [s]; max_T [K]; max_p [Pa]; left : seconds to go, estimated.

    notes : what happened to contact in it that should not go by in silence.
    """

    t: float
    t_end: float
    number: int
    total: int
    verdict: str
    message: str
    touching: int
    max_T: float
    max_p: float
    imbalance: float
    elapsed: float
    left: float
    notes: tuple[str, ...] = ()
    iterations: int = 0  # of the window, where the scheme iterates
    anyway: bool = False  # taken though it did not converge

    @property
    def taken(self) -> bool:
        return self.anyway or self.verdict == Verdict.ACCEPTED.value


class Run:
    """A run that is stepped window by window.

    >>> with Run(load_scenario("scenarios/sliding_blocks.yaml"), out="run.h5") as r:
    ...     for w in r.windows():
    ...         print(w.t, w.max_T)

    scenario : a checked Scenario.  out : the results file; made when the block is left, however it is left.
    processes : each half and the contact service in a process of its own.
    Ctrl-C ends the run after the window in hand; a second one at once.
    """

    def __init__(self, scenario: Scenario, out: str | Path, *, processes: bool = False) -> None:
        self.scenario = scenario
        self.out = Path(out)
        self.processes = processes
        self.notes: list[str] = list(scenario.notes)
        self.noticed: list[str] = []
        self.ledger = Ledger()
        self._stack = ExitStack()
        self._interrupted = False
        self._finished = False
        self._pace: deque[tuple[int, float]] = deque([(0, 0.0)], maxlen=PACE)
        self._framed = -1.0  # s, the time of the last frame

    def __enter__(self) -> Run:
        check_target(self.out)
        started = time.perf_counter()
        with ExitStack() as stack:
            stack.enter_context(_interrupts(self))
            launched = stack.enter_context(launch(self.scenario, processes=self.processes))
            self.halves = wanted_outputs(launched.thermal, launched.mechanical)
            self._asked = launched.asked
            self._check(launched.thermal, launched.mechanical)
            self.plan = plan_of(self.scenario)
            self._watched = Watched(self.scenario.interface, self.halves.mechanical_outputs)
            self.state = self._first_state(launched)
            self._recorder = Recorder(self.out, self._header(), self.scenario.interface)
            self._stack = stack.pop_all()
        self.setup_seconds = time.perf_counter() - started
        self._started = time.perf_counter()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        outcome, message = ("failed", str(error)) if error is not None else ("completed", "")
        if kind is KeyboardInterrupt or (error is None and self._interrupted):
            outcome, message = "interrupted", f"stopped at t = {self.state.now.t:.9g} s on request"
        elif error is None and not self._finished:
            outcome, message = "stopped", f"left at t = {self.state.now.t:.9g} s by its caller"
        try:
            if error is None or isinstance(error, CouplingError):
                self._frame()  # where the run stopped; both halves are at the end of the last accepted window
            self._recorder.end(outcome, message, self._totals())
        finally:
            self._stack.close()

    def windows(self) -> Iterator[Progress]:
        """Solve the windows; yields after every window tried, rejected ones too.

        Raises CouplingError when a window cannot be solved, HalfError when a half died.
        """
        frames = self.scenario.output.frames()
        kinks = {self.plan.schedule.clock.seconds(k) for k in self.plan.schedule.kinks}
        self._recorder.start(0.0, self._probed())
        self._frame()
        for tried in windows(self.halves, self.state, self.plan):
            notes = tried.notes
            if tried.accepted:
                notes = (*notes, *self._watched.after(self.state.now, tried.solved.state.now))
                self.state = tried.solved.state
                for terms in tried.solved.terms:
                    self.ledger = self.ledger.plus(terms)
            self.noticed += tried.notes
            facts = {"t": tried.t, "H": tried.H, "scheme": self.plan.scheme.value, "seconds": tried.seconds}
            self._recorder.window(tried.solved, facts, self.ledger, self._probed())
            if tried.accepted and (frames.due(tried.number + 1, self.state.now.t) or self.state.now.t in kinks):
                self._frame()
            yield replace(self._progress(tried), notes=notes)
            if self._interrupted:
                return
        self._finished = True

    def _probed(self) -> Array:
        return measure(self.scenario.probes, self.scenario.interface, self.state.now)

    def _check(self, thermal: Half, mechanical: Half) -> None:
        interface = self.scenario.interface
        expected = {"mesh.hash": interface.mesh_hash, "surfaces.hash": interface.surfaces_hash,
                    "geometry": interface.geometry}
        for half in (thermal, mechanical):
            for name, value in expected.items():
                own = half.strings.get(name, value)
                if own != value:
                    raise HalfError(f"was built for another scene ({name} is {own}, the scenario's is {value})",
                                    half=half.name)
            if self.scenario.coupling.scheme is Scheme.ITERATED and not half.can_save:
                raise HalfError("keeps no states, so its windows cannot be iterated; give another coupling.scheme",
                                half=half.name)
        self.notes += what_is_missing(thermal, mechanical, bool(interface.pairs))

    def _first_state(self, launched: Launched) -> CoupledState:
        thermal, mechanical = launched.thermal, launched.mechanical
        interface, end = self.scenario.interface, self.scenario.coupling.end
        n_s = len(interface.contact_nodes)
        link = {"contact.link": launched.link}
        first = thermal.initialise(0.0, end, link, {"x": interface.nodes}, [
            "T", *(n for n in ("f_s",) if n in self.halves.thermal_outputs)])
        given = {n: v for n, v in first.items() if n in mechanical.blocks}
        out = mechanical.initialise(0.0, end, link, given, [
            n for n in self.halves.mechanical_outputs if n in ("x", "contact.t_N", "contact.gap", "contact.covered")])
        now = Level(0.0, first["T"], out["x"], out.get("contact.t_N", np.zeros(n_s)),
                    out.get("contact.gap", np.full(n_s, np.nan)), out.get("contact.covered", np.zeros(n_s)),
                    first.get("f_s"))
        return CoupledState(now, None, 0, accounts_of(mechanical, len(interface.quads) + len(interface.triangles)))

    def _header(self) -> dict[str, Any]:
        s = self.scenario
        return {
            "title": s.title, "started": datetime.now(UTC).isoformat(timespec="seconds"),
            "scenario": {"text": s.text, "hash": s.hash, "resolved": dict(s.resolved), "file": Path(s.file).name,
                         "overrides": {key: str(value) for key, value in s.overrides.items()}},
            "temperature_unit": s.temperature_unit, "geometry": s.geometry,
            "halves": {"thermal": s.thermal_half, "mechanical": s.mechanical_half},
            "coupling": {"scheme": self.plan.scheme.value, "end": s.coupling.end, "windows": len(
                self.plan.schedule.bounds) - 1, "kinks": [self.plan.schedule.clock.seconds(k) for k in sorted(
                    self.plan.schedule.kinks)], "substeps": dict(self.plan.substeps)},
            "bodies": list(s.interface.bodies), "pairs": [vars(p) for p in s.interface.pairs],
            "probes": {n: {"quantity": p.quantity, "unit": p.unit} for n, p in s.probes.items()},
            "fields": {"thermal": {"point": ["T", *self._has("thermal", "f_s")], "cell": self._has("thermal", "q")},
                       "mechanical": {"point": ["u", "p", "gap"], "cell": self._has("mechanical", "sigma_v", "sigma")}},
            "processes": self.processes, "notes": self.notes, "machine": platform.platform(),
            "versions": {"python": platform.python_version(), **{p: version(p) for p in PACKAGES}},
        }

    def _has(self, role: str, *names: str) -> list[str]:
        """Which of these fields for pictures a half has."""
        return [n for n in names if n in getattr(self.halves, role).blocks]

    def _frame(self) -> None:
        """Record the fields as they are now, once."""
        if self.state.now.t == self._framed:
            return
        self._framed = self.state.now.t
        more: dict[str, Array] = {}
        for half, names in ((self.halves.thermal, self._has("thermal", "f_s", "q")),
                            (self.halves.mechanical, self._has("mechanical", "sigma_v", "sigma"))):
            more |= half.read(names) if names else {}
        self._recorder.frame(self.state.now, more)

    def _totals(self) -> dict[str, Any]:
        heats = {HEATS[n].replace(" ", "_"): {"made": a.made, "delivered": a.delivered, "carried": float(a.carry.sum())}
                 for n, a in self.state.accounts.items()}
        return {"seconds": time.perf_counter() - self._started, "setup_seconds": self.setup_seconds,
                "notes": [*self._watched.at_end(self.state.now), *self.noticed], "contact": self._asked(), **heats}

    def _progress(self, tried: Tried) -> Progress:
        elapsed, total = time.perf_counter() - self._started, len(self.plan.schedule.bounds) - 1
        done = max(tried.number + 1, 1)
        self._pace.append((done, elapsed))
        first, since = self._pace[0]
        left = (elapsed - since) / max(done - first, 1) * max(total - done, 0)
        m = tried.solved.monitors
        return Progress(self.state.now.t, self.scenario.coupling.end, done, total, tried.solved.verdict.value,
                        tried.solved.message, int(m.get("touching", 0)), m.get("max_T", np.nan), m.get("max_p", 0.0),
                        self.ledger.imbalance, elapsed, left, tried.notes,
                        len(tried.solved.course.misfits) if tried.solved.course else 0, tried.solved.anyway)


def what_is_missing(thermal: Half, mechanical: Half, touches: bool) -> list[str]:
    """What the halves lack and what it costs, a sentence each.  touches : whether the scene has contact pairs."""
    notes = [f"{half.name} keeps no states: a window that fails cannot be tried again"
             for half in (thermal, mechanical) if not half.can_save]
    if touches and "contact.t_N" not in mechanical.blocks:
        notes.append(f"{mechanical.name} gives no contact.t_N: conductance sees no pressure")
    if touches and "contact.gap" not in mechanical.blocks:
        notes.append(f"{mechanical.name} gives no contact.gap: gaps are not recorded")
    notes += [f"{thermal.name} takes no {n}: the heat {mechanical.name} makes is counted but not delivered"
              for n in _made_by(mechanical) if n not in thermal.blocks]
    return notes


def accounts_of(mechanical: Half, n_cells: int) -> dict[str, EnergyAccount]:
    """An empty account for E_M, and for each other heat that the mechanical half makes."""
    shapes = {"E_M": (n_cells,)} | {n: mechanical.blocks[n].shape for n in _made_by(mechanical)}
    return {n: EnergyAccount(np.zeros(shape)) for n, shape in shapes.items()}


def _made_by(half: Half) -> list[str]:
    return [n for n in HEATS if n in half.blocks and half.blocks[n].causality == "output"]


def plan_of(scenario: Scenario) -> Plan:
    """Where windows end, by which scheme, with how many substeps."""
    c = scenario.coupling
    return Plan(schedule(c.end, c.windows, c.kinks, c.bends), c.scheme, c.substeps, c.iteration)


def run(scenario: Scenario, out: str | Path = "run.h5", *, processes: bool = False,
        on_window: Callable[[Progress], None] | None = None) -> Results:
    """Run a scenario to its end and return what it left in `out`.

    on_window : called after every window tried.
    Raises CouplingError, HalfError; the results file then holds all accepted windows.
    """
    with Run(scenario, out, processes=processes) as r:
        for progress in r.windows():
            if on_window is not None:
                on_window(progress)
    return Results(out)


class _interrupts:  # noqa: N801  (a context manager used once, named like one)
    """While open, the first Ctrl-C asks the run to stop after its window; the second interrupts at once.

    An interrupt raised inside a half's step would look to the half like a failure of its own.
    """

    def __init__(self, owner: Run) -> None:
        self._owner = owner

    def __enter__(self) -> None:
        self._old: Any = None
        if threading.current_thread() is threading.main_thread():
            self._old = signal.signal(signal.SIGINT, self._handle)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self._owner._interrupted:
            raise KeyboardInterrupt
        self._owner._interrupted = True
        print("stopping after this window; Ctrl-C again stops at once", file=sys.stderr, flush=True)

    def __exit__(self, *exc: object) -> None:
        if self._old is not None:
            signal.signal(signal.SIGINT, self._old)
