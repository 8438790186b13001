"""Names of monitors: what rules may look at, and which output of a half tells it.

Beside those below: `thermal.OUTPUT` and `mechanical.OUTPUT` for any number that a half gives out (`OUTPUT[2]` for the second of
several), and every probe by its name.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

COUPLER = {
    "t": "s, end of the window", "window": "s, its size", "number": "windows taken before it",
    "failures": "tries in a row that failed", "iterations": "of the window, where the scheme iterates",
    "contraction": "measured ratio of residuals of plain iteration", "error": "largest error estimate, in tolerances",
    "error.temperature": "tolerances", "error.gap": "tolerances", "error.heat": "tolerances",
    "error.displacement": "tolerances", "max_T": "hottest node", "max_p": "Pa, largest contact pressure",
    "touching": "facing points under pressure", "imbalance": "of heat, over the run",
    "thermal.status": "0 well, 1 discarded", "mechanical.status": "0 well, 1 discarded",
}
"""Monitors of the coupler, each with its unit or meaning; one that a window does not have is not known in it."""

SHORT = {
    "max_dT": "thermal.max_dT", "heat_stored": "thermal.heat_stored",
    "max_strain_increment": "mechanical.max_strain_increment", "max_strain_rate": "mechanical.max_strain_rate",
    "slipping": "mechanical.contact.slipping",
}
"""Short names of what one half gives out."""

# A half that does not tell this gives the other, divided by the size of the window.
RATES = {"max_strain_rate": "max_strain_increment"}
LEVELS_OF_T = frozenset({"max_T"})  # in the scenario's unit of temperature
_OUTPUT = re.compile(r"(thermal|mechanical)\.([^\[\]]+)(?:\[(\d+)\])?")


@dataclass(frozen=True)
class Source:
    """An output of a half: half, block, and which value of it, from 0; per_window : divide by its size [s]."""

    half: str
    block: str
    index: int = 0
    per_window: bool = False


def known(name: str) -> bool:
    """Whether a name is that of a monitor, probes left out."""
    return name in COUPLER or name in SHORT or _OUTPUT.fullmatch(name) is not None


def source(name: str) -> Source | None:
    """Which output tells a monitor; None for those of the coupler, and for probes."""
    if name in COUPLER:
        return None
    match = _OUTPUT.fullmatch(SHORT.get(name, name))
    if match is None:
        return None
    half, block, index = match.groups()
    return Source(half, block, int(index) - 1 if index else 0)
