"""What an error quotes does nothing to the terminal it is printed on."""

from __future__ import annotations

import pytest

from coupler.errors import UNPRINTABLE, CouplingError, HalfError, ResultsError, ScenarioError, printable, together

BAD = "a\x1b[31mb\x9bc\rd\u202ee\ud800f\x00g"
GOOD = r"a\u001b[31mb\u009bc\u000dd\u202ee\ud800f\u0000g"


@pytest.mark.parametrize("error", [
    ScenarioError(BAD), ScenarioError("m", file=BAD), ScenarioError("m", key=BAD), ScenarioError("m", remedy=BAD),
    together([ScenarioError("m"), ScenarioError(BAD)]), HalfError(BAD), HalfError("m", half="h", log=BAD),
    CouplingError(BAD), CouplingError("m", remedy=BAD), ResultsError(BAD)])
def test_no_error_steers_a_terminal(error):
    assert UNPRINTABLE.search(str(error)) is None
    assert "[31m" in str(error)
    str(error).encode()  # no half of a character is left


def test_what_is_taken_out_can_be_told():
    assert printable(BAD) == GOOD
    text = "line\n\ttab, \u00e4, \u8f6e, \U0001f600"
    assert printable(text) == text
