"""Names of monitors: what rules may look at, and which output of a half tells it.

Beside those below: `thermal.OUTPUT` and `mechanical.OUTPUT` for any number that a half gives out (`OUTPUT[2]` for the
second of several), and every probe by its name.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

COUPLER = {
    "t": "s, end of the window", "window": "s, its size", "number": "of the window, from 1",
    "failures": "tries in a row that failed", "iterations": "of the exchange, 1 where the scheme does not iterate",
    "contraction": "measured ratio of residuals of plain iteration", "error": "largest error estimate, in tolerances",
    "error.temperature": "tolerances", "error.gap": "tolerances", "error.heat": "tolerances",
    "error.displacement": "tolerances",
    **{f"{part}.{name}": "tolerances" for part in ("splitting", "own")
       for name in ("temperature", "gap", "heat", "displacement")},
    "max_T": "hottest node", "max_p": "Pa, largest contact pressure",
    "touching": "facing points under pressure", "imbalance": "of the heat of the window",
    "thermal.status": "0 well, 1 discarded", "mechanical.status": "0 well, 1 discarded",
}
"""Monitors of the coupler, each with its unit or meaning; one that a window does not have is not known in it."""

SHORT = {
    "max_dT": "thermal.max_dT", "heat_stored": "thermal.heat_stored",
    "max_strain_increment": "mechanical.max_strain_increment", "max_strain_rate": "mechanical.max_strain_rate",
    "slipping": "mechanical.contact.slipping",
}
"""Short names of what one half gives out."""

# A half that does not tell the first gives the second, divided by the length of its substep.
RATE, INCREMENT = "mechanical.max_strain_rate", "mechanical.max_strain_increment"
LEVELS_OF_T = frozenset({"max_T"})  # given in the scenario's unit of temperature
_OUTPUT = re.compile(r"(thermal|mechanical)\.[^\[\]]+(\[[1-9]\d*\])?")


def full_name(name: str) -> str | None:
    """A monitor as it is looked up: COUPLER, `thermal.OUTPUT`, `mechanical.OUTPUT`; None for what is none of these."""
    full = SHORT.get(name, name)
    return full if full in COUPLER or _OUTPUT.fullmatch(full) else None


def outputs(monitors: Iterable[str]) -> frozenset[str]:
    """Outputs of the halves, `thermal.max_dT`, that tell these monitors (full names)."""
    told = {m.partition("[")[0] for m in monitors if m not in COUPLER and _OUTPUT.fullmatch(m)}
    return frozenset(told | ({INCREMENT} if RATE in told else set()))


def with_rate(monitors: Mapping[str, float], substep: float) -> Mapping[str, float]:
    """With the strain rate of a half that tells only the increment of its last substep [s]."""
    if RATE in monitors or INCREMENT not in monitors:
        return monitors
    return {**monitors, RATE: monitors[INCREMENT] / substep}
