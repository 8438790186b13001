"""What the boundary data are at a stage time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.field import Field, Level
from contact.half.signal import Signal
from thermal_fmu.spec import Model

# A time this close to a kink, as a share of the substep and of the time itself, is on it: clocks of integer ticks
# round a kink to 2^-40 of the end time, and the value on the wrong side of a jump would last a whole stage.
SNAP_STEP, SNAP_TIME = 1e-6, 4e-12

LoadFactors = Mapping[str, float]


@dataclass(frozen=True)
class Loads:
    """Levels at one time, each in the order of the model: numbers, but for fields that depend on place.

    Q_T [W/m3] of bodies.  fluxes [W/m2].  films : (h [W/m2K], Te [K]).  radiators : (factor, T_inf [K]).
    prescribed : temperatures [K].  pairs : (closed, open) factors.
    """

    Q_T: tuple[Level, ...]
    fluxes: tuple[Level, ...]
    films: tuple[tuple[Level, Level], ...]
    radiators: tuple[tuple[float, Level], ...]
    prescribed: tuple[Level, ...]
    pairs: tuple[tuple[float, float], ...]


def loads_at(model: Model, factors: LoadFactors, t: float, side: int) -> Loads:
    """Boundary data at t [s], at a jump before it (side = -1) or after it; factors : of the named ones."""
    def now(field: Field, name: str = "") -> Level:
        return field.level(t, side) * factor(name)

    def factor(name: str) -> float:
        return factors[name] if name else 1.0

    return Loads(
        tuple(now(b.Q_T) for b in model.bodies),
        tuple(now(b.value, b.name) for b in model.fluxes),
        tuple((now(b.h, b.name), now(b.Te)) for b in model.films),
        # fault: factor of radiation forgotten -> tuple((1.0, now(b.T_inf)) for b in model.radiators), |
        #   thermal_fmu/test_thermal_radiation
        tuple((factor(b.name), now(b.T_inf)) for b in model.radiators),
        tuple(now(b.value, b.name) for b in model.prescribed),
        tuple((0.0, 0.0) if p is None else (p.closed_factor.at(t, side), p.open_factor.at(t, side))
              for p in model.pairs),
    )


def factors_of(model: Model, inputs: Mapping[str, object]) -> dict[str, float]:
    """The factor inputs load.<name> by name."""
    return {name: float(np.asarray(inputs[f"load.{name}"], dtype=float)) for name in model.load_names}


@dataclass(frozen=True)
class Calendar:
    """kinks : times at which any signal jumps or bends.  jumps : those at which one jumps."""

    kinks: NDArray[np.float64]
    jumps: NDArray[np.float64]

    def snap(self, t: float, h: float) -> float:
        """The kink t is meant to be, else t itself; h : the substep [s]."""
        if self.kinks.size == 0:
            return t
        near = float(self.kinks[np.argmin(np.abs(self.kinks - t))])
        # fault: no snap -> return t | thermal_fmu/test_thermal_time
        return near if abs(near - t) <= _tolerance(t, h) else t

    def jump_within(self, t: float, h: float) -> bool:
        """Whether a signal jumps at the start of [t, t + h] or inside it; a jump at its end is the next one's."""
        early = _tolerance(t, h)
        return bool(((self.jumps >= t - early) & (self.jumps < t + h - early)).any())


def calendar_of(model: Model) -> Calendar:
    """The times at which the model's own signals bend and jump."""
    signals = model.signals
    kinks = np.unique(np.concatenate([np.empty(0), *(s.kinks for s in signals)]))
    jumps = np.unique(np.concatenate([np.empty(0), *(_jumps(s) for s in signals)]))
    return Calendar(kinks, jumps)


def _jumps(signal: Signal) -> NDArray[np.float64]:
    return signal.t[1:][(np.diff(signal.t) == 0) & (np.diff(signal.value) != 0)]


def _tolerance(t: float, h: float) -> float:
    return SNAP_STEP * h + SNAP_TIME * abs(t)
