"""Tells when a pair opens and closes without end because no state lasts: its conductance jumps at touch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

# A pair that turned so many times within this share of the run gets nowhere.
TURNS, SHARE = 10, 1e-3


class FlutterNotes:
    """Remembers when pairs turned last, and tells of each pair once.

    torn : pair -> its conductance apart and in touch [W/m2K], of those where they differ.  end : of the run [s].
    A run that is resumed begins anew.
    """

    def __init__(self, torn: Mapping[str, tuple[float, float]], end: float) -> None:
        self._torn, self._end = dict(torn), end
        self._turns: dict[str, list[float]] = {name: [] for name in torn}

    def after(self, names: Sequence[str], turned: Sequence[float]) -> tuple[str, ...]:
        """The notes of an accepted window.  names : of what has a status.  turned : when each turned last [s]."""
        found = []
        for what, t in zip(names, turned, strict=False):
            name = what.removeprefix("pair ")
            if name not in self._torn or t < 0.0 or t in self._turns[name][-1:]:
                continue
            turns = self._turns[name] = [*self._turns[name][1 - TURNS:], t]
            # fault: a pair that flutters without end is kept to itself -> if True: | coupler/test_flutter
            if len(turns) < TURNS or t - turns[0] > SHARE * self._end:
                continue
            apart, touching = self._torn.pop(name)
            found.append(f"pair {name} opened and closed {TURNS} times in {t - turns[0]:.3g} s: its conductance jumps "
                         f"from {apart:.6g} to {touching:.6g} W/m2K when it touches; in touch it soon opens, and "
                         "apart it soon closes. Windows stay as short as that. With laws that join there is a state "
                         "in between: in place of a constant `closed`, `{law: table, x: [0, P], h: "
                         f"[{apart:.6g}, {touching:.6g}]}}` with P [Pa] small beside the pressures of the scene, such "
                         "as 1e5 between metals")
        return tuple(found)
