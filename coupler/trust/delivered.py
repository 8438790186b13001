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


def checks(delivered: Mapping[str, float], totals: Mapping[str, float]) -> tuple[Check, ...]:
    """Return the check at the end; none where nothing was delivered, or the half states no terms.

    delivered : block -> [J] over the run.  totals : all of the ledger over the run [J].
    """
    if not any(name.startswith(PREFIX) for name in totals):
        return ()
    received = {block: sum(totals.get(term, 0.0) for term in TERMS[block]) for block, heat in delivered.items() if heat}
    if not received:
        return ()
    # Heat of squeezing goes to and fro, and its sum may be next to nothing; friction only heats.
    scale = {block: abs(delivered[block]) if block in ONLY_HEATS else max(abs(delivered[block]), moved(totals))
             for block in received}
    off = {block: abs(heat - delivered[block]) / scale[block] for block, heat in received.items()}
    block = max(off, key=off.__getitem__)
    # fault: heat that is taken twice is trusted -> number = 0.0 | coupler/test_trust_delivered
    number = off[block]
    return (measured(
        NAME, number, LIMITS,
        what=f"of {delivered[block]:.4g} J of {HEATS[block]} delivered, the thermal half states "
             f"{received[block]:.4g} J as received",
        remedy=f"Mend the half: {' and '.join(TERMS[block])} must be what it was given, once"),)
