"""Reads the steps of a deck, and how loads change over time from one step to the next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

from contact.problem.values import did_you_mean
from coupler.deck.lexer import DeckLine, KeywordBlock, Log, number, numbers, wrong
from coupler.deck.outline import Outline, named

PROCEDURES = ("STATIC", "COUPLED TEMPERATURE-DISPLACEMENT", "UNCOUPLED TEMPERATURE-DISPLACEMENT", "HEAT TRANSFER")
MAX_WINDOWS = 100_000
MOST = 200  # increments of a step that are all of one size; of more the first are small


@dataclass(frozen=True, eq=False)  # one step is itself only
class DeckStep:
    """A step of the deck.

    start, end, first (increment), longest (increment) : [s].  direct : all increments are equal.
    ramp : loads grow linearly from the step's start to its end, else they jump.  blocks : its loads and conditions.
    """

    procedure: str
    start: float
    end: float
    first: float
    longest: float
    direct: bool
    steady: bool
    ramp: bool
    row: DeckLine
    blocks: tuple[KeywordBlock, ...]

    @property
    def windows(self) -> dict[str, float]:
        """Return the entry of coupling.windows for this step."""
        span = self.end - self.start
        # No longest increment, 0, is as good as the whole step.
        # fault: decks: a step without a longest increment never grows its windows -> if self.direct or self.first >=
        #   span / MOST or self.longest <= self.first: | coupler/test_deck_hostile
        if self.direct or self.first >= span / MOST or 0.0 < self.longest <= self.first:
            return {"until": self.end, "size": min(self.first, span)}
        return {"until": self.end, "first": self.first, "last": min(self.longest or span, span / 50.0)}

    @property
    def count(self) -> float:
        """Estimate how many windows the step takes."""
        windows = self.windows
        return (self.end - self.start) / windows.get("size", windows.get("last", self.first))


def steps_of(outline: Outline, log: Log) -> list[DeckStep]:
    """Read the steps in order of time.  Raises ScenarioError for a deck without steps, or steady and transient ones."""
    steps: list[DeckStep] = []
    for owner in outline.steps:
        steps.append(_step(owner.block, owner.own, steps[-1].end if steps else 0.0, log))
    if not steps:
        row = outline.mesh[0].block.row if outline.mesh else DeckLine("", 0, "", ())
        raise wrong(row, "the deck has no *STEP", "Add one that says what is solved: *STEP, *HEAT TRANSFER, a line "
                    "with the first increment and the time of the step, *END STEP.")
    kinds = {step.steady for step in steps if step.procedure != "STATIC"}
    if len(kinds) > 1:
        raise wrong(steps[-1].row, "some steps are steady, others are not",
                    "A scenario is one or the other: write a deck for each.")
    if any(step.procedure == "STATIC" for step in steps) and kinds:
        log.note("in steps of *STATIC the bodies conduct heat too")
    return steps


def _step(block: KeywordBlock, own: Sequence[KeywordBlock], start: float, log: Log) -> DeckStep:
    procedures = [b for b in own if b.word in PROCEDURES]
    if len(procedures) != 1:
        raise wrong(block.row, f"a step has one procedure, this one has {len(procedures)}",
                    "Understood are *HEAT TRANSFER, *COUPLED and *UNCOUPLED TEMPERATURE-DISPLACEMENT, *STATIC.")
    procedure = procedures[0]
    row = procedure.data[0] if procedure.data else procedure.row
    first, span, least, longest = 1.0, 1.0, 0.0, 0.0
    if procedure.data:
        span = number(row, 1, "the time of the step", 0.0) or 1.0
        first = number(row, 0, "the first increment", 0.0) or span
        least, longest = number(row, 2, "the shortest increment", 0.0), number(row, 3, "the longest increment", 0.0)
    if min(span, first) <= 0.0 or min(least, longest) < 0.0:
        raise wrong(row, "times are greater than zero")
    direct, steady = "DIRECT" in procedure.options, "STEADY STATE" in procedure.options
    if not direct:
        log.note("windows have the size of the deck's first increment, or grow from it; `coupling.adaptive` lets them "
                 "find their own")
    if "NLGEOM" not in block.options and procedure.word != "HEAT TRANSFER":
        log.note("bodies move by finite strain, as with NLGEOM")
    ramp = block.option("AMPLITUDE") == "RAMP" or (
        block.option("AMPLITUDE") != "STEP" and (steady or procedure.word == "STATIC"))
    step = DeckStep(procedure.word, start, start + span, first, longest, direct, steady, ramp, block.row,
                tuple(b for b in own if b.word not in PROCEDURES))
    if not step.start < step.end < float("inf"):
        raise wrong(row, f"a step of {span:g} s from {start:g} s has no end that a number could hold")
    # fault: decks: a step may have any number of increments -> if False: | coupler/test_deck_hostile
    if step.count > MAX_WINDOWS:
        raise wrong(row, f"more than {MAX_WINDOWS} increments", "Give a longer longest increment, or none.")
    return step


# Loads over time: from step to step, by amplitudes, ramps and jumps.

MAX_POINTS = 5_000  # of an amplitude: a scenario is a text of some kilobytes
Signal = float | dict[str, list[float]]


@dataclass(frozen=True)
class Amplitude:
    """A factor, or a value, over time.

    points : (t [s], value).  total : t counts from the start of the deck, else of the step.
    absolute : it is the value itself, not a factor.
    """

    points: tuple[tuple[float, float], ...]
    total: bool
    absolute: bool

    def at(self, t: float) -> float:
        """Interpolate linearly between the points; constant outside."""
        if t <= self.points[0][0]:
            return self.points[0][1]
        for (t0, v0), (t1, v1) in pairwise(self.points):
            if t0 <= t < t1:
                return v0 + (v1 - v0) * (t - t0) / (t1 - t0)
        return self.points[-1][1]


@dataclass(frozen=True)
class LoadHistory:
    """A load over time.  points : (t [s], value) so far, times not decreasing; before them the first value holds."""

    points: tuple[tuple[float, float], ...]

    @property
    def last(self) -> float:
        """The value now."""
        return self.points[-1][1]

    @property
    def signal(self) -> Signal:
        """Return it as a scenario has it: a number, or a table without points that change nothing."""
        # fault: decks: a ramp's end and a jump give three values at one time -> points = self.points |
        #   coupler/test_deck
        points = _jumps(self.points)
        padded = (points[0], *points, points[-1])
        points = [now for before, now, later in zip(padded, padded[1:], padded[2:], strict=False)
                if now[1] != before[1] or later[1] != now[1]]
        if not points:
            return self.last
        return {"t": [t for t, _ in points], "value": [v for _, v in points]}


def _jumps(points: tuple[tuple[float, float], ...]) -> list[tuple[float, float]]:
    """Keep the first and the last of the points at one time: a ramp may end where the next step jumps."""
    ends: list[tuple[float, float]] = []
    for point in points:
        if ends and ends[-1] == point:
            continue
        if len(ends) > 1 and ends[-2][0] == point[0]:
            ends.pop()
        ends.append(point)
    return ends


def amplitudes_of(outline: Outline, log: Log) -> dict[str, Amplitude]:
    """Read the *AMPLITUDE blocks, by name in capitals.  Raises ScenarioError."""
    amplitudes = {}
    blocks = [*outline.model, *(b for owner in outline.steps for b in owner.own)]
    for block in (b for b in blocks if b.word == "AMPLITUDE"):
        kind = block.option("DEFINITION") or "TABULAR"
        if kind != "TABULAR":
            raise wrong(block.row, f"amplitudes of definition {kind[:30]} are not understood",
                        "Write it as a table: DEFINITION=TABULAR.")
        flat = [v for row in block.data for v in numbers(row, "an amplitude")]
        points = tuple(zip(flat[::2], flat[1::2], strict=False))
        if len(flat) % 2 or not points or len(points) > MAX_POINTS:
            raise wrong(block.row, f"an amplitude has pairs of time and value, 1 to {MAX_POINTS}")
        if any(b[0] < a[0] for a, b in pairwise(points)):
            raise wrong(block.row, "the times of an amplitude must not decrease")
        amplitudes[named(block, "NAME")] = Amplitude(points, block.option("TIME") == "TOTAL TIME",
                                                block.option("VALUE") == "ABSOLUTE")
    return amplitudes


def amplitude_at(block: KeywordBlock, option: str, amplitudes: Mapping[str, Amplitude]) -> Amplitude | None:
    """Return the amplitude that a block names, None where it names none.

    Raises ScenarioError where the deck has no such amplitude.
    """
    name = block.option(option)
    if not name:
        return None
    if name not in amplitudes:
        raise wrong(block.row, f"there is no amplitude {name[:60]}", did_you_mean(name[:60], amplitudes))
    return amplitudes[name]


@lru_cache(maxsize=4096)
def after(history: LoadHistory | None, step: DeckStep | None, value: float, amplitude: Amplitude | None,
          rest: float) -> LoadHistory:
    """Return the history of a load after a value is given in a step.

    history : so far, None where there was none.  step : None where the value holds from the start.
    rest : the value before the first one given.
    """
    t0, t1 = (step.start, step.end) if step is not None else (0.0, 0.0)
    before = history.points if history is not None else ((0.0, rest),)
    now = before[-1][1]
    if step is not None and amplitude is not None:
        shift = 0.0 if amplitude.total else t0
        size = 1.0 if amplitude.absolute else value
        inner = [(t + shift, v) for t, v in amplitude.points if t0 < t + shift < t1]
        ends = [(t, amplitude.at(t - shift)) for t in (t0, t1)]
        new = [(t, size * v + 0.0) for t, v in (ends[0], *inner, ends[1])]  # no -0
    elif step is not None and step.ramp:
        new = [(t0, now), (t1, value)]
    else:
        new = [(t0, value)]
    if t0 == 0.0:
        return LoadHistory(tuple(new))
    # fault: decks: a later step forgets what was before -> return LoadHistory(tuple(new)) | coupler/test_deck
    return LoadHistory((*before, (t0, now), *new))
