"""The coupling of a scenario, checked: windows that reach the end, and every kink of the data in use."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from coupler.scenario.coupling_schema import CouplingSpec, Windows
from coupler.scenario.document import Document, Key
from coupler.scenario.options import Adaptive, Iteration, OnCycle, OnUnstable, Scheme, Seen, WindowRange
from coupler.scenario.schema import OutputSpec

# More windows than this is a misplaced decimal point: a run of days that nobody meant.
MAX_WINDOWS = 5_000_000
# Times that should be equal may differ by round-off of this share.
SAME = 1e-12
# Iterates of a window where temperatures are steady, if nobody says how many: 30 are too few where a bar comes to touch
# a wall to which it conducts the better the harder it is pressed.
MOST_WHERE_STEADY = 100


@dataclass(frozen=True)
class CouplingOptions:
    """end [s]; runs begin at 0.  windows : ranges in order, the last reaches the end.

    kinks : times [s] in (0, end) at which data jump or change slope: those stated and those of every signal
    the chosen halves use.  bends : those of them where only thermal data change slope: no half need restart damped,
    which would make the midpoint rule first order along a finely sampled table.  substeps : role -> number in a window.
    iteration : of the scheme `iterated`.  adaptive : of adaptive windows; then windows is one range.
    locate, event_tolerance [s], branches : of events; 0: as coupler.control.events says.
    steady [K/s]: 0: never stop for that.  deadlines : role -> [s] that a step may take, where it is stated.
    restart : how often one that died is started anew.
    """

    scheme: Scheme
    end: float
    windows: tuple[WindowRange, ...]
    kinks: tuple[float, ...]
    bends: frozenset[float]
    substeps: Mapping[str, int]
    link: str
    iteration: Iteration = field(default_factory=Iteration)
    adaptive: Adaptive | None = None
    locate: bool = False
    event_tolerance: float = 0.0
    on_cycle: OnCycle = OnCycle.NOTE
    steady: float = 0.0
    branches: bool = False
    on_unstable: OnUnstable = OnUnstable.AUTO
    deadlines: Mapping[str, float] = field(default_factory=dict)
    restart: int = 0


def coupling_of(document: Document, spec: CouplingSpec, models: Mapping[str, Any]) -> CouplingOptions:
    """Check the windows and gather the kinks.  Raises ScenarioError."""
    for i, t in enumerate(spec.kinks):
        if t < 0:
            raise document.error(("coupling", "kinks", i), "a breakpoint cannot lie before the run begins, at 0 s",
                                 "Leave it out: a signal may have values before 0 s without it.")
    adaptive = spec.sized.sizes(spec.end) if spec.sized is not None else None
    windows = ((WindowRange(spec.end, spec.end, spec.end),) if spec.windows is None
               else _ranges(document, spec.windows, spec.end))
    # fault: unused signals make kinks -> times: Iterable[float] = (*spec.kinks, *kinks_in(models), 7.0) |
    #   coupler/test_scenario_load
    times: Iterable[float] = (*spec.kinks, *kinks_in(models))
    kinks = tuple(sorted({t for t in times if 0 < t < spec.end}))
    substeps = {"thermal": spec.substeps.thermal, "mechanical": spec.substeps.mechanical}
    # fault: a jump of thermal data taken for a bend -> events = {*spec.kinks, *kinks_in(models["mechanical"])} |
    #   coupler/test_scenario_load
    events = {*spec.kinks, *kinks_in(models["mechanical"]), *jumps_in(models["thermal"])}
    # What is held over a window without storage is wrong in full at its end, however short it is.
    # fault: auto holds x where temperatures are steady -> scheme = spec.scheme | coupler/test_steady_level
    scheme = Scheme.ITERATED if spec.scheme is Scheme.AUTO and is_steady(models) else spec.scheme
    return CouplingOptions(
        scheme, spec.end, windows, kinks, frozenset(kinks) - events, substeps, spec.link,
        # fault: iteration of a scenario not handed on -> Iteration(), adaptive, | coupler/test_scenario_iteration
        _iteration_of(spec, models), adaptive,
        adaptive is not None or spec.events.branches if spec.events.locate is None else spec.events.locate,
        spec.events.tolerance or 0.0, spec.on_cycle or _on_cycle(spec), spec.stop.steady or 0.0, spec.events.branches,
        spec.on_unstable, {role: s for role, s in vars(spec.deadlines).items() if s is not None},
        spec.restart)


def _iteration_of(spec: CouplingSpec, models: Mapping[str, Any]) -> Iteration:
    """The iteration of a scenario; where temperatures are steady, what nobody stated of it is as they need it.

    Without storage T is of the end of its step, and with x of its middle it would lag by half of it.  Nor does a
    shorter step make the answer to x weaker: where iterates do not agree soon, there is nothing to do but go on.
    """
    # fault: what is steady is given x of the middle of its step -> if True: | coupler/test_steady_level
    if not is_steady(models):
        return spec.iteration
    needed: dict[str, Any] = {"level": Seen.END, "max_iterations": MOST_WHERE_STEADY}
    return spec.iteration.changed(**{k: v for k, v in needed.items() if k not in spec.iteration.model_fields_set})


def is_steady(models: Mapping[str, Any]) -> bool:
    """Whether temperatures are those of a steady state at any time."""
    return bool(models["thermal"].get("method") == "steady")


def has_inertia(mechanical: Mapping[str, Any]) -> bool:
    """Whether bodies have inertia.  mechanical : model.json of the mechanical half."""
    return mechanical.get("method") == "explicit" or mechanical.get("dynamics") is not None


def moves_on(mechanical: Mapping[str, Any], steady: float) -> list[str]:
    """A sentence where a run that ends at rates of temperature below `steady` [K/s] may end while bodies move.

    mechanical : model.json of the mechanical half.
    """
    creeps = sorted(name for name, material in mechanical.get("materials", {}).items() if material.get("creep"))
    inert = has_inertia(mechanical)
    # fault: a run that ends while bodies fall or creep is not told -> if True: | coupler/test_stop_steady
    if steady == 0.0 or not (inert or creeps):
        return []
    what = "bodies with inertia move" if inert else f"{', '.join(creeps)} creep{'s' * (len(creeps) == 1)}"
    return [f"coupling.stop.steady looks at temperatures alone: the run may end while {what} on"]


def kinks_in(model: Any) -> Iterator[float]:
    """Times [s] of every signal table anywhere in a model, and those at which conditions are released."""
    for times in _tables_in(model):
        yield from times
    # fault: a condition released in the middle of a window -> for part in (): | coupler/test_release_run
    for part in (model, *model.values()):
        if isinstance(part, Mapping):
            yield from (b["until"] for b in part.get("boundary", ()) if isinstance(b.get("until"), float))


def varies(model: Any) -> bool:
    """Whether any signal in a model changes with time."""
    if isinstance(model, Mapping):
        # fault: data that change with time are taken for constant -> if False: | coupler/test_time_shift
        if "t" in model and "value" in model and len(model["t"]) > 1:
            return min(model["value"]) < max(model["value"])
        return any(varies(inner) for inner in model.values())
    return isinstance(model, list) and any(varies(inner) for inner in model)


def jumps_in(model: Any) -> Iterator[float]:
    """Times [s] at which a signal anywhere in a model has two values."""
    for times in _tables_in(model):
        yield from (t for t, after in pairwise(times) if t == after)


def _tables_in(model: Any) -> Iterator[list[float]]:
    if isinstance(model, Mapping):
        if "t" in model and "value" in model and len(model["t"]) > 1:
            yield model["t"]
        for inner in model.values():
            yield from _tables_in(inner)
    elif isinstance(model, list):
        for inner in model:
            yield from _tables_in(inner)


def _on_cycle(spec: CouplingSpec) -> OnCycle:
    """Fixed windows of a stated scheme are what somebody asked for: they are not changed unasked."""
    free = spec.sized is not None or spec.scheme is Scheme.AUTO
    return OnCycle.ITERATE if free else OnCycle.NOTE


def _ranges(document: Document, specs: Sequence[Windows], end: float) -> tuple[WindowRange, ...]:
    for i, (before, until) in enumerate(pairwise((0.0, *(spec.until for spec in specs)))):
        # fault: windows may go backwards -> if until < 0.0: | coupler/test_scenario_errors
        if until <= before:
            raise document.error(("coupling", "windows", i, "until"),
                                 f"time goes backwards: the range before ends at {before:g} s",
                                 "Put the ranges in order of `until`, each later than the one before.")
    start, count, ranges = 0.0, 0.0, []
    for i, spec in enumerate(specs):
        key: Key = ("coupling", "windows", i)
        sizes = dict(zip(("size",) if spec.size is not None else ("first", "last"), spec.sizes, strict=False))
        for name, size in sizes.items():
            if size > (spec.until - start) * (1 + SAME):
                raise document.error(
                    (*key, name), f"a window is longer than its range, {start:g} to {spec.until:g} s",
                    f"Write at most {spec.until - start:g}, or let the range end later.",
                )
        count += _count(spec.until - start, *spec.sizes)
        if count > MAX_WINDOWS:
            raise document.error(
                key, f"this makes {count:.3g} windows, more than {MAX_WINDOWS}", "Use larger windows."
            )
        ranges.append(WindowRange(end if math.isclose(spec.until, end, rel_tol=SAME) else spec.until, *spec.sizes))
        start = spec.until
        if start >= end * (1 - SAME):
            break  # an earlier end cuts the windows off: no need to rewrite them for a shorter run
    # fault: gap in the windows unseen -> if start < 0.5 * end: | coupler/test_scenario_errors
    if start < end * (1 - SAME):
        last: Key = ("coupling", "windows", len(specs) - 1, "until") if specs else ("coupling", "windows")
        raise document.error(
            last,
            f"the windows cover the run to {start:g} s only, not to its end, {end:g} s",
            "Add a range that reaches coupling.end.",
        )
    return tuple(ranges)


def _count(length: float, first: float, last: float) -> float:
    """About how many windows: the integral of 1/size, which is linear in time for a geometric sequence."""
    return length / first if math.isclose(first, last) else length * math.log(last / first) / (last - first)


# When fields are kept.

# A window end this near below a wanted time (as a share of it) is that time.
SAME_TIME = 1e-9
MOST_FRAMES = 50  # chosen for change, where nothing is said: as many as a page plays


@dataclass
class Frames:
    """Asked after every accepted window whether fields are due; remembers which times it has answered for."""

    every: int | None
    waiting: list[float]

    def due(self, number: int, t: float) -> bool:
        """number : accepted windows so far.  t [s]: the time reached."""
        passed = [w for w in self.waiting if w <= t * (1 + SAME_TIME)]
        self.waiting = self.waiting[len(passed):]
        # fault: fields by count forgotten -> return bool(passed) or (self.every is not None and number % self.every ==
        #   1) | coupler/test_scenario_load
        return bool(passed) or (self.every is not None and number % self.every == 0)


@dataclass(frozen=True)
class Output:
    """every : keep fields every so many windows, None: never by count.  at : at the first window end at or
    after these times [s], ascending.  The first and last state of a run are kept in any case.
    checkpoint : least wall time between two checkpoints [s], None: there are none.  most : frames chosen for change."""

    every: int | None
    at: Sequence[float] = field(default=())
    checkpoint: float | None = 30.0
    most: int = 0

    def frames(self) -> Frames:
        """A fresh count for one run."""
        return Frames(self.every, [t for t in self.at if t > 0])


def output_of(document: Document, spec: OutputSpec, end: float) -> Output:
    """Raises ScenarioError for a time after the end."""
    for i, t in enumerate(spec.fields.at):
        if t > end:
            raise document.error(
                ("output", "fields", "at", i), f"this is after the end of the run, {end:g} s",
                "Leave it out, or raise coupling.end.",
            )
    fields = spec.fields
    # Who counts windows has chosen; to all others the run shows where something happens.
    most = fields.most if fields.most is not None else MOST_FRAMES if fields.every is None else 0
    return Output(fields.every, tuple(sorted(set(fields.at))), spec.checkpoint, most)
