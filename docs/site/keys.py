"""Writes the key tables of docs/scenario.md from the classes that declare the keys: `python docs/site/keys.py`.

A table stands between `<!-- keys: NAME -->` and `<!-- end of keys -->`; tests/coupler/test_scenario_docs.py says when
one is stale.  TABLES names what is written where.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from math import inf
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from contact.problem import curves, flow, laws, material, mechanical, pairs, thermal, values
from contact.problem.boundary import Supported
from contact.problem.part import Entry, Part
from coupler.scenario import bodies, coupling_schema, mesh, options, rule_schema, schema

PAGE = Path(__file__).resolve().parents[1] / "scenario.md"
MARK = re.compile(r"<!-- keys: (\S+) -->\n(.*?)<!-- end of keys -->\n", re.S)


@dataclass(frozen=True)
class Table:
    """part : whose keys.  prefix : before each.  third : head of the third column.  without : keys told elsewhere."""

    part: type[Part]
    prefix: str = ""
    third: str = "default"
    without: frozenset[str] = frozenset()


def _but(*names: str) -> frozenset[str]:
    return frozenset(names)


TABLES = {
    "top": Table(schema.ScenarioFile),
    "material": Table(material.Material, third="needed by", without=_but("plastic", "creep", "liquid", "latent")),
    "latent": Table(material.Latent, "latent."),
    "axes": Table(material.Axes, "k."),
    "plastic": Table(flow.Plastic, "plastic."),
    "linear": Table(flow.LinearHardening, "plastic.hardening."),
    "voce": Table(flow.VoceHardening, "plastic.hardening."),
    "table": Table(flow.TableHardening, "plastic.hardening."),
    "creep": Table(flow.Creep, "creep."),
    "liquid": Table(flow.Liquid, "liquid."),
    "body": Table(bodies.MeshedBody),
    "run": Table(bodies.FromRun, "T0."),
    "region": Table(bodies.Region, "regions.NAME."),
    "block": Table(bodies.Block, "regions.NAME.rectangle."),
    "rectangle": Table(mesh.Rectangle),
    "file": Table(mesh.MeshFile),
    "contact": Table(pairs.ContactPair),
    "thermal": Table(schema.Thermal),
    "bind": Table(schema.Binding, "bind.NAME."),
    "thermal_boundary": Table(thermal.ThermalBoundary),
    "mechanical": Table(schema.Mechanical),
    "elastic_boundary": Table(mechanical.ElasticBoundary, third="place"),
    "coupling": Table(coupling_schema.CouplingSpec, without=_but("iteration", "adaptive")),
    "windows": Table(coupling_schema.Windows),
    "adaptive": Table(coupling_schema.AdaptiveSpec),
    "iteration": Table(options.Iteration),
    "rule": Table(rule_schema.RuleSpec, without=_but("when", "drive", "do")),
    "condition": Table(rule_schema.Condition),
    "action": Table(rule_schema.ActionSpec),
    "drive": Table(rule_schema.DriveSpec),
    "probe": Table(schema.ProbeSpec),
    "place": Table(schema.Place),
    "output": Table(schema.OutputSpec),
    "study": Table(schema.StudySpec),
    "property_table": Table(curves.PropertyTable),
}
WORDS = ((curves.SignalSpec, "SIGNAL"), (curves.FieldSpec, "FIELD"), (curves.PropertySpec, "PROPERTY"),
         (curves.PhasedSpec, "PHASED"), (laws.LawSpec, "LAW"), (values.Positive, "number > 0"),
         (values.NotNegative, "number >= 0"), (values.Whole, "whole number >= 1"), (values.Count, "whole number"),
         (values.Number, "number"), (values.Flag, "true, false"), (values.Name, "name"), (values.Text, "text"),
         (values.DottedName, "name"), (pairs.Stiffness, "number > 0 or `auto`"), (bool, "true, false"))
# Mappings that have a table of their own.
APART = (flow.Plastic, flow.Creep, flow.Liquid, material.Latent, material.Material, schema.Thermal, schema.Mechanical,
         coupling_schema.CouplingSpec, schema.OutputSpec, schema.StudySpec, options.Iteration,
         coupling_schema.AdaptiveSpec, rule_schema.DriveSpec, options.ErrorTolerances, options.Tolerances,
         mesh.Rectangle, mesh.MeshFile, coupling_schema.Windows)
ALWAYS = {options.ErrorTolerances, options.Tolerances}  # flattened though apart from others


def rows(table: Table) -> Iterator[tuple[str, str, str, str]]:
    """Key, type and unit, default, meaning of each key."""
    yield from _rows(table.part, table.prefix, table.without)


def _rows(part: type[Part], prefix: str, without: frozenset[str]) -> Iterator[tuple[str, str, str, str]]:
    hints = get_type_hints(part, include_extras=True)
    own = () if issubclass(part, Supported) else tuple(n for n in part.__annotations__ if n in part.model_fields)
    for name in dict.fromkeys((*own, *part.model_fields)):
        field = part.model_fields[name]
        if name in without:
            continue
        key, hint = prefix + (field.alias or name), _bare(hints[name])
        entry = part.entry(name) or Entry("")
        inner, many = _part_in(hint)
        if inner is not None and not entry.kind and (inner not in APART or inner in ALWAYS):
            if entry.default:
                yield key, "mapping", entry.default, entry.text
            yield from _rows(inner, f"{key}.{'NAME.' if many else ''}", frozenset())
            continue
        yield key, _kind(hint, entry), _default(field, entry), ". ".join(t for t in (entry.text,
                                                                                    entry.why.rstrip(".")) if t)


def _bare(hint: Any) -> Any:
    """A type without None and without what is said of its key."""
    if get_origin(hint) is Annotated:
        origin, *metadata = get_args(hint)
        rest = tuple(m for m in metadata if not isinstance(m, Entry))
        bare = _bare(origin) if not rest else origin
        return Annotated[(bare, *rest)] if rest else bare
    if get_origin(hint) in (Union, UnionType):
        left = [a for a in get_args(hint) if a is not NoneType]
        return _bare(left[0]) if len(left) == 1 else hint
    return hint


def _part_in(hint: Any) -> tuple[type[Part] | None, bool]:
    """The mapping a key holds, and whether it holds many by name."""
    if isinstance(hint, type) and issubclass(hint, Part):
        return hint, False
    if get_origin(hint) is dict:
        inner = _bare(get_args(hint)[1])
        return (inner, True) if isinstance(inner, type) and issubclass(inner, Part) else (None, True)
    return None, False


def _kind(hint: Any, entry: Entry) -> str:
    word = entry.kind or _word(hint)
    if entry.temperature:
        word = word.replace("number", "temperature") if "number" in word else f"{word}, temperature"
    elif not entry.kind or ">" not in entry.kind:
        word += _bounds(word, entry)
    if entry.unit and not entry.temperature and f", {entry.unit}" not in word:
        word += f", {entry.unit}"
    return word


def _word(hint: Any) -> str:
    for known, word in WORDS:
        if hint == known:
            return word
    if isinstance(hint, type) and issubclass(hint, Enum):
        return ", ".join(f"`{member.value}`" for member in hint)
    if get_origin(hint) is Literal:
        return ", ".join(f"`{value}`" for value in get_args(hint))
    if get_origin(hint) is tuple:
        return "[x, y]" if len(get_args(hint)) == 2 and get_args(hint)[1] is not Ellipsis else "[...]"
    if get_origin(hint) is dict:
        return f"name -> {_word(_bare(get_args(hint)[1]))}"
    if isinstance(hint, type) and issubclass(hint, Part):
        return "mapping"
    if get_origin(hint) is Annotated:
        return _word(_bare(get_args(hint)[0]))
    return "see below"


def _bounds(word: str, e: Entry) -> str:
    if ">" in word:
        return ""
    if e.above > -inf and e.below < inf:
        return f", {e.above:g} < value < {e.below:g}"
    if e.above > -inf:
        return f", in ({e.above:g}, {e.most:g}]" if e.most < inf else f" > {e.above:g}"
    if e.least > -inf:
        return f", {e.least:g} to {'below ' if e.below < inf else ''}{min(e.most, e.below):g}" if min(
            e.most, e.below) < inf else f" >= {e.least:g}"
    return f", at most {e.most:g}" if e.most < inf else ""


def _default(field: Any, entry: Entry) -> str:
    if entry.default:
        return entry.default
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    if isinstance(value, Enum):
        return f"`{value.value}`"
    if value is None or value == {} or isinstance(value, Part):
        return "none" if not isinstance(value, Part) else ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(f'{v:g}' for v in value)}]" if value else "none"
    return f"{value:.12g}" if isinstance(value, float) else f"`{value}`" if isinstance(value, str) else str(value)


def written(table: Table) -> str:
    """The table as the page has it."""
    head = f"| key | type, unit | {table.third} | meaning |\n|---|---|---|---|\n"
    return head + "".join(f"| `{key}` | {kind} | {default} | {text} |\n" for key, kind, default, text in rows(table))


def page(text: str) -> str:
    """The page with every table written anew."""
    return MARK.sub(lambda m: f"<!-- keys: {m.group(1)} -->\n{written(TABLES[m.group(1)])}<!-- end of keys -->\n", text)


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
