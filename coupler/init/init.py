"""Makes a new scenario (`slideline init`): by options or questions, from a template or a deck."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from textwrap import wrap
from typing import Annotated, Any, Protocol, TypeVar

import typer
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.representer import RoundTripRepresenter

from contact.problem.values import did_you_mean
from coupler.errors import ScenarioError
from coupler.init.templates import (
    Choices,
    LibraryMaterial,
    Template,
    chosen_materials,
    exchangeable,
    library,
    named,
    overrides_of,
    template_named,
    templates,
)
from coupler.record.paths import check_free, new_files
from coupler.scenario import parse_override
from coupler.scenario.document import WIDTH, Document, document_from, dumped, layout
from coupler.scenario.edits import apply_overrides
from coupler.scenario.load import Scenario, checked

# The questions of `slideline init`, for what no option gave; the function that asks is passed in.

Answer = TypeVar("Answer")
KEEP = "keep"


class Ask(Protocol):
    """Asks until `read` accepts the answer: it raises ScenarioError for one that is not valid."""

    def __call__(self, question: str, default: str, read: Callable[[str], Answer]) -> Answer: ...


def ask_template(ask: Ask, say: Callable[[str], None]) -> Template:
    """Ask for the template, by name or number."""
    choices = list(templates().values())
    for number, template in enumerate(choices, start=1):
        say(f"  {number}  {template.name}: {template.about}")
    return ask("Template (name or number)", choices[0].name, _template)


def ask_choices(template: Template, given: Choices, ask: Ask, say: Callable[[str], None]) -> Choices:
    """Ask for the choices that no option made."""
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
    """Ask for the file."""
    return ask("File", f"{template.name}.yaml", _free)


def _template(text: str) -> Template:
    by_name: Mapping[str, Template] = templates()
    if text.isdecimal() and 1 <= int(text) <= len(by_name):
        return list(by_name.values())[int(text) - 1]
    if text not in by_name:
        raise ScenarioError("there is no such template", value=text, remedy=did_you_mean(text, by_name))
    return by_name[text]


def _title(text: str) -> str:
    if not text.strip():
        raise ScenarioError("a title has letters", value=text, remedy="Write a few words.")
    return text.strip()


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ScenarioError("this is not a number", value=text, remedy="Write digits alone, such as 1.5.") from None
    if not 0 < value < math.inf:
        raise ScenarioError("this is not a number above 0", value=text, remedy="Write a larger one, such as 20.")
    return value


def _material(text: str) -> str:
    if text != KEEP and text not in library():
        raise ScenarioError("there is no such material", value=text, remedy=did_you_mean(text, [KEEP, *library()]))
    return text


def _free(text: str) -> Path:
    check_free(Path(text))
    return Path(text)


# A new scenario as a file: the template's text with comments kept, checked, never over another file.

LARGE = 1e5  # from here on numbers are easier read with an exponent


class _ExplicitScalars(RoundTripRepresenter):
    """Writes null as `null` (ruamel leaves its place empty), and large numbers with an exponent."""

    def represent_none(self, data: None) -> Any:
        return self.represent_scalar("tag:yaml.org,2002:null", "null")

    def represent_float(self, data: float) -> Any:
        if abs(data) < LARGE:
            return super().represent_float(data)
        text = next(text for digits in range(1, 18) if float(text := f"{data:.{digits}e}") == data)
        return self.represent_scalar("tag:yaml.org,2002:float", text)


_ExplicitScalars.add_representer(type(None), _ExplicitScalars.represent_none)
_ExplicitScalars.add_representer(float, _ExplicitScalars.represent_float)


def new_scenario(template: Template, choices: Choices, out: Path) -> Scenario:
    """Write a template with choices to a new file, and return the checked scenario.

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


def text_of(document: Document, overrides: Mapping[str, Any], materials: Mapping[str, LibraryMaterial]) -> str:
    """Return the text of a document with overrides, its comments, and the source of each named material."""
    yaml = layout()
    yaml.Representer = _ExplicitScalars
    commented = Document(document.path, document.text, yaml.load(document.text), document.lines)
    tree = _in_style(apply_overrides(commented, overrides).tree)
    for name, material in materials.items():
        tree["materials"].yaml_set_comment_before_after_key(
            name, before="\n".join(wrap(f"{name}: {material.about}. {material.source}.", WIDTH - 4)), indent=2)
    return dumped(tree, yaml)


def _in_style(node: Any) -> Any:
    """Write plain values that were put in on one line each; leave the others as they were."""
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


TemplateArgument = Annotated[str | None, typer.Argument(
    help="A template's name, see --list. Without one you are asked.", show_default=False)]
OutOption = Annotated[Path | None, typer.Option(
    "--out", "-o", help="The new file; default TEMPLATE.yaml, or the deck's name with .yaml.", show_default=False)]
ListOption = Annotated[bool, typer.Option("--list", help="List the templates and materials.")]
DeckOption = Annotated[Path | None, typer.Option(
    "--from", metavar="MODEL.inp", help="Convert an Abaqus or CalculiX deck instead.", show_default=False)]
UnitsOption = Annotated[str, typer.Option(
    "--units", metavar="UNITS", help="Units of the deck's numbers, with --from: mm,MPa, or SI. Default: those in which "
    "its materials are usual ones.", show_default=False)]
TitleOption = Annotated[str | None, typer.Option("--title", help="Title of the scenario.", show_default=False)]
EndOption = Annotated[float | None, typer.Option(
    "--end", metavar="SECONDS", help="When it ends.", show_default=False)]
MaterialOption = Annotated[list[str] | None, typer.Option(
    "--material", metavar="NAME=KIND", help="Make a material of the template a named one: lower=copper. "
    "May be repeated.")]
MeshOption = Annotated[float, typer.Option("--mesh", help="Factor on the cells along every edge.")]
SetOption = Annotated[list[str] | None, typer.Option(
    "--set", metavar="KEY=VALUE", help="Write another value: bodies.lower.T0=400. May be repeated.")]


def init_command(template: TemplateArgument = None, out: OutOption = None, listed: ListOption = False,
                 deck: DeckOption = None, units: UnitsOption = "", title: TitleOption = None, end: EndOption = None,
                 material: MaterialOption = None, mesh: MeshOption = 1.0, sets: SetOption = None) -> None:
    """Write a new scenario: from a template, by questions or by options, or from a deck."""
    if listed:
        _list()
        return
    choices = Choices(title, end, chosen_materials(material or ()), mesh,
                      dict(parse_override(text) for text in sets or ()))
    if deck is None:
        if units:
            raise ScenarioError("a template has its own units", key="--units", value=units,
                                remedy="Leave it out, or name a deck by --from.")
        _from_template(template, out, choices)
        return
    if template is not None or choices != Choices():
        raise ScenarioError("a deck is converted as it is", key="--from", value=str(deck),
                            remedy="Leave out the template and its options; change the scenario that is written")
    _from_deck(deck, out or Path(f"{deck.stem}.yaml"), units)


def _list() -> None:
    for title, entries in (("templates", templates()), ("materials, at 300 K", library())):
        typer.echo(f"{title}:")
        width = max(map(len, entries))
        for name, entry in entries.items():
            typer.echo(f"  {name:{width}}  {entry.about}")


def _from_template(name: str | None, out: Path | None, choices: Choices) -> None:
    if name is not None:
        template = template_named(name)
    else:
        _check_terminal()
        template = ask_template(_ask, typer.echo)
        choices = ask_choices(template, choices, _ask, typer.echo)
        out = out or ask_out(template, _ask)
    out = out or Path(f"{template.name}.yaml")
    scenario = new_scenario(template, choices, out)
    typer.echo(f"{out}: {scenario.title}")
    _next(out)


def _from_deck(deck: Path, out: Path, units: str) -> None:
    """Raises ScenarioError where the deck cannot be converted."""
    # Here and not above: who starts from a template needs no reader of decks.
    from coupler.deck import convert

    for line in convert(deck, out, units).lines:
        typer.echo(line)
    _next(out)


def _next(out: Path) -> None:
    typer.echo(f"  check it: slideline check {out}\n  run it:   slideline run {out} --report")


def _check_terminal() -> None:
    if not sys.stdin.isatty():
        raise ScenarioError("no template is named, and there is no terminal to ask on", key="TEMPLATE",
                            remedy=f"Name one of {', '.join(templates())}")


def _ask(question: str, default: str, read: Callable[[str], Answer]) -> Answer:
    while True:
        text = typer.prompt(question, default=default)
        try:
            return read(text)
        except ScenarioError as exc:
            typer.echo(f"  {exc}")
