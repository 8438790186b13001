"""A rule as data: on which monitors it looks, when it fires, and what it then does.  All in SI and kelvin."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum

from coupler.scenario.options import Scheme


class Of(Enum):
    """What of a monitor is compared."""

    VALUE = "value"
    CHANGE = "change"  # since the end of the window before
    RATE = "rate"  # that change a second


@dataclass(frozen=True)
class Test:
    """above < monitor < below (or its change or rate), in each of so many windows on end."""

    __test__ = False  # not one of pytest's

    monitor: str
    of: Of = Of.VALUE
    above: float = -math.inf
    below: float = math.inf
    windows: int = 1

    def holds(self, value: float) -> bool:
        """Whether a value passes; nan never does."""
        return self.above < value < self.below


@dataclass(frozen=True)
class When:
    """All of `all`, and where there are groups in `any` all tests of at least one group."""

    all: tuple[Test, ...] = ()
    any: tuple[tuple[Test, ...], ...] = ()

    def __iter__(self) -> Iterator[Test]:
        yield from self.all
        for group in self.any:
            yield from group


@dataclass(frozen=True)
class Change:
    """A number set (`to`), or multiplied (`times`; then to is nan), kept in [least, most]."""

    to: float = math.nan
    times: float = 1.0
    least: float = -math.inf
    most: float = math.inf

    def of(self, value: float) -> float:
        """The number after the change."""
        wanted = value * self.times if math.isnan(self.to) else self.to
        return min(max(wanted, self.least), self.most)


@dataclass(frozen=True)
class Retry:
    """Put the window back and try `window` (< 1) of it, but none shorter than least [s]."""

    window: float = 0.5
    least: float = 0.0


@dataclass(frozen=True)
class Substeps:
    """Another number of substeps of a half ("thermal" or "mechanical")."""

    half: str
    count: Change


@dataclass(frozen=True)
class Give:
    """Another value of an input of a half from now on: control.method, load.NAME, bc.NAME; start : its value before."""

    half: str
    name: str
    value: Change
    start: float = 0.0


@dataclass(frozen=True)
class UseScheme:
    """Another scheme from the next window on."""

    scheme: Scheme


@dataclass(frozen=True)
class Window:
    """Windows times a factor of what they would be (`times`), or none longer than so many seconds (`to`)."""

    size: Change


@dataclass(frozen=True)
class Stop:
    """End the run after this window, as completed, and say why."""

    reason: str


Action = Retry | Substeps | Give | UseScheme | Window | Stop


@dataclass(frozen=True)
class Drive:
    """A load (or bc) of a half driven so that a monitor holds a target (coupler.rules.drive).

    half, name : the input, `load.press`.  first : its value at the start.  least, most : its bounds.
    log : the load moves in its logarithm, else linearly.  gain : change of (ln) load for a change of (ln) monitor,
    1/slope; nan: measured as the run goes (log only).  rate : largest |change| of (ln) load a second.
    lag [s] : the time constant with which a monitor that is slow to answer goes to its target.
    """

    half: str
    name: str
    monitor: str
    target: float
    first: float
    least: float
    most: float
    log: bool
    gain: float = math.nan
    rate: float = math.inf
    lag: float = 0.0


@dataclass(frozen=True)
class Rule:
    """when : conditions (none: always).  do : what is done, in order.  drive : and what is driven while they hold.

    once : at most once in a run.  after, until [s] : only windows that end in (after, until].  cooldown : so many
    windows are let pass after it fired.
    """

    name: str
    when: When = When()
    do: tuple[Action, ...] = ()
    drive: Drive | None = None
    once: bool = False
    after: float = -math.inf
    until: float = math.inf
    cooldown: int = 0

    @property
    def changes_loads(self) -> bool:
        """Whether it changes an input of a half."""
        return self.drive is not None or any(isinstance(a, Give) for a in self.do)

    @property
    def monitors(self) -> frozenset[str]:
        """All it looks at."""
        own = {test.monitor for test in self.when}
        return frozenset(own | {self.drive.monitor} if self.drive else own)


@dataclass(frozen=True)
class Passed:
    """How late a rule acts: at the end of a window, in which what it looks at passed its bound.

    over : how far past it was then, in the unit of the monitor.  part : of its change in that window; 0: just then.
    """

    monitor: str
    over: float
    part: float


# What rules look at and do, in words: for the console, the results and the report.

def did(actions: Iterable[Action]) -> str:
    """Actions in words, one after the other."""
    return ", ".join(_one(a) for a in actions)


def looked_at(test: Test) -> str:
    """A monitor, or `rate of` it."""
    return test.monitor if test.of is Of.VALUE else f"{test.of.value} of {test.monitor}"


def _one(action: Action) -> str:
    match action:
        case Retry():
            return f"window rejected, x{action.window:g}"
        case Substeps():
            return f"{action.half}.substeps {_to(action.count)}"
        case Give():
            return f"{action.half}.{action.name} {_to(action.value)}"
        case UseScheme():
            return f"scheme {action.scheme.value}"
        case Window():
            return f"window {_to(action.size)}" + ("" if math.isnan(action.size.to) else " s at most")
        case Stop():
            return f"stop: {action.reason}" if action.reason else "stop"


def _to(change: Change) -> str:
    return f"x{change.times:g}" if math.isnan(change.to) else f"{change.to:.6g}"


# Names of monitors: what rules may look at, and which output of a half tells it.
#
# Beside those below: `thermal.OUTPUT` and `mechanical.OUTPUT` for any number that a half gives out (`OUTPUT[2]` for the
# second of several), and every probe by its name.

@dataclass(frozen=True)
class Monitor:
    """unit : SI, "1" for a number."""

    meaning: str
    unit: str = "1"


COUPLER = {
    "t": Monitor("end of the window", "s"), "window": Monitor("its size", "s"),
    "number": Monitor("of the window, from 1"), "failures": Monitor("tries in a row that failed"),
    "iterations": Monitor("of the exchange, 1 where the scheme does not iterate"),
    "contraction": Monitor("measured ratio of residuals of plain iteration"),
    "error": Monitor("largest error estimate, in tolerances"),
    **{f"{part}.{name}": Monitor("in tolerances") for part in ("error", "splitting", "own")
       for name in ("temperature", "gap", "heat", "displacement", "elastic_strain")},
    "max_T": Monitor("hottest node", "K"), "max_p": Monitor("largest contact pressure", "Pa"),
    "touching": Monitor("contact quadrature points under pressure"), "imbalance": Monitor("of the heat of the window"),
    "thermal.status": Monitor("0 well, 1 discarded"), "mechanical.status": Monitor("0 well, 1 discarded"),
}
"""Monitors of the coupler; one that a window does not have is not known in it."""

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
