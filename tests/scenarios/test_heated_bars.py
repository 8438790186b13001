"""Case D1, two bars in series: the temperatures of both sides of the interface, and the flux between them."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from coupler import Results, load_scenario, run

ROOT = Path(__file__).resolve().parents[2]
D1 = tomllib.loads((ROOT / "tests/expected.toml").read_text(encoding="utf-8"))["D1"]
H = 2000.0  # W/m2K


@pytest.fixture(scope="module")
def bars(tmp_path_factory) -> Results:
    return run(load_scenario(ROOT / "scenarios/heated_bars.yaml"), out=tmp_path_factory.mktemp("bars") / "run.h5")


def test_the_end_is_the_closed_form(bars: Results) -> None:
    # Linear elements are exact for a straight line; the transient has died to 1e-9 K, the digits given are 1e-5 K.
    assert bars.probe("hot.top")[1][-1] == pytest.approx(D1["T1"], abs=1e-5)
    assert bars.probe("cold.bottom")[1][-1] == pytest.approx(D1["T2"], abs=1e-5)
    jump = bars.probe("hot.top")[1][-1] - bars.probe("cold.bottom")[1][-1]
    assert jump * H == pytest.approx(D1["q"], rel=1e-8)


def test_the_interface_warms_without_a_swing(bars: Results) -> None:
    """Heat comes from below only, so neither side may cool; and the mean over the face is the value at its middle."""
    for name in ("hot.top", "cold.bottom"):
        assert np.diff(bars.probe(name)[1]).min() > -1e-6
    assert bars.probe("interface.mean")[1] == pytest.approx(bars.probe("cold.bottom")[1], abs=1e-8)
    assert bars.probe("interface.p")[1] == pytest.approx(1e6)
