"""Steps: when each begins and ends, what is solved in it, and how its loads come on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from coupler.deck.lexer import Block, Row, number, wrong
from coupler.deck.log import Log
from coupler.deck.outline import Outline

PROCEDURES = ("STATIC", "COUPLED TEMPERATURE-DISPLACEMENT", "UNCOUPLED TEMPERATURE-DISPLACEMENT", "HEAT TRANSFER")
MAX_WINDOWS = 100_000
MOST = 200  # increments of a step that are all of one size; of more the first are small


@dataclass(frozen=True, eq=False)  # one step is itself only
class Step:
    """start, end, first increment, longest increment [s].  direct : all increments alike.  ramp : loads grow from the
    step's start to its end; else they jump.  blocks : what is said in it."""

    procedure: str
    start: float
    end: float
    first: float
    longest: float
    direct: bool
    steady: bool
    ramp: bool
    row: Row
    blocks: tuple[Block, ...]

    @property
    def windows(self) -> dict[str, float]:
        """One entry of coupling.windows."""
        span = self.end - self.start
        # No longest increment, 0, is as good as the whole step.
        # fault: decks: a step without a longest increment never grows its windows -> if self.direct or self.first >=
        #   span / MOST or self.longest <= self.first: | coupler/test_deck_hostile
        if self.direct or self.first >= span / MOST or 0.0 < self.longest <= self.first:
            return {"until": self.end, "size": min(self.first, span)}
        return {"until": self.end, "first": self.first, "last": min(self.longest or span, span / 50.0)}

    @property
    def count(self) -> float:
        """So many windows, about."""
        windows = self.windows
        return (self.end - self.start) / windows.get("size", windows.get("last", self.first))


def steps_of(outline: Outline, log: Log) -> list[Step]:
    """The deck's steps in order of time.  Raises ScenarioError."""
    steps: list[Step] = []
    for owner in outline.steps:
        steps.append(_step(owner.block, owner.own, steps[-1].end if steps else 0.0, log))
    if not steps:
        row = outline.mesh[0].block.row if outline.mesh else Row("", 0, "", ())
        raise wrong(row, "the deck has no *STEP", "Add one that says what is solved: *STEP, *HEAT TRANSFER, a line "
                    "with the first increment and the time of the step, *END STEP.")
    kinds = {step.steady for step in steps if step.procedure != "STATIC"}
    if len(kinds) > 1:
        raise wrong(steps[-1].row, "some steps are steady, others are not",
                    "A scenario is one or the other: write a deck for each.")
    if any(step.procedure == "STATIC" for step in steps) and kinds:
        log.note("in steps of *STATIC the bodies conduct heat too")
    return steps


def _step(block: Block, own: Sequence[Block], start: float, log: Log) -> Step:
    found = [b for b in own if b.word in PROCEDURES]
    if len(found) != 1:
        raise wrong(block.row, f"a step has one procedure, this one has {len(found)}",
                    "Understood are *HEAT TRANSFER, *COUPLED and *UNCOUPLED TEMPERATURE-DISPLACEMENT, *STATIC.")
    procedure = found[0]
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
    step = Step(procedure.word, start, start + span, first, longest, direct, steady, ramp, block.row,
                tuple(b for b in own if b.word not in PROCEDURES))
    if not step.start < step.end < float("inf"):
        raise wrong(row, f"a step of {span:g} s from {start:g} s has no end that a number could hold")
    # fault: decks: a step may have any number of increments -> if False: | coupler/test_deck_hostile
    if step.count > MAX_WINDOWS:
        raise wrong(row, f"more than {MAX_WINDOWS} increments", "Give a longer longest increment, or none.")
    return step
