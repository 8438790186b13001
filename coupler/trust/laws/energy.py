"""Whether the energy of bodies with inertia is kept: what steps make of nothing, over the largest kinetic energy.

The half tells both (mechanical_fmu/energy.py).  A body that turns by much in a window, or whose fast vibrations are
not resolved, may speed up or slow down for no reason, and a window of half the size does much the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from coupler.schemes.state import KINETIC, MADE
from coupler.trust.checks import Check, measured

NAME = "energy of motion is kept"
# Of the largest kinetic energy.  A tenth is a speed that is 5 % off.  What is lost breaks nothing: methods that damp do
# it on purpose, and what rings may go.
NOTE_AT, LIMIT = 0.03, 0.1


@dataclass(frozen=True)
class EnergyLog:
    """kinetic : the largest of all bodies [J].  gained, lost : the most [J] that was made of nothing so far, and lost.

    t, t_lost [s] : when.  known : whether the half tells.
    """

    kinetic: float = 0.0
    gained: float = 0.0
    lost: float = 0.0
    t: float = 0.0
    t_lost: float = 0.0
    known: bool = False


def watched(log: EnergyLog, monitors: Mapping[str, float], t: float) -> EnergyLog:
    """Return the log after a window to t [s].  monitors : what the halves tell of it."""
    if f"mechanical.{MADE}" not in monitors:
        return log
    # fault: energy of nothing is trusted -> made = 0.0 | coupler/test_trust_energy
    made = monitors[f"mechanical.{MADE}"]
    log = replace(log, known=True, kinetic=max(log.kinetic, monitors[f"mechanical.{KINETIC}"]))
    if made > log.gained:
        return replace(log, gained=made, t=t)
    return replace(log, lost=-made, t_lost=t) if -made > log.lost else log


def checks(log: EnergyLog) -> tuple[Check, ...]:
    """Return the row at the end; none where no half tells, or nothing moves."""
    if not log.known or log.kinetic <= 0.0:
        return ()
    gained, lost = log.gained / log.kinetic, log.lost / log.kinetic
    if gained >= lost or gained > LIMIT:
        return (measured(
            NAME, gained, (NOTE_AT, LIMIT), t=log.t,
            what=f"bodies gained {log.gained:.3g} J of nothing by t = {log.t:.6g} s, {100 * gained:.3g} % of their "
                 "largest kinetic energy: they turn by too much in a window, or vibrations that windows do not "
                 "resolve feed on it",
            remedy="Use mechanical.elastic.dynamics: {rho_inf: 0.8}, which damps what rings too fast for the windows, "
                   "or smaller windows (coupling.adaptive.most, coupling.windows); make bodies rigid that are stiff"),)
    return (measured(
        # fault: energy that damping takes from a motion is not told -> NAME, 0.0, (NOTE_AT, float("inf")), |
        #   coupler/test_trust_energy
        NAME, lost, (NOTE_AT, float("inf")), t=log.t_lost,
        what=f"bodies lost {log.lost:.3g} J by t = {log.t_lost:.6g} s that neither work nor friction accounts for, "
             f"{100 * lost:.3g} % of their largest kinetic energy: the method damps what is fast for the windows, "
             "which may be the motion itself, and small swings of rigid bodies on the penalty of what they lie on",
        remedy="Use smaller windows (coupling.adaptive.most, coupling.windows), or rho_inf nearer to 1; of swings that "
               "settle a larger penalty leaves less"),)
