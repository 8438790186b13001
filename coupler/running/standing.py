"""Where a run stands: the end of its last accepted window, kept in checkpoints, and the way back to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from contact.rpc.calls import LinkError
from coupler.control.state import Committed
from coupler.errors import HalfError
from coupler.fmu.half import Half
from coupler.fmu.launch import Launched
from coupler.record.checkpoint import Keeper, RunRecord, state_of


class Standing:
    """What a checkpoint of the last accepted window holds, and how the halves come back to it after a failure.

    halves : as the run uses them.  n_halves : how many there are behind them, for a role may have several.
    """

    def __init__(self, keeper: Keeper, launched: Launched, halves: Sequence[Half], n_halves: int) -> None:
        self._keeper, self._launched, self._halves, self._n_halves = keeper, launched, halves, n_halves
        self._broken: BaseException | None = None

    @property
    def can_be_kept(self) -> bool:
        """Whether this run can be resumed."""
        return self._keeper.on

    @property
    def remedy(self) -> str:
        """How this run, if it ends early, is gone on with; empty where it cannot be."""
        return self._keeper.remedy

    def note(self, committed: Committed, record: RunRecord) -> None:
        """Note where the run stands: what a checkpoint of it holds, and where the halves are."""
        self._committed, self._places = (committed, record), self._launched.places()

    def keep_if_due(self) -> str:
        """Write a checkpoint where one is due; return why it could not be written."""
        if not self._keeper.due:
            return ""
        self._keeper.keep(*self._committed)
        return self._keeper.trouble

    def keep_at_end(self, restarts: Sequence[str]) -> None:
        """Write the checkpoint of a run that ends early.  restarts : who was started anew, up to now."""
        committed, record = self._committed
        self._keeper.keep(committed, replace(record, restarts=tuple(restarts)))

    def broke(self, error: HalfError | LinkError) -> None:
        """Note an error that ended a window: from one of no other place is there a way back."""
        self._broken = error

    def broken_by(self, error: BaseException | None) -> bool:
        """Whether this error ended a window."""
        return error is self._broken

    def recovered(self, error: BaseException | None) -> bool:
        """Bring both halves back to the end of the last accepted window, as far as that can be."""
        if not isinstance(error, (HalfError, LinkError)) or not self.can_be_kept:
            return False
        if self._launched.recover is None:
            # Only of a failure inside a window is it known where the halves had been.
            return self.broken_by(error) and isinstance(error, HalfError) and error.went_back
        if len(self._places) < self._n_halves:
            return False
        try:
            # fault: after a failure a half stays where that left it -> pass |
            #   coupler/test_restarts::test_without_restarts_nothing_is_lost_either
            self._launched.recover(self._places)
            for half in self._halves:
                state_of(half)
        except (HalfError, LinkError) as exc:
            error.add_note(f"the end of the last accepted window could not be kept: {exc}")
            return False
        return True
