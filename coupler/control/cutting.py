"""A window that does not stand is tried again, shorter: how much, and when that is given up."""

from __future__ import annotations

from dataclasses import dataclass, replace

from coupler.control.plan import Plan
from coupler.control.state import Committed, ControlState
from coupler.errors import CouplingError
from coupler.schemes.window import Solved, Span

# A window is halved at most this often before the run gives up: 2^-10 of a window a user chose is a sign of a
# problem that smaller windows do not cure.
MAX_CUTS = 10
# So many tries on end without one that stands are a loop, whoever asked for them.
MAX_TRIES = 60


@dataclass(frozen=True)
class Facts:
    """A window that was tried.  at : before it."""

    plan: Plan
    at: Committed
    span: Span
    solved: Solved

    @property
    def t(self) -> float:
        """Where it begins [s]."""
        return self.span.clock.seconds(self.span.k0)

    @property
    def H(self) -> float:
        """Its size [s]."""
        return self.span.end - self.t


def cut(facts: Facts, share: float, why: str) -> ControlState:
    """Control for the next try, `share` (< 1) of the window.  Raises CouplingError where it may not be cut again."""
    if facts.plan.adaptive is not None:
        return shorter(facts, share * facts.H, why)
    control, span = facts.at.control, facts.span
    ends = control.ends or (span.k1,)
    if ends[-1] != span.k1:
        ends = (*ends, span.k1)
    middle = span.k0 + int((span.k1 - span.k0) * share)
    if len(ends) > MAX_CUTS or middle == span.k0:
        raise gave_up(facts, why, f"the window was halved {len(ends) - 1} times to {facts.H:.3g} s")
    return tried_again(facts, replace(control, ends=(*ends, middle), aim=0), why)


def shorter(facts: Facts, size: float, why: str) -> ControlState:
    """Control for a next try of `size` [s].  Raises CouplingError where the window is at its least."""
    adaptive, control = facts.plan.adaptive, facts.at.control
    assert adaptive is not None
    if at_least(facts):
        raise gave_up(facts, why, f"the window of {facts.H:.3g} s is at its least")
    return tried_again(facts, replace(control, size=max(size, adaptive.least), reason=f"tried again after: {why}",
                                      below=facts.span.k1, aim=0), why)


def at_least(facts: Facts) -> bool:
    """Whether a window that finds its own size may not be shorter."""
    adaptive = facts.plan.adaptive
    return adaptive is not None and adaptive.least * (1.0 + 1e-6) >= facts.H


def tried_again(facts: Facts, control: ControlState, why: str) -> ControlState:
    """With one more failure counted.  Raises CouplingError after too many on end."""
    if control.failures >= MAX_TRIES:
        raise gave_up(facts, why, f"{control.failures} tries on end were put back")
    return replace(control, failures=control.failures + 1)


def gave_up(facts: Facts, why: str, how: str) -> CouplingError:
    """The error of a window that cannot be solved."""
    course = facts.solved.course
    return CouplingError(
        f"{why}; {how}", t=facts.t, window=facts.at.control.number + 1,
        iteration=len(course.misfits) if course else 0,
        residuals=tuple(course.misfits[-1].values()) if course else (),
        remedy="Everything up to here is in the results file. Give smaller windows (coupling.windows) "
               "or more substeps around this time, or look at the data that change here")
