"""Where a run stands after a window, for whoever shows it."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from coupler.control.loop import Tried
from coupler.schemes.state import Ledger, Verdict

# The time left is told from the pace of this many windows: some windows cost ten times others.
PACE = 50


@dataclass(frozen=True)
class Progress:
    """Where a run stands after a window.  t, t_end [s]; max_T [K]; max_p [Pa]; left : seconds to go, estimated.

    total : windows of the schedule; 0 where windows find their own size.  notes : what happened that should not go by
    in silence.  H [s], scheme, reason : of the window tried.  event : what happened to contact.  fired : which rules.
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
    anyway: bool = False  # taken though it did not converge, or its error is too large
    H: float = 0.0
    scheme: str = ""
    reason: str = ""
    event: str = ""
    fired: tuple[str, ...] = ()

    @property
    def taken(self) -> bool:
        return self.anyway or self.verdict == Verdict.ACCEPTED.value

    @property
    def share(self) -> float:
        """How much is done: by windows, because most of the work lies where they are small; by time where it is not
        known how many there will be."""
        return self.number / self.total if self.total else self.t / self.t_end


class Pace:
    """How fast a run goes, from its last windows.  share : what was done when it began."""

    def __init__(self, share: float = 0.0) -> None:
        self._marks: deque[tuple[float, float]] = deque([(share, 0.0)], maxlen=PACE)

    def left(self, share: float, elapsed: float) -> float:
        """Seconds to go."""
        self._marks.append((share, elapsed))
        first, since = self._marks[0]
        return (elapsed - since) / (share - first) * max(1.0 - share, 0.0) if share > first else math.inf


@dataclass(frozen=True)
class Standing:
    """What progress is told against.  total : windows of the schedule, 0: not known."""

    t_end: float
    total: int
    elapsed: float
    ledger: Ledger


def progress(tried: Tried, standing: Standing, pace: Pace, notes: tuple[str, ...]) -> Progress:
    """After a try."""
    t, done = tried.after.state.now.t, tried.number + 1
    share = done / standing.total if standing.total else t / standing.t_end
    solved, m = tried.solved, tried.solved.monitors
    return Progress(
        t, standing.t_end, done, standing.total, solved.verdict.value, solved.message, int(m.get("touching", 0)),
        m.get("max_T", math.nan), m.get("max_p", 0.0), standing.ledger.imbalance, standing.elapsed,
        pace.left(share, standing.elapsed), notes, len(solved.history.misfits) if solved.history else 0, solved.anyway,
        tried.H, solved.scheme.value, tried.reason, tried.event,
        tuple(f"rule {f.rule!r}: {f.text}" for f in tried.fired if not f.driving))
