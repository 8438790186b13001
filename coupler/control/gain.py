"""What windows of a scheme make of a small disturbance, from two spare iterates: whether the exchange is stable.

Two numbers of a window of H seconds are measured where they matter, along the direction in which the exchange answers:

    rho   what plain iteration multiplies a difference of guesses by, its sign turned: > 0 turns against what changed
    R     what the thermal half leaves of a difference in one more window, with the exchange held, as mechanics feel it

A window solved once gives the thermal half x and t_N that belong to temperatures before, w_0 T_n + w_1 T_(n-1) + ... by
its scheme, and a disturbance goes from window to window by

    T_(n+1) = R T_n - 2 rho (w_0 T_n + w_1 T_(n-1) + w_2 T_(n-2)),

whose largest root is m: it dies where |m| < 1 (docs/theory.md, limits of stability, has the limits in closed form).
Iterated windows see half of the end: (1 + rho) T_(n+1) = (R - rho) T_n.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from coupler.control.solve_window import SavedStates, SolveOptions
from coupler.scenario.options import Scheme, Seen
from coupler.schemes.levels import Level, exchanged, weights
from coupler.schemes.schemes import scheme_of, with_mode
from coupler.schemes.state import NO_WORK, CoupledState, Halves, Solved, Span
from coupler.schemes.sweep import DiscardError, mechanical_first, mechanical_pass, thermal_pass

Array = NDArray[np.float64]

# Differences below this share of the largest temperature [K/K] are what solvers leave.
ROUND_OFF = 1e-10
# How far a limit is looked for, in windows, and how nearly it is found.
FARTHEST, NEARLY = 64.0, 1e-3
SOLVES = 8


@dataclass(frozen=True)
class Gain:
    """rho, R : see above, of windows of H [s].  held : w_0, w_1, ... of the scheme.  seen : share of the end."""

    H: float
    rho: float
    R: float
    held: tuple[float, ...]
    seen: float = 0.0

    @property
    def m(self) -> float:
        """What a disturbance is multiplied by in a window: < 0 where it turns round or goes about; nan: unknown."""
        return multiplier(self.rho, self.R, self.held, self.seen)

    @property
    def limit(self) -> float:
        """The longest stable window [s], by the laws of one mode; inf: any, as far as was looked."""
        def unstable(share: float) -> bool:
            a = damping(self.R)
            longer = Gain(self.H * share, self.rho * share * (1.0 + a) / (1.0 + a * share), 1.0 / (1.0 + a * share),
                          self.held, self.seen)
            return longer.m <= -1.0

        if not unstable(FARTHEST):
            return math.inf
        low, high = 0.0, FARTHEST
        while high - low > NEARLY * high:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if unstable(middle) else (middle, high)
        return self.H * low


def damping(R: float) -> float:
    """Return theta a H from what is left of a difference, as backward Euler leaves 1/(1 + a H); 0 where it grows."""
    return 1.0 / R - 1.0 if 0.0 < R < 1.0 else 0.0 if R >= 1.0 else 2.0


def multiplier(rho: float, R: float, held: tuple[float, ...], seen: float = 0.0) -> float:
    """Return the largest root m, < 0 where its real part is or where it is a pair; nan: unknown.

    rho, R, held, seen : as of Gain.
    """
    if math.isnan(rho) or math.isnan(R):
        return math.nan
    lead = 1.0 + 2.0 * rho * seen
    # fault: an alternation is seen once whatever the scheme extrapolates -> terms = [2.0 * rho / lead] |
    #   coupler/test_gain
    terms = [2.0 * rho * w / lead for w in held]
    found = np.roots([1.0, terms[0] - R / lead, *terms[1:]])
    root = complex(found[np.abs(found).argmax()])
    return math.copysign(abs(root), -1.0 if abs(root.imag) > 1e-9 or root.real < 0.0 else 1.0)


def held_by(scheme: Scheme, level: Seen, before: CoupledState, end: float, extrapolation: float,
            ) -> tuple[tuple[float, ...], float]:
    """Return w_0, w_1, ... of a window and the share of its end.

    before : the state at its start.  end [s], extrapolation : of it.  level : `coupling.iteration.level`.
    """
    if scheme is Scheme.ITERATED:
        return ((0.0,), 1.0) if level is Seen.END else ((0.5,), 0.5)
    if scheme is Scheme.PARALLEL:
        return (0.0, 1.0), 0.0
    if scheme_of(scheme).sees_start_T:
        return (0.5, 0.5), 0.0
    if scheme is Scheme.ALONG_HEAT:
        return (1.5, -0.5), 0.0
    if scheme is Scheme.EXTRAPOLATED and before.past:
        return weights([level.t for level in (before.now, *before.past[:2])], end, extrapolation), 0.0
    return (1.0,), 0.0


def measured(halves: Halves, before: CoupledState, span: Span, options: SolveOptions, saved: SavedStates,
             solved: Solved) -> Gain | None:
    """Return the gain of a window, SOLVES half-solves; None where a half would not do an iterate, or nothing changes.

    before : the state at its start.  saved : the states of both halves then, to which they are put back before each
    iterate.  solved : its outcome.  The halves end anywhere within the window after it.
    """
    if inputs := with_mode(options.settings.inputs, halves.mechanical, scheme_of(solved.scheme).frozen_entropy):
        halves = replace(halves, inputs=inputs)
    guess = solved.state.now
    try:
        first, first_after = _iterate(halves, before, span, guess, saved, solved)
        second, second_after = _iterate(halves, before, span, first, saved, solved)
    except DiscardError:
        return None
    step, out = first.T - guess.T, second.T - first.T
    H = span.end - before.now.t
    least = ROUND_OFF * float(np.abs(guess.T).max())
    if float(np.abs(step).max()) <= least:
        return None
    held, seen = held_by(solved.scheme, options.settings.iteration.level, before, span.end, solved.extrapolation)
    rho = -float(step @ out) / float(step @ step)
    if float(np.abs(out).max()) <= least:
        return Gain(H, 0.0, 0.0, held, seen)
    # What the exchange feels of it, not all there is: of a rod that is its mean temperature.  The iterates felt `step`
    # as `felt`, so `out` as -rho times that.
    felt, later = _felt(first, second, first, second), _felt(first_after, second_after, first, second)
    scale = -rho * float(felt @ felt)
    # fault: what the half itself leaves is not measured -> return Gain(H, rho, 0.0, held, seen) | coupler/test_gain
    return Gain(H, rho, float(felt @ later) / scale if scale else 0.0, held, seen)


def _felt(a: Level, b: Level, first: Level, second: Level) -> Array:
    """Difference of x and t_N from a to b, each over that from the first to the second iterate; what has none is 0."""
    parts = []
    for name in ("x", "t_N"):
        size = float(np.linalg.norm(getattr(second, name) - getattr(first, name)))
        parts.append((getattr(b, name) - getattr(a, name)).ravel() / size if size > 0.0 else np.zeros(0))
    return np.concatenate(parts)


def _iterate(halves: Halves, before: CoupledState, span: Span, guess: Level, saved: SavedStates,
             solved: Solved) -> tuple[Level, Level]:
    """The window on a guess of T at its end, and one more with x and t_N held, but for those that come out of it."""
    saved.roll_back("a window is only looked at")
    swept = mechanical_first(halves, before, span, exchanged(guess))
    more = replace(span, k0=span.k1, k1=2 * span.k1 - span.k0)
    none = {n: replace(a, carry=np.zeros_like(a.carry)) for n, a in swept.accounts.items()}
    held = CoupledState(replace(solved.state.now, t=span.end), (), before.events, none, swept.sent)
    after = thermal_pass(halves, held, more.times("thermal"), None, NO_WORK)
    warm = replace(held, sent=after.sent)
    moved = mechanical_pass(halves, warm, more.times("mechanical"), after.outputs, NO_WORK)
    t_N = moved.outputs.get("contact.t_N", guess.t_N)
    return swept.level, replace(swept.level, T=after.outputs["T"], x=moved.outputs["x"], t_N=t_N)
