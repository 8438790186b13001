"""Heat that was delivered to the thermal half, against what the half states that it received.

The heat balance holds as well where a half takes friction heat twice, or a part of it, and says so.  The coupler knows
what it delivered: every joule of it is a term of the half's balance.
"""

from __future__ import annotations

from collections.abc import Mapping

from coupler.schemes.accounts import HEATS
from coupler.schemes.ledger import PREFIX, moved
from coupler.trust.checks import Check, measured

# Of what was delivered: noted, broken.
LIMITS = (1e-6, 1e-2)
NAME = "delivered heat is received"
# Block that crosses -> the terms in which a thermal half states it.
TERMS = {"E_M": ("heat.mechanical",), "E_S": ("heat.entropy",),
         "contact.E_friction": ("heat.friction.slave", "heat.friction.master")}
ONLY_HEATS = ("contact.E_friction",)
LEFT = "heat made is handed over"
# Of what was made or handed over: what is left over at the end of a run of 50 windows, and of 5.
LEFT_LIMITS = (0.02, 0.2)
# Of all heat that moved: less than that changes no temperature.
SLIGHT = 1e-3


def checks(delivered: Mapping[str, float], totals: Mapping[str, float]) -> tuple[Check, ...]:
    """Return the check at the end; none where nothing was delivered, or the half states no terms.

    delivered : block -> [J] over the run.  totals : all of the ledger over the run [J].
    """
    if not any(name.startswith(PREFIX) for name in totals):
        return ()
    received = {block: sum(totals.get(term, 0.0) for term in TERMS[block]) for block, heat in delivered.items() if heat}
    if not received:
        return ()
    scale = {block: _scale(block, abs(delivered[block]), totals) for block in received}
    off = {block: abs(heat - delivered[block]) / scale[block] for block, heat in received.items()}
    block = max(off, key=off.__getitem__)
    # fault: heat that is taken twice is trusted -> number = 0.0 | coupler/test_trust_delivered
    number = off[block]
    return (measured(
        NAME, number, LIMITS,
        what=f"of {delivered[block]:.4g} J of {HEATS[block]} delivered, the thermal half states "
             f"{received[block]:.4g} J as received",
        remedy=f"Mend the half: {' and '.join(TERMS[block])} must be what it was given, once"),)


def left_checks(handed: Mapping[str, float], left: Mapping[str, float],
                totals: Mapping[str, float]) -> tuple[Check, ...]:
    """Return the check at the end; none where no mechanical heat was made or handed over.

    handed : block -> [J] over the run.  left : block -> [J] made and not handed over, < 0: handed over and not made.
    totals : all of the ledger over the run [J].
    Friction is handed over as it goes on; a body that stops within a long window makes less of it.
    """
    made = {block: heat + left[block] for block, heat in handed.items() if heat or left[block]}
    scale = {block: _scale(block, max(abs(heat), abs(handed[block])), totals) for block, heat in made.items()}
    # fault: friction heat that is nothing beside other heat is noted -> least = 0.0 | coupler/test_trust_delivered
    least = SLIGHT * moved(totals)
    off = {block: max(abs(left[block]) - least, 0.0) / scale[block] for block in made}
    if not off:
        return ()
    block = max(off, key=off.__getitem__)
    # fault: heat that was handed over and never made is trusted -> number = 0.0 | coupler/test_trust_delivered
    number = off[block]
    return (measured(
        LEFT, number, LEFT_LIMITS,
        what=f"of {HEATS[block]} {made[block]:.4g} J were made and {handed[block]:.4g} J handed to the thermal half: "
             "temperatures are off by the difference",
        remedy="Use smaller windows where heat begins or ends, scheme: iterated, or adaptive windows (leave "
               "coupling.windows out)"),)


def _scale(block: str, heat: float, totals: Mapping[str, float]) -> float:
    """What is off is held against [J].  Heat of squeezing goes to and fro, and its sum may be next to nothing; friction
    only heats.
    """
    return heat if block in ONLY_HEATS else max(heat, moved(totals))
