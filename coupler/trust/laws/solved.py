"""How exactly each half solved its equations, as it tells itself (outputs `residual`).

A thermal half tells the heat that is missing at its nodes as a share of the heat that flowed in a substep.  It counts
with that heat, over the run: a missing joule stays missing.  A mechanical half tells the forces that are out of balance
as a share of those on a body.  Every step is an equilibrium of its own, so the largest of them counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from coupler.schemes.ledger import moved
from coupler.schemes.state import RESIDUAL
from coupler.trust.checks import Check, measured

# Of heat or forces: noted, broken.  Halves solve to 1e-10 and 1e-8 where the scene does not say otherwise.  A body that
# bends yields to a small part of the forces that it carries, (thickness/length)^2: with 0.3 % out of balance a beam 50
# times as long as thick may not have moved at all.
LIMITS = (1e-6, 1e-4)
NAME = "equations solved by the halves"


@dataclass(frozen=True)
class SolvedLog:
    """missing, moved [J]: heat that was missing so far, of that which was moved.

    force [1]: the largest share of forces out of balance, in a window to t [s].  tell : the halves that told.
    """

    missing: float = 0.0
    moved: float = 0.0
    force: float = 0.0
    t: float = 0.0
    tell: frozenset[str] = frozenset()


def watched(log: SolvedLog, monitors: Mapping[str, float], terms: Mapping[str, float], t: float) -> SolvedLog:
    """Return the log after a window to t [s].

    monitors : of the window, `thermal.residual` and `mechanical.residual` where the halves tell them.
    terms : its heat and what nodes took up or gave off (Ledger.everything), name -> [J].
    """
    told = {side for side in ("thermal", "mechanical") if f"{side}.{RESIDUAL}" in monitors}
    log = replace(log, tell=log.tell | told)
    if "thermal" in told:
        heat = moved(terms)
        # fault: heat that is missing is not added up -> heat = 0.0 | coupler/test_trust_solved
        log = replace(log, missing=log.missing + monitors[f"thermal.{RESIDUAL}"] * heat, moved=log.moved + heat)
    force = monitors.get(f"mechanical.{RESIDUAL}", 0.0)
    # fault: forces out of balance are trusted -> return log | coupler/test_trust_solved
    return replace(log, force=force, t=t) if force > log.force else log


def checks(log: SolvedLog) -> tuple[Check, ...]:
    """Return the check at the end, none where no half told."""
    if not log.tell:
        return ()
    heat = log.missing / log.moved if log.moved > 0.0 else 0.0
    if heat > log.force:
        what = f"{100 * heat:.2g} % of the heat that is moved is missing in the thermal half's equations"
        remedy = "Use a smaller thermal.tolerance"
    else:
        what = (f"forces of {100 * log.force:.2g} % of those on a body are out of balance in the mechanical half's "
                f"equations at t = {log.t:.6g} s")
        remedy = "Use a smaller mechanical.elastic.tolerance"
    return (measured(NAME, max(heat, log.force), LIMITS, what=what, remedy=remedy,
                     t=0.0 if heat > log.force else log.t),)
