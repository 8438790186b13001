"""Contact laws in the scenario: temperatures in their tables are in the scenario's unit like all others."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, error_of, load_text

CLOSED = "{law: constant, h: 2000}"


def table(x: str) -> str:
    return f"{{law: table, variable: T, x: {x}, h: [1, 2]}}"


def test_tables_of_conductance_in_temperature_become_kelvin(tmp_path: Path) -> None:
    text = GOOD.replace(CLOSED, f"{{law: sum, of: [{table('[-20, 100]')}, {{law: table, x: [0, 9], h: [1, 2]}}]}}")
    inner, by_pressure = load_text(tmp_path, text).models["thermal"]["pairs"]["face"]["conduction"]["closed"]["of"]
    assert inner["x"] == pytest.approx([253.15, 373.15])
    assert inner["variable"] == "T"
    assert by_pressure["x"] == [0, 9]


def test_kelvin_tables_are_left_alone(tmp_path: Path) -> None:
    text = GOOD.replace("degC", "K").replace(CLOSED, table("[20, 100]"))
    assert load_text(tmp_path, text).models["thermal"]["pairs"]["face"]["conduction"]["closed"]["x"] == [20.0, 100.0]


@pytest.mark.parametrize(("law", "key", "words"), [
    (table("[-300, 100]"), "contact.face.conduction.closed.x.0", "absolute zero"),
    (table("[100, 20]"), "contact.face.conduction.closed.x.1", "increase"),
    (table("[20, hot]"), "contact.face.conduction.closed.x.1", "number"),
    ("{law: sum, of: [3]}", "contact.face.conduction.closed.of.0", "law"),
    ("{law: sum, of: 3}", "contact.face.conduction.closed.of", "list"),
    ("{law: sum, of: []}", "contact.face.conduction.closed.of", "at least one law"),
    ("{law: table, variable: Q, x: [0, 1], h: [1, 1]}", "contact.face.conduction.closed.variable", "Known here: T, x"),
    ("3", "contact.face.conduction.closed", "contact law"),
])
def test_a_law_that_is_none_is_named(law: str, key: str, words: str, tmp_path: Path) -> None:
    error = error_of(tmp_path, CLOSED, law)
    assert error.key == key
    assert words in f"{error.message} {error.remedy}"
