"""Windows solved as one system by Newton's method with Krylov directions: another way to what iterating converges to.

Over a window the mechanical half maps T at its end to x and t_N (and heat), the thermal half those back to T.  Both are
asked what they are asked by the coupler (DirectHalf.advance, with states put back), but who asks is written anew
here, from docs/theory.md: nothing of coupler.schemes is used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, gmres

from contact.half.interface import Interface
from coupler.fmu.half import Half, Status
from coupler.fmu.launch import Launched

Floats = NDArray[np.float64]
Ints = NDArray[np.integer]
MECHANICAL = ("x", "contact.t_N")
RUBBED = "contact.E_friction"
MADE = ("E_M", RUBBED)  # spread evenly over the window; E_S at its start belongs to one scheme alone
NEWTON, DIRECTIONS = 12, 30
LEAST_TURN = 1e-5  # rad: less is straight on
STEP = 1e-4  # K, of differences: a thousand times what tight Newton tolerances leave, and small against any law


class NoAnswerError(Exception):
    """A half refused, or Newton's method did not end."""


@dataclass(frozen=True)
class End:
    """A window's end: T (n,) [K], f_s (n,) or None, x (n, 2) [m], t_N (n_q,) [Pa]."""

    T: Floats
    x: Floats
    t_N: Floats
    f_s: Floats | None = None


@dataclass(frozen=True)
class Window:
    """t [s] of start and end; event : the count that makes halves restart damped.

    substeps : thermal, mechanical.  at_end : whether the thermal half is given x and t_N of the end of its substep.
    """

    t0: float
    t1: float
    event: int
    substeps: tuple[int, int] = (1, 1)
    at_end: bool = False

    def times(self, side: int) -> Floats:
        return np.linspace(self.t0, self.t1, self.substeps[side] + 1)


@dataclass(frozen=True)
class Friction:
    """Friction heat that is made by the pressure at the end of steps, between two windows (docs/theory.md).

    left : made and not handed over, of it kept : what belongs to later times, (n_q,) [J].  power : (n_q,) [W] of the
    window before, event : its count; None: there is none.
    """

    left: Floats | float = 0.0
    kept: Floats | float = 0.0
    power: Floats | float = 0.0
    event: int | None = None

    def handed(self, window: Window, made: Floats) -> tuple[Floats, Friction]:
        """What of (n_q,) [J] a window hands over, and how it stands then.

        The rule of trapezoids says (P' - P) h/2 less, which is kept back; all is due where there is nothing to compare.
        """
        H = window.t1 - window.t0
        left = self.left + made
        if self.event == window.event and made.any():
            kept = self.kept + 0.5 * H / window.substeps[1] * (made / H - self.power)
        else:
            left, kept = left - self.kept, np.zeros_like(made)
        most = np.maximum(left - kept, 0.0)
        total = max(float((left - kept).sum()), 0.0)
        now = most * (total / most.sum()) if most.any() else most
        return now, Friction(left - now, kept, made / H, window.event)


class Both:
    """Two halves, initialised, at the start of a window."""

    def __init__(self, thermal: Half, mechanical: Half, start: End, bodies: Ints | None = None) -> None:
        """bodies : (n,) that of each node, which goes along an arc where it turns; None: all go straight."""
        self.halves, self.now, self._bodies = (thermal, mechanical), start, bodies
        self._tokens: tuple[int, ...] = ()
        at_end = mechanical.strings.get(f"{RUBBED}.at") == "end"
        self._friction = self._then = Friction() if at_end else None

    def __enter__(self) -> Both:
        """The start of a window: `outcome` comes back to it until `take` goes on from its end."""
        self._tokens = tuple(half.save() for half in self.halves)
        return self

    def __exit__(self, *_: object) -> None:
        for half, token in zip(self.halves, self._tokens, strict=True):
            half.release(token)

    def outcome(self, window: Window, T: Floats, f_s: Floats | None) -> End:
        """What comes of T and f_s (n,) at the window's end; the halves are there.  Raises NoAnswerError."""
        for half, token in zip(self.halves, self._tokens, strict=True):
            half.restore(token)
        return self._sweep(window, T, f_s)

    def take(self, window: Window, T: Floats, f_s: Floats | None) -> End:
        """The same, and the next window begins there."""
        self.now = self.outcome(window, T, f_s)
        self._friction = self._then
        return self.now

    def solve(self, window: Window, guess: End, tolerance: float) -> End:
        """The window's end, where T given to mechanics is the T that comes of it, to a tolerance [K].

        Raises NoAnswerError.
        """
        def difference(z: Floats) -> Floats:
            return _packed(self.outcome(window, *_unpacked(z, self.now))) - z

        z = _packed(guess)
        r = difference(z)
        for _ in range(NEWTON):
            if np.abs(r).max() <= tolerance:
                return self.outcome(window, *_unpacked(z, self.now))

            def slope(v: Floats, z: Floats = z, r: Floats = r) -> Floats:
                size = float(np.abs(v).max())
                return np.zeros_like(v) if size == 0.0 else (difference(z + STEP / size * v) - r) * size / STEP

            n = len(z)
            step, _ = gmres(LinearOperator((n, n), slope, dtype=float), -r, rtol=1e-3, atol=0.0, restart=DIRECTIONS,
                            maxiter=1)
            z, r = self._within(z, step, r, difference)
        raise NoAnswerError(f"{NEWTON} iterations leave {np.abs(r).max():.3g} K at t = {window.t1:.6g} s")

    def _within(self, z: Floats, step: Floats, r: Floats,
                difference: Callable[[Floats], Floats]) -> tuple[Floats, Floats]:
        """The guess a step on, cut until what is left is smaller; the plain iterate where no cut does it."""
        for share in 0.5 ** np.arange(8):
            new = z + share * step
            if (new[:len(self.now.T)] > 0.0).all() and np.linalg.norm(left := difference(new)) < np.linalg.norm(r):
                return new, left
        return z + r, difference(z + r)

    def _sweep(self, window: Window, T: Floats, f_s: Floats | None) -> End:
        """Mechanics with T going straight to what is given, thermal with x and t_N going straight to what comes."""
        (thermal, mechanical), made = self.halves, dict[str, Floats]()
        x, t_N = self.now.x, self.now.t_N
        asked = [n for n in (*MECHANICAL, *MADE) if n in mechanical.blocks
                 and mechanical.blocks[n].causality == "output"]
        count = {"control.event": np.array(float(window.event))}
        for a, b in pairwise(window.times(1)):
            w = (b - window.t0) / (window.t1 - window.t0)
            given = {"T": self.now.T + w * (T - self.now.T), **count}
            if f_s is not None and "f_s" in mechanical.blocks:
                given["f_s"] = self.now.f_s + w * (f_s - self.now.f_s)
            out = self._advance(mechanical, a, b, given, asked)
            x, t_N = out["x"], out.get("contact.t_N", t_N)
            for name in MADE:
                if name in out:
                    made[name] = made.get(name, 0.0) + out[name]
        if self._friction is not None and RUBBED in made:
            made[RUBBED], self._then = self._friction.handed(window, np.asarray(made[RUBBED]))
        wanted = ["T", *(["f_s"] if self.now.f_s is not None else [])]
        for a, b in pairwise(window.times(0)):
            at = b if window.at_end else 0.5 * (a + b)
            w, share = (at - window.t0) / (window.t1 - window.t0), (b - a) / (window.t1 - window.t0)
            given = {"x": on_the_way(self.now.x, x, w, self._bodies),
                     "contact.t_N": self.now.t_N + w * (t_N - self.now.t_N),
                     **{n: share * e for n, e in made.items() if n in thermal.blocks}, **count}
            out = self._advance(thermal, a, b, given, wanted)
        return End(out["T"], x, t_N, out.get("f_s"))

    def _advance(self, half: Half, a: float, b: float, given: Mapping[str, Floats],
                 asked: Sequence[str]) -> dict[str, Floats]:
        done = half.advance(float(a), float(b - a), {n: v for n, v in given.items() if n in half.blocks}, asked)
        if done.status is not Status.OK:
            raise NoAnswerError(f"{half.name}: {done.message}")
        return done.outputs


def on_the_way(a: Floats, b: Floats, w: float, bodies: Ints | None) -> Floats:
    """Where nodes are at the part w of the way from a to b : (n, 2) [m] (docs/coupling.md): a body turns evenly.

    In the complex plane: the turn is that of the best fit, its pole the point that stays; what the body deforms besides
    goes straight, as seen by who turns along.
    """
    z0, z1 = (x[:, 0] + 1j * x[:, 1] for x in (a, b))
    z = (1.0 - w) * z0 + w * z1
    for body in range(-1 if bodies is None else int(bodies.max()) + 1):
        here = bodies == body
        p, q = z0[here], z1[here]
        turn = float(np.angle((np.conj(p - p.mean()) * (q - q.mean())).sum()))
        if abs(turn) >= LEAST_TURN:
            pole = (q.mean() - np.exp(1j * turn) * p.mean()) / (1.0 - np.exp(1j * turn))
            back = pole + np.exp(-1j * turn) * (q - pole)
            z[here] = pole + np.exp(1j * w * turn) * ((1.0 - w) * p + w * back - pole)
    return np.stack([z.real, z.imag], axis=1)


def _packed(end: End) -> Floats:
    return end.T if end.f_s is None else np.concatenate([end.T, end.f_s])


def _unpacked(z: Floats, like: End) -> tuple[Floats, Floats | None]:
    n = len(like.T)
    return z[:n], None if like.f_s is None else np.clip(z[n:], 0.0, 1.0)


def windows_of(t: Floats, restarts: Sequence[float], substeps: tuple[int, int], at_end: bool) -> Iterator[Window]:
    """The windows that end at t (n,) [s], from the first time on.  restarts [s]: where halves restart damped."""
    count = 0
    for a, b in pairwise(t):
        count += any(abs(a - k) <= 1e-12 * max(t[-1], 1.0) for k in restarts)
        yield Window(float(a), float(b), count, substeps, at_end)


def begun(launched: Launched, interface: Interface, end: float) -> Both:
    """Both halves at time 0 of a run to end [s]."""
    thermal, mechanical = launched.thermal, launched.mechanical
    link = {"contact.link": launched.link}
    first = thermal.initialise(0.0, end, link, {"x": interface.nodes}, [n for n in ("T", "f_s") if n in thermal.blocks])
    out = mechanical.initialise(0.0, end, link, {n: v for n, v in first.items() if n in mechanical.blocks},
                                [n for n in MECHANICAL if n in mechanical.blocks])
    start = End(first["T"], out["x"], out.get("contact.t_N", np.zeros(0)), first.get("f_s"))
    return Both(thermal, mechanical, start, None if interface.axisymmetric else interface.node_body)
