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

    wanted : what will be asked for.  It is read at the first question to its half, all of it at once; what is not in
    it is read when it is asked for.
    """

    def __init__(self, halves: Mapping[str, Half], wanted: Names) -> None:
        self._halves, self._wanted = halves, wanted
        self._found: dict[str, dict[str, Array]] = {}

    def read(self, role: str, names: Sequence[str]) -> dict[str, Array]:
        """Name -> array in the shape and unit of its block; of a foreign half it may be no number in places."""
        if not names:
            return {}
        found = self._found.setdefault(role, {})
        if missing := [n for n in names if n not in found]:
            # fault: each who asks sends a message of its own -> more: list[str] = [] | coupler/test_look
            more = [n for n in self._wanted.get(role, ()) if n not in found and n not in missing]
            found |= self._halves[role].read([*missing, *more], finite=False)
        return {n: found[n] for n in names}


def together(*asked: Names) -> dict[str, list[str]]:
    """All that is asked for, each name once."""
    roles = {role: None for names in asked for role in names}
    return {role: list({n: None for names in asked for n in names.get(role, ())}) for role in roles}
