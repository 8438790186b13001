"""From a deck to a scenario file with its mesh beside it."""

from __future__ import annotations

import contextlib
from pathlib import Path

from coupler.deck.bodies import Names, bodies_of
from coupler.deck.boundary import NodeSets
from coupler.deck.lexer import blocks_of
from coupler.deck.log import Log
from coupler.deck.mesh import mesh_of
from coupler.deck.outline import outline_of
from coupler.deck.surfaces import surfaces_of
from coupler.deck.told import Converted
from coupler.deck.tree import Deck, tree_of
from coupler.deck.words import understood
from coupler.deck.write import Groups, mesh_text, scenario_text
from coupler.errors import ScenarioError
from coupler.outset import plan_of
from coupler.scenario import load_scenario


def convert(path: Path, out: Path) -> Converted:
    """Write the scenario `out` (.yaml), and its mesh beside it (same stem, .msh), of the deck `path`.

    Raises ScenarioError, naming the deck's file, line, text and what to do, where a deck cannot be read, holds what no
    scenario can say (3-D elements, surfaces of nodes), makes a scenario that does not pass its check, or where a file
    to be written is already there.  Then nothing is left behind.
    """
    beside = out.with_suffix(".msh")
    for file in (out, beside):
        if file.exists():
            raise ScenarioError("there is a file of this name already", file=str(file), remedy="Give another --out.")
    log = Log()
    deck = _read(path, log)
    title = deck.outline.title or path.stem
    tree = tree_of(deck, beside.name, title, log)
    told = Converted((out, beside), tuple(log.missed), tuple(log.notes))
    head = [f"From the deck {path.name}.", *(f"- {note}" for note in log.notes),
            "Not understood:" if log.missed else "All of the deck was understood.", *(f"  {m}" for m in log.missed)]
    mesh = mesh_text(deck.mesh, Groups(deck.bodies, deck.surfaces.edges, deck.sets.named))
    _put(((beside, mesh), (out, scenario_text(tree, head))), path)
    return told


def _read(path: Path, log: Log) -> Deck:
    """The deck's mesh with its names."""
    outline = outline_of(understood(blocks_of(path), log))
    mesh, names = mesh_of(outline, log), Names()
    bodies = bodies_of(outline, mesh, names, log)
    return Deck(outline, mesh, bodies, surfaces_of(outline, mesh, names, log), NodeSets(mesh, names))


def _put(texts: tuple[tuple[Path, str], ...], deck: Path) -> None:
    """Write the files and check the scenario, the last of them; take all away again where that fails."""
    written: list[Path] = []
    try:
        for file, text in texts:
            with file.open("x", encoding="utf-8") as stream:
                written.append(file)
                stream.write(text)
        plan_of(load_scenario(texts[-1][0]))
    except (OSError, ScenarioError) as exc:
        for file in written:
            with contextlib.suppress(OSError):
                file.unlink()
        if isinstance(exc, OSError):
            raise ScenarioError(f"cannot be written ({exc.strerror})", file=str(texts[-1][0])) from exc
        raise ScenarioError(f"the deck makes a scenario that does not pass its check: {exc}", file=str(deck)) from exc
