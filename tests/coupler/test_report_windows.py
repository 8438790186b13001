"""What the report tells of windows and of their errors, in words and as bands."""

from __future__ import annotations

import base64
import sys
from pathlib import Path

import numpy as np
import pytest

from coupler.record.results import Results, _ProbeSeries
from coupler.record.tables import ERROR_FIELDS
from coupler.report.control import EACH, commonest, every_window, iterates_picture, stretches
from coupler.report.curves import error_of, probe_pictures
from coupler.report.heat import heat_table
from coupler.report.page import about, answer, render
from coupler.report.player import fields_to_show

sys.path.insert(0, str(Path(__file__).parent))
from synthetic_run import END, Case, blocks, level, times_of, write_run


@pytest.fixture
def run(tmp_path: Path) -> Results:
    return write_run(tmp_path / "run.h5", Case())


def with_errors(results: Results, kelvin: float) -> Results:
    """As if every window taken but the last had this error in T."""
    rows = np.flatnonzero(results.windows.taken)[:-1]
    results.errors = np.array([(k, kelvin, *[np.nan] * (len(ERROR_FIELDS) - 2)) for k in rows],
                              dtype=list(ERROR_FIELDS)).view(np.recarray)
    return results


def test_stretches_end_at_kinks_and_where_the_scheme_changes(run: Results) -> None:
    found, count = stretches(run)
    # Windows are 625 s long; of kinks at 9900 and 10000 s, and at 14773 and 15000 s, one ends a window.
    assert [float(s.start) for s in found] == [0, 2500, 10000, 12500, 15000]
    assert [float(s.end) for s in found] == [2500, 10000, 12500, 15000, END]
    assert count == 5
    assert sum(s.windows for s in found) == 40
    assert sum(s.rejected for s in found) == 4
    assert sum(s.solves for s in found) == run.windows.solves.sum()
    assert {s.sizes for s in found} == {"625"}
    run.windows.scheme[5:] = "staggered"
    # The fifth row is the first after 2500 s: one is a window rejected.
    assert [(s.scheme, s.windows) for s in stretches(run)[0]][:3] == [
        ("extrapolated", 4), ("staggered", 12), ("staggered", 4)]


@pytest.mark.few("0.25")
@pytest.mark.parametrize("contraction", [np.nan, 0.25])
def test_contractions_are_drawn_where_any_was_measured(run: Results, contraction: float) -> None:
    run.windows.iterations[:], run.windows.contraction[:] = 3, contraction
    picture = iterates_picture(run)
    assert picture is not None
    drawn = base64.b64decode(picture.src.partition(",")[2]).decode()
    assert ("<!-- plain iteration diverges above -->" in drawn) == np.isfinite(contraction)
    assert ("below" in picture.alt) == np.isfinite(contraction)


def test_every_window_has_its_verdict_and_why(run: Results) -> None:
    rows = every_window(run)
    assert len(rows) == len(run.windows) < EACH
    assert [r.verdict for r in rows].count("thermal discard") == 4
    assert {r.why for r in rows if r.verdict == "thermal discard"} == {Case().message}
    assert {r.why for r in rows if r.verdict == "accepted"} == {"as the schedule says"}


def test_the_error_of_a_window_stands_at_its_end(run: Results) -> None:
    assert error_of(run, "T") is None
    error = error_of(with_errors(run, 2.5), "T")
    assert error is not None
    assert np.isnan(error[[0, -1]]).all()
    assert (error[1:-1] == 2.5).all()
    assert error_of(run, "gap") is None  # not known
    assert error_of(run, "p") is None  # never told


def test_curves_carry_their_error(run: Results) -> None:
    bare = probe_pictures(run)[0]
    banded = probe_pictures(with_errors(run, 2.5))[0]
    assert "Bands: the estimated error of each window, at most 2.5 °C" not in banded.caption  # a difference is in K
    assert "Bands: the estimated error of each window, at most 2.5 K" in banded.caption
    assert "Bands" not in bare.caption
    drawn = [base64.b64decode(p.src.split(",", 1)[1]).decode().count("FillBetween") for p in (bare, banded)]
    assert drawn[1] > drawn[0]


def test_the_highest_temperature_may_be_that_of_the_start(tmp_path: Path) -> None:
    results = write_run(tmp_path / "run.h5", Case(windows=4, frames=0))
    start = float(level(blocks(4), 0.0).T.max())
    assert results.max_T == start
    results.max_T = 2000.0
    assert "highest temperature is 1726.8 °C" in answer(results)[0]
    assert times_of(Case(windows=4))[0] == 0.0


def test_a_run_that_moves_no_heat_says_so(tmp_path: Path) -> None:
    """Mechanics alone: one temperature is neither a highest nor a lowest, and nothing is there to balance."""
    results = write_run(tmp_path / "run.h5", Case(windows=4, frames=0))
    results.max_T = 293.15
    results.extremes["thermal.T"] = np.full((5, 2), 293.15)
    results._terms = {name: np.zeros_like(course) for name, course in results._terms.items()}
    said = answer(results)
    assert said[0] == "The temperature is 20 °C everywhere, from start to end."
    assert said[2].startswith("No heat moves in this run")
    assert "balance" not in said[2]
    assert heat_table(results) is None
    shown = [s.field.label for s in fields_to_show(results)]
    assert shown.index("T") > 0
    results.extremes["thermal.T"][3, 1] = 294.0
    assert next(s.field.label for s in fields_to_show(results)) == "T"


@pytest.mark.parametrize(("size", "begins"), [(1e-7, "Bodies are pressed together from the start"),
                                              (2.5, "Bodies press on each other first at t = 2.5 s")])
def test_what_closes_at_once_is_in_touch_from_the_start(size: float, begins: str, tmp_path: Path) -> None:
    """A pair drawn in touch carries its first pressure at the end of the first window, however short that is."""
    results = write_run(tmp_path / "run.h5", Case(windows=4, frames=0))
    results.windows.max_p[:], results.windows.H[0] = 1e6, size
    assert answer(results)[1].startswith(begins)


def test_a_scene_speaks_for_itself(tmp_path: Path) -> None:
    text = "# Two blocks meet.\n# They are <hot>.\n#\n# Run it: now\nslideline: 2\n"
    results = write_run(tmp_path / "run.h5", Case(windows=2, frames=0, text=text))
    assert about(results) == "Two blocks meet. They are <hot>."
    assert "They are &lt;hot&gt;." in render(results)
    assert about(write_run(tmp_path / "b.h5", Case(windows=2, frames=0))) == ""


def test_axes_of_a_round_scene_are_r_and_z(tmp_path: Path) -> None:
    results = write_run(tmp_path / "run.h5", Case(windows=4, frames=0))
    results.header["geometry"] = "axisymmetric"
    results._probes["lift"] = _ProbeSeries(np.arange(5) * 1e-3, "m", "u_y")
    caption = next(p.caption for p in probe_pictures(results) if "lift" in p.caption)
    assert caption.startswith("Displacement u_z of")


def test_reasons_of_several_windows_tell_the_range_of_their_numbers(run: Results) -> None:
    run.reasons = {k: f"error of temperature is {0.5 + k / 4:g} times its tolerance; block2 at 3 s" for k in range(3)}
    run.reasons[3] = "extrapolated: contraction 2.5e-05"
    assert commonest(run, [0, 1, 2, 3]) == ("error of temperature is 0.5 to 1 times its tolerance; block2 at 3 s (3); "
                                            "extrapolated: contraction 2.5e-05 (1)")
