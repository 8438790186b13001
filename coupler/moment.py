"""Moments of a run that were kept, to go back to."""

from __future__ import annotations

from dataclasses import dataclass

from coupler.control.plan import Plan
from coupler.control.state import Committed
from coupler.errors import CouplingError
from coupler.fmu.half import Half
from coupler.record.checkpoint import Told
from coupler.schemes.window import Halves


@dataclass(frozen=True, eq=False)
class Moment:
    """The end of a window.  tokens : of the states of both halves.  plan : its rules may have been changed since."""

    committed: Committed
    told: Told
    plan: Plan
    tokens: tuple[int, int]

    @property
    def t(self) -> float:
        """s."""
        return self.committed.state.now.t


class Moments:
    """Those that can be gone back to; each holds a state of both halves until it is let go."""

    def __init__(self, halves: Halves) -> None:
        self._halves: tuple[Half, Half] = (halves.thermal, halves.mechanical)
        self._kept: list[Moment] = []

    def keep(self, committed: Committed, told: Told, plan: Plan) -> Moment:
        """Both halves stand at the end of the committed window.  Raises CouplingError where one keeps no states."""
        for half in self._halves:
            if not half.can_save:
                raise CouplingError(f"half {half.name!r} keeps no states, so no window can be gone back to",
                                    t=committed.state.now.t)
        thermal, mechanical = self._halves
        self._kept.append(Moment(committed, told, plan, (thermal.save(), mechanical.save())))
        return self._kept[-1]

    def put_back(self, moment: Moment) -> None:
        """Both halves to a moment; later ones are let go, for what led there is no longer so.

        Raises CouplingError for a moment that was let go.
        """
        if moment not in self._kept:
            raise CouplingError("this moment was let go: the run was taken back to one before it", t=moment.t)
        for half, token in zip(self._halves, moment.tokens, strict=True):
            # fault: halves stay where they were when the run is rewound -> pass | coupler/test_interactive
            half.restore(token)
        for later in self._kept[self._kept.index(moment) + 1:]:
            # fault: moments after one that was gone back to stay -> pass | coupler/test_interactive
            self.let_go(later)

    def let_go(self, moment: Moment) -> None:
        """Give its states back."""
        self._kept.remove(moment)
        for half, token in zip(self._halves, moment.tokens, strict=True):
            half.release(token)
