"""The heat balance: energies into the bodies by mechanism, and how far they are from adding up."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

PREFIX = "heat."
STORED = "heat.stored."
MOVED = "heat_moved"  # no term: what nodes took up or gave off, where a half tells it
ROUNDING = "heat_rounding"  # no term: what round-off leaves of the heat of a substep, where a half tells it
NO_TERMS = (MOVED, ROUNDING)


@dataclass(frozen=True)
class Ledger:
    """Totals [J] by term (the thermal half's `heat.*` outputs).

    Every term but the stored ones counts what came INTO the bodies; heat.stored.<body> is what its enthalpy grew.
    The two sides of an interface are separate terms, each taken from its own side.
    lost : the low-order bits of each total, so that a million windows add up as exactly as one (Neumaier).
    """

    totals: Mapping[str, float] = field(default_factory=dict)
    lost: Mapping[str, float] = field(default_factory=dict)

    def plus(self, terms: Mapping[str, float]) -> Ledger:
        """The ledger after one more substep."""
        totals, lost = dict(self.totals), dict(self.lost)
        for name, energy in terms.items():
            old = totals.get(name, 0.0)
            new = old + energy
            larger, smaller = (old, energy) if abs(old) >= abs(energy) else (energy, old)
            lost[name] = lost.get(name, 0.0) + ((larger - new) + smaller)
            totals[name] = new
        return Ledger(totals, lost)

    def after(self, substeps: Iterable[Mapping[str, float]]) -> Ledger:
        """The ledger after some more substeps."""
        ledger = self
        for terms in substeps:
            ledger = ledger.plus(terms)
        return ledger

    @property
    def terms(self) -> dict[str, float]:
        """Total of each term [J]."""
        return {name: total for name, total in self.everything.items() if name not in NO_TERMS}

    @property
    def everything(self) -> dict[str, float]:
        """Total of each term, and of what nodes took up or gave off [J]."""
        return {name: total + self.lost[name] for name, total in self.totals.items()}

    @property
    def imbalance(self) -> float:
        """0 where every joule is accounted for (imbalance)."""
        return imbalance(self.everything)


def imbalance(terms: Mapping[str, float]) -> float:
    """|sum of all terms| / sum of |terms|, stored heat counted against the rest.

    Where heat only runs inside a body all terms are round-off: what its nodes took up or gave off (MOVED, no term) is
    the scale then, where it is told.  Where nothing moves that is round-off, too: what round-off leaves of the heat the
    bodies hold (ROUNDING, no term) is accounted for, where it is told.
    """
    signed = [-e if name.startswith(STORED) else e for name, e in terms.items() if name not in NO_TERMS]
    scale = moved(terms)
    # fault: bodies at rest are held against their round-off -> off = abs(math.fsum(signed)) |
    #   coupler/test_accounts
    off = max(abs(math.fsum(signed)) - terms.get(ROUNDING, 0.0), 0.0)
    return off / scale if scale > 0 else 0.0


def moved(terms: Mapping[str, float]) -> float:
    """Return the heat moved into bodies or, where it is told, inside them [J]."""
    every = math.fsum(abs(e) for name, e in terms.items() if name not in NO_TERMS)
    # fault: the balance of heat that runs inside a body is held against its round-off -> return every |
    #   coupler/test_starts::test_without_boundary_the_mean_stays_and_the_rest_decays
    return max(every, terms.get(MOVED, 0.0))


MECHANISMS = {
    "heat.temperature.in": "prescribed temperature, in",
    "heat.temperature.out": "prescribed temperature, out",
    "heat.flux": "prescribed flux",
    "heat.convection": "convection",
    "heat.radiation": "far radiation",
    "heat.source": "thermal source",
    "heat.mechanical": "mechanical heat",
    "heat.entropy": "thermoelastic heat (entropy part)",
    "heat.contact.slave": "solid contact, into the slave",
    "heat.contact.master": "solid contact, into the master",
    "heat.gap.slave": "gas gap, into the slave",
    "heat.gap.master": "gas gap, into the master",
    "heat.near_radiation.slave": "near radiation, into the slave",
    "heat.near_radiation.master": "near radiation, into the master",
    "heat.friction.slave": "friction, into the slave",
    "heat.friction.master": "friction, into the master",
}


def mechanism(term: str) -> str:
    """The plain name of a ledger term."""
    if term.startswith(STORED):
        return f"stored in {term[len(STORED):]}"
    return MECHANISMS.get(term, term.removeprefix(PREFIX))
