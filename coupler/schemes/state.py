"""A window: what goes into it and what comes out.  Values in, values out; a failed window leaves no trace."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from coupler.fmu.half import Half
from coupler.scenario.options import Scheme
from coupler.schemes.acceleration import Memory
from coupler.schemes.account import HEATS, Accounts
from coupler.schemes.clock import Clock
from coupler.schemes.ledger import PREFIX
from coupler.schemes.level import Level

Array = NDArray[np.float64]


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


@dataclass(frozen=True)
class Work:
    """What a window cost: half-solves (the hardware-free unit), iterations, and seconds."""

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
    """The window of ticks [k0, k1].  substeps : {"thermal": n, "mechanical": m}."""

    clock: Clock
    k0: int
    k1: int
    substeps: Mapping[str, int]

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
class Course:
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

    course : where the scheme iterates.  anyway : the window is taken although it did not converge, or its error is too
    large, by request.  scheme : by which it was solved.  curve : how that drew x and t_N on.
    whole : where this is the answer of the window's two halves (coupler.control.doubling), that of the window in one.
    """

    verdict: Verdict
    message: str
    state: CoupledState
    terms: tuple[Mapping[str, float], ...]
    work: Work
    monitors: Mapping[str, float]
    course: Course | None = None
    anyway: bool = False
    scheme: Scheme | None = None
    curve: float = 0.0
    whole: Solved | None = None

    @property
    def taken(self) -> bool:
        """Whether the run goes on from this window's end."""
        return self.verdict is Verdict.ACCEPTED or self.anyway


@dataclass(frozen=True)
class Halves:
    """The two halves of a run and what is asked of each after a substep.

    inputs : side -> name -> value, given to a half in every substep besides what is exchanged (Settings.inputs).
    """

    thermal: Half
    mechanical: Half
    thermal_outputs: tuple[str, ...]
    mechanical_outputs: tuple[str, ...]
    inputs: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def wanted_outputs(thermal: Half, mechanical: Half, monitors: Collection[str] = ()) -> Halves:
    """Which outputs to ask for, from what the halves have.

    monitors : what else is looked at, `thermal.max_dT` or `mechanical.max_strain_increment`; scalars only.
    """
    t = [n for n, b in thermal.blocks.items() if b.causality == "output" and b.kind == "Real"
         and (n.startswith(PREFIX) or n in ("T", "f_s", "iterations", "contact.touching")
              or f"thermal.{n}" in monitors)]
    more = [n.removeprefix("mechanical.") for n in sorted(monitors) if n.startswith("mechanical.")]
    wanted = ("x", "contact.t_N", "contact.gap", "contact.covered", *HEATS, "iterations", "contact.touching")
    has = {n for n, b in mechanical.blocks.items() if b.causality == "output"}
    m = [n for n in dict.fromkeys((*wanted, *more)) if n in has]
    return Halves(thermal, mechanical, tuple(t), tuple(m))
