"""The form of a scenario file: its JSON Schema for editors, and its versions."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from ruamel.yaml import YAML
from ruamel.yaml.nodes import MappingNode, Node, SequenceNode

from contact.problem.curves import Form, PropertyTable
from contact.problem.laws import Table
from contact.problem.part import Part
from coupler.errors import ScenarioError
from coupler.scenario.coupling_schema import CouplingSpec
from coupler.scenario.document import Key, dotted
from coupler.scenario.options import Scheme
from coupler.scenario.quantities import WITHOUT
from coupler.scenario.schema import VERSION, ScenarioFile

# The JSON Schema of a scenario, so that editors complete and check its keys.

VALUE_WITH_UNIT = r"^\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*[^\s\d].*$"
DRAFT = "https://json-schema.org/draft/2020-12/schema"


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of a scenario file of the newest version.

    It knows keys, types, units (in the descriptions) and bounds; what hangs together across keys only `check` can say.
    """
    schema = _without_titles(ScenarioFile.model_json_schema(mode="validation"))
    plain = {kind.__name__ for kind in WITHOUT}
    # fault: editors mark values with units as wrong -> plain = set(schema["$defs"]) | coupler/test_scenario_units
    schema["$defs"] = {name: part if name in plain else _with_units(part) for name, part in schema["$defs"].items()}
    schema["properties"] = _with_units(schema["properties"])
    # A text such as "mm, MPa, degC" is the mapping `units` in short.
    schema["properties"]["units"] = {"anyOf": [schema["properties"]["units"], {"type": "string"}]}
    schema["properties"]["slideline"] = {"enum": list(range(1, VERSION + 1)), "description": "version of this form"}
    return {"$schema": DRAFT, "$id": f"slideline-scenario-{VERSION}", "title": "Slideline scenario"} | schema


def _with_units(node: Any) -> Any:
    """A schema whose numbers may be texts with a unit; of which kind, `check` says."""
    if isinstance(node, list):
        return [_with_units(value) for value in node]
    if not isinstance(node, dict):
        return node
    made = {key: _with_units(value) for key, value in node.items()}
    if node.get("type") != "number":
        return made
    number = {key: made.pop(key) for key in ("type", "minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum")
              if key in made}
    return {"anyOf": [number, {"type": "string", "pattern": VALUE_WITH_UNIT}]} | made


def _without_titles(node: Any) -> Any:
    """A schema less the titles that only repeat the names of keys."""
    if isinstance(node, dict):
        return {key: _without_titles(value) for key, value in node.items()
                if not (key == "title" and isinstance(value, str))}
    return [_without_titles(value) for value in node] if isinstance(node, list) else node


# Versions of the scenario form: what an older one means by a key it leaves out, and how a file becomes the newest.
#
# A file of version 1 reads with the defaults of version 1; `migrate` writes them out where they differ from today's,
# so a migrated file gives the same numbers.  A later change of a default is a row in DEFAULTS, and the next version.

P = TypeVar("P", bound=Part)


@dataclass(frozen=True)
class Default:
    """What an older version means where a key is left out.  matters : for which parts it changes a number."""

    key: str
    value: Any
    matters: Callable[[Any], bool]


def _bends(table: Any) -> bool:
    """Through two points a cubic is a straight line too."""
    return len(table.T if isinstance(table, PropertyTable) else table.x) > 2


# version -> class of a mapping -> what it means there.
DEFAULTS: Mapping[int, Mapping[type[Part], Default]] = {
    1: {
        # fault: tables of version 1 read as linear -> **{}, | coupler/test_scenario_versions
        PropertyTable: Default("form", Form.CUBIC, _bends),
        Table: Default("form", Form.CUBIC, _bends),
        # fault: files of version 1 run by today's scheme -> **{}, | coupler/test_defaults
        CouplingSpec: Default("scheme", Scheme.STAGGERED, lambda coupling: True),
    },
}


def with_old_defaults(file: ScenarioFile) -> ScenarioFile:
    """Return the file with the defaults of its own version where it leaves keys out."""
    defaults = DEFAULTS.get(file.slideline, {})
    return _rebuilt(file, defaults) if defaults else file


def _rebuilt(value: Any, defaults: Mapping[type[Part], Default]) -> Any:
    if isinstance(value, Part):
        changed = {name: new for name in type(value).model_fields
                   if (new := _rebuilt(old := getattr(value, name), defaults)) is not old}
        if _unsaid(value, defaults):
            default = defaults[type(value)]
            changed[default.key] = default.value
        return value.model_copy(update=changed) if changed else value
    if isinstance(value, tuple):
        made = tuple(_rebuilt(one, defaults) for one in value)
        return made if any(a is not b for a, b in zip(made, value, strict=True)) else value
    if isinstance(value, dict):
        return {key: _rebuilt(one, defaults) for key, one in value.items()}
    return value


def _unsaid(part: Part, defaults: Mapping[type[Part], Default]) -> bool:
    default = defaults.get(type(part))
    return default is not None and default.key not in part.model_fields_set and default.matters(part)


def unsaid(file: ScenarioFile) -> list[tuple[Key, str, str]]:
    """List what the file leaves to its version and would read otherwise today: place, key, value."""
    defaults = DEFAULTS.get(file.slideline, {})
    return [(at, defaults[type(part)].key, defaults[type(part)].value.value) for at, part in _parts(file, ())
            if _unsaid(part, defaults)]


def _parts(value: Any, at: Key) -> Iterator[tuple[Key, Part]]:
    if isinstance(value, Part):
        yield at, value
        for name, field in type(value).model_fields.items():
            yield from _parts(getattr(value, name), (*at, field.alias or name))
    elif isinstance(value, tuple):
        for i, one in enumerate(value):
            yield from _parts(one, (*at, i))
    elif isinstance(value, dict):
        for key, one in value.items():
            yield from _parts(one, (*at, key))


def notice(file: ScenarioFile, name: str) -> list[str]:
    """Say in a sentence that a file is of an older version, and what that means for it."""
    if file.slideline == VERSION:
        return []
    keys = [key for _, key, _ in unsaid(file)]
    n, means = keys.count("form"), []
    if n:
        means.append(f"{n} table{'s' * (n > 1)} without `form` {'are' if n > 1 else 'is'} read as cubic")
    if "scheme" in keys:
        means.append("the scheme that `coupling` does not name is `staggered`")
    return [f"{name} is of version {file.slideline} of the scenario form{', so ' * bool(means)}{' and '.join(means)}; "
            f"`slideline migrate {name}` writes version {VERSION} with the same numbers"]


def migrated(text: str, file: ScenarioFile) -> str:
    """Return the text of a file in the newest version: what it left to its own is written out, nothing else moves.

    Raises ScenarioError where a place cannot be found in the text.
    """
    root = YAML().compose(io.StringIO(text))
    edits: dict[int, tuple[int, str]] = {}
    for at, key, value in unsaid(file):
        node = _node(root, at)
        if not isinstance(node, MappingNode):
            raise ScenarioError("this place cannot be found in the text", key=dotted(at), remedy=f"Add {key}: {value}.")
        if node.flow_style:
            end = node.end_mark.index - 1
            edits[end] = (end, f", {key}: {value}")
        else:
            start = node.value[0][0].start_mark
            edits[start.index] = (start.index, f"{key}: {value}\n{' ' * start.column}")
    version = _node(root, ("slideline",))
    assert version is not None, "the file was checked"
    edits[version.start_mark.index] = (version.end_mark.index, str(VERSION))
    for start in sorted(edits, reverse=True):
        end, new = edits[start]
        text = text[:start] + new + text[end:]
    return text


def _node(node: Node | None, at: Sequence[str | int]) -> Node | None:
    """The node at a place; through merged mappings (<<) too."""
    for part in at:
        if isinstance(node, SequenceNode) and isinstance(part, int):
            node = node.value[part]
        elif isinstance(node, MappingNode):
            node = _child(node, str(part))
        else:
            return None
    return node


def _child(node: MappingNode, name: str) -> Node | None:
    for key, value in node.value:
        if key.value == name:
            return value
    for key, value in node.value:
        if key.value == "<<":
            for merged in value.value if isinstance(value, SequenceNode) else [value]:
                if isinstance(merged, MappingNode) and (found := _child(merged, name)) is not None:
                    return found
    return None
