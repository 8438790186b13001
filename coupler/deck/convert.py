"""From a deck to a scenario file with its mesh beside it."""

from __future__ import annotations

from pathlib import Path

from coupler.deck.bodies import Names, bodies_of
from coupler.deck.boundary import NodeSets
from coupler.deck.lexer import blocks_of, printable
from coupler.deck.log import Log
from coupler.deck.mesh import mesh_of
from coupler.deck.outline import outline_of
from coupler.deck.surfaces import surfaces_of
from coupler.deck.told import Converted
from coupler.deck.tree import Deck, tree_of
from coupler.deck.words import understood
from coupler.deck.write import Groups, mesh_text, scenario_text
from coupler.errors import ScenarioError
from coupler.newfile import check_free, new_files
from coupler.outset import plan_of
from coupler.scenario import load_scenario


def convert(path: Path, out: Path) -> Converted:
    """Write the scenario `out` (.yaml), and its mesh beside it (same stem, .msh), of the deck `path`.

    Raises ScenarioError, naming the deck's file, line, text and what to do, where a deck cannot be read, holds what no
    scenario can say (3-D elements, surfaces of nodes), makes a scenario that does not pass its check, or where a file
    to be written is already there.  Then nothing is left behind.
    """
    check_free(out)
    beside = out.with_suffix(".msh")
    if beside == out:
        raise ScenarioError("this is the name of the mesh beside the scenario", file=str(out),
                            remedy="End the scenario in .yaml")
    check_free(beside)
    log = Log()
    deck = _read(path, log)
    title = deck.outline.title or printable(path.stem)
    tree = tree_of(deck, beside.name, title, log)
    told = Converted((out, beside), tuple(log.missed), tuple(log.notes))
    head = [f"From the deck {path.name}.", *(f"- {note}" for note in log.notes),
            "Not understood:" if log.missed else "All of the deck was understood.", *(f"  {m}" for m in log.missed)]
    mesh = mesh_text(deck.mesh, Groups(deck.bodies, deck.surfaces.edges, deck.sets.named))
    with new_files({beside: mesh, out: scenario_text(tree, head)}):
        try:
            plan_of(load_scenario(out))
        except ScenarioError as exc:
            raise ScenarioError(f"the deck makes a scenario that does not pass its check: {exc}",
                                file=str(path)) from exc
    return told


def _read(path: Path, log: Log) -> Deck:
    """The deck's mesh with its names."""
    outline = outline_of(understood(blocks_of(path), log))
    mesh, names = mesh_of(outline, log), Names()
    bodies = bodies_of(outline, mesh, names, log)
    return Deck(outline, mesh, bodies, surfaces_of(outline, mesh, names, log), NodeSets(mesh, names))
