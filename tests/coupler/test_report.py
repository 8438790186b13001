"""The report: its numbers, what it does with strange runs and strange names, and that it loads nothing."""

from __future__ import annotations

import base64
import re
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from coupler.errors import ResultsError
from coupler.fmu.outputs import On, OutputField
from coupler.record.paths import checkpoint_of, journal_of, stopped_of
from coupler.record.results import Results
from coupler.report import write_report
from coupler.report.curves import eventful
from coupler.report.fields import outline
from coupler.report.figures import choose, duration, named, number, shown, spread
from coupler.report.page import render

sys.path.insert(0, str(Path(__file__).parent))
from synthetic_run import Case, blocks, record, write_run

CASE = Case()
FEW = Case(windows=3, frames=0, probes=False, reject=0)


class Page(HTMLParser):
    """What a browser would see: text without tags, tables as rows, images, every attribute that loads something."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.text, self.rows, self.images, self.loads, self.tags = "", [], [], [], []
        self._open = False
        self.feed(html)
        self.close()

    def handle_starttag(self, tag: str, attrs: list) -> None:
        self.tags.append(tag)
        self.loads += [v for k, v in attrs if k in ("src", "href", "data", "action", "srcset", "poster")]
        if tag == "img":
            self.images.append(dict(attrs))
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
            self._open = True

    def handle_endtag(self, tag: str) -> None:
        self._open = self._open and tag not in ("td", "th")

    def handle_data(self, data: str) -> None:
        self.text += "" if self.tags[-1:] in (["style"], ["script"]) and data.strip() else data
        if self._open:
            self.rows[-1][-1] += data.strip()

    def row(self, first: str) -> list[str]:
        return next(r for r in self.rows if r and r[0] == first)

    @property
    def words(self) -> str:
        return " ".join(self.text.split())


def page_of(results: Results, folder: Path) -> Page:
    return Page(write_report(results, folder / "report.html").read_text("utf-8"))


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Page:
    folder = tmp_path_factory.mktemp("report")
    return page_of(write_run(folder / "run.h5", CASE), folder)


def test_summary_tells_the_numbers(page: Page) -> None:
    found = re.search(r"The run completed: (\d+) s of simulated time in (\d+) windows \((\d+) rejected\) with "
                      r"(\d+) solver calls, in ([\d.]+) s of wall-clock time", page.words)
    assert found is not None
    assert [float(x) for x in found.groups()] == [25000, 40, 4, 84, 2.5]
    assert "The relative energy-balance error is 0.0001." in page.words
    assert "highest temperature is 1000 °C" in page.words
    assert "highest contact pressure is 10 MPa, at t = 12500 s" in page.words
    assert "press on each other first at t = 10625 s" in page.words


def test_a_completed_run_has_no_banner(page: Page) -> None:
    assert "This run" not in page.words


def test_heat_table_holds_the_ledger(page: Page) -> None:
    assert page.row("prescribed temperature, in") == ["prescribed temperature, in", "2.8000"]
    assert page.row("convection")[1] == "-0.8000"
    names = [r[0] for r in page.rows if r]
    assert [names.count(n) for n in ("convection", "stored in lower", "stored in upper")] == [1, 1, 1]
    assert page.row("stored in upper")[1] == "0.5992"
    assert [r[1] for r in page.rows if r and r[0] == "total"] == ["2.0000", "1.9992"]
    assert page.row("solid contact") == ["solid contact", "-1.2000", "1.2000", "0"]
    assert "per metre of depth" in page.words


def test_time_table_adds_up(page: Page) -> None:
    seconds = {n: float(page.row(n)[1].split()[0]) for n in (
        "thermal half", "mechanical half", "FMI and transport", "recording", "coupler", "set-up")}
    assert (seconds["thermal half"], seconds["mechanical half"]) == (0.8, 0.4)
    assert (seconds["FMI and transport"], seconds["set-up"]) == (0.2, 0.5)
    assert sum(seconds.values()) == pytest.approx(2.5, abs=0.005)


def test_rejected_windows_are_listed_with_their_reason(page: Page) -> None:
    rows = [r for r in page.rows if len(r) == 4 and r[-1] == CASE.message]
    assert len(rows) == 4
    assert rows[0] == ["625", "1250", "thermal discard", CASE.message]


def test_pictures_say_what_they_show_and_are_whole(page: Page) -> None:
    assert len(page.images) == 11
    assert all(len(i["alt"]) > 30 for i in page.images)
    for image in page.images:
        head, data = image["src"].split(",", 1)
        content = base64.b64decode(data, validate=True)
        assert content.startswith(b"\x89PNG" if "png" in head else b"<?xml")
    temperatures = next(i["alt"] for i in page.images if "against time" in i["alt"])
    assert "lower.top.left 0 °C at first, 18 °C at last" in temperatures
    assert "upper.bottom.centre 1000 °C at first" in temperatures
    assert sum("Temperature of the bodies at t = 0 s" in i["alt"] for i in page.images) == 1


def test_the_page_loads_nothing(page: Page) -> None:
    assert page.loads
    assert all(v.startswith("data:image/") for v in page.loads)
    assert not {"link", "iframe", "object", "embed", "a"} & set(page.tags)


def test_facts_and_versions(page: Page) -> None:
    assert page.row("halves")[1] == "thermal: thermal, mechanical: elastic"
    assert "slave upper.bottom, master lower.top" in page.row("contact pairs")[1]
    assert page.row("breakpoints")[1].startswith("2500 s, 9900 s, 10000 s, 12500 s, 14772.7 s, 15000 s")
    assert page.row("versions")[1] == "python 3.11, numpy 2.0"
    assert "a note of the run" in page.words
    assert "slideline: 2 title: synthetic" in page.words


def test_names_of_strangers_are_text(tmp_path: Path) -> None:
    bad = "<script>alert('x')</script>"
    case = Case(windows=3, frames=2, title=bad, text=f"</pre>{bad}", message=f"{bad} & more", reject=2)
    results = write_run(tmp_path / "run.h5", case, "failed", bad)
    html = write_report(results, tmp_path / "r.html").read_text("utf-8")
    # Two blocks of data and our own script, which alone the policy lets run.
    assert html.count("<script") == html.count("</script>") == 3
    assert "&lt;script&gt;" in html
    page = Page(html)
    assert page.words.count(bad) >= 4  # title, heading, banner, scenario, message of a window


def test_a_gap_that_faces_nothing_is_not_drawn(tmp_path: Path) -> None:
    results = write_run(tmp_path / "run.h5", Case(windows=10, frames=0, reject=0))
    gap = results._probes["gap"].values
    gap[-3:] = results.header["pairs"][0]["gap_max"]
    page = page_of(results, tmp_path)
    assert any("probe gap against time" in i["alt"] and "gap 50.8 mm at first, none at last" in i["alt"]
               for i in page.images)


def test_mechanisms_that_moved_no_heat_are_left_out(tmp_path: Path) -> None:
    results = write_run(tmp_path / "run.h5", Case(windows=3, frames=0, probes=False))
    results._terms["source"] = np.zeros(4)
    results._terms["flux"] = np.array([0.0, 5.0, 5.0, 0.0])
    names = [r[0] for r in page_of(results, tmp_path).rows if r]
    assert "prescribed flux" in names
    assert "thermal source" not in names


def test_probe_names_are_no_formulas(tmp_path: Path) -> None:
    results = write_run(tmp_path / "run.h5", Case(windows=3, frames=0))
    for old, new in zip(results.probe_names[:3], ("_hidden", "cost $x^$", "<b>&amp;"), strict=True):
        results._probes[new] = results._probes.pop(old)
    svg = base64.b64decode(page_of(results, tmp_path).images[0]["src"].split(",", 1)[1]).decode()
    for label in ("_hidden", "cost $x^$", "&lt;b&gt;&amp;amp;"):
        assert label in svg


@pytest.mark.few("something-did not complete (something)")
@pytest.mark.parametrize(("outcome", "headline"), [
    ("failed", "This run failed."), ("interrupted", "This run was interrupted."),
    ("stopped", "This run was stopped before its end."), ("something", "did not complete (something)")])
def test_a_run_that_did_not_complete_has_a_banner(tmp_path: Path, outcome: str, headline: str) -> None:
    results = write_run(tmp_path / "run.h5", Case(windows=1, frames=0, probes=False), outcome, "out of patience")
    words = page_of(results, tmp_path).words
    assert headline in words
    assert "out of patience." in words


def test_a_killed_run_says_how_far_it_came(tmp_path: Path) -> None:
    record(tmp_path / "run.h5", Case(windows=10, probes=False, frames=2))._journal.close()
    words = page_of(Results(tmp_path / "run.h5"), tmp_path).words
    assert "This run was killed. It reached t = 25000 s of 25000 s." in words
    assert "of wall-clock time" in words
    assert "To go on" not in words
    for left in (checkpoint_of, stopped_of):
        left(tmp_path / "run.h5").touch()
    assert "To go on: slideline resume run.h5" in page_of(Results(tmp_path / "run.h5"), tmp_path).words


@pytest.mark.few("case2")
@pytest.mark.parametrize("case", [
    Case(windows=1, frames=1, reject=0), Case(windows=1, frames=0, probes=False, ledger=False, reject=0),
    Case(windows=0, frames=0, reject=0), Case(windows=3, frames=0), Case(windows=3, probes=False)])
def test_small_runs_report_too(tmp_path: Path, case: Case) -> None:
    page = page_of(write_run(tmp_path / "run.h5", case), tmp_path)
    assert f"in {case.windows} window" in page.words
    assert ("Heat" in page.words) == (case.ledger and case.windows > 0)


def test_field_files_gone_are_a_note(tmp_path: Path) -> None:
    results = write_run(tmp_path / "run.h5", Case(windows=10, frames=11, probes=False))
    results.field_files["thermal"].unlink()
    page = page_of(results, tmp_path)
    assert "No pictures of the thermal fields" in page.words
    assert any("Von Mises" in i["alt"] for i in page.images)


def test_a_later_unfinished_run_is_a_note(tmp_path: Path) -> None:
    write_run(tmp_path / "run.h5", Case(windows=1, frames=0, probes=False))
    record(tmp_path / "run.h5", Case(windows=2))._journal.close()
    results = Results(tmp_path / "run.h5")
    assert f"{journal_of(results.path).name} is beside it" in page_of(results, tmp_path).words


def test_what_cannot_be_read_or_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match="no such results file"):
        write_report(Results(tmp_path / "none.h5"), tmp_path / "r.html")
    results = write_run(tmp_path / "run.h5", Case(windows=1, frames=0))
    with pytest.raises(ResultsError, match="cannot be written"):
        write_report(results, tmp_path / "none" / "r.html")


def test_the_closer_look_is_where_curves_move() -> None:
    t = np.linspace(0, 100, 501)
    jump = np.clip((t - 40) / 10, 0, 1)
    assert eventful(t, [jump, 1 - jump], [40, 50, 70]) == pytest.approx((39.5, 50.5))
    assert eventful(t, [jump], []) == pytest.approx((39.5, 50.5))
    assert eventful(t, [t], []) is None
    assert eventful(t, [np.zeros(501)], [40, 50]) is None


def test_frames_chosen() -> None:
    times = np.linspace(0, 100, 101)
    told = np.interp(times, [0, 40, 60, 100], [0, 0, 1, 1]) + 0.25 * times / 100
    picks = choose(times, told, [33.0, 71.2], most=8)
    assert {0, 33, 71, 100} <= set(picks)
    assert len(picks) == 8
    assert all(40 <= k <= 60 for k in set(picks) - {0, 33, 71, 100})
    assert choose(times, told, list(range(0, 100, 5)), most=6)[::5] == [0, 100]
    assert choose(times[:1], told[:1], []) == [0]
    assert choose(times[:3], told[:3], []) == [0, 1, 2]


def test_outline_is_the_boundary_of_both_bodies() -> None:
    scene = blocks(4)
    edges = outline(scene.quads, scene.triangles)
    lengths = np.linalg.norm(np.diff(scene.nodes[edges], axis=1), axis=2)
    assert lengths.sum() == pytest.approx(8 * 0.0762, rel=1e-12)


@pytest.mark.slow
def test_a_caption_speaks_of_breakpoints_only_where_there_are_some(tmp_path: Path) -> None:
    for kinks in ((2500.0,), ()):
        page = Page(render(write_run(tmp_path / f"{len(kinks)}.h5", Case(windows=3, frames=2, kinks=kinks))))
        assert ("Thin vertical lines" in page.text) == bool(kinks)


def test_labels_of_kinks_do_not_cover_each_other() -> None:
    places = spread(np.array([0.1, 0.105, 0.5, 0.99, 0.995, 1.0]), 0.02)
    assert (np.diff(places) >= 0.02 - 1e-12).all()
    assert places[-1] <= 1.0
    assert places[2] == 0.5


@pytest.mark.parametrize(("value", "digits", "text"), [
    (25000.0, 4, "25000"), (14772.727, 6, "14772.7"), (3.21e-15, 2, "3.2e-15"), (0.0, 4, "0"), (-0.8, 6, "-0.8"),
    (1e7, 3, "1e+07"), (0.05, 2, "0.05"), (float("nan"), 3, "nan")])
def test_numbers(value: float, digits: int, text: str) -> None:
    assert number(value, digits) == text


@pytest.mark.parametrize(("unit", "value", "text"), [
    ("m", 0.0508, "50.8 mm"), ("m", 7.1e-6, "7.1 µm"), ("m", 3.0, "3 m"), ("Pa", 1e7, "10 MPa"),
    ("Pa", 1.5e9, "1.5 GPa"), ("J", 2500.0, "2.5 kJ"), ("K", 300.0, "26.85 °C"), ("m", 0.0, "0 mm"), ("W", 3.0, "3 W"),
    ("1", 0.25, "0.25")])
def test_units_fit_the_size(unit: str, value: float, text: str) -> None:
    assert shown(unit, value, "degC").text(value) == text


def test_durations() -> None:
    assert [duration(s) for s in (0.0123, 59.0, 185.0, 7800.0)] == ["0.0123 s", "59 s", "3 min 5 s", "2 h 10 min"]


@pytest.mark.few("0.001-at the end 0.001 J")
@pytest.mark.parametrize(("rest", "said"), [(-4.9e-32, "all of it"), (1e-3, "at the end 0.001 J")])
def test_round_off_of_heat_is_not_told_as_heat(rest: float, said: str, tmp_path: Path) -> None:
    record(tmp_path / "run.h5", FEW).end("completed", "", {
        "seconds": 1.0, "setup_seconds": 0.5, "friction_heat": {"made": 3509.0, "delivered": 3509.0, "carried": rest}})
    assert page_of(Results(tmp_path / "run.h5"), tmp_path).row("friction heat")[1].endswith(said)


@pytest.mark.slow
def test_a_share_has_no_unit_beside_an_axis(tmp_path: Path) -> None:
    assert (named("solid fraction", "1"), named("gap", "mm")) == ("solid fraction", "gap [mm]")
    results = write_run(tmp_path / "run.h5", Case(melts=True))
    # The script has indices in brackets.
    assert "[1]" not in render(results).partition("<script>")[0]


@pytest.mark.slow
def test_planned_windows_are_told_where_they_are_planned(tmp_path: Path) -> None:
    """Of adaptive windows only the ends are known that they must meet."""
    results = write_run(tmp_path / "run.h5")
    for adaptive, said in ((False, "40 windows to t = 25000 s"), (True, "adaptive windows to t = 25000 s")):
        results.header["coupling"]["adaptive"] = adaptive
        assert said in page_of(results, tmp_path).row("coupling")[1]


@pytest.mark.slow
def test_extremes_have_the_unit_that_fits_each(tmp_path: Path) -> None:
    results = write_run(tmp_path / "run.h5")
    results.header["outputs"] = [OutputField("mechanical", "sigma_v", "sigma_v", On.CELLS, (0,), "Pa").to_json()]
    results.extremes["mechanical.sigma_v"] = np.array([[3.4, 20.0], [5.0, 9.6e7]] + [[5.0, 1e6]] * (len(results.t) - 2))
    row = page_of(results, tmp_path).row("von Mises stress")
    assert (row[1], row[3]) == ("3.4 Pa", "96 MPa")


def test_what_rules_look_at_has_its_unit(tmp_path: Path) -> None:
    results = write_run(tmp_path / "run.h5", FEW)
    results._monitors = {"mechanical.reaction.die[2]": np.linspace(0.0, -73066.0, len(results.t))}
    results.header["monitors"] = {"mechanical.reaction.die[2]": "N"}
    assert "least -73.066 kN, largest 0 kN" in page_of(results, tmp_path).words


def test_solid_fraction_and_flux_are_shown_where_a_run_has_them(page: Page, tmp_path: Path) -> None:
    results = write_run(tmp_path / "run.h5", Case(melts=True))
    alts = [i["alt"] for i in page_of(results, tmp_path).images]
    assert sum(alt.startswith("Solid fraction of the bodies at t = 0 s") for alt in alts) == 1
    # The largest of all cells is ten times (1000 + t) W/m2; the frame is the last, where the mean is largest.
    assert any("Heat flux" in alt and "t = 25000 s" in alt and alt.endswith("up to 260 kW/m².") for alt in alts)
    assert not any("Heat flux" in i["alt"] or "Solid fraction" in i["alt"] for i in page.images)


def test_heats_of_the_mechanical_half_are_told_apart(tmp_path: Path) -> None:
    record(tmp_path / "run.h5", FEW).end("completed", "", {
        "seconds": 1.0, "setup_seconds": 0.5, "mechanical_heat": {"made": 0.0, "delivered": 0.0, "carried": 0.0},
        "friction_heat": {"made": 5.0, "delivered": 4.0, "carried": 1.0}})
    page = page_of(Results(tmp_path / "run.h5"), tmp_path)
    assert page.row("friction heat")[1] == "made 5 J, delivered 4 J, not yet delivered at the end 1 J"
    assert not any(row and row[0] == "mechanical heat" for row in page.rows)
