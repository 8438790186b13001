"""A new scenario as a file: the template's text with comments kept, checked, never over another file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from textwrap import wrap
from typing import Any

from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.representer import RoundTripRepresenter

from coupler.init.choices import Choices, named, overrides_of
from coupler.init.materials import Material
from coupler.init.templates import Template
from coupler.newfile import check_free, new_files
from coupler.scenario.document import Document
from coupler.scenario.load import checked
from coupler.scenario.override import apply_overrides
from coupler.scenario.reading import document_from
from coupler.scenario.scenario import Scenario
from coupler.scenario.writing import WIDTH, dumped, layout

LARGE = 1e5  # from here on numbers are easier read with an exponent


class _Words(RoundTripRepresenter):
    """Writes null as a word (ruamel leaves its place empty), and large numbers with an exponent."""

    def represent_none(self, data: None) -> Any:
        return self.represent_scalar("tag:yaml.org,2002:null", "null")

    def represent_float(self, data: float) -> Any:
        if abs(data) < LARGE:
            return super().represent_float(data)
        text = next(text for digits in range(1, 18) if float(text := f"{data:.{digits}e}") == data)
        return self.represent_scalar("tag:yaml.org,2002:float", text)


_Words.add_representer(type(None), _Words.represent_none)
_Words.add_representer(float, _Words.represent_float)


def new_scenario(template: Template, choices: Choices, out: Path) -> Scenario:
    """Write a template with choices to a new file; what was written, checked.

    Raises ScenarioError, and writes nothing, where a choice is wrong or the file cannot be made.
    """
    check_free(out)
    document = template.document_for(out)
    overrides = overrides_of(document.tree, choices)
    scenario = checked(document, overrides)
    text = text_of(document, overrides, named(document.tree, choices)) if overrides else document.text
    assert document_from(out, text).tree == scenario.resolved, "a scenario survives being written"
    with new_files({out: text}):
        return scenario


def text_of(document: Document, overrides: Mapping[str, Any], materials: Mapping[str, Material]) -> str:
    """The text of a document with values put in place, comments kept, and the source of each named material."""
    yaml = layout()
    yaml.Representer = _Words
    commented = Document(document.path, document.text, yaml.load(document.text), document.lines)
    tree = _in_style(apply_overrides(commented, overrides).tree)
    for name, material in materials.items():
        tree["materials"].yaml_set_comment_before_after_key(
            name, before="\n".join(wrap(f"{name}: {material.about}. {material.source}.", WIDTH - 4)), indent=2)
    return dumped(tree, yaml)


def _in_style(node: Any) -> Any:
    """What was put in as plain values on one line each; what was there as it was."""
    if type(node) is list:
        node = CommentedSeq(node)
        node.fa.set_flow_style()
    elif type(node) is dict:
        node = CommentedMap(node)
        node.fa.set_flow_style()
    for key, value in node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ():
        if type(value) in (list, dict) or isinstance(value, CommentedMap | CommentedSeq):
            node[key] = _in_style(value)
    return node
