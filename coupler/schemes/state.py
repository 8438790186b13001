"""A window: what goes into it and what comes out.  Values in, values out; a failed window leaves no trace."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from coupler.fmu.half import Half
from coupler.scenario.options import Iteration, Scheme
from coupler.schemes.acceleration import Memory
from coupler.schemes.accounts import DAMPED, HEATS, Accounts
from coupler.schemes.ledger import NO_TERMS, PREFIX
from coupler.schemes.levels import Level
from coupler.schemes.paths import Bodies
from coupler.schemes.schedule import Clock

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
    one.  final : no shorter window would do, as a half says that gave up.  share : of the window that would; 0: it does
    not say.
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
    share: float = 0.0

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


ACROSS = "across.T_off"  # of a thermal half with one temperature across: how far its surfaces differ from that [K]
OFF_MESH = "mesh.T_off"  # of a thermal half on a mesh of its own: what the scene's does not hold of T [K]
ELASTIC_STRAIN = "elastic_strain"  # of a mechanical half whose bodies remember, (n_cells, 4)
T_MISSED = "mesh.T_missed."  # of a body, of a thermal half: what its cells are too large for [K]
FRONT_OFF = "mesh.T_front_off"  # of nodes: what a front of melting puts them off by [K]
HIGH_OFF, LOW_OFF = "mesh.T_high_off.", "mesh.T_low_off."  # what its highest and lowest T are off by for it [K]
HALVED = "mesh.halved."  # of an output of a thermal half: what halved cells change of it
RESIDUAL = "residual"  # of either half: what its equations leave, as a share of the heat, or of the forces [1]
MADE, KINETIC = "energy.made", "energy.kinetic"  # of a mechanical half with inertia: of nothing, of motion [J]
PLACES_OFF = "mesh.u_off"  # of a mechanical half: how much farther its nodes would be on a finer mesh [m]
SHAPE_OFF = "mesh.x_off"  # of a mechanical half on a mesh of its own: what the scene's does not hold of x [m]


def wanted_outputs(thermal: Half, mechanical: Half, monitors: Collection[str] = ()) -> Halves:
    """Which outputs to ask for, from what the halves have.

    monitors : what else is looked at, `thermal.max_dT` or `mechanical.max_strain_increment`; scalars only.
    """
    t = [n for n, b in thermal.blocks.items() if b.causality == "output" and b.kind == "Real"
         and (n.startswith(PREFIX) or n in ("T", "f_s", "iterations", RESIDUAL, "contact.touching", *NO_TERMS)
              or n in (OFF_MESH, ACROSS) or f"thermal.{n}" in monitors)]
    more = [n.removeprefix("mechanical.") for n in sorted(monitors) if n.startswith("mechanical.")]
    wanted = ("x", "contact.t_N", "contact.gap", "contact.covered", *HEATS, "iterations", RESIDUAL, "contact.touching",
              DAMPED, SHAPE_OFF, ELASTIC_STRAIN, MADE, KINETIC)
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
