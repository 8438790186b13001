"""The scenario file's `rules`, key by key; what they name is looked up in rules.py."""

from __future__ import annotations

import re
from enum import StrEnum
from typing import Annotated, Any

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from contact.problem.part import Entry, Part, exactly_one
from contact.problem.values import Count, Name, NotNegative, Number, Positive, Text, Whole, number, problem
from coupler.scenario.options import Scheme
from coupler.scenario.rule_model import Change, Of

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
        "name of the boundary condition whose factor `load.NAME` is driven; or",
        kind="name",
        default="one of them required")] = None
    bc: Annotated[Name | None, Entry(
        "the added value `bc.NAME` of that condition of `mechanical.elastic`",
        kind="name",
        default="one of them required")] = None
    half: Annotated[HalfName | None, Entry(
        "where both have the name",
        default="the one that has the name")] = None
    so_that: Annotated[dict[Text, Number], Entry(
        "the monitor and its target",
        kind="{MONITOR: target}")] = Field(min_length=1,
                                                                                                          max_length=1)
    scale: Annotated[Scale | None, Entry(
        "whether the load moves by factors (`log`) or by differences",
        default="`log` for `load`, `linear` for `bc`")] = None
    gain: Annotated[Number | None, Entry(
        "change of (the logarithm of) the load for a change of (the logarithm of) the monitor; required with "
        "`linear`, and below 0 there if the monitor falls where the load grows",
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
            if self.gain is not None and self.gain <= 0.0:
                raise problem("must be greater than zero: the load moves in its logarithm, and so does the monitor",
                              "Or give `scale: linear`, where a gain below 0 is for a monitor that falls where the "
                              "load grows.", at=("gain",))
        elif not self.gain:
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

    name: Annotated[Text, Entry("name of the rule in messages and results; each name only once")]
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
    after: Annotated[NotNegative, Entry("acts only in windows that end after this time", unit="s")] = 0.0
    until: Annotated[Positive | None, Entry(
        "acts only in windows that end at this time or before", unit="s", default="the end")] = None
    # fault: a key that a page's fragment has is unknown -> cool_down: Annotated[Count, Entry( |
    #   test_docs::test_yaml_is_understood
    cooldown: Annotated[Count, Entry(
        "number of windows after a firing in which the rule does not act",
        kind="count")] = 0

    @model_validator(mode="after")
    def _does_something(self) -> RuleSpec:
        if not self.name.strip():
            raise problem("a rule needs a name, for its firings are told by it", at=("name",))
        if not self.do and self.drive is None:
            raise problem("a rule needs `do` or `drive`")
        if self.until is not None and self.until <= self.after:
            raise problem(f"until is not later than after, {self.after:g} s", at=("until",))
        for name, given in self.when.items():
            if (name == "any") != isinstance(given, tuple):
                raise problem("a list stands under `any`, and only there", at=("when", name))
        kinds = [next(n for n in ActionSpec.model_fields if getattr(a, n) is not None) for a in self.do]
        if "retry" in kinds and ("stop" in kinds or self.drive is not None):
            raise problem("a window that is rejected can neither end the run nor move a load",
                          "Make two rules of it.", at=("do",))
        if self.do and not self.when and not self.once and self.until is None:
            raise problem("a rule without `when` acts in every window", "Give `when`, or `once: true`.")
        return self
