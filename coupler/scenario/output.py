"""When fields are kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from coupler.scenario.document import Document
from coupler.scenario.schema import Output as OutputSpec

# A window end this near below a wanted time (as a share of it) is that time.
SAME = 1e-9


@dataclass
class Frames:
    """Asked after every accepted window whether fields are due; remembers which times it has answered for."""

    every: int | None
    waiting: list[float]

    def due(self, number: int, t: float) -> bool:
        """number : accepted windows so far.  t [s]: the time reached."""
        passed = [w for w in self.waiting if w <= t * (1 + SAME)]
        self.waiting = self.waiting[len(passed):]
        # fault: fields by count forgotten -> return bool(passed) or (self.every is not None and number % self.every ==
        #   1) | coupler/test_scenario_load
        return bool(passed) or (self.every is not None and number % self.every == 0)


@dataclass(frozen=True)
class Output:
    """every : keep fields every so many windows, None: never by count.  at : at the first window end at or
    after these times [s], ascending.  The first and last state of a run are kept in any case.
    checkpoint : least wall time between two checkpoints [s], None: there are none."""

    every: int | None
    at: Sequence[float] = field(default=())
    checkpoint: float | None = 30.0

    def frames(self) -> Frames:
        """A fresh count for one run."""
        return Frames(self.every, [t for t in self.at if t > 0])


def output_of(document: Document, spec: OutputSpec, end: float) -> Output:
    """Raises ScenarioError for a time after the end."""
    for i, t in enumerate(spec.fields.at):
        if t > end:
            raise document.error(
                ("output", "fields", "at", i), f"this is after the end of the run, {end:g} s"
            )
    return Output(spec.fields.every, tuple(sorted(set(spec.fields.at))), spec.checkpoint)
