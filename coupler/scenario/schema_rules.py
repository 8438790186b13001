"""The scenario file's `rules`: their form.  What they name is looked up in rules_of.py."""

from __future__ import annotations

import re
from enum import StrEnum
from typing import Annotated, Any

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from coupler.rules.model import Change, Of
from coupler.scenario.base import Part, exactly_one
from coupler.scenario.options import Scheme
from coupler.scenario.quantity import Name, NotNegative, Number, Positive, Text, Whole, number, problem

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
