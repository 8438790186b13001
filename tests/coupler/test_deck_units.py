"""Decks have no units: those in mm, t, s are seen by their materials, and make the scenario of the deck in SI."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from coupler.cli.cli import app
from coupler.deck import convert
from coupler.errors import ScenarioError
from coupler.scenario import Scenario, load_scenario

sys.path.insert(0, str(Path(__file__).parent))
from decks import coupled_deck, heat_deck

HELD = "*BOUNDARY\nBOTTOM, 1, 2\nTOP, 1\n"
LOADS = HELD + "*CLOAD\nTOP, 2, -30.\n*DSFLUX\nSLAVE, S, 200.\n"
# By hand: the deck in mm, t, s; sections are 1 m thick.
MM = {"*SPECIFIC HEAT\n500.": "*SPECIFIC HEAT\n5.E8", "*DENSITY\n7800.": "*DENSITY\n7.8E-9",
      "2.E11, .3": "2.E5, .3", "*GAP CONDUCTANCE\n1000.": "*GAP CONDUCTANCE\n1.",
      "MATERIAL=STEEL\n1.\n": "MATERIAL=STEEL\n1000.\n", "S, 200.": "S, .2"}
STATIC = "*STEP\n*STATIC\n1., 10.\n" + LOADS.partition("*DSFLUX")[0] + "*END STEP\n"


def in_mm(text: str) -> str:
    begin, end = text.index("*NODE"), text.index("*ELEMENT")
    rows = re.sub(r"(?<=, )[\d.D-]+", lambda m: f"{1000 * float(m[0].replace('D', 'E')):g}", text[begin:end])
    text = text[:begin] + rows + text[end:]
    for old, new in MM.items():
        text = text.replace(old, new)
    return text


def scenario(folder: Path, text: str, units: str = "") -> tuple[Scenario, str]:
    folder.mkdir()
    (folder / "deck.inp").write_text(text, encoding="utf-8")
    told = convert(folder / "deck.inp", folder / "s.yaml", units)
    return load_scenario(folder / "s.yaml"), " ".join(told.notes)


def close(a: Any, b: Any) -> bool:
    """Equal trees, numbers to 1e-12 of each."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(close(a[k], b[k]) for k in a)
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(map(close, a, b))
    if isinstance(a, int | float) and isinstance(b, int | float):
        return a == pytest.approx(b, rel=1e-12, abs=0.0)
    return a == b


@pytest.mark.parametrize("deck", [heat_deck("*DSFLUX\nSLAVE, S, 200.\n"), coupled_deck(LOADS),
                                  coupled_deck().partition("*STEP")[0] + STATIC])
def test_a_deck_in_mm_is_the_deck_in_si(deck: str, tmp_path: Path) -> None:
    assert in_mm(deck) != deck
    si, said_si = scenario(tmp_path / "si", deck)
    mm, said_mm = scenario(tmp_path / "mm", in_mm(deck))
    assert "taken for SI" in said_si
    assert "taken for mm, MPa and s" in said_mm
    assert close(dict(mm.models), dict(si.models))
    assert mm.interface.nodes == pytest.approx(si.interface.nodes, rel=1e-12, abs=1e-15)
    assert [p.gap_max for p in mm.interface.pairs] == pytest.approx([p.gap_max for p in si.interface.pairs], rel=1e-12)
    assert si.units is None
    assert mm.units is not None
    assert mm.units.symbols == "mm, MPa"


def test_stiffness_alone_tells(tmp_path: Path) -> None:
    """210000 is softer than rubber in Pa, and steel in MPa; with a density of SI beside it, it stays SI."""
    bare = re.sub(r"\*CONDUCTIVITY.*?(?=\*ELASTIC)", "", coupled_deck().partition("*STEP")[0] + STATIC, flags=re.S)
    assert "*DENSITY" not in bare
    _, said = scenario(tmp_path / "alone", bare.replace("2.E11", "210000."))
    assert "taken for mm, MPa and s" in said
    assert "E = 210000" in said
    _, said = scenario(tmp_path / "dense", (coupled_deck().partition("*STEP")[0] + STATIC).replace("2.E11", "210000."))
    assert "taken for SI" in said
    _, said = scenario(tmp_path / "si", bare)
    assert "taken for SI" in said


def test_units_are_given(tmp_path: Path) -> None:
    for units in ("SI", "m,Pa", "m, kg"):
        made, said = scenario(tmp_path / units.replace(" ", ""), in_mm(heat_deck()), units)
        assert made.units is None
        assert "taken" not in said.partition("temperatures")[0]
    made, _ = scenario(tmp_path / "cm", heat_deck(), "cm,N")
    assert made.units is not None
    assert made.units.symbols == "cm, N"
    assert made.interface.nodes.max() == pytest.approx(0.2e-2)


@pytest.mark.parametrize(("units", "words"), [("mm", "one unit of stress"), ("mm,Mpa", "Did you mean 'MPa'"),
                                              ("mm,MPa,K", "follows from the deck"), ("mm,MPa,N", "are needed")])
def test_what_is_no_system_is_refused(units: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError) as found:
        scenario(tmp_path / "s", heat_deck(), units)
    assert found.value.key == "--units"
    assert words in f"{found.value.message} {found.value.remedy}"
    assert not (tmp_path / "s/s.yaml").exists()


def test_the_command_takes_units(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "deck.inp").write_text(in_mm(coupled_deck(LOADS)), encoding="utf-8")
    said = CliRunner().invoke(app, ["init", "--from", "deck.inp", "--units", "mm,MPa"])
    assert said.exit_code == 0, said.output
    assert "length: mm, stress: MPa" in (tmp_path / "deck.yaml").read_text(encoding="utf-8")
    checked = CliRunner().invoke(app, ["check", "deck.yaml"])
    assert "plain numbers are in mm, MPa and s" in checked.output
    assert "engineering material" not in checked.output
    refused = CliRunner().invoke(app, ["init", "casting", "--units", "mm,MPa"])
    assert isinstance(refused.exception, ScenarioError)
    assert "a template has its own units" in str(refused.exception)
