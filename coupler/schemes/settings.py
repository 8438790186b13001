"""Settings: what of a run may be changed while it runs, by a rule, by its user, by `auto`.  Values, never in place."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from coupler.scenario.options import Iteration, Scheme


@dataclass(frozen=True)
class Settings:
    """How the next window is solved.

    substeps : {"thermal": n, "mechanical": m}.  window_factor : multiplies the size that was planned.
    window_cap : no window is longer [s]; inf: as planned.
    inputs : side -> name of an input -> value, given to that half in every substep besides what is exchanged
    (control.method, load.NAME, bc.NAME).  A half keeps what it was last given: a name is never taken out again.
    """

    scheme: Scheme
    substeps: Mapping[str, int]
    iteration: Iteration = field(default_factory=Iteration)
    window_factor: float = 1.0
    window_cap: float = math.inf
    inputs: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
