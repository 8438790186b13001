"""The progress of a run after each window, and an estimate of the time to go."""

from __future__ import annotations

import math
import warnings
from collections import deque
from dataclasses import dataclass

from coupler.control.loop import Tried
from coupler.schemes.ledger import Ledger
from coupler.schemes.state import Verdict

# The time to go is estimated from this many windows: some windows cost ten times others.
WINDOWS = 50


@dataclass(frozen=True)
class Progress:
    """The progress of a run after a window was tried.

    t, t_end : time and end of the run [s].  total : windows of the schedule; 0 for adaptive windows.
    touching : contact points that touch.  max_T [K], max_p [Pa] : largest temperature and contact pressure.
    imbalance : relative energy-balance error.  elapsed, remaining : wall time [s], the latter estimated.
    notes : warnings.  H [s], scheme, reason : of the window.  event : of contact.  fired : rules that did.
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
    remaining: float
    notes: tuple[str, ...] = ()
    iterations: int = 0  # of the window, where the scheme iterates
    anyway: bool = False  # accepted though it did not converge, or its error is too large
    H: float = 0.0
    scheme: str = ""
    reason: str = ""
    event: str = ""
    fired: tuple[str, ...] = ()
    solves: int = 0  # solver calls of the window

    @property
    def taken(self) -> bool:
        return self.anyway or self.verdict == Verdict.ACCEPTED.value

    @property
    def fraction(self) -> float:
        """How much of the run is done: by windows, because most of the work lies where they are small; by time
        where their number is not known."""
        return self.number / self.total if self.total else self.t / self.t_end

    @property
    def share(self) -> float:
        """The old name of `fraction`."""
        warnings.warn("Progress.share is now Progress.fraction", DeprecationWarning, stacklevel=2)
        return self.fraction

    @property
    def left(self) -> float:
        """The old name of `remaining`."""
        warnings.warn("Progress.left is now Progress.remaining", DeprecationWarning, stacklevel=2)
        return self.remaining


class RemainingTime:
    """Estimates the time to go from the last windows.  fraction : of the run that was done when it began."""

    def __init__(self, fraction: float = 0.0) -> None:
        self._marks: deque[tuple[float, float]] = deque([(fraction, 0.0)], maxlen=WINDOWS)

    def after(self, fraction: float, elapsed: float) -> float:
        """Return the seconds to go when a fraction of the run is done after `elapsed` seconds."""
        self._marks.append((fraction, elapsed))
        first, since = self._marks[0]
        if fraction <= first:
            return math.inf
        return (elapsed - since) / (fraction - first) * max(1.0 - fraction, 0.0)


@dataclass(frozen=True)
class RunStatus:
    """What progress is measured against.  total : windows of the schedule, 0: not known.  elapsed : [s]."""

    t_end: float
    total: int
    elapsed: float
    ledger: Ledger


def progress(tried: Tried, status: RunStatus, time_to_go: RemainingTime, notes: tuple[str, ...]) -> Progress:
    """Return the progress after a window was tried."""
    t, done = tried.after.state.now.t, tried.number + 1
    fraction = done / status.total if status.total else t / status.t_end
    solved, m = tried.solved, tried.solved.monitors
    return Progress(
        t, status.t_end, done, status.total, solved.verdict.value, solved.message, int(m.get("touching", 0)),
        m.get("max_T", math.nan), m.get("max_p", 0.0), status.ledger.imbalance, status.elapsed,
        time_to_go.after(fraction, status.elapsed), notes, len(solved.history.misfits) if solved.history else 0,
        solved.anyway, tried.H, solved.scheme.value, tried.reason, tried.event,
        tuple(f"rule {f.rule!r}: {f.text}" for f in tried.fired if not f.driving),
        solved.work.thermal_solves + solved.work.mechanical_solves)
