"""Heat and force by name: which outputs of the halves belong to the named conditions, sources and pairs of a scenario.

A scenario, rules and results say `heat.NAME`, `reaction.NAME` and `reaction_moment.NAME`; the halves call them
`condition.heat.NAME` and so on, so that a condition named `flux` is not taken for the mechanism `heat.flux` of the
thermal half, nor one named as a body for `reaction.BODY` of the mechanical half.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from contact.half.functions import field_from
from contact.problem.boundary import FORCES, MOTIONS, TRACTIONS, WEIGHTS
from contact.problem.values import did_you_mean

PREFIXES = ("heat.", "reaction.", "reaction_moment.")
OUTPUT = "condition."
TURNS = (MOTIONS[2], FORCES[2])
TAKEN = frozenset({"flux", "convection", "source", "mechanical", "radiation", "entropy"})
"""Names behind `thermal.heat.` that are mechanisms of the half (docs/design.md)."""
ALONG = {"x": 1, "y": 2}
_PART = re.compile(r"(?P<name>.+?)(?:\[(?P<number>[1-9])\]|\.(?P<along>[xy]))")


@dataclass(frozen=True)
class ConditionOutput:
    """One output.  name : `heat.wall`.  half : "thermal" | "mechanical".  kind : of the condition, in words.

    place : surface, point or body it acts on.  parts : what its numbers are, ("",) of a single one.  unit : SI.
    """

    name: str
    half: str
    kind: str
    place: str
    parts: tuple[str, ...]
    unit: str

    @property
    def output(self) -> str:
        """The name of the half's output."""
        return OUTPUT + self.name

    def to_json(self) -> dict[str, Any]:
        """Plain values that travel as JSON."""
        return {**vars(self), "parts": list(self.parts)}


def condition_output(about: Mapping[str, Any]) -> ConditionOutput:
    """The output behind such values."""
    return ConditionOutput(**{**about, "parts": tuple(about["parts"])})


def condition_outputs(models: Mapping[str, Mapping[str, Any]], pairs: Sequence[str]) -> dict[str, ConditionOutput]:
    """What the halves of this package give out, by name.  models : half -> its model.json.  pairs : their names."""
    return {c.name: c for c in (*_heats(models["thermal"], pairs), *_forces(models["mechanical"]))}


def _heats(model: Mapping[str, Any], pairs: Sequence[str]) -> Iterator[ConditionOutput]:
    for b in model.get("boundary", ()):
        if "name" in b:
            kind = next(k for k in ("temperature", "flux", "convection", "radiation") if k in b)
            place = str(b.get("on", b.get("at", b.get("body"))))
            yield ConditionOutput(f"heat.{b['name']}", "thermal", kind, place, ("",), "J")
    for name, body in model.get("bodies", {}).items():
        if any(not field_from(part.get("Q_T", 0.0)).is_zero for part in (body, *body.get("regions", {}).values())):
            yield ConditionOutput(f"heat.source.{name}", "thermal", "source", name, ("",), "J")
    for pair in pairs:
        yield ConditionOutput(f"heat.pair.{pair}", "thermal", "contact pair", pair, ("slave", "master"), "J")


def _forces(model: Mapping[str, Any]) -> Iterator[ConditionOutput]:
    conditions = list(model.get("boundary", ()))
    gravity = model.get("gravity") or {}
    if "name" in gravity and any(gravity.get(i, 0.0) != 0.0 for i in ("x", "y")):
        conditions.append({"name": gravity["name"], "body": "all bodies", "gravity": True})
    for b in conditions:
        if "name" not in b:
            continue
        key = next(k for k in ("rotation", *MOTIONS, "pressure", *TRACTIONS, *FORCES, *WEIGHTS, "gravity") if k in b)
        place = str(b.get("on", b.get("at", b.get("body"))))
        if key in (*TURNS, "rotation"):
            yield ConditionOutput(f"reaction_moment.{b['name']}", "mechanical", key, place, ("",), "N.m")
        if key not in TURNS:
            yield ConditionOutput(f"reaction.{b['name']}", "mechanical", key, place, ("x", "y"), "N")


def is_condition(text: str) -> bool:
    """Whether a text is `heat.NAME`, `reaction.NAME[2]` or the like."""
    return text.startswith(PREFIXES)


def resolved(text: str, known: Mapping[str, ConditionOutput],
             bodies: Sequence[str]) -> tuple[ConditionOutput, int] | None:
    """The output and its number (from 1) that `heat.NAME`, `reaction.NAME.y` or `reaction.NAME[2]` means.

    `thermal.heat.NAME` and `mechanical.reaction.NAME` mean it too, where the half has no such output of its own.
    None where there is none, and where it is not said which of two numbers.
    """
    half, _, rest = text.partition(".")
    own = half in ("thermal", "mechanical")
    name, number = rest if own else text, 1
    if name not in known and (part := _PART.fullmatch(name)):
        name, number = part["name"], int(part["number"]) if part["number"] else ALONG[part["along"]]
    elif name in known and len(known[name].parts) > 1:
        return None
    output = known.get(name)
    if output is None or number > len(output.parts):
        return None
    # fault: a condition is taken for the output of a half that has its name -> if own and output.half != half: |
    #   coupler/test_named_conditions
    if own and (output.half != half or name.partition(".")[2] in (*TAKEN, *bodies)):
        return None
    return output, number


def remedy(text: str, known: Mapping[str, ConditionOutput]) -> str:
    """What could be meant by a text that means nothing."""
    every = [f"{c.name}{part}" for c in known.values()
             for part in ([f".{p}" if p in ALONG else f"[{k + 1}]" for k, p in enumerate(c.parts)]
                          if len(c.parts) > 1 else [""])]
    if not any(c.name.startswith(text.partition(".")[0] + ".") for c in known.values()):
        return "Nothing of this scene has one: a condition needs a `name`, and its half must tell its heat or force."
    return did_you_mean(text, every) + " Conditions have these by the `name` they are given."
