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

from coupler.scenario.document import DottedName, Name, NotNegative, Number, Positive, Text, Whole, number, problem
from coupler.scenario.mesh import Body
from coupler.scenario.options import Acceleration, OnCycle, OnMax, Scheme, Seen, Tolerance, Tolerances
from coupler.scenario.options import Adaptive as Sizes
from coupler.scenario.options import ErrorTolerances as ErrorOptions
from coupler.scenario.options import Iteration as IterationOptions
from coupler.scenario.physics import ContactPair, Material, Mechanical, Thermal
from coupler.scenario.rule_model import Change, Of
from coupler.scenario.values import Part, SignalSpec, exactly_one

# The scenario file's `study`: a grid of runs, and what their errors are measured against (docs/study.md).

Values = tuple[Any, ...]


class StudyReference(Part):
    """scheme, with windows `finer` times as fine as the finest of the grid, after `set`; or the answer in `file`.

    error : what the author of a file says of it, as the errors of the study are measured.
    """

    scheme: Scheme = Scheme.ITERATED
    finer: Whole = 4
    set: dict[Text, Any] = Field(default_factory=dict)
    file: Text | None = None
    error: NotNegative | None = None

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

    grid: tuple[dict[Text, Values], ...] = ()
    measure: tuple[DottedName, ...] = ()
    span: tuple[Number, Number] | None = None
    reference: StudyReference = StudyReference()

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

ERROR_DEFAULT = ErrorOptions()


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


class ErrorTolerances(Part):
    """What error a window may make, a quantity each."""

    temperature: TemperatureError = TemperatureError()
    gap: GapError = GapError()
    heat: HeatError = HeatError()
    displacement: DisplacementError = DisplacementError()

    @property
    def method(self) -> ErrorOptions:
        """The checked values."""
        parts = (self.temperature, self.gap, self.heat, self.displacement)
        return ErrorOptions(*(Tolerance(q.atol, q.rtol) for q in parts))


# The scenario file's `coupling.adaptive`, `coupling.events` and `coupling.stop`.

# Windows shorter than this share of the first are a sign that something else is wrong.
LEAST = 1e-6


class Adaptive(Part):
    """Windows that find their own size [s] from the error they make."""

    first: Positive
    least: Positive | None = None
    most: Positive | None = None
    tolerance: ErrorTolerances = ErrorTolerances()

    @model_validator(mode="after")
    def _in_order(self) -> Adaptive:
        if self.least is not None and self.least > self.first:
            raise problem("the first window is shorter than the least", at=("least",))
        if self.most is not None and self.most < self.first:
            raise problem("the first window is longer than the most", at=("most",))
        return self

    def sizes(self, end: float) -> Sizes:
        """The checked values for a run of `end` seconds."""
        first = min(self.first, end)
        least = self.least if self.least is not None else LEAST * first
        most = self.most if self.most is not None else end
        return Sizes(first, min(least, first), min(most, end), self.tolerance.method)


class Events(Part):
    """locate : end windows where contact opens, closes, sticks or slips.  tolerance [s]: how nearly.

    branches : and where a gap or a pressure passes a bend of a law.
    """

    locate: bool | None = None
    tolerance: Positive | None = None
    branches: StrictBool = False

    @model_validator(mode="after")
    def _are_located(self) -> Events:
        if self.branches and self.locate is False:
            raise problem("branches are events, and events are not located", "Leave locate out.", at=("branches",))
        return self


class Stop(Part):
    """steady [K/s]: stop once the temperature of no node changes faster for two windows."""

    steady: NotNegative | None = None


# The scenario file's `coupling.iteration`; defaults and their reasons are those of coupler.scenario.options.

METHOD = IterationOptions()
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

    temperature: TemperatureTolerance = TemperatureTolerance()
    gap: GapTolerance = GapTolerance()
    pressure: PressureTolerance = PressureTolerance()
    solid_fraction: SolidFractionTolerance = SolidFractionTolerance()


class Iteration(Part):
    """How `iterated` goes to agreement; other schemes do not read it."""

    acceleration: Acceleration = METHOD.acceleration
    relaxation: Positive = METHOD.relaxation
    max_iterations: Whole = METHOD.max_iterations
    on_max: OnMax = METHOD.on_max
    reuse: NotNegative = float(METHOD.reuse)
    tolerance: IterationTolerances = IterationTolerances()
    level: Seen = METHOD.level

    @model_validator(mode="after")
    def _in_bounds(self) -> Iteration:
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
    def method(self) -> IterationOptions:
        """The checked values."""
        t = self.tolerance
        tolerances = Tolerances(
            *(Tolerance(q.atol, q.rtol) for q in (t.temperature, t.gap, t.pressure, t.solid_fraction)))
        return IterationOptions(self.acceleration, self.relaxation, self.max_iterations, self.on_max, int(self.reuse),
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

    above: Number | None = None
    below: Number | None = None
    between: tuple[Number, Number] | None = None
    of: Of = Of.VALUE
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

    window: Positive = 0.5
    least: NotNegative = 0.0

    @model_validator(mode="after")
    def _smaller(self) -> RetrySpec:
        if self.window >= 1.0:
            raise problem("must be less than 1, or the same window would fail again", at=("window",))
        return self


class SubstepsSpec(Part):
    """Substeps of one half or both, kept in [least, most]."""

    thermal: NewValue | None = None
    mechanical: NewValue | None = None
    least: Whole = 1
    most: Whole = 64

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

    thermal: Text | None = None
    mechanical: Text | None = None

    @model_validator(mode="after")
    def _one(self) -> MethodSpec:
        if self.thermal is None and self.mechanical is None:
            raise problem("a half is needed: thermal or mechanical")
        return self


class ActionSpec(Part):
    """One thing that a rule does."""

    retry: RetrySpec | None = None
    substeps: SubstepsSpec | None = None
    method: MethodSpec | None = None
    scheme: Scheme | None = None
    window: NewValue | None = None
    set: dict[Text, NewValue] | None = None
    stop: Text | None = None

    @model_validator(mode="after")
    def _one(self) -> ActionSpec:
        exactly_one(self, type(self).model_fields)
        if self.window is not None and self.window.to <= 0.0:
            raise problem("must be greater than zero", at=("window",))
        return self


class DriveSpec(Part):
    """A load, or bc, driven so that a monitor holds a target."""

    load: Name | None = None
    bc: Name | None = None
    half: HalfName | None = None
    so_that: dict[Text, Number] = Field(min_length=1, max_length=1)
    scale: Scale | None = None
    gain: Positive | None = None
    first: Number | None = None
    least: Number | None = None
    most: Number | None = None
    rate: Positive | None = None
    lag: NotNegative = 0.0

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

    name: Text
    when: When = Field(default_factory=dict)
    do: tuple[ActionSpec, ...] = ()
    drive: DriveSpec | None = None
    once: bool = False
    after: NotNegative = 0.0
    until: Positive | None = None
    # fault: a key that a page's fragment has is unknown -> cool_down: NotNegative = 0.0 |
    #   test_docs::test_yaml_is_understood
    cooldown: NotNegative = 0.0

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


FORMAT_VERSION = 1


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

    temperature: TemperatureUnit


class Windows(Part):
    """Windows up to `until` [s]: all of one size, or growing (shrinking) geometrically, first to last [s]."""

    until: Positive
    size: Positive | None = None
    first: Positive | None = None
    last: Positive | None = None

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


class Substeps(Part):
    """Substeps of each half in a window."""

    thermal: Whole = 1
    mechanical: Whole = 1


class Coupling(Part):
    """end [s], runs begin at 0; kinks [s] besides those of the signals; link to the contact service."""

    scheme: Scheme = Scheme.STAGGERED
    iteration: Iteration = Iteration()
    end: Positive
    kinks: tuple[Number, ...] = ()
    windows: tuple[Windows, ...] | None = None
    adaptive: Adaptive | None = None
    events: Events = Events()
    on_cycle: OnCycle | None = None
    stop: Stop = Stop()
    substeps: Substeps = Substeps()
    link: Text = "direct"

    @model_validator(mode="after")
    def _one_way_to_size(self) -> Coupling:
        exactly_one(self, ("windows", "adaptive"))
        return self

    @model_validator(mode="after")
    def _link_known(self) -> Coupling:
        if self.link not in ("direct", "codec") and not self.link.startswith("zenoh:"):
            raise problem("unknown link", "Known here: direct, codec, zenoh:ENDPOINT.", at=("link",))
        return self


class Place(Part):
    """A point of a body's reference mesh (at [m], body), or the max, min or mean over a surface."""

    at: tuple[Number, Number] | None = None
    body: Name | None = None
    max: Text | None = None
    min: Text | None = None
    mean: Text | None = None

    @model_validator(mode="after")
    def _one_form(self) -> Place:
        form = exactly_one(self, ("at", "max", "min", "mean"))
        if (form == "at") != (self.body is not None):
            raise problem("`at` and `body` go together")
        return self


ProbeTarget = Text | Place


HALVES = ("thermal.", "mechanical.")  # a probe of any output of a half is named HALF.OUTPUT


class Probe(Part):
    """One quantity of the exchange, or one output of a half by its name, and where."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, ProbeTarget]

    T: ProbeTarget | None = None
    u_x: ProbeTarget | None = None
    u_y: ProbeTarget | None = None
    gap: ProbeTarget | None = None
    p: ProbeTarget | None = None
    f_s: ProbeTarget | None = None

    @classmethod
    def _knows(cls, key: object) -> bool:
        return super()._knows(key) or (isinstance(key, str) and key.startswith(HALVES))

    @model_validator(mode="after")
    def _one_quantity(self) -> Probe:
        exactly_one(self, (*type(self).model_fields, *self.__pydantic_extra__))
        return self

    @property
    def quantity(self) -> str:
        """The key that is given."""
        return next(n for n in (*type(self).model_fields, *self.__pydantic_extra__) if getattr(self, n) is not None)


class Fields(Part):
    """When fields are kept: every so many windows, and at the first window end at or after times [s]."""

    every: Whole | None = None
    at: tuple[NotNegative, ...] = ()


class Output(Part):
    """What is recorded besides the probes, which are kept at every window.

    checkpoint : least wall time between two checkpoints [s]; 0: after every window; null: none, and no resume.
    """

    fields: Fields = Fields()
    checkpoint: NotNegative | None = 30.0


class ScenarioFile(Part):
    """The whole file."""

    slideline: Whole
    title: Text = ""
    units: Units
    geometry: Geometry
    signals: dict[Name, SignalSpec] = Field(default_factory=dict)
    materials: dict[Name, Material] = Field(min_length=1)
    bodies: dict[Name, Body] = Field(min_length=1)
    contact: dict[Name, ContactPair] = Field(default_factory=dict)
    thermal: Thermal
    mechanical: Mechanical
    coupling: Coupling
    rules: tuple[RuleSpec, ...] = ()
    probes: dict[DottedName, Probe] = Field(default_factory=dict)
    output: Output = Output()
    study: StudySpec | None = None

    @model_validator(mode="after")
    def _version_known(self) -> ScenarioFile:
        if self.slideline != FORMAT_VERSION:
            raise problem("a version of the scenario form this program does not know",
                          f"It reads version {FORMAT_VERSION}.", at=("slideline",))
        return self
