"""A deck, read, run and held against a closed form: heat through two blocks and the contact between them, steady."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from coupler.running.run import run
from coupler.scenario import load_scenario

sys.path.insert(0, str(Path(__file__).parent.parent / "coupler"))
from decks import converted, heat_deck

pytestmark = pytest.mark.usefixtures("unlooked")

K, H, LENGTH, HOT = 50.0, 1000.0, 0.1, 100.0  # of the deck: conductivity, conductance, height of a block, top


def test_steady_heat_through_contact_is_that_of_three_resistances(tmp_path: Path) -> None:
    text = heat_deck(f"*BOUNDARY\nBOTTOM, 11, 11, 0.\nTOP, 11, 11, {HOT}\n")
    text = text.replace("*HEAT TRANSFER, DIRECT\n1., 10.", "*HEAT TRANSFER, STEADY STATE\n1., 1.")
    _, told = converted(tmp_path, text.replace("*STEP", "*STEP, AMPLITUDE=STEP"))
    results = run(load_scenario(told.files[0]), tmp_path / "run.h5")
    q = HOT / (2 * LENGTH / K + 1 / H)
    assert results.probe("LOWER.T_max", "degC")[1][-1] == pytest.approx(q * LENGTH / K, rel=1e-9)
    assert results.probe("UPPER.T_min", "degC")[1][-1] == pytest.approx(HOT - q * LENGTH / K, rel=1e-9)
