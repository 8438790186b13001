"""Tells when a body that nothing held was damped until contact held it."""

from __future__ import annotations

from collections.abc import Mapping

from coupler.schemes.accounts import DAMPED


class DampingNotes:
    """Remembers the work of the damping so far, and tells of the first window in which it grows.

    A run that is resumed begins with what its first window has.
    """

    def __init__(self) -> None:
        self._work: float | None = None
        self._told = False

    def after(self, t: float, monitors: Mapping[str, float]) -> tuple[str, ...]:
        """Return the note of a window from t [s] that was taken, if there is one; monitors : of the window."""
        work = monitors.get(f"mechanical.{DAMPED}")
        if work is None:
            return ()
        before = self._work if self._work is not None else 0.0 if t == 0.0 else work
        self._work = work
        # fault: damping kept to itself -> if True: | coupler/test_first_contact_run
        if self._told or not work > before:
            return ()
        self._told = True
        return (f"from t = {t:g} s nothing held a body until contact did: it was damped on its way, which took "
                f"{work - before:.3g} J (probe mechanical.{DAMPED}); no damping is left in the equilibrium found",)
