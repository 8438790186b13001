"""The verb `slideline init`: options in, a file out, a few lines said."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from coupler.errors import ScenarioError
from coupler.init.ask import Answer, ask_choices, ask_out, ask_template
from coupler.init.choices import Choices, chosen_materials
from coupler.init.materials import library
from coupler.init.templates import template_named, templates
from coupler.init.write import new_scenario
from coupler.scenario import parse_override

TemplateArgument = Annotated[str | None, typer.Argument(
    help="A template's name, see --list. Without one you are asked.", show_default=False)]
OutOption = Annotated[Path | None, typer.Option(
    "--out", "-o", help="The new file; default TEMPLATE.yaml, or the deck's name with .yaml.", show_default=False)]
ListOption = Annotated[bool, typer.Option("--list", help="Say which templates and materials there are.")]
DeckOption = Annotated[Path | None, typer.Option(
    "--from", metavar="MODEL.inp", help="Convert an Abaqus or CalculiX deck instead.", show_default=False)]
TitleOption = Annotated[str | None, typer.Option("--title", help="What the scenario is called.", show_default=False)]
EndOption = Annotated[float | None, typer.Option(
    "--end", metavar="SECONDS", help="When it ends.", show_default=False)]
MaterialOption = Annotated[list[str] | None, typer.Option(
    "--material", metavar="NAME=KIND", help="Make a material of the template a named one: lower=copper. "
    "May be repeated.")]
MeshOption = Annotated[float, typer.Option("--mesh", help="So many times as many cells along every edge.")]
SetOption = Annotated[list[str] | None, typer.Option(
    "--set", metavar="KEY=VALUE", help="Write another value: bodies.lower.T0=400. May be repeated.")]


def init_command(template: TemplateArgument = None, out: OutOption = None, listed: ListOption = False,
                 deck: DeckOption = None, title: TitleOption = None, end: EndOption = None,
                 material: MaterialOption = None, mesh: MeshOption = 1.0, sets: SetOption = None) -> None:
    """Write a new scenario: from a template, by questions or by options, or from a deck."""
    if listed:
        _list()
        return
    choices = Choices(title, end, chosen_materials(material or ()), mesh,
                      dict(parse_override(text) for text in sets or ()))
    if deck is None:
        _from_template(template, out, choices)
        return
    if template is not None or choices != Choices():
        raise ScenarioError("a deck is converted as it is", key="--from", value=str(deck),
                            remedy="Leave out the template and its options; change the scenario that is written")
    _from_deck(deck, out or Path(f"{deck.stem}.yaml"))


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


def _from_deck(deck: Path, out: Path) -> None:
    """Raises ScenarioError where the deck cannot be converted."""
    # Here and not above: who starts from a template needs no reader of decks.
    from coupler.deck import convert

    for line in convert(deck, out).lines:
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
