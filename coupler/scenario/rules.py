"""From the rules of a scenario to those of a run: names looked up, temperatures in kelvin."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from contact.problem.mechanical import Solution
from contact.problem.thermal import Method
from contact.problem.values import did_you_mean
from coupler.scenario import rule_model
from coupler.scenario.conditions import ConditionOutput, is_condition, remedy, resolved
from coupler.scenario.document import Key
from coupler.scenario.frozen_entropy import frozen_entropy_wrong
from coupler.scenario.kinds import OWN
from coupler.scenario.rule_model import (
    Action,
    Drive,
    Give,
    Of,
    Retry,
    Rule,
    Stop,
    Substeps,
    Test,
    UseScheme,
    When,
    Window,
)
from coupler.scenario.rule_model import Change as NewValue
from coupler.scenario.rule_schema import ActionSpec, Condition, Conditions, DriveSpec, HalfName, RuleSpec
from coupler.scenario.scene import Context

# control.method of our own halves (docs/design.md); 0 is the method of the scenario.
THERMAL_METHODS = {"own": 0} | {method.value: number for number, method in enumerate(Method, start=1)}
SMALL_METHODS = {n: k for n, k in THERMAL_METHODS.items() if n != Method.STEADY.value}
ELASTIC_METHODS = {"own": 0} | {method.value: number for number, method in enumerate(Solution, start=1)}
METHODS: Mapping[str, Mapping[str, int]] = {
    "thermal": THERMAL_METHODS, "lumped": SMALL_METHODS, "thermal_rod": SMALL_METHODS, "elastic": ELASTIC_METHODS}
HALVES = tuple(h.value for h in HalfName)


def rules_of(c: Context, models: Mapping[str, Mapping[str, Any]], conditions: Mapping[str, ConditionOutput],
             least: float = 0.0) -> tuple[Rule, ...]:
    """The rules, in the order of the file.  models : as written for both halves.  Raises ScenarioError.

    conditions : by name, whose heat and force are known.
    least : no adaptive window is shorter [s].
    """
    found: list[Rule] = []
    for i, spec in enumerate(c.file.rules):
        if any(r.name == spec.name for r in found):
            c.found.wrong(("rules", i, "name"), f"there is another rule {spec.name!r}",
                          "Firings are told by name; give each rule its own.")
        with c.found.each():
            found.append(_Reader(c, models, conditions, ("rules", i), least).rule(spec))
    return tuple(found)


class _Reader:
    """Reads one rule.  key : its place in the file.  least : of windows [s]."""

    def __init__(self, c: Context, models: Mapping[str, Mapping[str, Any]], conditions: Mapping[str, ConditionOutput],
                 key: Key, least: float) -> None:
        self._c, self._models, self._conditions, self._key, self._least = c, models, conditions, key, least

    def rule(self, spec: RuleSpec) -> Rule:
        do = tuple(a for i, action in enumerate(spec.do) for a in self._actions(action, (*self._key, "do", i)))
        # A time that is not given bounds nothing: a run begins at 0, and no window ends there.
        return Rule(spec.name, self._when(spec), do, self._drive(spec.drive) if spec.drive else None, spec.once,
                    spec.after, spec.until if spec.until is not None else math.inf, spec.cooldown)

    def _when(self, spec: RuleSpec) -> When:
        key = (*self._key, "when")
        single = {n: given for n, given in spec.when.items() if isinstance(given, Condition)}
        groups = spec.when.get("any", ())
        assert not isinstance(groups, Condition), "the schema has seen to it"
        return When(self._tests(single, key),
                    tuple(self._tests(group, (*key, "any", i)) for i, group in enumerate(groups)))

    def _tests(self, conditions: Conditions, key: Key) -> tuple[Test, ...]:
        return tuple(self._test(name, spec, (*key, name)) for name, spec in conditions.items())

    def _test(self, name: str, spec: Condition, key: Key) -> Test:
        monitor, is_T = self._monitor(name, key)
        low, high = spec.bounds
        places: tuple[Key, Key] = (("between", 0), ("between", 1)) if spec.between is not None else (
            ("above",), ("below",))

        def bound(value: float | None, place: Key, none: float) -> float:
            if value is None:
                return none
            # fault: a rule's temperature taken for kelvin -> return self._c.convert.kelvin(value, (*key, *place)) if
            #   False else value | coupler/test_scenario_rules
            return self._c.convert.kelvin(value, (*key, *place)) if is_T and spec.of is Of.VALUE else value

        return Test(monitor, spec.of, bound(low, places[0], -math.inf), bound(high, places[1], math.inf), spec.windows)

    def _monitor(self, name: str, key: Key) -> tuple[str, bool]:
        """Its full name, and whether it is a temperature.  Raises ScenarioError."""
        probes, full = self._c.file.probes, rule_model.full_name(name)
        if of := resolved(name, self._conditions, self._c.interface.bodies):
            output, number = of
            full = f"{output.half}.{output.output}" + (f"[{number}]" if len(output.parts) > 1 else "")
        if name in probes and full is not None:
            raise self._c.document.error(key, f"{name} is a monitor and a probe", "Give the probe another name.")
        if name in probes:
            return name, probes[name].T is not None
        if full is None and is_condition(name):
            raise self._c.document.error(key, "no condition has this", remedy(name, self._conditions))
        if full is None:
            known = (*rule_model.COUPLER, *rule_model.SHORT, *probes)
            raise self._c.document.error(
                key, "there is no such monitor or probe", did_you_mean(name, known)
                + " Numbers that a half gives out are thermal.NAME and mechanical.NAME.")
        return full, name in rule_model.LEVELS_OF_T

    def _actions(self, spec: ActionSpec, key: Key) -> Iterator[Action]:
        if spec.retry is not None:
            yield Retry(spec.retry.window, max(spec.retry.least, self._least))
        if spec.substeps is not None:
            for half in HALVES:
                if (change := getattr(spec.substeps, half)) is not None:
                    yield Substeps(half, NewValue(change.to, change.times, spec.substeps.least, spec.substeps.most))
        if spec.method is not None:
            for half in HALVES:
                if (name := getattr(spec.method, half)) is not None:
                    yield Give(half, "control.method", NewValue(to=self._method(half, name, (*key, "method", half))))
        if (lack := frozen_entropy_wrong(self._c.file, spec.scheme, (*key, "scheme"))) is not None:
            raise self._c.document.error(lack.key, lack.text, lack.remedy)
        if spec.scheme is not None:
            yield UseScheme(spec.scheme)
        if spec.window is not None:
            yield Window(spec.window)
        for name, change in (spec.set or {}).items():
            yield self._give(name, change, (*key, "set", name))
        if spec.stop is not None:
            yield Stop(spec.stop)

    def _method(self, half: str, name: str, key: Key) -> int:
        kind = str(self._models[half]["half"])
        known = METHODS.get(kind)
        if known is None:
            raise self._c.document.error(key, f"the half {kind!r} has no other methods",
                                         "Leave `method` out for this half.")
        if name not in known:
            raise self._c.document.error(key, f"the half {kind!r} has no such method", did_you_mean(name, known))
        if name == "theta" and "theta" not in self._models[half]:
            raise self._c.document.error(key, "the method theta needs the value of theta",
                                         "Give `thermal.theta`, 0.5 to 1, beside `thermal.method`.")
        if name == "explicit" and "dynamics" not in self._models[half]:
            raise self._c.document.error(key, "the method explicit needs inertia",
                                         "Add mechanical.elastic.dynamics.")
        settle = [n for n, pair in self._models[half]["pairs"].items() if pair.get("augmented") is not None]
        # fault: a rule takes explicit steps with pressures that never settle -> if False: |
        #   coupler/test_scenario_rules::test_a_rule_takes_no_explicit_steps_where_pressures_settle
        if name == "explicit" and settle:
            stated = self._c.file.contact[settle[0]].augmented is not None
            raise self._c.document.error(
                key, f"the method explicit finds no equilibrium in which the pressures of contact.{settle[0]} settle",
                (f"Leave contact.{settle[0]}.augmented out" if stated else
                 f"Write contact.{settle[0]}.augmented: null: what is tied settles by default")
                + ": the pair then acts by its penalty alone in the whole run; or choose another method.")
        return known[name]

    def _give(self, name: str, change: NewValue, key: Key) -> Give:
        head, _, rest = name.partition(".")
        half, kind_and_name = (head, rest) if head in HALVES else (None, name)
        kind, _, condition = kind_and_name.partition(".")
        if kind not in ("load", "bc") or not condition:
            raise self._c.document.error(key, "not an input that a rule can set",
                                         "Write load.NAME or bc.NAME, the name being that of a boundary condition.")
        return Give(self._half(kind, condition, half, key), kind_and_name, change, 1.0 if kind == "load" else 0.0)

    def _half(self, kind: str, condition: str, half: str | None, key: Key) -> str:
        """The half that has a condition of this name.  Raises ScenarioError."""
        names = {role: {b["name"] for b in (*model.get("boundary", ()), model.get("gravity", {})) if "name" in b}
                 for role, model in self._models.items()}
        # What another package's half calls its inputs is seen only when it is loaded.
        if half is not None and self._models[half]["half"] not in OWN[half].values():
            return half
        fits = [r for r in HALVES if condition in names[r] and half in (None, r)
                and (kind == "load" or r == "mechanical")]
        if len(fits) == 1:
            return fits[0]
        if fits:
            raise self._c.document.error(key, f"both halves have a condition {condition!r}", "Say which: thermal.load."
                                         f"{condition} or mechanical.load.{condition}; for a drive give `half`.")
        # fault: a condition of the thermal half is said not to be there -> if False: | coupler/test_scenario_rules
        if kind == "bc" and condition in names["thermal"]:
            raise self._c.document.error(key, f"{condition!r} is a condition of the thermal half, which takes load "
                                         "alone", f"Let the rule change load.{condition}, by which the value of the "
                                         "condition is multiplied (give it a value other than 0).")
        known = names["mechanical"] if kind == "bc" else names["thermal"] | names["mechanical"]
        raise self._c.document.error(key, f"there is no named boundary condition {condition!r} that takes {kind}",
                                     did_you_mean(condition, known))

    def _drive(self, spec: DriveSpec) -> Drive:
        key = (*self._key, "drive")
        kind = "load" if spec.load is not None else "bc"
        condition = spec.load or spec.bc or ""
        half = self._half(kind, condition, spec.half.value if spec.half else None, (*key, kind))
        (name, target), = spec.so_that.items()
        at = (*key, "so_that", name)
        monitor, is_T = self._monitor(name, at)
        target = self._c.convert.kelvin(target, at) if is_T else target
        if spec.log and target == 0.0:
            raise self._c.document.error(at, "a target of zero has no logarithm, in which this load moves",
                                         "Give `scale: linear` and a gain.")
        first = spec.begin
        least = spec.least if spec.least is not None else first * 1e-6 if spec.log else -math.inf
        return Drive(half, f"{kind}.{condition}", monitor, target, first, least,
                     spec.most if spec.most is not None else math.inf, spec.log,
                     spec.gain if spec.gain is not None else math.nan, spec.rate if spec.rate is not None else math.inf,
                     spec.lag)
