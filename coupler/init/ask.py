"""The questions of `slideline init`, of what no option said; whoever asks is passed in."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Protocol, TypeVar

from coupler.errors import ScenarioError
from coupler.init.choices import Choices
from coupler.init.materials import exchangeable, library
from coupler.init.templates import Template, templates
from coupler.newfile import check_free
from coupler.scenario.quantity import did_you_mean

Answer = TypeVar("Answer")
KEEP = "keep"


class Ask(Protocol):
    """Asks until `read` takes the answer: it raises ScenarioError for one that will not do."""

    def __call__(self, question: str, default: str, read: Callable[[str], Answer]) -> Answer: ...


def ask_template(ask: Ask, say: Callable[[str], None]) -> Template:
    """Which template, by name or number."""
    known = list(templates().values())
    for number, template in enumerate(known, start=1):
        say(f"  {number}  {template.name}: {template.about}")
    return ask("Template (name or number)", known[0].name, _template)


def ask_choices(template: Template, given: Choices, ask: Ask, say: Callable[[str], None]) -> Choices:
    """The choices no option made."""
    tree = template.document.tree
    title = given.title if given.title is not None else ask("Title", str(tree["title"]), _title)
    end = given.end if given.end is not None else ask("End time, s", f"{tree['coupling']['end']:g}", _positive)
    materials = dict(given.materials)
    asked = [name for name in exchangeable(tree) if name not in materials]
    if asked:
        say(f"  materials: {', '.join(library())}; {KEEP}: the template's own numbers")
    for name in asked:
        kind = ask(f"Material of {name}", KEEP, _material)
        if kind != KEEP:
            materials[name] = kind
    mesh = given.mesh if given.mesh != 1.0 else ask("Mesh, times as many cells along every edge", "1", _positive)
    return replace(given, title=title if title != tree["title"] else None,
                   end=end if end != tree["coupling"]["end"] else None, materials=materials, mesh=mesh)


def ask_out(template: Template, ask: Ask) -> Path:
    """Where it goes."""
    return ask("File", f"{template.name}.yaml", _free)


def _template(text: str) -> Template:
    known: Mapping[str, Template] = templates()
    if text.isdecimal() and 1 <= int(text) <= len(known):
        return list(known.values())[int(text) - 1]
    if text not in known:
        raise ScenarioError("there is no such template", value=text, remedy=did_you_mean(text, known))
    return known[text]


def _title(text: str) -> str:
    if not text.strip():
        raise ScenarioError("a title has letters", value=text)
    return text.strip()


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ScenarioError("this is not a number", value=text) from None
    if not 0 < value < math.inf:
        raise ScenarioError("this is not a number above 0", value=text)
    return value


def _material(text: str) -> str:
    if text != KEEP and text not in library():
        raise ScenarioError("there is no such material", value=text, remedy=did_you_mean(text, [KEEP, *library()]))
    return text


def _free(text: str) -> Path:
    check_free(Path(text))
    return Path(text)
