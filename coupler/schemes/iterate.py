"""The iterated window: mechanics and thermal over it again and again, until what they tell each other agrees.

What is guessed, and accelerated, is T (with f_s) at the end of the window; each iterate is mechanics with that T, then
thermal on the x and t_N that mechanics found.  Guessing x and t_N instead would do as well for one mode, but T is
smooth where contact is not, every t_N the thermal half sees comes from equilibrium and so is never a tension, and the
heat mechanics made is delivered to the joule in the iterate that made it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from coupler.errors import in_words
from coupler.scenario.options import Iteration, OnMax, Scheme, Seen, Tolerance, Tolerances
from coupler.schemes.acceleration import Memory, Trail, contraction, contractions, next_guess, relaxed, remembered
from coupler.schemes.levels import Level, exchanged, predicted
from coupler.schemes.scheme import BOTH_ENDS, CouplingScheme, Exchange, Exchanged, Sees, WindowTask
from coupler.schemes.state import NO_WORK, IterationHistory, Solved, Verdict, Work
from coupler.schemes.sweep import Swept, mechanical_first

# Whether a window's iterates agree: one number a quantity, at most 1 where it does.

Array = NDArray[np.float64]

# Quantity -> field of a level.
QUANTITIES = {"temperature": "T", "gap": "x", "pressure": "t_N", "solid_fraction": "f_s"}


@dataclass(frozen=True)
class FixedPointStep:
    """What one iterate did.  guess : what was put in; found : what came out; former : x and t_N one iterate before.

    share : of the change of x and t_N since `former` that the residual still left stands for, |r|/|g - g_former|;
    inf where that is not known.
    """

    guess: Level
    found: Level
    former: Level
    share: float


def misfits(start: Level, step: FixedPointStep, tolerance: Tolerances) -> Mapping[str, float]:
    """Differences in units of their tolerance; a quantity the scene does not have is left out.

    T and f_s were guessed, so outcome less guess is known.  x and t_N follow from the guess; what they would still
    change by is known only from the last change, times how much smaller the residual is than the step that made it.
    The iterate before the first is the start of the window.
    """
    # fault: gap not judged -> apart = {"temperature": (step.found.T, step.guess.T, 1.0), "gap": (step.found.x,
    #   step.found.x, 0.0), | coupler/test_iterated
    apart = {"temperature": (step.found.T, step.guess.T, 1.0), "gap": (step.found.x, step.former.x, step.share),
             # fault: pressure not judged -> "pressure": (step.found.t_N, step.found.t_N, 0.0)} | coupler/test_iterated
             "pressure": (step.found.t_N, step.former.t_N, step.share)}
    if step.found.f_s is not None and step.guess.f_s is not None:
        apart["solid_fraction"] = (step.found.f_s, step.guess.f_s, 1.0)
    return {name: share if math.isinf(share) else share * _misfit(
        new, old, getattr(start, QUANTITIES[name]), getattr(tolerance, name))
        for name, (new, old, share) in apart.items() if new.size}


def _misfit(new: Array, old: Array, start: Array, tolerance: Tolerance) -> float:
    change = float(np.abs(new - start).max())
    return float(np.abs(new - old).max()) / (tolerance.atol + tolerance.rtol * change)


# Guesses nearer to each other than this many tolerances tell no contraction: round-off of the halves is in them.
TOO_NEAR = 1e-3


@dataclass(frozen=True)
class _Progress:
    """The iterates of a window so far.  guess : the next.  former : x and t_N of the iterate before, in a level.

    At first that is the start of the window, where T, x and t_N belong together too.
    """

    guess: Level
    former: Level
    trail: Trail = field(default_factory=Trail)
    misfits: tuple[dict[str, float], ...] = ()
    work: Work = NO_WORK

    @property
    def history(self) -> IterationHistory:
        return IterationHistory(self.misfits, self.trail.factors, contraction(self.trail, TOO_NEAR),
                      contractions(self.trail, TOO_NEAR))

    @property
    def converged(self) -> bool:
        # fault: one iterate more than needed -> return len(self.misfits) > 1 and max(self.misfits[-2].values()) <= 1.0
        #   | coupler/test_iterated
        return max(self.misfits[-1].values()) <= 1.0

    @property
    def tells_no_more(self) -> bool:
        """Whether the next guess would be too near to tell a contraction."""
        return float(np.linalg.norm(self.trail.residual())) <= TOO_NEAR


def solve_iterated(w: WindowTask) -> Solved:
    """Solves a window by iteration.  Raises DiscardError."""
    halves, state, span, how = w.halves, w.state, w.span, w.iteration
    first = predicted(state.now, state.before, span.end)
    so_far = _Progress(first, state.now)
    for k in range(1, how.max_iterations + 1):
        if k > 1:
            so_far = _next(so_far, how, state.memory)
            # fault: an iterate begins where the one before ended -> pass | coupler/test_iterated
            w.roll_back("a window is to be iterated")
        # fault: iterated windows give x of the middle whatever is asked -> swept = mechanical_first(halves, state,
        #   span, exchanged(so_far.guess), so_far.work, False) | stability/test_rods
        swept = mechanical_first(halves, state, span, exchanged(so_far.guess), so_far.work, how.level is Seen.END)
        so_far = _judged(so_far, state.now, swept, how)
        if so_far.converged and (k >= how.LEAST or so_far.tells_no_more):
            break
    solved = swept.solved(state, Scheme.ITERATED, so_far.history)
    # fault: nothing learnt from windows past -> solved = replace(solved, state=replace(solved.state, memory=())) |
    #   coupler/test_iterated
    solved = replace(solved, state=replace(solved.state, memory=remembered(state.memory, so_far.trail, how)))
    if so_far.converged:
        return solved
    # fault: unconverged windows accepted in silence -> return replace(solved, verdict=Verdict.ACCEPTED,
    #   message=_why(so_far, how), | coupler/test_iterated
    return replace(solved, verdict=Verdict.MAX_ITERATIONS, message=_why(so_far, how),
                   anyway=how.on_max is OnMax.ACCEPT)


def _judged(so_far: _Progress, start: Level, swept: Swept, how: Iteration) -> _Progress:
    """After one more iterate: its residual, and how far each quantity is from agreement."""
    known = so_far.trail.guesses[-1] if so_far.trail.guesses else _packed(start, how)
    trail = so_far.trail.plus(_packed(so_far.guess, how), _packed(swept.level, how))
    step, left = (float(np.linalg.norm(v)) for v in (trail.guesses[-1] - known, trail.residual()))
    # Where the guess is the one before, nothing tells what the residual would do to x and t_N.
    # fault: change since the last iterate taken for what is left -> share = 1.0 if step > 0.0 else math.inf if left >
    #   0.0 else 0.0 | coupler/test_iterated
    share = left / step if step > 0.0 else math.inf if left > 0.0 else 0.0
    told = misfits(start, FixedPointStep(so_far.guess, swept.level, so_far.former, share), how.tolerance)
    return replace(so_far, former=swept.level, trail=trail, misfits=(*so_far.misfits, dict(told)), work=swept.work)


def _next(so_far: _Progress, how: Iteration, memory: Memory) -> _Progress:
    """The next guess; the careful step where acceleration leaves what temperatures can be."""
    # fault: acceleration off -> vector, factor = so_far.trail.outcomes[-1], 1.0 | coupler/test_iterated
    vector, factor = next_guess(how, so_far.trail, memory)
    guess = _unpacked(vector, so_far.guess, how)
    # fault: guesses below absolute zero kept -> if not (np.isfinite(vector).all() and True): | coupler/test_iterated
    if not (np.isfinite(vector).all() and (guess.T > 0.0).all()):
        vector, factor = relaxed(how, so_far.trail)
        guess = _unpacked(vector, so_far.guess, how)
    return replace(so_far, guess=guess, trail=replace(so_far.trail, factors=(*so_far.trail.factors, factor)))


def _packed(level: Level, how: Iteration) -> Array:
    """T and f_s as one vector in units of their floors, so that neither drowns the other."""
    T = level.T / how.tolerance.temperature.atol
    return T if level.f_s is None else np.concatenate([T, level.f_s / how.tolerance.solid_fraction.atol])


def _unpacked(vector: Array, like: Level, how: Iteration) -> Level:
    n = len(like.T)
    T = vector[:n] * how.tolerance.temperature.atol
    if like.f_s is None:
        return replace(like, T=T)
    return replace(like, T=T, f_s=np.clip(vector[n:] * how.tolerance.solid_fraction.atol, 0.0, 1.0))


def _why(so_far: _Progress, how: Iteration) -> str:
    """The message of a window that did not converge."""
    last = ", ".join(f"{name.replace('_', ' ')} by {in_words(value)} times its tolerance"
                     for name, value in so_far.misfits[-1].items())
    ratio = so_far.history.contraction
    told = f"; plain iteration multiplies a difference by {in_words(ratio)} here" if ratio == ratio else ""
    return (f"not converged: after {how.max_iterations} iterations with acceleration {how.acceleration.value} the last "
            f"two differ in {last}{told}")


_END = Exchanged(Sees.END, 1)
ITERATED = CouplingScheme(Scheme.ITERATED, solve_iterated,
                          {Seen.MIDDLE: Exchange(BOTH_ENDS, BOTH_ENDS, BOTH_ENDS),
                           Seen.END: Exchange(_END, BOTH_ENDS, BOTH_ENDS)},
                          needs_states=True, ends_behind_event=False,
                          simpler=(Scheme.STAGGERED, Scheme.EXTRAPOLATED))
