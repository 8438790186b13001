"""Two runs side by side: what is largest, when and where; the sentence, the page, and the exit codes."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from coupler.cli.cli import app
from coupler.errors import ResultsError
from coupler.record.results import Results
from coupler.report.comparison import (
    compare,
    difference_figure,
    off_line,
    scales,
    sentence,
    told_by_both,
    write_comparison,
)
from coupler.trust.checks import Check, TrustVerdict

sys.path.insert(0, str(Path(__file__).parent))
from synthetic_run import Case, write_run

CASE = Case(frames=2, reject=0)
NAME = "lower.top.left"


@pytest.fixture(scope="module")
def runs(tmp_path_factory) -> tuple[Results, Results]:
    """A run of 40 windows, and the same with half as many, one probe 300 K off in one of them."""
    folder = tmp_path_factory.mktemp("runs")
    a = write_run(folder / "a.h5", CASE)
    write_run(folder / "b.h5", replace(CASE, windows=20))
    with h5py.File(folder / "b.h5", "r+") as f:
        f[f"probes/{NAME}"][10] -= 300.0
    return a, Results(folder / "b.h5")


def test_the_largest_difference_has_its_time_sign_and_values(runs: tuple[Results, Results]) -> None:
    a, b = runs
    c = compare(a, b)
    d = next(d for d in c.differences if d.curves.name == NAME)
    assert d.t == b.t[10]
    assert d.b == b.probe(NAME)[1][10]
    assert d.by == pytest.approx(d.b - np.interp(d.t, *a.probe(NAME)), abs=1e-12)
    assert d.by < -299
    assert {e.curves.name for e in c.differences} == set(a.probe_names)
    assert not c.only_a + c.only_b
    assert c.heats["convection"] == pytest.approx((40 * -20.0, 20 * -20.0))


def test_times_of_both_are_looked_at_and_none_beyond_the_shorter_run(runs: tuple[Results, Results]) -> None:
    a, b = runs
    t = compare(b, a).differences[0].curves.t
    np.testing.assert_array_equal(t, np.union1d(a.t, b.t))


def test_the_line_through_a_long_window_is_no_difference(tmp_path: Path) -> None:
    """One curved history, in windows of 20 and of 2 s, in turns: neither run is off at an end of its own."""
    write_run(tmp_path / "a.h5", CASE)
    write_run(tmp_path / "b.h5", CASE)
    long, short = np.arange(0.0, 1000.0, 20.0), np.arange(0.0, 1000.0, 2.0)
    ends = {"a": np.concatenate([long[long < 400], short[short >= 400]]),
            "b": np.concatenate([short[short < 400], long[long >= 400]])}
    for jump in (0.0, 0.5):
        runs = []
        for name, t in ends.items():
            run = Results(tmp_path / f"{name}.h5")
            T = 300.0 + 0.005 * (t - 500.0) ** 2 + jump * (name == "b") * (t > 700.0)
            run.t, run._terms = t, {}
            run._probes = {NAME: replace(run._probes[NAME], values=T)}
            runs.append(run)
        for one, other in (runs, runs[::-1]):
            d = compare(one, other).differences[0]
            at_all_times = np.abs(d.curves.b - d.curves.a).max()
            # A parabola's chord over 20 s: 0.005 * (20 / 2)**2; over the shorter windows a hundredth of it.
            assert at_all_times > 0.49
            assert abs(d.by) == pytest.approx(jump, abs=0.0051)
            if jump:
                assert d.t > 700.0
            # What is drawn is what is told: the chord of the long windows was drawn as a difference of 0.5 K.
            values, apart = scales([d], "K")
            drawn = difference_figure([d], values, apart, "temperature").axes[1].lines[0].get_ydata()
            assert np.abs(drawn).max() == pytest.approx(abs(float(apart(np.array(d.by)))), rel=1e-12)


def test_what_both_tell_is_at_ends_of_both_and_of_the_longer_window() -> None:
    a, b = np.array([0.0, 10.0, 20.0]), np.array([0.0, 4.0, 8.0, 12.0, 16.0, 20.0])
    t = np.union1d(a, b)
    for told in (told_by_both(a, b, t), told_by_both(b, a, t)):
        assert t[told].tolist() == [0.0, 10.0, 20.0]


def test_where_nothing_is_faced_no_gap_is_compared(runs: tuple[Results, Results], tmp_path: Path) -> None:
    a, _ = runs
    (tmp_path / "open.h5").write_bytes(a.path.read_bytes())
    with h5py.File(tmp_path / "open.h5", "r+") as f:
        gap = f["probes/gap"]
        gap[:] = [*gap[:5] + 1e-3, *np.full(len(gap) - 5, 0.1)]
    d = next(d for d in compare(a, Results(tmp_path / "open.h5")).differences if d.curves.name == "gap")
    assert d.by == pytest.approx(1e-3, abs=1e-12)
    assert np.isnan(d.curves.b[5:]).all()


def test_one_sentence(runs: tuple[Results, Results]) -> None:
    a, b = runs
    told = sentence(compare(a, b), ("a.h5", "b.h5"), "degC")
    assert re.match(r"b\.h5 differs from a\.h5 by up to .* K in temperature \(.*, t = .* s: .* °C against .* °C\)",
                    told)
    assert told.count(". ") == 0
    assert told.endswith(".")
    assert sentence(compare(a, a), ("a.h5", "a.h5"), "degC") == "a.h5 agrees with a.h5 in 6 probes up to t = 25000 s."


def test_the_page_loads_nothing_and_shows_every_probe(runs: tuple[Results, Results], tmp_path: Path) -> None:
    page, told = write_comparison(*runs, tmp_path / "page.html")
    text = page.read_text(encoding="utf-8")
    assert told in text
    assert text.count('src="data:image/svg') == 3  # temperature, gap, pressure
    assert all(f"<td>{n}</td>" in text for n in runs[0].probe_names)
    assert "<script" not in text
    assert not re.search(r'(src|href)="(?!data:)', text)


def test_runs_without_a_common_probe_are_refused(runs: tuple[Results, Results], tmp_path: Path) -> None:
    blind = write_run(tmp_path / "blind.h5", replace(CASE, probes=False))
    with pytest.raises(ResultsError, match="no probe in common"):
        compare(runs[0], blind)


def test_the_command_and_its_exit_codes(runs: tuple[Results, Results], tmp_path: Path) -> None:
    a, b = (str(r.path) for r in runs)
    page = tmp_path / "both.html"
    done = CliRunner().invoke(app, ["compare", a, b, "-o", str(page)])
    assert done.exit_code == 0, done.output  # nobody knows what is allowed: no verdict
    assert done.output.startswith("b.h5 differs from a.h5 by up to")
    assert "no verdict; not judged, for no error of it is known: " in done.output
    assert page.exists()
    with pytest.raises(ResultsError, match="no such results file"):  # main() makes exit code 3 of it
        CliRunner().invoke(app, ["compare", a, str(tmp_path / "none.h5")], catch_exceptions=False)
    with pytest.raises(ResultsError, match="not a page"):
        CliRunner().invoke(app, ["compare", a, b, "-o", a], catch_exceptions=False)


def test_an_axisymmetric_scene_is_told_in_r_and_z(tmp_path: Path) -> None:
    a, b = (write_run(tmp_path / f"{n}.h5", replace(CASE, windows=10)) for n in "ab")
    d = compare(a, b).differences[0]
    apart = replace(d, curves=replace(d.curves, quantity="u_y", unit="m", name="top"), a=0.0, b=1e-3)
    c = replace(compare(a, b), differences=(apart,))
    assert "displacement u_z" in sentence(c, ("a", "b"), "K", "axisymmetric")
    assert "displacement u_y" in sentence(c, ("a", "b"), "K")


def test_a_run_that_is_not_to_be_trusted_is_named(runs: tuple[Results, Results], tmp_path: Path) -> None:
    a, b = runs[0], Results(runs[1].path)
    b.totals["trust"] = [Check("exchange is stable", TrustVerdict.BROKEN, 1.5, 1.0, what="it grows").as_dict()]
    page, text = write_comparison(a, b, tmp_path / "page.html")
    assert text.splitlines()[-1] == "  do not trust b.h5: exchange is stable: it grows"
    assert "Do not trust b.h5." in page.read_text(encoding="utf-8")
    page, text = write_comparison(a, runs[1], tmp_path / "page.html")
    assert "trust" not in text
    assert "Do not trust" not in page.read_text(encoding="utf-8")


def test_how_far_a_straight_line_is_off():
    """Of a parabola exactly; a kink at an end of a window bends nothing inside."""
    own, t = np.array([0.0, 1.0, 3.0, 4.0, 6.0]), np.array([0.0, 0.5, 2.0, 3.5, 5.0, 6.0])
    line = np.interp(t, own, 2.0 * own**2)
    assert off_line(own, 2.0 * own**2, t) == pytest.approx(line - 2.0 * t**2)
    assert off_line(own, np.abs(own - 3.0), t) == pytest.approx(0.0)
    assert off_line(own[:2], own[:2], t) == pytest.approx(0.0)
    assert off_line(own, np.where(own > 3.0, np.nan, own), np.array([5.0])) == [0.0]
