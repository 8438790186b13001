"""The plan of a run: what stays as it is from its first window to its last."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from coupler.control.body_strain import NO_CELLS, BodyCells
from coupler.control.contact_status import Branch, ContactState, ContactStatus, PairNodes, contact_status, side
from coupler.control.flutter import NOT_TORN, Torn
from coupler.rules.engine import Memory, spent
from coupler.rules.instant import has_instant, standing
from coupler.scenario.options import Adaptive, Iteration, OnCycle, OnUnstable, Scheme
from coupler.scenario.rule_model import Rule
from coupler.schemes.levels import Level
from coupler.schemes.schedule import Schedule
from coupler.schemes.state import Settings
from coupler.trust.surfaces.skipped import PlacedData
from coupler.trust.surfaces.ways import Ways


@dataclass(frozen=True)
class Locate:
    """Whether windows are ended where contact opens, closes, sticks or slips, and where rules act on the scene.

    tolerance [s]: how nearly; 0: as coupler.control.events says.  pairs : the pairs that are looked at.
    branches : of laws that are looked at too.
    """

    on: bool = False
    tolerance: float = 0.0
    pairs: tuple[PairNodes, ...] = ()
    branches: tuple[Branch, ...] = ()

    def status(self, level: Level, monitors: Mapping[str, float]) -> ContactStatus:
        """All that is looked at: pairs, branches of laws, friction."""
        contact = contact_status(self.pairs, level, monitors)
        # fault: bends are not looked at -> if True: | coupler/test_branches
        if not self.branches:
            return contact
        sides = [side(branch, level) for branch in self.branches]
        return ContactStatus(level.t, (*contact.status[:-1], *(s for s, _ in sides), contact.status[-1]),
                             (*contact.margins[:-1], *(margins for _, margins in sides), contact.margins[-1]))

    @property
    def names(self) -> tuple[str, ...]:
        """Of each status, in words."""
        return (*(f"pair {p.name}" for p in self.pairs), *(b.name for b in self.branches), "contact")


@dataclass(frozen=True)
class Plan:
    """How to run: where windows end, by which scheme, with how many substeps of each half, iterated how.

    adaptive : None where windows end as the schedule says; else its bounds are only those that must be met.
    steady : stop once max |dT/dt| stays below this [K/s]; 0: never.  probed : a level -> the values of the probes.
    watched : a level, at which the halves are -> (n,) in SI of what errors are estimated; (0,): of nothing.
    steady_data : whether no datum and no rule changes with time what acts on the scene.
    latent : the largest latent heat over heat capacity [K]; 0: nothing melts.  ways : how surfaces pass each other, on
    motions that the scene states; None: nobody looks.
    placed : data over place or gap, of which windows are to skip nothing; None: nobody looks.
    steady_T : whether temperatures are those of a steady state at any time.  inertia : whether bodies have any.
    mechanical : (n,) which of those the mechanical half makes; (0,): none.  cells : of each body, of the scene's mesh.
    pairs : the pair nodes of each pair.  torn : those whose conductance jumps at touch.
    """

    schedule: Schedule
    scheme: Scheme
    substeps: Mapping[str, int]
    iteration: Iteration = field(default_factory=Iteration)
    adaptive: Adaptive | None = None
    locate: Locate = Locate()
    on_cycle: OnCycle = OnCycle.NOTE
    on_unstable: OnUnstable = OnUnstable.WARN
    steady: float = 0.0
    rules: Sequence[Rule] = ()
    probed: Callable[[Level], Mapping[str, float]] = lambda level: {}
    watched: Callable[[Level], NDArray[np.float64]] = lambda level: np.empty(0)
    mechanical: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, dtype=bool))
    cells: BodyCells = NO_CELLS
    pairs: tuple[NDArray[np.intp], ...] = ()
    steady_data: bool = False
    steady_T: bool = False
    inertia: bool = False
    torn: Torn = NOT_TORN
    latent: float = 0.0
    ways: Ways | None = None
    placed: PlacedData | None = None

    @property
    def settings(self) -> Settings:
        """Those of the first window."""
        return Settings(self.scheme, self.substeps, self.iteration)

    @cached_property
    def instants(self) -> tuple[Rule, ...]:
        """The rules that act on the scene at an instant."""
        return tuple(rule for rule in self.rules if has_instant(rule))

    def status(self, level: Level, monitors: Mapping[str, float], seen: Mapping[str, float],
               memory: Memory) -> ContactStatus:
        """Return the status of all that is located: pairs, branches of laws, rules, friction.

        monitors : of contact.  seen : what rules look at, at the level.  memory : of the rules, before the window.
        """
        contact = self.locate.status(level, monitors)
        # fault: a rule acts only where a window happens to end -> found = [(None, ()) for _ in self.instants] |
        #   coupler/test_rules_instant
        found = [standing(rule, spent(rule, memory), seen) for rule in self.instants]
        states = [ContactState.APART if acts is None else ContactState.ACTS if acts else ContactState.WAITS
                  for acts, _ in found]
        return ContactStatus(level.t, (*contact.status[:-1], *states, contact.status[-1]),
                             (*contact.margins[:-1], *(left for _, left in found), contact.margins[-1]))

    @property
    def names(self) -> tuple[str, ...]:
        """Of each status, in words."""
        names = self.locate.names
        return (*names[:-1], *(f"rule {rule.name}" for rule in self.instants), names[-1])

    @property
    def last(self) -> int:
        """The tick at which the run ends."""
        return self.schedule.bounds[-1]

    def must_end(self, tick: int) -> int:
        """The first tick after this one at which a window has to end: a kink, or the end of the run."""
        return self._stops[bisect_right(self._stops, tick)]

    @cached_property
    def _stops(self) -> list[int]:
        return sorted({*self.schedule.kinks, self.last})
