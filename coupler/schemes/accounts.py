"""The energy accounts: heat the mechanical half made, what of it was delivered, what is carried to the next window."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Block that crosses -> plain name.  Each has an account of its own.
HEATS = {"E_M": "mechanical heat", "E_S": "entropy part", "contact.E_friction": "friction heat"}
# Work of what damped bodies until contact held them [J], since the start; of the half elastic, where a body is loose.
DAMPED = "work.stabilisation"
# What goes on as it went in the window before, unless something opens or closes; so it can be handed over ahead.  Not
# E_M: that of squeezing turns against the change of T that made it, and ahead of it would grow from delta 1/3 on.
AHEAD = frozenset(("contact.E_friction",))
AT_ONCE = frozenset(("E_S",))  # a temperature jump at the start of the first substep; the others are spread in time


# What presses on the places of an account at the start and the end of a window (Level.pressed), (n_q,) [Pa] each.
Pressed = tuple[Array, Array]


@dataclass(frozen=True)
class Foreseen:
    """Heat that goes on as it went is handed over before it is made: that of H [s].

    trend : how far its power is taken along the line through the last two windows (1.0), or held as in the last (0.0).
    """

    H: float
    trend: float = 0.0


@dataclass(frozen=True)
class EnergyAccount:
    """Energies [J].  carry : (n_cells,) or (n_q,) made but not yet delivered; < 0: delivered ahead of what was made.

    made, delivered : totals over the run.  power : same shape, made in the last window [W]; None: in none yet.
    late : same shape, what of the carry belongs to later times [J] (see `make`); None: nothing.  at_end : it is made
    by the forces at the end of a step, as the half says.
    slope : same shape, how fast the power changes [W/s]; None: it is not known.  age : from the time that the power is
    of to the end of the last window [s].
    Energies cross the border, not rates: a rate of one window used over a window of another length loses heat.
    """

    carry: Array
    made: float = 0.0
    delivered: float = 0.0
    power: Array | None = None
    late: Array | None = None
    at_end: bool = False
    slope: Array | None = None
    age: float = 0.0

    @property
    def left(self) -> float:
        """Return what was made and not delivered [J], but for what belongs to later times; < 0: delivered, not made."""
        return float(self.carry.sum()) - (0.0 if self.late is None else float(self.late.sum()))

    def due(self, ahead: Foreseen) -> Array:
        """Return the carry, without what belongs to later times, and what H [s] more make [J], >= 0.

        ahead : its H is 0.0 where the window's own heat is in the carry.
        Nothing is taken back from a place that was handed too much and has been left since: the others are handed so
        much less, so that in all no more is delivered than was made.
        """
        now = self.carry if self.late is None else self.carry - self.late
        # fault: friction heat is not extrapolated -> wanted = now | coupler/test_accounts
        wanted = now if self.power is None else now + ahead.H * self.power
        if self.slope is not None and ahead.trend > 0.0:
            # fault: power is taken along its line for too long or too short a time -> wanted = wanted + ahead.trend *
            #   ahead.H * (0.5 * ahead.H) * self.slope | coupler/test_friction_trend
            wanted = wanted + ahead.trend * ahead.H * (0.5 * ahead.H + self.age) * self.slope
        most, total = np.maximum(wanted, 0.0), float(wanted.sum())
        # fault: what was handed ahead to places left behind is handed on again -> return most | coupler/test_accounts
        return most * (total / float(most.sum())) if total > 0.0 else np.zeros_like(most)

    def deliver(self, handed: Array, late: Array | None) -> EnergyAccount:
        """The account after an energy was handed to the thermal half.

        handed : same shape as the carry [J].  late : what of the carry that is left belongs to later times.
        """
        if not handed.any():
            return replace(self, late=late)
        # fault: friction heat is delivered twice -> return replace(self, delivered=self.delivered +
        #   float(handed.sum())) | scenarios/test_friction_heat
        return replace(self, carry=self.carry - handed, delivered=self.delivered + float(handed.sum()), late=late)

    def make(self, energy: Array | float, H: float, step: float, fresh: bool,
             pressed: Pressed | None = None) -> EnergyAccount:
        """Return the account after the mechanical half made an energy in a window of H [s].

        energy : same shape as the carry [J]; a float, 0.0, where the half makes none.  step [s] : of the half in it.
        fresh : nothing is known of the power before this window, or all that is made is handed over as it is.
        pressed : at the start and the end of the window; None: power changes as pressure does.
        What is made by the forces at the end of steps is (p' - p)/2 times a step and the rate of slip more than the
        trapezoidal rule says, in a window whose pressure goes from p to p': that belongs to later times.  Where
        histories begin anew, or nothing is made any more, the trapezoidal rule has the last word: what it says is what
        was made.
        """
        if isinstance(energy, float):
            return self
        late = None
        if self.at_end and not fresh and self.power is not None and energy.any():
            known = 0.0 if self.late is None else self.late
            # fault: friction heat is that of the pressure at the end of a window -> late = None |
            #   coupler/test_friction_order
            late = 0.5 * step * _by_pressure(self.power, energy / H, pressed) + known
        # fault: friction heat forgotten between windows -> carry = self.carry | coupler/test_accounts
        carry, made = self.carry + energy, self.made + float(energy.sum())
        # fault: what belonged to later times is left over when friction ends -> if False: | coupler/test_accounts
        if late is None and self.late is not None:
            carry, made = carry - self.late, made - float(self.late.sum())
        # fault: power at the end of steps is taken for that of their middle -> age = 0.5 * H |
        #   coupler/test_friction_trend
        age = 0.5 * (H - step) if self.at_end else 0.5 * H
        slope = None if fresh or self.power is None else (energy / H - self.power) / (H - age + self.age)
        return replace(self, carry=carry, made=made, power=energy / H, late=late, slope=slope, age=age)


def _by_pressure(before: Array, power: Array, pressed: Pressed | None) -> Array:
    """How much of a change of power [W] is that of pressure, (n_q,).  before, power : in the last window and in this.

    A power is p v, so p' v - p v = (P + P') (p' - p)/(p + p') with the mean rate of slip v = (P + P')/(p + p').  What
    begins to slip, or slips faster, under the same pressure makes at the end of a step what it made in the mean.
    """
    if pressed is None:
        return power - before
    both = pressed[0] + pressed[1]
    # fault: what slips faster is taken for what is pressed harder -> return power - before | coupler/test_accounts
    return np.divide((before + power) * (pressed[1] - pressed[0]), both, out=np.zeros_like(power), where=both > 0.0)


Accounts = Mapping[str, EnergyAccount]


def due(accounts: Accounts, ahead: Foreseen | None) -> dict[str, Array]:
    """Return what is handed over in a window, by block, (n_cells,) or (n_q,) [J].

    ahead : what belongs to later times is kept back, too; None: all that is carried is due.
    """
    return {n: a.due(ahead) if ahead is not None and n in AHEAD else a.carry for n, a in accounts.items()}


def share_of(handed: Mapping[str, Array], share: float, first: bool) -> dict[str, Array]:
    """Return what a thermal substep is given of each energy [J], by block, (n_cells,) or (n_q,).

    That is its share of the window, or, of what is due at once, all of it in the first substep.
    """
    # fault: entropy part handed to every substep -> shares = {n: 1.0 if n in AT_ONCE else share for n in handed} |
    #   coupler/test_accounts
    shares = {n: float(first) if n in AT_ONCE else share for n in handed}
    return {n: e if shares[n] == 1.0 else e * shares[n] for n, e in handed.items()}


def delivered(accounts: Accounts, handed: Mapping[str, Array], taken: Container[str],
              ahead: Foreseen | None) -> dict[str, EnergyAccount]:
    """Return the accounts after a thermal half went over a window.

    handed : what it was given, by block [J].  taken : blocks it has; one it lacks is carried on.  ahead : as of `due`.
    """
    # fault: what was handed over with all the rest is taken for kept back -> return {n: a.deliver(handed[n], a.late) if
    #   n in taken else a | coupler/test_accounts
    return {n: a.deliver(handed[n], None if ahead is None else a.late) if n in taken else a
            for n, a in accounts.items()}


def with_made(accounts: Accounts, made: Mapping[str, Array], times: Sequence[float], fresh: bool,
              pressed: Pressed) -> dict[str, EnergyAccount]:
    """Return the accounts after a mechanical half went over a window: what it made is due.

    made : same shape as the carry [J] of each account, by block; a block that is missing made nothing.
    times : of the half's steps [s].  fresh : as of EnergyAccount.make.
    """
    H = times[-1] - times[0]
    return {n: a.make(made.get(n, 0.0), H, H / (len(times) - 1), fresh,
                      pressed if a.carry.shape == pressed[0].shape == pressed[1].shape else None)
            for n, a in accounts.items()}
