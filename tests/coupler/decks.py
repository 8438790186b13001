"""Small decks for the tests of the deck reader: two blocks of two cells, one on the other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from coupler.deck import Converted, convert
from coupler.scenario.document import read_document

MESH = """*HEADING
 Two blocks
*NODE, NSET=NALL
1, 0., 0.
2, 1.D-1, 0.
3, .2, 0.
4, 0., .1
5, .1, .1
6, .2, .1
11, 0., .1
12, .1, .1
13, .2, .1
14, 0., .2
15, .1, .2
16, .2, .2
*ELEMENT, TYPE={type}, ELSET=LOWER
1, 1, 2, 5, 4
2, 2, 3, 6, 5
*ELEMENT, TYPE={type}, ELSET=UPPER
11, 11, 12, 15, 14
12, 12, 13, 16, 15
*NSET, NSET=BOTTOM, GENERATE
1, 3
*NSET, NSET=TOP
14, 15, 16
*NSET, NSET=LEFT
1, 4, 11, 14
*NSET, NSET=NUPPER, GENERATE
11, 16
*SURFACE, NAME=SLAVE
UPPER, S1
*SURFACE, NAME=MASTER
LOWER, S3
"""
STEEL = """*MATERIAL, NAME=STEEL
*CONDUCTIVITY
50.
*SPECIFIC HEAT
500.
*DENSITY
7800.
"""
SOLID = STEEL + """*ELASTIC
2.E11, .3
*EXPANSION
1.2E-5
"""
SECTIONS = """*SOLID SECTION, ELSET=LOWER, MATERIAL=STEEL
1.
*SOLID SECTION, ELSET=UPPER, MATERIAL=STEEL
1.
"""
PAIR = """*SURFACE INTERACTION, NAME=TOUCH
*GAP CONDUCTANCE
1000.
*CONTACT PAIR, INTERACTION=TOUCH
SLAVE, MASTER
"""
START = """*INITIAL CONDITIONS, TYPE=TEMPERATURE
NALL, 20.
NUPPER, 400.
"""
HEAT = """*STEP
*HEAT TRANSFER, DIRECT
1., 10.
{inside}*END STEP
"""
COUPLED = """*STEP, NLGEOM
*COUPLED TEMPERATURE-DISPLACEMENT, DIRECT
1., 10.
{inside}*END STEP
"""


def heat_deck(inside: str = "", *, model: str = "", mesh: str = "", kind: str = "DC2D4") -> str:
    """Two blocks that exchange heat.  inside : of the step.  model, mesh : more of either."""
    return (MESH.format(type=kind) + mesh + STEEL + SECTIONS + PAIR + START + model + HEAT.format(inside=inside))


def coupled_deck(inside: str = "", *, model: str = "", mesh: str = "", material: str = "", kind: str = "CPE4T") -> str:
    """Two blocks that exchange heat and press each other."""
    return (MESH.format(type=kind) + mesh + SOLID + material + SECTIONS + PAIR + START + model
            + COUPLED.format(inside=inside))


def converted(folder: Path, text: str | bytes, **others: str) -> tuple[dict[str, Any], Converted]:
    """The scenario's tree of a deck, and what was told; others : files beside it, by name without .inp."""
    deck, out = folder / "deck.inp", folder / "scene.yaml"
    for name, inner in others.items():
        (folder / f"{name}.inp").write_text(inner, encoding="utf-8")
    if isinstance(text, bytes):
        deck.write_bytes(text)
    else:
        deck.write_text(text, encoding="utf-8")
    for old in (out, out.with_suffix(".msh")):
        old.unlink(missing_ok=True)
    told = convert(deck, out)
    return read_document(out).tree, told
