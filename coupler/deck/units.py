"""What a deck without units says of its temperatures: absolute zero, and the constant of radiation."""

from __future__ import annotations

from collections.abc import Sequence

from coupler.deck.lexer import Row, number, wrong
from coupler.deck.log import Log
from coupler.deck.outline import Outline

ZERO_C = -273.15
NEAR = 0.2  # decks round absolute zero
COLD = 150.0  # a deck whose temperatures are all above is in K


def physics_of(outline: Outline, seen: Sequence[float], radiates: bool, log: Log) -> tuple[str, float]:
    """(unit of temperature, Stefan-Boltzmann constant, 0 where the deck has none).  seen : temperatures in the deck.

    Raises ScenarioError where absolute zero is that of another scale.
    """
    log.note("numbers are as written; all is taken for SI (m, s, kg, Pa, W), which a deck does not say")
    zero, sigma = None, 0.0
    for block in (b for b in outline.model if b.word == "PHYSICAL CONSTANTS"):
        for option in block.options:
            row = Row(block.row.file, block.row.line, block.row.text, (block.options[option],))
            if option == "ABSOLUTE ZERO":
                zero = number(row, 0, "absolute zero")
                if min(abs(zero), abs(zero - ZERO_C)) > NEAR:
                    raise wrong(row, "absolute zero is -273.15 (degC) or 0 (K)", "Write the deck in degC or K.")
            elif option == "STEFAN BOLTZMANN":
                sigma = number(row, 0, "the constant")
    if radiates and not sigma:
        log.note("the deck has no STEFAN BOLTZMANN; the constant is that of SI")
    if zero is not None:
        return ("K" if abs(zero) <= NEAR else "degC"), sigma
    unit = "K" if radiates or min(seen) > COLD else "degC"
    log.note(f"the deck has no ABSOLUTE ZERO; temperatures are taken for {unit}")
    return unit, sigma
