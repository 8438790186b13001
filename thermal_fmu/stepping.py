"""How a half steps in time, as its model.json says it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

from contact.half.checks import keys, known, number
from thermal_fmu.methods import METHOD_NAMES, METHODS, Method, theta_method

MOST_INCREMENTS = 100_000  # a count beyond this is a slip of the pen


@dataclass(frozen=True)
class Adaptive:
    """What the inner steps of a substep must keep to.

    tolerance : of the estimated local error of T, largest over the nodes [K].  max_dT : largest change of T at a node
    [K].  least : the shortest inner step [s]; None: LEAST_SHARE of the substep.
    """

    tolerance: float = inf
    max_dT: float = inf
    least: float | None = None


@dataclass(frozen=True)
class Stepping:
    """method : a name of METHOD_NAMES.  theta : of the method `theta`.  increments : of the method `steady`.

    adaptive : None where a substep is one step.  tolerance : of Newton's method, as a share of the heat that flows.
    """

    method: str
    theta: float
    increments: int
    adaptive: Adaptive | None
    tolerance: float

    def method_of(self, name: str) -> Method:
        """The method of that name, `theta` with this model's theta."""
        return theta_method(self.theta) if name == "theta" else METHODS[name]


def parse_stepping(spec: Mapping[str, Any]) -> Stepping:
    """The keys method, theta, increments, adaptive and tolerance of a model.json.  Raises ValueError naming the key."""
    method = known(spec.get("method", "midpoint"), "method", METHOD_NAMES)
    theta = number(spec.get("theta", 0.5), "theta")
    if not 0.5 <= theta <= 1.0:
        raise ValueError(f"model.json: theta must be 0.5 to 1, not {theta!r}")
    adaptive = None if spec.get("adaptive") is None else _adaptive(spec["adaptive"])
    if adaptive is not None and method == "steady":
        raise ValueError("model.json: adaptive: the method 'steady' has no steps in time; leave one of them out")
    return Stepping(method, theta, _count(spec.get("increments", 1)), adaptive,
                    number(spec.get("tolerance", 1e-10), "tolerance", 0.0))


def _adaptive(spec: Any) -> Adaptive:
    keys(spec, "adaptive", set(), ("tolerance", "max_dT", "least"))
    if spec.get("tolerance") is None and spec.get("max_dT") is None:
        raise ValueError("model.json: adaptive: needs tolerance or max_dT (or both), in K")
    given = {key: number(value, f"adaptive.{key}", 0.0) for key, value in spec.items() if value is not None}
    return Adaptive(**given)


def _count(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= MOST_INCREMENTS:
        raise ValueError(f"model.json: increments must be a whole number from 1 to {MOST_INCREMENTS}, not {value!r}")
    return value
