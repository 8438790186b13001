"""From a deck to a scenario file with its mesh beside it."""

from __future__ import annotations

from pathlib import Path

from coupler.deck.told import Converted
from coupler.errors import ScenarioError


def convert(path: Path, out: Path) -> Converted:
    """Write the scenario `out` (.yaml), and its mesh beside it (same stem, .msh), of the deck `path`.

    Raises ScenarioError, naming the deck's file, line, text and what to do, where a deck cannot be read, holds what no
    scenario can say (3-D elements, surfaces of nodes), or where a file to be written is already there.
    """
    raise ScenarioError("decks cannot be read yet", file=str(path), value=str(out))
