"""What windows of a scheme make of a small disturbance, from two spare iterates: whether the exchange is stable.

Three numbers of a window of H seconds are measured where they matter, along the direction in which the exchange
answers:

    rho    what plain iteration multiplies a difference of guesses by, its sign turned: > 0 turns against what changed
    rho_h  the part of it that comes by the heat mechanics make, not by x and t_N
    R      what the thermal half leaves of a difference in one more window, with the exchange held, as mechanics feel it

A window gives the thermal half x and t_N that belong to temperatures w_0 T_n + w_1 T_(n-1) + ... + w T_(n+1), and heat
that was made between others, v_0 T_n + v_1 T_(n-1) + ... + v T_(n+1) (the schemes' table: coupler.schemes.scheme), and
a disturbance goes from window to window by

    T_(n+1) = R T_n - 2 (rho - rho_h) (w_0 T_n + ... + w T_(n+1)) - rho_h (v_0 T_n + ... + v T_(n+1)),

whose largest root is m: it dies where |m| < 1 (docs/theory.md, limits of stability, has the limits in closed form).

That is the law of mechanics that remember nothing.  Where they do (inertia, a bar that conducts for itself) R comes
out, mostly, as no thermal half can leave it, and m is not known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from coupler.control.solve_window import SavedStates, SolveOptions
from coupler.scenario.options import Scheme
from coupler.schemes.accounts import Foreseen, with_made
from coupler.schemes.levels import Level, exchanged, weights
from coupler.schemes.scheme import Exchange, OfLevels
from coupler.schemes.schemes import scheme_of, with_mode
from coupler.schemes.state import NO_WORK, CoupledState, Halves, Solved, Span
from coupler.schemes.sweep import DiscardError, Swept, mechanical_first, mechanical_pass, thermal_pass
from coupler.trust.in_time.stability import GROWS, RINGS

Array = NDArray[np.float64]

# Differences below this share of the largest temperature [K/K] are what solvers leave.
ROUND_OFF = 1e-10
# What a thermal half can leave of a difference: not more than all of it, nor does any method turn round more; and a
# little, because mechanics may feel a difference more when it has spread.
LEAST_R, MOST_R = -1.05, 1.1
# |m| that is no reason to look closer, whatever R is: it is below this part of what rings.
CALM = 0.5
# How far a limit is looked for, in windows, how short the shortest is, and how nearly it is found.
FARTHEST, SHORTEST, NEARLY = 64.0, 1e-3, 1e-3


LATE_HEAT = OfLevels((1.0, -1.0))  # of the window before


@dataclass(frozen=True)
class Gain:
    """rho, R, rho_h : see above, of windows of H [s]; R 0.0 where rho is too small for it to matter.

    geometry, heat : w and v of the scheme.

    solves : of either half that measuring took.
    """

    H: float
    rho: float
    R: float
    geometry: OfLevels
    heat: OfLevels = LATE_HEAT
    rho_h: float = 0.0
    solves: int = 0

    @property
    def m(self) -> float:
        """What a disturbance is multiplied by in a window: < 0 where it turns round or goes about; nan: unknown."""
        if math.isnan(self.rho) or not LEAST_R <= self.R <= MOST_R:
            return math.nan
        return multiplier(self)

    @property
    def rings(self) -> bool:
        """Whether a disturbance grows by turning round, or rings because the exchange turns against what changed.

        Where it drives on what changed, what rings is the method of the thermal half.
        """
        # fault: ringing of a half alone is laid to the exchange -> return self.m < -RINGS | coupler/test_instability
        return self.m <= -GROWS or (self.m < -RINGS and self.rho > 0.0)

    @property
    def limit(self) -> float:
        """The longest stable window [s], by the laws of one mode; inf: any, 0.0: none, as far as was looked."""
        return self.H * self.up_to(-1.0, FARTHEST)

    def up_to(self, m: float, most: float = 1.0) -> float:
        """Return the longest window whose m is not below this (< 0), over H, up to `most`; inf: all, 0.0: none."""
        # fault: a limit is looked for in longer windows only -> if self.in_windows(most).m > m: |
        #   coupler/test_instability
        if self.in_windows(most).m > m and (most <= 1.0 or self.m > m):
            return math.inf if most > 1.0 else most
        low, high = SHORTEST, most if self.m > m else min(most, 1.0)
        if not self.in_windows(low).m > m:
            return 0.0
        while high - low > NEARLY * high:
            middle = math.sqrt(low * high)
            low, high = (middle, high) if self.in_windows(middle).m > m else (low, middle)
        return low

    def in_windows(self, share: float) -> Gain:
        """Return the gain in windows of `share` times the size: R as the method leaves it, rho with the window."""
        R, left = self.R, 0.0
        if R < 0.0:  # the midpoint rule's (1 - z/2)/(1 + z/2)
            z = 2.0 * (1.0 - R) / max(1.0 + R, 1e-6)
            R, left = (1.0 - 0.5 * z * share) / (1.0 + 0.5 * z * share), (1.0 + 0.5 * z) / (1.0 + 0.5 * z * share)
        else:
            z = 1.0 / R - 1.0 if 0.0 < R < 1.0 else 0.0 if R >= 1.0 else 2.0
            R, left = 1.0 / (1.0 + z * share), (1.0 + z) / (1.0 + z * share)
        # What made heat depends on how far T went, not on how long that took.
        heat = self.rho_h * left
        return replace(self, H=self.H * share, R=R, rho=(self.rho - self.rho_h) * left * share + heat, rho_h=heat)

    def by(self, exchange: Exchange, extrapolated: tuple[float, ...] = (1.0,)) -> Gain:
        """Return the gain of the same window by another exchange.  extrapolated : as of `Exchange.geometry_of`."""
        return replace(self, geometry=exchange.geometry_of(extrapolated), heat=exchange.heat_of)


def multiplier(g: Gain) -> float:
    """Return the largest root m of a gain, < 0 where its real part is or where it is a pair."""
    n = max(len(g.geometry.past), len(g.heat.past))
    w, v = (np.pad(np.array(of.past), (0, n - len(of.past))) for of in (g.geometry, g.heat))
    by_x = 2.0 * (g.rho - g.rho_h)
    terms = by_x * w + g.rho_h * v
    terms[0] -= g.R
    found = np.roots([1.0 + by_x * g.geometry.end + g.rho_h * g.heat.end, *terms])
    if not found.size:
        return 0.0
    root = complex(found[np.abs(found).argmax()])
    return math.copysign(abs(root), -1.0 if abs(root.imag) > 1e-9 or root.real < 0.0 else 1.0)


def extrapolated_weights(scheme: Scheme, before: CoupledState, end: float, extrapolation: float) -> tuple[float, ...]:
    """Return the shares of the levels behind in x and t_N of the middle of a window, where a scheme extrapolates.

    before : the state at its start.  end [s], extrapolation : of it.
    """
    times = [level.t for level in (before.now, *before.past[:2])]
    return weights(times if before.past else times[:1], end, extrapolation)


def measured(halves: Halves, before: CoupledState, span: Span, options: SolveOptions, saved: SavedStates,
             solved: Solved) -> Gain | None:
    """Return the gain of a window; None where a half would not do an iterate, or nothing changes.

    before : the state at its start.  saved : the states of both halves then, to which they are put back before each
    iterate.  solved : its outcome.  The halves end anywhere within the window after it.
    """
    scheme = scheme_of(solved.scheme)
    if inputs := with_mode(options.settings.inputs, halves.mechanical, scheme.frozen_entropy):
        halves = replace(halves, inputs=inputs)
    level, H = options.settings.iteration.level, span.end - before.now.t
    held = extrapolated_weights(solved.scheme, before, span.end, solved.extrapolation)
    bare = Gain(H, 0.0, 0.0, OfLevels((1.0,))).by(scheme.exchange_at(level), held)
    try:
        return _Look(halves, before, span, saved, solved).gain(bare)
    except DiscardError:
        return None


@dataclass(frozen=True)
class _Look:
    """A window that was solved, and what it is looked at with; see `measured`."""

    halves: Halves
    before: CoupledState
    span: Span
    saved: SavedStates
    solved: Solved

    def gain(self, bare: Gain) -> Gain | None:
        """Return the gain.  bare : that of a window in which nothing answers.  Raises DiscardError."""
        guess = self.solved.state.now
        first = self._iterate(guess)
        step = first.level.T - guess.T
        least = ROUND_OFF * float(np.abs(guess.T).max())
        if float(np.abs(step).max()) <= least:
            return None
        second = self._iterate(first.level)
        out = second.level.T - first.level.T
        if float(np.abs(out).max()) <= least:
            return replace(bare, solves=4)
        size = float(step @ step)
        found = replace(bare, rho=-float(step @ out) / size, solves=4)
        made = any(a.made != self.before.accounts[n].made for n, a in first.accounts.items())
        # fault: the exchange is never looked at closer -> if True: | coupler/test_gain
        if max(abs(multiplier(replace(found, rho_h=h))) for h in ((0.0, found.rho) if made else (0.0,))) < CALM:
            return found
        later = self._after(second)
        if made:
            by_heat = self._heated(first.level, second).T - first.level.T
            found = replace(found, rho_h=-float(step @ by_heat) / size, solves=found.solves + 2)
        first_later = self._after(self._iterate(guess))
        # What the exchange feels of it, not all there is: of a rod that is its mean temperature.  The iterates felt
        # `step` as `felt`, so `out` as -rho times that.
        felt = _felt(first.level, second.level, first.level, second.level)
        left = _felt(first_later, later, first.level, second.level)
        scale = -found.rho * float(felt @ felt)
        # fault: what the half itself leaves is not measured -> return replace(found, R=0.0) | coupler/test_gain
        return replace(found, R=float(felt @ left) / scale if scale else 0.0, solves=found.solves + 6)

    def _iterate(self, guess: Level) -> Swept:
        """The window on a guess of T at its end."""
        self.saved.roll_back("a window is only looked at")
        return mechanical_first(self.halves, self.before, self.span, exchanged(guess))

    def _heated(self, geometry: Level, heat: Swept) -> Level:
        """The window on x and t_N of one iterate and the heat of another."""
        self.saved.roll_back("a window is only looked at")
        before, span = self.before, self.span
        state = replace(before, accounts=with_made(before.accounts, heat.made, span.times("mechanical"),
                                                   not before.past, (before.now.pressed, heat.level.pressed)))
        thermal = thermal_pass(self.halves, state, span.times("thermal"), (before.now, geometry), NO_WORK,
                               ahead=Foreseen(0.0))
        return replace(geometry, T=thermal.outputs["T"])

    def _after(self, swept: Swept) -> Level:
        """One more window after an iterate with x and t_N held, but for those that come out of it."""
        span = self.span
        more = replace(span, k0=span.k1, k1=2 * span.k1 - span.k0)
        none = {n: replace(a, carry=np.zeros_like(a.carry), late=None) for n, a in swept.accounts.items()}
        held = CoupledState(replace(self.solved.state.now, t=span.end), (), self.before.events, none, swept.sent)
        after = thermal_pass(self.halves, held, more.times("thermal"), None, NO_WORK)
        warm = replace(held, sent=after.sent)
        moved = mechanical_pass(self.halves, warm, more.times("mechanical"), after.outputs, NO_WORK)
        t_N = moved.outputs.get("contact.t_N", swept.level.t_N)
        return replace(swept.level, T=after.outputs["T"], x=moved.outputs["x"], t_N=t_N)


def _felt(a: Level, b: Level, first: Level, second: Level) -> Array:
    """Difference of x and t_N from a to b, each over that from the first to the second iterate; what has none is 0."""
    parts = []
    for name in ("x", "t_N"):
        size = float(np.linalg.norm(getattr(second, name) - getattr(first, name)))
        parts.append((getattr(b, name) - getattr(a, name)).ravel() / size if size > 0.0 else np.zeros(0))
    return np.concatenate(parts)
