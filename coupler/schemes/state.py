"""A window: what goes into it and what comes out.  Values in, values out; a failed window leaves no trace."""

from __future__ import annotations

import math
from collections.abc import Collection, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from coupler.fmu.half import Half
from coupler.scenario.options import Iteration, Scheme, WindowRange
from coupler.schemes.acceleration import Memory
from coupler.schemes.levels import Level
from coupler.schemes.paths import Bodies

Array = NDArray[np.float64]


# The master clock: integer ticks of 2^-40 of the end time, and the exact times of marked ticks.

TICKS = 2**40


@dataclass(frozen=True)
class Clock:
    """Ticks 0 .. 2^40 cover [0, end] seconds.

    A marked time (a kink) keeps its own floating-point value, so that a signal which jumps there is
    evaluated at the jump and not 1e-8 s beside it.
    """

    end: float
    marks: dict[int, float] = field(default_factory=dict)

    def ticks(self, t: float) -> int:
        """The tick nearest to t [s]."""
        return round(t / self.end * TICKS)

    def seconds(self, tick: int) -> float:
        """The time of a tick [s]."""
        return self.marks.get(tick, tick / TICKS * self.end)


def clock_with_marks(end: float, times: Iterable[float]) -> Clock:
    """A clock to `end` [s] that knows the exact times of the given marks (those after the end are left out)."""
    bare = Clock(end)
    return Clock(end, {bare.ticks(t): t for t in (*times, end) if 0 < t <= end})


# The energy accounts: heat the mechanical half made, what of it was delivered, what is carried to the next window.

# Block that crosses -> plain name.  Each has an account of its own.
HEATS = {"E_M": "mechanical heat", "E_S": "entropy part", "contact.E_friction": "friction heat"}
# Work of what damped bodies until contact held them [J], since the start; of the half elastic, where a body is loose.
DAMPED = "work.stabilisation"
# What goes on as it went in the window before, unless something opens or closes; so it can be handed over ahead.  Not
# E_M: that of squeezing turns against the change of T that made it, and ahead of it would grow from delta 1/3 on.
AHEAD = frozenset(("contact.E_friction",))
AT_ONCE = frozenset(("E_S",))  # a temperature jump at the start of the first substep; the others are spread in time


@dataclass(frozen=True)
class EnergyAccount:
    """Energies [J].  carry : (n_cells,) or (n_q,) made but not yet delivered; < 0: delivered ahead of what was made.

    made, delivered : totals over the run.  power : same shape, made in the last window [W]; None: in none yet.
    late : same shape, what of the carry belongs to later times [J] (see `make`); None: nothing.  at_end : it is made
    by the forces at the end of a step, as the half says.
    Energies cross the border, not rates: a rate of one window used over a window of another length loses heat.
    """

    carry: Array
    made: float = 0.0
    delivered: float = 0.0
    power: Array | None = None
    late: Array | None = None
    at_end: bool = False

    def due(self, H: float) -> Array:
        """Return the carry, without what belongs to later times, and what H [s] more make at the same power [J], >= 0.

        H : 0.0 where the window's own heat is in the carry.
        Nothing is taken back from a place that was handed too much and has been left since: the others are handed so
        much less, so that in all no more is delivered than was made.
        """
        now = self.carry if self.late is None else self.carry - self.late
        # fault: friction heat is not extrapolated -> wanted = now | coupler/test_accounts
        wanted = now if self.power is None else now + H * self.power
        most, total = np.maximum(wanted, 0.0), float(wanted.sum())
        # fault: what was handed ahead to places left behind is handed on again -> return most | coupler/test_accounts
        return most * (total / float(most.sum())) if total > 0.0 else np.zeros_like(most)

    def deliver(self, handed: Array, late: Array | None) -> EnergyAccount:
        """The account after an energy was handed to the thermal half.

        handed : same shape as the carry [J].  late : what of the carry that is left belongs to later times.
        """
        if not handed.any():
            return replace(self, late=late)
        # fault: friction heat is delivered twice -> return replace(self, delivered=self.delivered +
        #   float(handed.sum())) | scenarios/test_friction_heat
        return replace(self, carry=self.carry - handed, delivered=self.delivered + float(handed.sum()), late=late)

    def make(self, energy: Array | float, H: float, step: float, fresh: bool) -> EnergyAccount:
        """Return the account after the mechanical half made an energy in a window of H [s].

        energy : same shape as the carry [J]; a float, 0.0, where the half makes none.  step [s] : of the half in it.
        fresh : nothing is known of the power before this window, or all that is made is handed over as it is.
        What is made by the forces at the end of steps is (P' - P)/2 times a step more than the trapezoidal rule says,
        in a window whose power goes from P to P': that belongs to later times.  Where histories begin anew, or nothing
        is made any more, the trapezoidal rule has the last word: what it says is what was made.
        """
        if isinstance(energy, float):
            return self
        late = None
        if self.at_end and not fresh and self.power is not None and energy.any():
            # fault: friction heat is that of the pressure at the end of a window -> late = None |
            #   coupler/test_friction_order
            late = 0.5 * step * (energy / H - self.power) + (0.0 if self.late is None else self.late)
        # fault: friction heat forgotten between windows -> carry = self.carry | coupler/test_accounts
        carry, made = self.carry + energy, self.made + float(energy.sum())
        # fault: what belonged to later times is left over when friction ends -> if False: | coupler/test_accounts
        if late is None and self.late is not None:
            carry, made = carry - self.late, made - float(self.late.sum())
        return replace(self, carry=carry, made=made, power=energy / H, late=late)


Accounts = Mapping[str, EnergyAccount]


def due(accounts: Accounts, ahead: float | None) -> dict[str, Array]:
    """Return what is handed over in a window, by block, (n_cells,) or (n_q,) [J].

    ahead [s] : of heat that goes on as it went, what this time makes is handed over before it is made, and what belongs
    to later times is kept back; None: all that is carried is due.
    """
    return {n: a.due(ahead) if ahead is not None and n in AHEAD else a.carry for n, a in accounts.items()}


def share_of(handed: Mapping[str, Array], share: float, first: bool) -> dict[str, Array]:
    """Return what a thermal substep is given of each energy [J], by block, (n_cells,) or (n_q,).

    That is its share of the window, or, of what is due at once, all of it in the first substep.
    """
    # fault: entropy part handed to every substep -> shares = {n: 1.0 if n in AT_ONCE else share for n in handed} |
    #   coupler/test_accounts
    shares = {n: float(first) if n in AT_ONCE else share for n in handed}
    return {n: e if shares[n] == 1.0 else e * shares[n] for n, e in handed.items()}


def delivered(accounts: Accounts, handed: Mapping[str, Array], taken: Container[str],
              ahead: float | None) -> dict[str, EnergyAccount]:
    """Return the accounts after a thermal half went over a window.

    handed : what it was given, by block [J].  taken : blocks it has; one it lacks is carried on.  ahead : as of `due`.
    """
    # fault: what was handed over with all the rest is taken for kept back -> return {n: a.deliver(handed[n], a.late) if
    #   n in taken else a | coupler/test_accounts
    return {n: a.deliver(handed[n], None if ahead is None else a.late) if n in taken else a
            for n, a in accounts.items()}


def with_made(accounts: Accounts, made: Mapping[str, Array], times: Sequence[float],
              fresh: bool) -> dict[str, EnergyAccount]:
    """Return the accounts after a mechanical half went over a window: what it made is due.

    made : same shape as the carry [J] of each account, by block; a block that is missing made nothing.
    times : of the half's steps [s].  fresh : as of EnergyAccount.make.
    """
    H = times[-1] - times[0]
    return {n: a.make(made.get(n, 0.0), H, H / (len(times) - 1), fresh) for n, a in accounts.items()}


# The heat balance: energies into the bodies by mechanism, and how far they are from adding up.

PREFIX = "heat."
STORED = "heat.stored."
MOVED = "heat_moved"  # no term: what nodes took up or gave off, where a half tells it
ROUNDING = "heat_rounding"  # no term: what round-off leaves of the heat of a substep, where a half tells it
NO_TERMS = (MOVED, ROUNDING)


@dataclass(frozen=True)
class Ledger:
    """Totals [J] by term (the thermal half's `heat.*` outputs).

    Every term but the stored ones counts what came INTO the bodies; heat.stored.<body> is what its enthalpy grew.
    The two sides of an interface are separate terms, each taken from its own side.
    lost : the low-order bits of each total, so that a million windows add up as exactly as one (Neumaier).
    """

    totals: Mapping[str, float] = field(default_factory=dict)
    lost: Mapping[str, float] = field(default_factory=dict)

    def plus(self, terms: Mapping[str, float]) -> Ledger:
        """The ledger after one more substep."""
        totals, lost = dict(self.totals), dict(self.lost)
        for name, energy in terms.items():
            old = totals.get(name, 0.0)
            new = old + energy
            larger, smaller = (old, energy) if abs(old) >= abs(energy) else (energy, old)
            lost[name] = lost.get(name, 0.0) + ((larger - new) + smaller)
            totals[name] = new
        return Ledger(totals, lost)

    def after(self, substeps: Iterable[Mapping[str, float]]) -> Ledger:
        """The ledger after some more substeps."""
        ledger = self
        for terms in substeps:
            ledger = ledger.plus(terms)
        return ledger

    @property
    def terms(self) -> dict[str, float]:
        """Total of each term [J]."""
        return {name: total for name, total in self.everything.items() if name not in NO_TERMS}

    @property
    def everything(self) -> dict[str, float]:
        """Total of each term, and of what nodes took up or gave off [J]."""
        return {name: total + self.lost[name] for name, total in self.totals.items()}

    @property
    def imbalance(self) -> float:
        """0 where every joule is accounted for (imbalance)."""
        return imbalance(self.everything)


def imbalance(terms: Mapping[str, float]) -> float:
    """|sum of all terms| / sum of |terms|, stored heat counted against the rest.

    Where heat only runs inside a body all terms are round-off: what its nodes took up or gave off (MOVED, no term) is
    the scale then, where it is told.  Where nothing moves that is round-off, too: what round-off leaves of the heat the
    bodies hold (ROUNDING, no term) is accounted for, where it is told.
    """
    signed = [-e if name.startswith(STORED) else e for name, e in terms.items() if name not in NO_TERMS]
    # fault: the balance of heat that runs inside a body is held against its round-off -> scale = math.fsum(abs(e) for
    #   e in signed) | coupler/test_starts::test_without_boundary_the_mean_stays_and_the_rest_decays
    scale = max(math.fsum(abs(e) for e in signed), terms.get(MOVED, 0.0))
    # fault: bodies at rest are held against their round-off -> off = abs(math.fsum(signed)) |
    #   coupler/test_accounts
    off = max(abs(math.fsum(signed)) - terms.get(ROUNDING, 0.0), 0.0)
    return off / scale if scale > 0 else 0.0


MECHANISMS = {
    "heat.temperature.in": "prescribed temperature, in",
    "heat.temperature.out": "prescribed temperature, out",
    "heat.flux": "prescribed flux",
    "heat.convection": "convection",
    "heat.radiation": "far radiation",
    "heat.source": "thermal source",
    "heat.mechanical": "mechanical heat",
    "heat.entropy": "thermoelastic heat (entropy part)",
    "heat.contact.slave": "solid contact, into the slave",
    "heat.contact.master": "solid contact, into the master",
    "heat.gap.slave": "gas gap, into the slave",
    "heat.gap.master": "gas gap, into the master",
    "heat.near_radiation.slave": "near radiation, into the slave",
    "heat.near_radiation.master": "near radiation, into the master",
    "heat.friction.slave": "friction, into the slave",
    "heat.friction.master": "friction, into the master",
}


def mechanism(term: str) -> str:
    """The plain name of a ledger term."""
    if term.startswith(STORED):
        return f"stored in {term[len(STORED):]}"
    return MECHANISMS.get(term, term.removeprefix(PREFIX))


class Verdict(Enum):
    """What became of a window; never overwritten."""

    ACCEPTED = "accepted"
    THERMAL_DISCARD = "thermal discard"
    MECHANICAL_DISCARD = "mechanical discard"
    MAX_ITERATIONS = "max iterations"
    ERROR = "error too large"
    EVENT = "event inside"
    RULE = "cut by a rule"
    CYCLE = "two-cycle"
    UNSTABLE = "unstable exchange"


@dataclass(frozen=True)
class Work:
    """What a window cost: solver calls (the hardware-free unit), iterations, and seconds."""

    thermal_solves: int = 0
    mechanical_solves: int = 0
    thermal_iterations: int = 0
    mechanical_iterations: int = 0
    thermal_seconds: float = 0.0
    mechanical_seconds: float = 0.0
    fmi_seconds: float = 0.0  # calls to the halves less the seconds inside them: FMI and transport
    values: int = 0  # real numbers that crossed a border

    def plus(self, other: Work) -> Work:
        """The sum of two."""
        if self is NO_WORK:
            return other
        return Work(self.thermal_solves + other.thermal_solves, self.mechanical_solves + other.mechanical_solves,
                    self.thermal_iterations + other.thermal_iterations,
                    self.mechanical_iterations + other.mechanical_iterations,
                    self.thermal_seconds + other.thermal_seconds, self.mechanical_seconds + other.mechanical_seconds,
                    self.fmi_seconds + other.fmi_seconds, self.values + other.values)


NO_WORK = Work()


@dataclass(frozen=True)
class CoupledState:
    """Everything the coupler remembers between windows.

    now : the exchange at the end of the last window.  past : up to three before it since the last event, newest first.
    events : the count that tells a half to restart damped.  accounts : block -> heat made and delivered.
    sent : what each half was last given, so that a block which did not change is not sent again.
    memory : what the acceleration keeps of windows past.
    """

    now: Level
    past: tuple[Level, ...]
    events: int
    accounts: Accounts
    sent: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    memory: Memory = ()

    @property
    def before(self) -> Level | None:
        """The level before `now`; None after an event."""
        return self.past[0] if self.past else None


@dataclass(frozen=True)
class Span:
    """The window of ticks [k0, k1].  substeps : {"thermal": n, "mechanical": m}.

    stop : the next tick at which a drive has a kink or the run ends.
    """

    clock: Clock
    k0: int
    k1: int
    substeps: Mapping[str, int]
    stop: int | None = None

    @property
    def breaks(self) -> bool:
        """Whether what went on in the window may not go on after it."""
        return self.k1 == self.stop

    @cached_property
    def end(self) -> float:
        """The end of the window [s]."""
        return self.clock.seconds(self.k1)

    def times(self, side: str) -> list[float]:
        """Start and ends of a half's substeps [s]."""
        n = self.substeps[side]
        if n == 1:
            return [self.clock.seconds(self.k0), self.end]
        return [self.clock.seconds(self.k0 + (self.k1 - self.k0) * i // n) for i in range(n + 1)]


@dataclass(frozen=True)
class IterationHistory:
    """How an iterated window went.

    misfits : for each iterate quantity -> difference in units of its tolerance.  factors : of the steps between
    iterates.  contraction : largest measured ratio of successive residuals of plain iteration; nan if unknown.
    ratios : all of them, the nearest to the solution last; < 0 where what comes out turns against what was put in.
    """

    misfits: tuple[Mapping[str, float], ...]
    factors: tuple[float, ...]
    contraction: float
    ratios: tuple[float, ...] = ()


@dataclass(frozen=True)
class Solved:
    """The outcome of a window.  terms : the heat terms of each thermal substep [J] (empty after a discard).

    history : where the scheme iterates.  anyway : the window is taken although it did not converge, or its error is too
    large, by request.  scheme : by which it was solved.  extrapolation : of x and t_N in it.
    whole : where this is the answer of the window's two halves (coupler.control.solve_window), that of the window in
    one.  final : no shorter window would do, as a half says that gave up.
    """

    verdict: Verdict
    message: str
    state: CoupledState
    terms: tuple[Mapping[str, float], ...]
    work: Work
    monitors: Mapping[str, float]
    history: IterationHistory | None = None
    anyway: bool = False
    scheme: Scheme = field(kw_only=True)
    extrapolation: float = 0.0
    whole: Solved | None = None
    final: bool = False

    @property
    def taken(self) -> bool:
        """Whether the run goes on from this window's end."""
        return self.verdict is Verdict.ACCEPTED or self.anyway


@dataclass(frozen=True)
class Halves:
    """The two halves of a run and what is asked of each after a substep.

    inputs : side -> name -> value, given to a half in every substep besides what is exchanged (Settings.inputs).
    bodies : (n_nodes,) body of each node, -1 for none, by which x goes along arcs; None: not known.
    """

    thermal: Half
    mechanical: Half
    thermal_outputs: tuple[str, ...]
    mechanical_outputs: tuple[str, ...]
    inputs: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    bodies: Bodies | None = None


def wanted_outputs(thermal: Half, mechanical: Half, monitors: Collection[str] = ()) -> Halves:
    """Which outputs to ask for, from what the halves have.

    monitors : what else is looked at, `thermal.max_dT` or `mechanical.max_strain_increment`; scalars only.
    """
    t = [n for n, b in thermal.blocks.items() if b.causality == "output" and b.kind == "Real"
         and (n.startswith(PREFIX) or n in ("T", "f_s", "iterations", "contact.touching", *NO_TERMS)
              or f"thermal.{n}" in monitors)]
    more = [n.removeprefix("mechanical.") for n in sorted(monitors) if n.startswith("mechanical.")]
    wanted = ("x", "contact.t_N", "contact.gap", "contact.covered", *HEATS, "iterations", "contact.touching",
              DAMPED)
    has = {n for n, b in mechanical.blocks.items() if b.causality == "output"}
    m = [n for n in dict.fromkeys((*wanted, *more)) if n in has]
    return Halves(thermal, mechanical, tuple(t), tuple(m))


# Settings: what of a run may be changed while it runs, by a rule, by its user, by `auto`.  Values, never in place.

@dataclass(frozen=True)
class Settings:
    """How the next window is solved.

    substeps : {"thermal": n, "mechanical": m}.  window_factor : multiplies the size that was planned.
    window_cap : no window is longer [s]; inf: as planned.
    inputs : side -> name of an input -> value, given to that half in every substep besides what is exchanged
    (control.method, load.NAME, bc.NAME).  A half keeps what it was last given: a name is never taken out again.
    """

    scheme: Scheme
    substeps: Mapping[str, int]
    iteration: Iteration = field(default_factory=Iteration)
    window_factor: float = 1.0
    window_cap: float = math.inf
    inputs: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


# The schedule: where windows end, before anything has been solved.

@dataclass(frozen=True)
class Schedule:
    """bounds : ticks at which windows end, ascending, from 0 on.  kinks : those of them that are kinks.

    events : the kinks at which halves restart damped.
    """

    clock: Clock
    bounds: tuple[int, ...]
    kinks: frozenset[int]
    events: frozenset[int]


def schedule(end: float, ranges: Sequence[WindowRange], kinks: Iterable[float],
             bends: Collection[float] = ()) -> Schedule:
    """Windows over [0, end] that end at every kink and at the end of every range.

    end [s].  kinks [s]: times at which boundary data jump or change slope; 0 and times past the end are left out.
    bends [s]: those of them where no half need restart damped.
    Raises ValueError if the ranges do not reach the end or do not advance.
    """
    if not ranges or ranges[-1].until < end:
        raise ValueError(f"the windows must reach the end of the run, {end} s")
    kink_times = sorted({t for t in kinks if 0 < t < end})
    clock = clock_with_marks(end, [*kink_times, *(r.until for r in ranges)])
    bounds, start = [0], 0.0
    for r in ranges:
        until = min(r.until, end)
        if until <= start:
            raise ValueError(f"a range of windows ends at {r.until} s, where the one before it ends at {start} s")
        range_start = start
        for piece_end in [t for t in kink_times if start < t < until] + [until]:
            first, last = _sizes_at(r, range_start, start, piece_end)
            base, sizes = start, geometric_sizes(piece_end - start, first, last)
            for i in range(len(sizes) - 1):
                bounds.append(clock.ticks(base + math.fsum(sizes[: i + 1])))
            bounds.append(clock.ticks(piece_end))
            start = piece_end
        if until == end:
            break
    unique = tuple(sorted(set(bounds)))
    events = frozenset(clock.ticks(t) for t in kink_times if t not in bends)
    return Schedule(clock, unique, frozenset(clock.ticks(t) for t in kink_times), events)


def _sizes_at(r: WindowRange, range_start: float, start: float, end: float) -> tuple[float, float]:
    """First and last window size of the piece [start, end] of a range: a geometric sequence is linear in time."""
    length = r.until - range_start

    def size(t: float) -> float:
        return r.first + (r.last - r.first) * (t - range_start) / length

    return size(start), size(end)


def geometric_sizes(length: float, first: float, last: float) -> list[float]:
    """Sizes of about first ... last that add up to length, each the same factor of the one before."""
    ratio = last / first
    # Sizes of a geometric sequence change linearly with the time covered, so their number is the integral of 1/size.
    n = length / first if abs(ratio - 1.0) < 1e-12 else length * math.log(ratio) / (last - first)
    count = max(1, math.ceil(n - 1e-9))
    factor = ratio ** (1.0 / (count - 1)) if count > 1 else 1.0
    sizes = [factor**i for i in range(count)]
    total = math.fsum(sizes)
    return [s / total * length for s in sizes]
