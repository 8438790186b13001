"""Rules: conditions on what the halves and the coupler show of a window -> what changes.  Pure.

A rule sees the monitors of a window that was solved, before it is taken.  What it does holds from the next window on,
but for `retry`: the window is then put back, and with it what every rule remembers of it.  What stays is that the rule
which asked for the retry fired, or its `once` and `cooldown` would never count.  A window that failed is shown only to
rules that ask for `failures` or a status; nothing is remembered of it but that they fired.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from coupler.fmu.half import Block
from coupler.rules.drive import Driven, begun, driven
from coupler.rules.instant import passed
from coupler.scenario.options import Scheme
from coupler.scenario.rule_model import (
    COUPLER,
    INCREMENT,
    RATE,
    Action,
    Change,
    Drive,
    Give,
    Of,
    Passed,
    Retry,
    Rule,
    Stop,
    Substeps,
    Test,
    UseScheme,
    Window,
    did,
    looked_at,
    outputs,
    with_rate,
)
from coupler.schemes.state import Settings
from coupler.schemes.sweep import FEW

# Whether the halves of a run have what its rules look at and change.

Blocks = Mapping[str, Mapping[str, Block]]


def unfit(rules: Iterable[Rule], blocks: Blocks) -> list[str]:
    """A sentence on everything that a half lacks.  blocks : half ("thermal", "mechanical") -> what it has."""
    return [f"rule {rule.name!r}: {lack}" for rule in rules for lack in _lacks(rule, blocks)]


def schemes_of(rules: Iterable[Rule]) -> frozenset[Scheme]:
    """Those that rules may change to."""
    return frozenset(a.scheme for rule in rules for a in rule.do if isinstance(a, UseScheme))


def _lacks(rule: Rule, blocks: Blocks) -> Iterator[str]:
    for monitor in sorted(rule.monitors - COUPLER.keys()):
        told = outputs([monitor])
        if told and not any(_has(blocks, name, monitor) for name in ((RATE, INCREMENT) if monitor == RATE else told)):
            yield f"the {monitor.partition('.')[0]} half gives out no {monitor.partition('.')[2]}"
    gives = [(a.half, a.name) for a in rule.do if isinstance(a, Give)]
    for half, name in gives + ([(rule.drive.half, rule.drive.name)] if rule.drive else []):
        # fault: rules: an input that a half does not have goes unnoticed -> if name in blocks[half] and
        #   blocks[half][name].causality != "input": | coupler/test_rules_fit
        if name not in blocks[half] or blocks[half][name].causality != "input":
            yield f"the {half} half has no input {name}"


def _has(blocks: Blocks, output: str, monitor: str) -> bool:
    """Whether a half gives out this number, or so many of them."""
    half, _, name = output.partition(".")
    block = blocks[half].get(name)
    if block is None or block.causality != "output" or block.kind != "Real":
        return False
    if not monitor.endswith("]"):
        return block.shape == ()
    return len(block.shape) == 1 and int(monitor[monitor.rindex("[") + 1:-1]) <= block.shape[0] <= FEW


# From settings and what rules do to the settings that follow.

# A rule that fires in every window halves again and again: beyond these a factor of the window is a mistake.
FACTORS = (2.0**-20, 2.0**20)


def applied(settings: Settings, actions: Iterable[Action]) -> Settings:
    """The settings after these actions, in order.  Retry and Stop change none."""
    for action in actions:
        settings = _one(settings, action)
    return settings


def _one(settings: Settings, action: Action) -> Settings:
    match action:
        case Substeps(half=half, count=count):
            # fault: rules: substeps without an upper bound -> n = max(round(settings.substeps[half] * count.times), 1)
            #   | coupler/test_rules
            n = max(round(count.of(settings.substeps[half])), 1)
            return replace(settings, substeps={**settings.substeps, half: n})
        case Give(half=half, name=name, value=value):
            known = settings.inputs.get(half, {})
            return replace(settings, inputs={**settings.inputs, half: {
                **known, name: value.of(known.get(name, action.start))}})
        case UseScheme(scheme=scheme):
            return replace(settings, scheme=scheme)
        case Window(size=size) if math.isnan(size.to):
            factor = min(max(size.of(settings.window_factor), FACTORS[0]), FACTORS[1])
            return replace(settings, window_factor=factor)
        case Window(size=size):
            return replace(settings, window_cap=size.to)
    return settings


__all__ = ["Fired", "Firing", "Memory", "Past", "Rule", "alone", "fire", "fire_failed", "first_loads",
           "first_memory", "first_settings", "retried", "spent", "value", "wanted"]

# Monitors that a window which failed has too; without one of them a rule does not look at it.
OF_FAILURE = frozenset({"failures", "thermal.status", "mechanical.status"})


@dataclass(frozen=True)
class Past:
    """What is remembered of one rule.  fired : how often.  rest : windows still to let pass.  streaks : windows on end
    in which each of its tests held, in their order."""

    fired: int = 0
    rest: int = 0
    streaks: tuple[int, ...] = ()


@dataclass(frozen=True)
class Memory:
    """What all rules remember.  rules : by name.  last : the monitors at the end of the last window taken, "t" among
    them.

    drives : by the name of their rule.
    """

    rules: Mapping[str, Past] = field(default_factory=dict)
    last: Mapping[str, float] = field(default_factory=dict)
    drives: Mapping[str, Driven] = field(default_factory=dict)


@dataclass(frozen=True)
class Firing:
    """rule : its name.  text : what it did.  values : the monitors it looked at.

    driving : only the next value of a driven load, which is no news.
    passed : how late it is, of a rule that has an instant in this window (coupler.rules.instant).
    """

    rule: str
    text: str
    values: Mapping[str, float] = field(default_factory=dict)
    driving: bool = False
    passed: Passed | None = None


@dataclass(frozen=True)
class Fired:
    """What the rules say after a window.

    settings : of the windows that follow, or of the next try.  memory : with them.  retry : put the window back and try
    this share of it; 0: keep it.  stop : why the run is to end; "": it goes on.
    """

    settings: Settings
    memory: Memory
    log: tuple[Firing, ...] = ()
    retry: float = 0.0
    stop: str = ""


def wanted(rules: Sequence[Rule]) -> tuple[str, ...]:
    """Names of the monitors that the rules read, `thermal.OUTPUT` and `mechanical.OUTPUT` those of the halves.

    Where they want a strain rate the increment is among them: not every half tells the rate.
    """
    read: set[str] = set().union(*(r.monitors for r in rules))
    return tuple(sorted(read | outputs(read)))


def units(rules: Sequence[Rule], blocks: Blocks) -> dict[str, str]:
    """SI unit of each monitor that the rules read, "1" for a number.  blocks : of each half, by role and name."""
    found = {}
    for monitor in wanted(rules):
        half, _, name = monitor.partition(".")
        block = blocks.get(half, {}).get(name.partition("[")[0])
        # fault: monitors have no unit -> found[monitor] = "1" | coupler/test_rules
        found[monitor] = block.unit if block is not None else COUPLER[monitor].unit if monitor in COUPLER else "1"
    return found


def first_memory(rules: Sequence[Rule], monitors: Mapping[str, float]) -> Memory:
    """Before the first window.  monitors : those known at the start ("t", probes), from which changes count."""
    return Memory(last=dict(monitors), drives={r.name: begun(r.drive) for r in rules if r.drive})


def first_loads(rules: Sequence[Rule]) -> dict[str, dict[str, float]]:
    """half -> name of an input -> the first value of its drive: what a half must be given to start in equilibrium."""
    loads: dict[str, dict[str, float]] = {}
    for rule in rules:
        if rule.drive:
            loads.setdefault(rule.drive.half, {})[rule.drive.name] = rule.drive.first
    return loads


def first_settings(rules: Sequence[Rule], settings: Settings) -> Settings:
    """Those of the first window: with the first value of every driven load."""
    return applied(settings, [Give(d.half, d.name, Change(to=d.first)) for r in rules if (d := r.drive)])


def fire(rules: Sequence[Rule], memory: Memory, monitors: Mapping[str, float], settings: Settings) -> Fired:
    """Which rules fire after a window that could be taken.

    monitors : of that window; needs "t", where it ends, and "window", its size [s].  One that is missing is not known,
    and a condition on it does not hold.  A rule that puts the window back comes before all others: they have not seen
    it then.
    """
    # A window that can be taken has not failed, however often it was tried: nobody fires for the same tries twice.
    # fault: strain rate from the whole window where the increment is of a substep -> monitors = {**with_rate(monitors,
    #   monitors["window"]), | coupler/test_rules
    monitors = {**with_rate(monitors, monitors["window"] / settings.substeps["mechanical"]),
                # fault: rules: failed tries heard again in the window that is taken -> } | coupler/test_rules
                **dict.fromkeys(OF_FAILURE, 0.0)}
    seen = {r.name: _seen(r, memory, monitors) for r in rules}
    due = [r for r in rules if _acts(r, monitors["window"]) and _due(r, seen[r.name], monitors["t"])]
    back = [r for r in due if _share(r, monitors["window"])]
    if back:
        log = tuple(Firing(r.name, did(r.do), _values(r, memory, monitors)) for r in back)
        # fault: rules: a window put back keeps what other rules counted in it -> return Fired(applied(settings,
        #   _others(back)), replace(_with_fired(memory, back), last=dict(monitors)), log, | coupler/test_rules
        # fault: rules: what other rules do stays when the window goes back -> return Fired(applied(settings,
        #   _others(due)), _with_fired(memory, back), log, | coupler/test_rules
        return Fired(applied(settings, _others(back)), _with_fired(memory, back), log,
                     min(_share(r, monitors["window"]) for r in back))
    settings = applied(settings, _others(due))
    log = tuple(Firing(r.name, did(_others([r])), _values(r, memory, monitors),
                       passed=passed(r, spent(r, memory), memory.last, monitors)) for r in due if _others([r]))
    kept = {r.name: _after(r, seen[r.name], r in due) for r in rules}
    fired = _driven(due, monitors, Fired(settings, memory, log, stop=_stop(due)))
    return replace(fired, memory=replace(fired.memory, rules=kept, last=dict(monitors)))


def fire_failed(rules: Sequence[Rule], memory: Memory, monitors: Mapping[str, float], settings: Settings) -> Fired:
    """The rules that ask for failures or a status, on a window that failed and was put back.

    monitors : what such a window has: t (where it begins), window, number, failures, thermal.status, mechanical.status,
    and what is known of its iterations.  Settings and memory count for the next try; retry : the share of it then, 0:
    as without rules.
    """
    asked = [r for r in rules if OF_FAILURE & r.monitors and (_others([r]) or _share(r, monitors["window"]))]
    due = [r for r in asked if _due(r, _seen(r, memory, monitors), monitors["t"])]
    log = tuple(Firing(r.name, did(r.do), _values(r, memory, monitors)) for r in due)
    shares = [share for r in due if (share := _share(r, monitors["window"]))]
    return Fired(applied(settings, _others(due)), _with_fired(memory, due), log, min(shares, default=0.0), _stop(due))


def alone(rule: Rule, memory: Memory, monitors: Mapping[str, float], failed: bool = False) -> tuple[
        Firing | None, Memory]:
    """Whether one rule would fire on a window that is done with, and the memory after it.  Nothing is put back.

    failed : monitors are those of `fire_failed`.
    """
    if failed and not OF_FAILURE & rule.monitors:
        return None, memory
    if not failed:
        monitors = {**monitors, **dict.fromkeys(OF_FAILURE, 0.0)}
    seen = _seen(rule, memory, monitors)
    due = _acts(rule, monitors["window"]) and _due(rule, seen, monitors["t"])
    fired = Firing(rule.name, did(rule.do), _values(rule, memory, monitors)) if due else None
    if failed:
        return fired, _with_fired(memory, [rule]) if due else memory
    # fault: check --rules: the window before is not remembered -> return fired, replace(memory, rules={rule.name:
    #   _after(rule, seen, due)}) | scenarios/test_rules
    return fired, replace(memory, rules={rule.name: _after(rule, seen, due)}, last=dict(monitors))


def retried(memory: Memory, fired: Fired) -> Memory:
    """The memory for the next try of a window that was put back, by a rule or not.  memory : before that window."""
    # fault: rules: once and cooldown forgotten with a window put back -> return memory | coupler/test_rules
    return fired.memory if fired.retry else memory


def value(test: Test, last: Mapping[str, float], monitors: Mapping[str, float]) -> float:
    """What a test compares; nan where it is not known.  last : the monitors of the window before."""
    now, before = monitors.get(test.monitor, math.nan), last.get(test.monitor, math.nan)
    if test.of is Of.VALUE:
        return now
    change = now - before
    # fault: rules: a rate not divided by the time since the window before -> return change if test.of is Of.CHANGE else
    #   change | coupler/test_rules
    return change if test.of is Of.CHANGE else change / (monitors["t"] - last.get("t", math.nan))


def spent(rule: Rule, memory: Memory) -> bool:
    """Whether a rule fires at most once, and has."""
    return rule.once and memory.rules.get(rule.name, Past()).fired > 0


def _share(rule: Rule, window: float) -> float:
    """The share of a window that a rule wants to try instead; 0: it does not, or that would be too short."""
    # fault: rules: a retry below its least -> return min((a.window for a in rule.do if isinstance(a, Retry)),
    #   default=0.0) | coupler/test_rules
    return min((a.window for a in rule.do if isinstance(a, Retry) and window * a.window >= a.least), default=0.0)


def _acts(rule: Rule, window: float) -> bool:
    """Whether anything would follow; a retry that may not make the window shorter is nothing."""
    return rule.drive is not None or bool(_others([rule])) or _share(rule, window) > 0.0


def _others(rules: Sequence[Rule]) -> tuple[Action, ...]:
    """What they do besides putting the window back."""
    return tuple(a for r in rules for a in r.do if not isinstance(a, Retry))


def _driven(due: Sequence[Rule], monitors: Mapping[str, float], fired: Fired) -> Fired:
    """Move every drive that is on, after a window; a monitor that is not known leaves its load as it is."""
    log, settings, memory = fired.log, fired.settings, fired.memory
    drives = dict(memory.drives)
    for rule in due:
        drive = rule.drive
        if drive is None or math.isnan(monitors.get(drive.monitor, math.nan)):
            continue
        known = drives.get(rule.name, begun(drive))
        drives[rule.name] = new = driven(drive, known, monitors[drive.monitor], monitors["window"])
        give = _give(drive, new)
        settings = applied(settings, [give])
        if new.value != known.value:
            log = (*log, Firing(rule.name, did([give]), _values(rule, memory, monitors), driving=True))
    return replace(fired, settings=settings, memory=replace(memory, drives=drives), log=log)


def _give(drive: Drive, known: Driven) -> Give:
    return Give(drive.half, drive.name, Change(to=known.value))


def _seen(rule: Rule, memory: Memory, monitors: Mapping[str, float]) -> Past:
    """What a rule remembers, with its streaks after one more window."""
    past = memory.rules.get(rule.name, Past())
    tests = tuple(rule.when)
    before = past.streaks if len(past.streaks) == len(tests) else (0,) * len(tests)
    return replace(past, streaks=tuple(n + 1 if test.holds(value(test, memory.last, monitors)) else 0
                                       for n, test in zip(before, tests, strict=True)))


def _due(rule: Rule, seen: Past, t: float) -> bool:
    """Whether it fires.  seen : what it remembers, with this window's streaks."""
    if (rule.once and seen.fired) or seen.rest or not rule.after < t <= rule.until:
        return False
    met = [n >= test.windows for n, test in zip(seen.streaks, rule.when, strict=True)]
    n = len(rule.when.all)
    groups = []
    for group in rule.when.any:
        groups.append(all(met[n:n + len(group)]))
        n += len(group)
    # fault: rules: any taken for all -> return all(met[:len(rule.when.all)]) and (all(groups) or not groups) |
    #   coupler/test_rules
    return all(met[:len(rule.when.all)]) and (any(groups) or not groups)


def _fired(rule: Rule, past: Past) -> Past:
    return replace(past, fired=past.fired + 1, rest=rule.cooldown)


def _with_fired(memory: Memory, due: Sequence[Rule]) -> Memory:
    """The memory in which these rules fired, and nothing else happened."""
    return replace(memory, rules={**memory.rules, **{r.name: _fired(r, memory.rules.get(r.name, Past())) for r in due}})


def _after(rule: Rule, seen: Past, fired: bool) -> Past:
    """What is kept of a window that stands; "so many windows on end" are counted anew after a rule fired."""
    # fault: rules: windows in a row counted on after a firing -> return _fired(rule, seen) if fired else replace(seen,
    #   rest=max(seen.rest - 1, 0)) | coupler/test_rules
    return replace(_fired(rule, seen), streaks=()) if fired else replace(seen, rest=max(seen.rest - 1, 0))


def _stop(due: Sequence[Rule]) -> str:
    """Why the run is to end."""
    return "; ".join(f"rule {r.name!r}" + (f": {a.reason}" if a.reason else "") for r in due for a in r.do
                     if isinstance(a, Stop))


def _values(rule: Rule, memory: Memory, monitors: Mapping[str, float]) -> dict[str, float]:
    """What it looked at; a change or a rate under its own name."""
    found = {looked_at(test): value(test, memory.last, monitors) for test in rule.when}
    return found | ({rule.drive.monitor: monitors.get(rule.drive.monitor, math.nan)} if rule.drive else {})
