"""The scenario file, key by key (docs/scenario.md is its reference)."""

from __future__ import annotations

import re
from enum import StrEnum
from typing import Annotated, Any

from pydantic import (
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    StrictBool,
    Tag,
    field_validator,
    model_validator,
)

from contact.problem.curves import SignalSpec
from contact.problem.material import Material
from contact.problem.mechanical import Elastic, Rigid, Rod
from contact.problem.pairs import ContactPair
from contact.problem.part import Entry, Part, exactly_one
from contact.problem.thermal import ThermalSettings
from contact.problem.values import DottedName, Name, NotNegative, Number, Positive, Text, Whole, number, problem
from coupler.scenario.mesh import MeshedBody
from coupler.scenario.options import (
    Acceleration,
    Adaptive,
    ErrorTolerances,
    Iteration,
    OnCycle,
    OnMax,
    Scheme,
    Seen,
    Tolerance,
    Tolerances,
)
from coupler.scenario.rule_model import Change, Of

# The scenario file's `study`: a grid of runs, and what their errors are measured against (docs/study.md).

Values = tuple[Any, ...]


class StudyReference(Part):
    """scheme, with windows `finer` times as fine as the finest of the grid, after `set`; or the answer in `file`.

    error : what the author of a file says of it, as the errors of the study are measured.
    """

    scheme: Annotated[Scheme, Entry("how the reference is computed")] = Scheme.ITERATED
    finer: Annotated[Whole, Entry(
        "its windows are so many times as fine as the finest of the grid")] = 4
    set: Annotated[dict[Text, Any], Entry(
        "what else it changes, such as `{mesh: 2}`",
        kind="{axis: value}",
        default="none")] = Field(default_factory=dict)
    file: Annotated[Text | None, Entry(
        "instead: a stored answer, a results file or a table `.csv` (`t`, then probes by name, SI); relative "
        "to the scenario",
        kind="path",
        default="none")] = None
    error: Annotated[NotNegative | None, Entry(
        "the relative error of that file",
        default="not known")] = None

    @model_validator(mode="after")
    def _one_kind(self) -> StudyReference:
        if self.file is None and self.error is not None:
            raise problem("the error of a reference that is computed is measured", "Leave it out.", at=("error",))
        if self.file is not None and self.set:
            raise problem("a reference is either a file or computed, so there is nothing to set", at=("set",))
        return self


class StudySpec(Part):
    """grid : axis -> values, every combination is run; several grids are put on one chart.

    measure : probes (default: all that change).  span : [from, until], s (default: all of the run).
    """

    grid: Annotated[tuple[dict[Text, Values], ...], Entry(
        "every combination is run. Axes: `scheme`, `half`, `thermal`, `substeps`; the factors `windows`, "
        "`tolerance`, `mesh`; any dotted key",
        kind="{axis: [values]}, or a list of such",
        default="`--grid`")] = ()
    measure: Annotated[tuple[DottedName, ...], Entry(
        "probes whose error counts",
        kind="[probe, ...]",
        default="all that change")] = ()
    span: Annotated[tuple[Number, Number] | None, Entry(
        "from when until when",
        unit="s",
        default="all of the run")] = None
    reference: Annotated[StudyReference, Entry("what the errors are measured against")] = StudyReference()

    @field_validator("grid", mode="before")
    @classmethod
    def _one_or_several(cls, value: Any) -> Any:
        grids = [value] if isinstance(value, dict) else value
        if not isinstance(grids, list | tuple) or not all(isinstance(g, dict) for g in grids):
            raise problem("a grid is a mapping of axes, or a list of such",
                          "For example {scheme: [staggered, iterated]}.")
        for k, grid in enumerate(grids):
            for axis, values in grid.items():
                place = (axis,) if isinstance(value, dict) else (k, axis)
                if not isinstance(values, list | tuple) or not values:
                    raise problem("an axis is a list of values", "Write [a, b, ...].", at=place)
        return tuple(grids)

    @model_validator(mode="after")
    def _in_order(self) -> StudySpec:
        if self.span is not None and self.span[1] <= self.span[0]:
            raise problem("the span ends before it begins", at=("span",))
        return self


# The scenario file's `coupling.adaptive.tolerance`; defaults and reasons are those of coupler.scenario.options.

ERROR_DEFAULT = ErrorTolerances()


class TemperatureError(Part):
    """atol [K]."""

    atol: Positive = ERROR_DEFAULT.temperature.atol
    rtol: NotNegative = ERROR_DEFAULT.temperature.rtol


class GapError(Part):
    """atol [m]."""

    atol: Positive = ERROR_DEFAULT.gap.atol
    rtol: NotNegative = ERROR_DEFAULT.gap.rtol


class HeatError(Part):
    """atol [J]."""

    atol: Positive = ERROR_DEFAULT.heat.atol
    rtol: NotNegative = ERROR_DEFAULT.heat.rtol


class DisplacementError(Part):
    """atol [m]."""

    atol: Positive = ERROR_DEFAULT.displacement.atol
    rtol: NotNegative = ERROR_DEFAULT.displacement.rtol


class ErrorTolerancesSpec(Part):
    """What error a window may make, a quantity each."""

    temperature: Annotated[TemperatureError, Entry(
        "of the error of one window",
        unit="K",
        kind="`{atol, rtol}`",
        default="[coupling.md](coupling.md)")] = TemperatureError()
    gap: Annotated[GapError, Entry(
        "of the error of one window",
        unit="m",
        kind="`{atol, rtol}`",
        default="[coupling.md](coupling.md)")] = GapError()
    heat: Annotated[HeatError, Entry(
        "of the error of one window",
        unit="J",
        kind="`{atol, rtol}`",
        default="[coupling.md](coupling.md)")] = HeatError()
    displacement: Annotated[DisplacementError, Entry(
        "of the error of one window",
        unit="m",
        kind="`{atol, rtol}`",
        default="[coupling.md](coupling.md)")] = DisplacementError()

    @property
    def method(self) -> ErrorTolerances:
        """The checked values."""
        parts = (self.temperature, self.gap, self.heat, self.displacement)
        return ErrorTolerances(*(Tolerance(q.atol, q.rtol) for q in parts))


# The scenario file's `coupling.adaptive`, `coupling.events` and `coupling.stop`.

# Windows shorter than this share of the first are a sign that something else is wrong.
LEAST = 1e-6


class AdaptiveSpec(Part):
    """Windows that find their own size [s] from the error they make."""

    first: Annotated[Positive, Entry(
        "the first window, and the first after a kink or an event; a shorter one follows if its error is too "
        "large",
        unit="s")]
    least: Annotated[Positive | None, Entry(
        "no window is shorter but to end at a kink or an event; at this size an error that is too large is "
        "taken and told",
        unit="s",
        default="1e-6 of `first`")] = None
    most: Annotated[Positive | None, Entry("no window is longer", unit="s", default="`end`")] = None
    tolerance: Annotated[ErrorTolerancesSpec, Entry("of the error of one window")] = ErrorTolerancesSpec()

    @model_validator(mode="after")
    def _in_order(self) -> AdaptiveSpec:
        if self.least is not None and self.least > self.first:
            raise problem("the first window is shorter than the least", at=("least",))
        if self.most is not None and self.most < self.first:
            raise problem("the first window is longer than the most", at=("most",))
        return self

    def sizes(self, end: float) -> Adaptive:
        """The checked values for a run of `end` seconds."""
        first = min(self.first, end)
        least = self.least if self.least is not None else LEAST * first
        most = self.most if self.most is not None else end
        return Adaptive(first, min(least, first), min(most, end), self.tolerance.method)


class Events(Part):
    """locate : end windows where contact opens, closes, sticks or slips.  tolerance [s]: how nearly.

    branches : and where a gap or a pressure passes a bend of a law.
    """

    locate: Annotated[bool | None, Entry(
        "windows end where contact opens, closes, sticks or slips",
        kind="true, false",
        default="true with `adaptive`, else false")] = None
    tolerance: Annotated[Positive | None, Entry(
        "how nearly",
        unit="s",
        default="1e-6 of the window")] = None
    branches: Annotated[StrictBool, Entry(
        "windows end, too, where the least gap or the largest pressure of a pair passes a bend of a law: "
        "`p_max`, `d_cut`, `d_full`, `d_near`, `d_far`; sets `events.locate`")] = False

    @model_validator(mode="after")
    def _are_located(self) -> Events:
        if self.branches and self.locate is False:
            raise problem("branches are events, and events are not located", "Leave locate out.", at=("branches",))
        return self


class StopSpec(Part):
    """steady [K/s]: stop once the temperature of no node changes faster for two windows."""

    steady: Annotated[NotNegative | None, Entry(
        "the run ends, as completed, once no node's temperature changes faster for two windows and no kink "
        "lies ahead",
        unit="K/s",
        default="none")] = None


# The scenario file's `coupling.iteration`; defaults and their reasons are those of coupler.scenario.options.

METHOD = Iteration()
ITERATION_DEFAULT = METHOD.tolerance


class TemperatureTolerance(Part):
    """atol [K]."""

    atol: Positive = ITERATION_DEFAULT.temperature.atol
    rtol: NotNegative = ITERATION_DEFAULT.temperature.rtol


class GapTolerance(Part):
    """atol [m]."""

    atol: Positive = ITERATION_DEFAULT.gap.atol
    rtol: NotNegative = ITERATION_DEFAULT.gap.rtol


class PressureTolerance(Part):
    """atol [Pa]."""

    atol: Positive = ITERATION_DEFAULT.pressure.atol
    rtol: NotNegative = ITERATION_DEFAULT.pressure.rtol


class SolidFractionTolerance(Part):
    """atol [1]."""

    atol: Positive = ITERATION_DEFAULT.solid_fraction.atol
    rtol: NotNegative = ITERATION_DEFAULT.solid_fraction.rtol


class IterationTolerances(Part):
    """A difference passes if it is at most atol + rtol times the largest change over the window."""

    temperature: Annotated[TemperatureTolerance, Entry(
        "of the largest change over the window, so errors of all windows add up to at most 1e-4 of the way a "
        "quantity goes; `atol` > 0 is the floor at rest",
        unit="K",
        kind="`{atol, rtol}`",
        default="1e-4, 1e-4")] = TemperatureTolerance()
    gap: Annotated[GapTolerance, Entry(
        "of every coordinate; 1e-4 of a gas layer of 10 um",
        unit="m",
        kind="`{atol, rtol}`",
        default="1e-9, 1e-4")] = GapTolerance()
    pressure: Annotated[PressureTolerance, Entry(
        "1e-4 of 1 MPa",
        unit="Pa",
        kind="`{atol, rtol}`",
        default="100, 1e-4")] = PressureTolerance()
    solid_fraction: Annotated[SolidFractionTolerance, Entry(
        "0.4 J/kg of aluminium's latent heat, as little as `temperature`'s",
        kind="`{atol, rtol}`",
        default="1e-6, 1e-4")] = SolidFractionTolerance()


class IterationSpec(Part):
    """How `iterated` goes to agreement; other schemes do not read it."""

    acceleration: Annotated[Acceleration, Entry(
        "how the next guess is made",
        why="It converges where the others do, and where several modes are stiff, at the same cost for one.")] = (
            METHOD.acceleration)
    relaxation: Annotated[Positive, Entry(
        "first factor of `aitken` and `iqn_ils`, and that of `constant`, which needs one below 1",
        kind="number in (0, 1]",
        why="Where `T` does not act back, a whole first step makes the second iterate the last.")] = METHOD.relaxation
    max_iterations: Annotated[Whole, Entry(
        "iterates of one window",
        why="Accelerated windows take 2 to 16; one that takes more is cheaper in two halves.")] = METHOD.max_iterations
    on_max: Annotated[OnMax, Entry(
        "what follows then: `stop` ends the run; `accept` goes on, and the window keeps its verdict `max "
        "iterations`",
        why="Halved, the contraction is halved too.")] = METHOD.on_max
    reuse: Annotated[NotNegative, Entry(
        "windows whose residuals `iqn_ils` remembers; nothing is kept over a kink",
        kind="count, 0 for none",
        default="0",
        why="1 or 2 save iterates where slopes hardly change, and cost some where a melting front moves.")] = (
            float(METHOD.reuse))
    tolerance: Annotated[IterationTolerances, Entry("when a window agrees")] = IterationTolerances()
    level: Annotated[Seen, Entry(
        "of which time of its substep the thermal half is given `x` and `t_N`",
        why="`middle` is of second order; `end` is of first order, and with `backward_euler` or `sdirk2` "
            "damps windows of any size.")] = METHOD.level

    @model_validator(mode="after")
    def _in_bounds(self) -> IterationSpec:
        if self.relaxation > 1.0:
            raise problem("a relaxation above 1 leaves the bounds that both iterates keep",
                          "It is a share, above 0 and at most 1.", at=("relaxation",))
        if self.acceleration is Acceleration.CONSTANT and self.relaxation == 1.0:
            raise problem("constant needs a relaxation below 1", "With 1 it would be the acceleration `none`.",
                          at=("relaxation",))
        if self.reuse != int(self.reuse):
            raise problem("windows are counted in whole numbers", at=("reuse",))
        return self

    @property
    def method(self) -> Iteration:
        """The checked values."""
        t = self.tolerance
        tolerances = Tolerances(
            *(Tolerance(q.atol, q.rtol) for q in (t.temperature, t.gap, t.pressure, t.solid_fraction)))
        return Iteration(self.acceleration, self.relaxation, self.max_iterations, self.on_max, int(self.reuse),
                         tolerances, self.level)


# The scenario file's `rules`: their form.  What they name is looked up in rules_of.py.

_TIMES = re.compile(r"x\s*((?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)")


def _change(value: Any) -> Change:
    """A number to set, or `x2`: times 2."""
    if isinstance(value, Change):
        return value
    match = _TIMES.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        if isinstance(value, str) and value[:1] in ("x", "*", "/"):
            raise problem("not a factor", "Write x2 for twice, x.5 for half, or a number.")
        return Change(to=number(value))
    times = float(match.group(1))
    if times == 0.0:
        raise problem("must be greater than zero")
    return Change(times=times)


NewValue = Annotated[Change, BeforeValidator(_change)]


class HalfName(StrEnum):
    THERMAL = "thermal"
    MECHANICAL = "mechanical"


class Scale(StrEnum):
    """In what a driven load moves."""

    LOG = "log"
    LINEAR = "linear"


class Condition(Part):
    """Holds while the monitor (or its change over the window, or that a second) is above, below or between."""

    above: Annotated[Number | None, Entry("the monitor is above it", default="none")] = None
    below: Annotated[Number | None, Entry("the monitor is below it", default="none")] = None
    between: Annotated[tuple[Number, Number] | None, Entry(
        "instead of both; bounds themselves do not count",
        kind="[a, b]",
        default="none")] = None
    of: Annotated[Of, Entry(
        "what is compared: its value, its change since the end of the window before, or that change a second")] = (
            Of.VALUE)
    windows: Whole = Field(default=1, alias="for")

    @model_validator(mode="after")
    def _bounds(self) -> Condition:
        if self.between is not None and (self.above is not None or self.below is not None):
            raise problem("`between` stands for `above` and `below`", "Give one or the other.", at=("between",))
        if self.between is None and self.above is None and self.below is None:
            raise problem("a bound is needed: above, below or between")
        low, high = self.bounds
        if low is not None and high is not None and not low < high:
            raise problem(f"no value is above {low:g} and below {high:g}")
        return self

    @property
    def bounds(self) -> tuple[float | None, float | None]:
        """above, below."""
        return self.between if self.between is not None else (self.above, self.below)


def _form(value: Any) -> str:
    return "<groups>" if isinstance(value, list | tuple) else "<condition>"


Conditions = dict[Text, Condition]
When = dict[Text, Annotated[
    Annotated[Condition, Tag("<condition>")] | Annotated[tuple[Conditions, ...], Tag("<groups>")],
    Discriminator(_form)]]


class RetrySpec(Part):
    """Put the window back and try this share of it, none shorter than least [s]."""

    window: Annotated[Positive, Entry("the share of the window that is tried")] = 0.5
    least: Annotated[NotNegative, Entry("no window is shorter", unit="s")] = 0.0

    @model_validator(mode="after")
    def _smaller(self) -> RetrySpec:
        if self.window >= 1.0:
            raise problem("must be less than 1, or the same window would fail again", at=("window",))
        return self


class SubstepsSpec(Part):
    """Substeps of one half or both, kept in [least, most]."""

    thermal: Annotated[NewValue | None, Entry(
        "a number, or `x2` for twice as many",
        default="as they are")] = None
    mechanical: Annotated[NewValue | None, Entry(
        "the same of the other half",
        default="as they are")] = None
    least: Annotated[Whole, Entry("no fewer")] = 1
    most: Annotated[Whole, Entry("no more")] = 64

    @model_validator(mode="after")
    def _whole(self) -> SubstepsSpec:
        given = {n: c for n in HalfName if (c := getattr(self, n)) is not None}
        if not given:
            raise problem("a half is needed: thermal or mechanical")
        for name, change in given.items():
            if change.to == change.to and (change.to != int(change.to) or change.to < 1):
                raise problem("must be a whole number, 1 or more, or a factor such as x2", at=(name.value,))
        if self.least > self.most:
            raise problem(f"least is {self.least}, more than most, {self.most}", at=("least",))
        return self


class MethodSpec(Part):
    """The solution method of one half or both, by its name in the scenario; own: that of the scenario."""

    thermal: Annotated[Text | None, Entry(
        "the half's method by its name; `own` is that of the scenario",
        default="as it is")] = None
    mechanical: Annotated[Text | None, Entry("the same of the other half", default="as it is")] = None

    @model_validator(mode="after")
    def _one(self) -> MethodSpec:
        if self.thermal is None and self.mechanical is None:
            raise problem("a half is needed: thermal or mechanical")
        return self


class ActionSpec(Part):
    """One thing that a rule does."""

    retry: Annotated[RetrySpec | None, Entry("put the window back and try a share of it")] = None
    substeps: Annotated[SubstepsSpec | None, Entry("other numbers of substeps")] = None
    method: Annotated[MethodSpec | None, Entry("another method of a half")] = None
    scheme: Annotated[Scheme | None, Entry("as `coupling.scheme`")] = None
    window: Annotated[NewValue | None, Entry(
        "`x.5`: windows of half the planned size; `2`: none longer than 2 s",
        kind="number or factor")] = None
    set: Annotated[dict[Text, NewValue] | None, Entry(
        "the factor of a named boundary condition, or what is added to it",
        kind="{load.NAME: number or factor}")] = None
    stop: Annotated[Text | None, Entry(
        "the run ends after this window, as completed, and says why")] = None

    @model_validator(mode="after")
    def _one(self) -> ActionSpec:
        exactly_one(self, type(self).model_fields)
        if self.window is not None and self.window.to <= 0.0:
            raise problem("must be greater than zero", at=("window",))
        return self


class DriveSpec(Part):
    """A load, or bc, driven so that a monitor holds a target."""

    load: Annotated[Name | None, Entry(
        "which input is driven, by the name of its boundary condition; or",
        kind="name",
        default="one of them required")] = None
    bc: Annotated[Name | None, Entry(
        "the same of what is added",
        kind="name",
        default="one of them required")] = None
    half: Annotated[HalfName | None, Entry(
        "where both have the name",
        default="the one that has the name")] = None
    so_that: Annotated[dict[Text, Number], Entry("what is to be held", kind="{MONITOR: target}")] = Field(min_length=1,
                                                                                                          max_length=1)
    scale: Annotated[Scale | None, Entry(
        "in what the load moves",
        default="`log` for `load`, `linear` for `bc`")] = None
    gain: Annotated[Positive | None, Entry(
        "change of (the logarithm of) the load for a change of (the logarithm of) the monitor; required with "
        "`linear`",
        default="measured (`log`)")] = None
    first: Annotated[Number | None, Entry(
        "value at the start (the half begins in equilibrium with it)",
        default="1 (`bc`: 0)")] = None
    least: Annotated[Number | None, Entry("bound", default="1e-6 `first` (`linear`: none)")] = None
    most: Annotated[Number | None, Entry("bound", default="none")] = None
    rate: Annotated[Positive | None, Entry(
        "largest change of (the logarithm of) the load a second; with `log` never more than twice or half in "
        "a window",
        unit="1/s",
        default="none")] = None
    lag: Annotated[NotNegative, Entry(
        "for a monitor that is slow to answer, such as a temperature: it goes to its target with this time "
        "constant. 0 suits one that answers at once, such as a strain rate",
        unit="s")] = 0.0

    @model_validator(mode="after")
    def _one(self) -> DriveSpec:
        exactly_one(self, ("load", "bc"))
        if self.log:
            for name in ("first", "least", "most"):
                if (value := getattr(self, name)) is not None and value <= 0.0:
                    raise problem("must be greater than zero: the load moves in its logarithm",
                                  "Or give `scale: linear` and a gain.", at=(name,))
        elif self.gain is None:
            raise problem("a gain is needed where the load moves linearly",
                          "Give the change of load for a change of the monitor by 1.")
        low, first, high = self.least, self.begin, self.most
        if (low is not None and low > first) or (high is not None and high < first):
            raise problem(f"the first value, {first:g}, is out of its bounds", "Give first, least and most in order.")
        return self

    @property
    def log(self) -> bool:
        return self.scale is Scale.LOG if self.scale is not None else self.load is not None

    @property
    def begin(self) -> float:
        """The first value."""
        return self.first if self.first is not None else 1.0 if self.load is not None or self.log else 0.0


class RuleSpec(Part):
    """When all conditions hold at the end of a window, do; in windows that end in (after, until] [s]."""

    name: Annotated[Text, Entry("by which its firings are told; each rule its own")]
    when: Annotated[When, Entry(
        "all must hold; under `any` stands a list of such mappings, one of which must hold besides",
        kind="{MONITOR: condition}",
        default="always")] = Field(default_factory=dict)
    do: Annotated[tuple[ActionSpec, ...], Entry(
        "what follows, in order; each entry one of those below",
        kind="list",
        default="none")] = ()
    drive: Annotated[DriveSpec | None, Entry(
        "a load that follows a target, below; a rule has `do` or `drive` or both",
        kind="mapping",
        default="none")] = None
    once: Annotated[bool, Entry("fires at most once in a run")] = False
    after: Annotated[NotNegative, Entry("only in windows that end later", unit="s")] = 0.0
    until: Annotated[Positive | None, Entry("and not later than this", unit="s", default="the end")] = None
    # fault: a key that a page's fragment has is unknown -> cool_down: Annotated[NotNegative, Entry( |
    #   test_docs::test_yaml_is_understood
    cooldown: Annotated[NotNegative, Entry(
        "windows that are let pass after it fired",
        kind="count",
        default="0")] = 0.0

    @model_validator(mode="after")
    def _does_something(self) -> RuleSpec:
        if not self.name.strip():
            raise problem("a rule needs a name, for its firings are told by it", at=("name",))
        if not self.do and self.drive is None:
            raise problem("a rule needs `do` or `drive`")
        if self.until is not None and self.until <= self.after:
            raise problem(f"until is not later than after, {self.after:g} s", at=("until",))
        if self.cooldown != int(self.cooldown):
            raise problem("windows are counted in whole numbers", at=("cooldown",))
        for name, given in self.when.items():
            if (name == "any") != isinstance(given, tuple):
                raise problem("a list stands under `any`, and only there", at=("when", name))
        kinds = [next(n for n in ActionSpec.model_fields if getattr(a, n) is not None) for a in self.do]
        if "retry" in kinds and ("stop" in kinds or self.drive is not None):
            raise problem("a window that is put back can neither end the run nor move a load",
                          "Make two rules of it.", at=("do",))
        if self.do and not self.when and not self.once and self.until is None:
            raise problem("a rule without `when` acts in every window", "Give `when`, or `once: true`.")
        return self


VERSION = 2  # of the scenario form; older ones: coupler.scenario.versions


class Geometry(StrEnum):
    """plane: per metre of depth.  axisymmetric: x = r, y = z."""

    PLANE = "plane"
    AXISYMMETRIC = "axisymmetric"


class TemperatureUnit(StrEnum):
    """The unit of every temperature in the file.  Inside all is kelvin."""

    DEGC = "degC"
    K = "K"


class Units(Part):
    """Only temperature has a choice; all else is SI."""

    temperature: Annotated[TemperatureUnit, Entry(
        "unit of every temperature in the file; differences are not converted")]


class Thermal(ThermalSettings):
    """Which half solves for heat, and how."""

    half: Annotated[Text, Entry("in the plane; one temperature a body; conduction along x of rectangles "
                              "([halves.md](halves.md)); or a kind that another package adds, or the path of an FMU "
                              "ending in `.fmu` ([write_a_half.md](write_a_half.md))",
                              kind="`thermal`, `lumped`, `rod`")] = (
        "thermal")
    options: Annotated[dict[str, Any], Entry("for a half of another package, passed on unchanged in its model.json",
                                           kind="mapping", default="none")] = Field(default_factory=dict)


class Mechanical(Part):
    """Which half solves for displacements; the settings of the kinds not chosen stay, so that a swap is one word."""

    half: Annotated[Text, Entry("`--swap mechanical=rigid` changes just this",
                                kind="`elastic`, `rigid`, `rod`, or one that "
                              "another package adds, or the path of an FMU")]
    elastic: Annotated[Elastic | None, Entry("of the half `elastic`")] = None
    rigid: Annotated[Rigid | None, Entry("of the half `rigid`")] = None
    rod: Annotated[Rod | None, Entry("of the half `rod`")] = None
    options: Annotated[dict[str, Any], Entry("for a half of another package, passed on unchanged in its model.json",
                                           kind="mapping", default="none")] = Field(default_factory=dict)


class Windows(Part):
    """Windows up to `until` [s]: all of one size, or growing (shrinking) geometrically, first to last [s]."""

    until: Annotated[Positive, Entry("end of the range", unit="s")]
    size: Annotated[Positive | None, Entry(
        "of its windows, no longer than the range; or",
        unit="s",
        default="this or the two below")] = None
    first: Annotated[Positive | None, Entry(
        "the first, growing or shrinking geometrically",
        unit="s")] = None
    last: Annotated[Positive | None, Entry("to the last", unit="s")] = None

    @model_validator(mode="after")
    def _one_form(self) -> Windows:
        if (self.size is None) == (self.first is None) or (self.first is None) != (self.last is None):
            raise problem("a range of windows has either `size`, or both `first` and `last`")
        return self

    @property
    def sizes(self) -> tuple[float, float]:
        """First and last size [s]."""
        if self.size is not None:
            return self.size, self.size
        assert self.first is not None
        assert self.last is not None
        return self.first, self.last


class SubstepCounts(Part):
    """Substeps of each half in a window."""

    thermal: Annotated[Whole, Entry("substeps of the thermal half in a window")] = 1
    mechanical: Annotated[Whole, Entry("of the mechanical half")] = 1


class CouplingSpec(Part):
    """end [s], runs begin at 0; kinks [s] besides those of the signals; link to the contact service."""

    scheme: Annotated[Scheme, Entry(
        "thermal first (the paper's); mechanics first; both at once; thermal first on extrapolated geometry; the same "
        "along the heat stored, for windows with many thermal substeps; both until they agree, at two solves or more; "
        "mechanics at frozen entropy, for `elastic` with `adiabatic: true`; one of them, the cheapest that is safe, "
        "window by window ([coupling.md](coupling.md)). What each half sees of the other, and the order: "
        "[theory.md](theory.md)",
        kind="`staggered`, `mechanical_first`, `parallel`, `extrapolated`, `along_heat`, `iterated`, `adiabatic`, "
             "`auto`")] = Scheme.STAGGERED
    iteration: Annotated[IterationSpec, Entry(
        "how `iterated` goes to agreement; other schemes do not read it",
        default="")] = IterationSpec()
    end: Annotated[Positive, Entry("runs begin at 0", unit="s")]
    kinks: Annotated[tuple[Number, ...], Entry(
        "times at which windows end and prediction starts afresh, besides the kinks of all signals the chosen "
        "halves use; at those stated here, at jumps, and at kinks of motion and load the thermal half "
        "restarts damped too",
        unit="s",
        kind="[s, ...]",
        default="none")] = ()
    windows: Annotated[tuple[Windows, ...] | None, Entry(
        "ranges, in order, that reach `end` (what lies beyond it is cut off): `{until, size}` or `{until, "
        "first, last}`",
        kind="list",
        default="this or `adaptive`")] = None
    adaptive: Annotated[AdaptiveSpec | None, Entry(
        "windows find their own size from the error they make",
        default="none")] = None
    events: Annotated[Events, Entry("where windows end because of contact")] = Events()
    on_cycle: Annotated[OnCycle | None, Entry(
        "what follows when something goes up and down from window to window: it is only told; the windows "
        "after it are iterated; the window is put back and halved",
        default="`note`; `iterate` with `adaptive` or `auto`")] = None
    stop: Annotated[StopSpec, Entry("when a run ends early")] = StopSpec()
    substeps: Annotated[SubstepCounts, Entry("in a window")] = SubstepCounts()
    link: Annotated[Text, Entry(
        "how the halves reach the contact service",
        kind="`direct`, `codec`, `zenoh:ENDPOINT`")] = "direct"

    @model_validator(mode="after")
    def _one_way_to_size(self) -> CouplingSpec:
        exactly_one(self, ("windows", "adaptive"))
        return self

    @model_validator(mode="after")
    def _link_known(self) -> CouplingSpec:
        if self.link not in ("direct", "codec") and not self.link.startswith("zenoh:"):
            raise problem("unknown link", "Known here: direct, codec, zenoh:ENDPOINT.", at=("link",))
        return self


class Place(Part):
    """A point of a body's reference mesh (at [m], body), or the max, min or mean over a surface."""

    at: Annotated[tuple[Number, Number] | None, Entry(
        "a point in the reference configuration; it moves with the body",
        unit="m")] = None
    body: Annotated[Name | None, Entry("of which body the point is")] = None
    max: Annotated[Text | None, Entry("the largest over a surface or the nodes of a body")] = None
    min: Annotated[Text | None, Entry("the smallest")] = None
    mean: Annotated[Text | None, Entry("the mean by reference area or volume")] = None

    @model_validator(mode="after")
    def _one_form(self) -> Place:
        form = exactly_one(self, ("at", "max", "min", "mean"))
        if (form == "at") != (self.body is not None):
            raise problem("`at` and `body` go together")
        return self


ProbeTarget = Text | Place


HALVES = ("thermal.", "mechanical.")  # a probe of any output of a half is named HALF.OUTPUT


class ProbeSpec(Part):
    """One quantity of the exchange, or one output of a half by its name, and where."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, ProbeTarget]

    T: Annotated[ProbeTarget | None, Entry("temperature", unit="K", kind="place")] = None
    u_x: Annotated[ProbeTarget | None, Entry("displacement", unit="m", kind="place")] = None
    u_y: Annotated[ProbeTarget | None, Entry("displacement", unit="m", kind="place")] = None
    gap: Annotated[ProbeTarget | None, Entry("on contact surfaces only", unit="m", kind="place")] = None
    p: Annotated[ProbeTarget | None, Entry(
        "contact pressure, on contact surfaces only",
        unit="Pa",
        kind="place")] = None
    f_s: Annotated[ProbeTarget | None, Entry(
        "solid fraction, where a material has `latent`",
        kind="place")] = None

    @classmethod
    def knows(cls, key: object) -> bool:
        return super().knows(key) or (isinstance(key, str) and key.startswith(HALVES))

    @model_validator(mode="after")
    def _one_quantity(self) -> ProbeSpec:
        exactly_one(self, (*type(self).model_fields, *self.__pydantic_extra__))
        return self

    @property
    def quantity(self) -> str:
        """The key that is given."""
        return next(n for n in (*type(self).model_fields, *self.__pydantic_extra__) if getattr(self, n) is not None)


class Fields(Part):
    """When fields are kept: every so many windows, and at the first window end at or after times [s]."""

    every: Annotated[Whole | None, Entry(
        "keep fields every so many windows",
        default="never by count")] = None
    at: Annotated[tuple[NotNegative, ...], Entry(
        "keep them at the first window end at or after each time",
        kind="[s, ...]",
        default="none")] = ()


class OutputSpec(Part):
    """What is recorded besides the probes, which are kept at every window.

    checkpoint : least wall time between two checkpoints [s]; 0: after every window; null: none, and no resume.
    """

    fields: Annotated[Fields, Entry("when fields are kept")] = Fields()
    checkpoint: Annotated[NotNegative | None, Entry(
        "least wall time between two checkpoints, from which `slideline resume` goes on; 0: after every "
        "window; null: none, and no resume",
        unit="s",
        kind="number >= 0, or null")] = 30.0


class ScenarioFile(Part):
    """The whole file."""

    slideline: Annotated[Whole, Entry(
        "version of this form; `slideline migrate` writes the newest",
        kind="2")]
    title: Annotated[Text, Entry("shown in results", default="the file's name")] = ""
    units: Annotated[Units, Entry("of temperatures")]
    geometry: Annotated[Geometry, Entry(
        "plane strain, per metre of depth; or x = r, y = z, the whole turn of 2 pi")]
    signals: Annotated[dict[Name, SignalSpec], Entry(
        "data over time, used by name; a signal nobody uses makes no kink",
        kind="name -> SIGNAL",
        default="none")] = Field(default_factory=dict)
    materials: Annotated[dict[Name, Material], Entry(
        "what bodies are made of",
        kind="name -> material")] = Field(min_length=1)
    bodies: Annotated[dict[Name, MeshedBody], Entry("what there is", kind="name -> body")] = Field(min_length=1)
    contact: Annotated[dict[Name, ContactPair], Entry(
        "what may meet",
        kind="name -> pair",
        default="none")] = Field(default_factory=dict)
    thermal: Annotated[Thermal, Entry("the thermal half")]
    mechanical: Annotated[Mechanical, Entry("the mechanical half")]
    coupling: Annotated[CouplingSpec, Entry("how the two exchange")]
    rules: Annotated[tuple[RuleSpec, ...], Entry(
        "what changes when something is seen",
        kind="list",
        default="none")] = ()
    probes: Annotated[dict[DottedName, ProbeSpec], Entry(
        "values over time; names may have dots",
        kind="name -> probe",
        default="none")] = Field(default_factory=dict)
    output: Annotated[OutputSpec, Entry("what is kept")] = OutputSpec()
    study: Annotated[StudySpec | None, Entry(
        "a grid of runs, for `slideline study`",
        default="none")] = None

    @model_validator(mode="after")
    def _version_known(self) -> ScenarioFile:
        if self.slideline > VERSION:
            raise problem("a version of the scenario form this program does not know",
                          f"It reads versions 1 to {VERSION}.", at=("slideline",))
        return self
