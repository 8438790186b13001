"""Case D1, two bars in series: the temperatures of both sides of the interface, and the flux between them."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from coupler import Results, load_scenario, run
from coupler.cli.cli import app

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


@pytest.mark.slow
def test_an_elastic_half_in_the_place_of_the_rigid_one_says_the_same(tmp_path: Path) -> None:
    """It makes the pressure that the rigid one states.  The two come as near as the scenario's file says."""
    done = CliRunner().invoke(app, ["run", str(ROOT / "scenarios/heated_bars.yaml"), "-o", str(tmp_path / "bars.h5"),
                                    "--swap", "mechanical=elastic", "--compare", "-q"])
    assert done.exit_code == 0, done.output
    assert "bars.h5 and bars-own.h5 say the same within error: 6 of 6 probes and fields" in done.output
    elastic, rigid = (Results(tmp_path / name) for name in ("bars.h5", "bars-own.h5"))
    assert (elastic.header["halves"]["mechanical"], rigid.header["halves"]["mechanical"]) == ("elastic", "rigid")
    for name, most in (("hot.top", 2e-3), ("cold.bottom", 2e-3), ("interface.p", 4.0)):
        off = np.abs(elastic.probe(name)[1] - rigid.probe(name)[1]).max()
        assert 0.0 < off < most, name
