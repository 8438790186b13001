"""When a heat balance is solved: small beside the heat that flows, or as small as round-off lets it become."""

from __future__ import annotations

from typing import Protocol

STAGE_TOLERANCE = 0.1  # of the model's tolerance: the heat balance of a long run must close to it
STALLED = 0.1  # of the residual before: what a solve leaves of it where only round-off is left
REFINED = 0.5  # of the heat that is missing in all: what a solve that is worth it takes off


class HeatBalance(Protocol):
    """norm : sum of |R| at free nodes [J].  missing : |sum of R| there [J].  scale : sum of the sizes of all heats [J].
    """

    @property
    def norm(self) -> float: ...
    @property
    def missing(self) -> float: ...
    @property
    def scale(self) -> float: ...


def is_solved(now: HeatBalance, before: HeatBalance | None, tolerance: float, floor: float) -> bool:
    """Return whether `now` needs no further solve.

    before : of the iterate before; None: now is that of the guess.  tolerance : of the model [1].  floor : a bound of
    the round-off in norm [J].

    What lies within round-off of the guess is not yet as small as it can be, and adds up from step to step: the heat
    of a long step may be less than the round-off of what could flow in it.  Bodies at rest have no residual.  Below the
    floor a residual may be made smaller as long as it is more than the heat balance asks for and solves take it off;
    its sum over all nodes does not see the round-off of what they exchange, and is made as small as it gets.
    """
    enough = STAGE_TOLERANCE * tolerance * now.scale
    if now.norm <= enough:
        return True
    if before is None:
        # fault: little heat beside much round-off is at rest -> return now.norm <= floor and now.scale <= 1e3 * floor |
        #   thermal_fmu/test_thermal_ledger
        # fault: a guess within round-off is taken as it is -> return now.norm <= floor |
        #   thermal_fmu/test_thermal_ledger
        return False
    settled = now.missing <= enough or now.missing > REFINED * before.missing
    # fault: what a whole scene takes up is lost in what its nodes exchange -> if False: |
    #   thermal_fmu/test_thermal_ledger
    if not settled:
        return False
    # fault: whatever lies below the bound of round-off is taken -> stalled = True | thermal_fmu/test_thermal_ledger
    stalled = now.norm > STALLED * before.norm
    return now.norm <= (floor if stalled else min(floor, tolerance * now.scale))


def left_over(now: HeatBalance, floor: float) -> float:
    """Return the heat that is missing beyond round-off, as a share of the heat that flows [1].

    floor : a bound of the round-off in norm [J].
    """
    # fault: round-off where hardly any heat flows is told as heat that is missing -> floor = 0.0 |
    #   thermal_fmu/test_thermal_newton::test_round_off_is_no_heat_that_is_missing
    return max(now.norm - floor, 0.0) / now.scale if now.scale > 0.0 else 0.0
