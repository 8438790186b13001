"""What both halves give out at one time, in one message a half: what a run records is asked for by several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from coupler.fmu.half import Half

Array = NDArray[np.float64]
Names = Mapping[str, Sequence[str]]  # role -> outputs of that half


class Look:
    """The outputs of both halves as they are now; good until either of them goes on.

    wanted : what will be asked for, read at once, so that a half that dies is found before anything of it is written.
    What is not in it is read when it is asked for.
    """

    def __init__(self, halves: Mapping[str, Half], wanted: Names) -> None:
        """Raises HalfError, and what a half that is gone raises."""
        self._halves = halves
        self._found = {role: dict(halves[role].read(list(names), finite=False))
                       for role, names in wanted.items() if names}

    @staticmethod
    def of(found: Mapping[str, Mapping[str, Array]]) -> Look:
        """Return the look at outputs that were read before.  found : role -> output -> array."""
        look = Look({}, {})
        look._found = {role: dict(read) for role, read in found.items()}
        return look

    def read(self, role: str, names: Sequence[str]) -> dict[str, Array]:
        """Name -> array in the shape and unit of its block; of a foreign half it may be no number in places."""
        found = self._found.setdefault(role, {})
        # fault: each who asks sends a message of its own -> missing = list(names) | coupler/test_look
        missing = [n for n in names if n not in found]
        if missing:
            found |= self._halves[role].read(missing, finite=False)
        return {n: found[n] for n in names}


def together(*asked: Names) -> dict[str, list[str]]:
    """All that is asked for, each name once."""
    roles = {role: None for names in asked for role in names}
    return {role: list({n: None for names in asked for n in names.get(role, ())}) for role in roles}
