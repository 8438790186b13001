"""The page in a browser: it is quiet, its numbers are those of run.h5, and what a user moves moves."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from coupler.record.results import Results
from coupler.report import write_report
from coupler.report.figures import shown
from coupler.report.player import nodes_of

sys.path.insert(0, str(Path(__file__).parent))
from browser import CHROMIUM, WHY_SKIPPED, Browser
from synthetic_run import Case, L, write_run

needs_browser = pytest.mark.skipif(not CHROMIUM, reason=WHY_SKIPPED)
PIXELS = """(() => { const c = document.querySelector("canvas.bodies");
  const d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
  let h = 0; for (let k = 0; k < d.length; k++) h = (31 * h + d[k]) | 0; return h; })()"""
SLIDE = """(() => { const s = document.querySelector("#player input[type=range]");
  s.value = %d; s.dispatchEvent(new Event("input")); })()"""


def legend(chart: int) -> str:
    """The names of a chart with the values at the time of the cursor."""
    return f"""Object.fromEntries([...document.querySelectorAll('[data-chart="{chart}"] .legend button')].map(
      (b) => [b.children[1].textContent, b.querySelector(".value").textContent]))"""


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Results:
    results = write_run(tmp_path_factory.mktemp("live") / "run.h5", Case(melts=True, frames=21))
    write_report(results, results.path.with_suffix(".html"))
    return results


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile")) as b:
        yield b


@pytest.fixture
def page(browser: Browser, ran: Results) -> Browser:
    browser.resize(1280, 900)
    browser.open(ran.path.with_suffix(".html"))
    return browser


@needs_browser
@pytest.mark.few("390-True", "1280-False")
@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [390, 800, 1280, 2200])
def test_the_page_is_quiet_and_fits_every_width(width: int, dark: bool, browser: Browser, ran: Results) -> None:
    browser.resize(width, 900, dark)
    browser.open(ran.path.with_suffix(".html"))
    assert browser.troubles == []
    assert browser.value("document.documentElement.scrollWidth") <= width
    assert browser.value("getComputedStyle(document.body).backgroundColor") == (
        "rgb(18, 22, 27)" if dark else "rgb(255, 255, 255)")


@needs_browser
def test_the_slider_moves_picture_charts_and_contact_together(page: Browser, ran: Results) -> None:
    before, cursor = page.value(PIXELS), "document.querySelector('[data-chart=\"0\"] .cursor').getAttribute('x1')"
    contact, old = "document.querySelector('[data-line]').textContent", page.value(cursor)
    told = page.value(contact)
    page.value(SLIDE % 4)
    assert page.value(PIXELS) != before
    assert page.value(cursor) != old
    assert page.value(contact) != told
    t = ran.field("thermal.T")[0][4]
    assert page.value("document.querySelector('#player output').textContent") == f"t = {t:g} s"
    page.value(SLIDE % 20)
    assert page.value(PIXELS) == before
    assert page.troubles == []


@needs_browser
def test_charts_have_the_numbers_of_the_run(page: Browser, ran: Results) -> None:
    row = 23
    page.value("history.replaceState(null, '', '#')")
    page.open(ran.path.with_suffix(".html"), f"#t={ran.t[row]}")
    told = page.value(legend(0))
    for name, text in told.items():
        assert float(text) == pytest.approx(ran.probe(name, unit="degC")[1][row], rel=1e-4), name
    assert set(told) == {n for n in ran.probe_names if ran.quantity(n) == "T"}


@needs_browser
def test_the_picture_has_the_numbers_of_the_fields(page: Browser, ran: Results) -> None:
    t, T = ran.field("thermal.T")
    for k in (0, 6):
        page.value(SLIDE % k)
        said = page.value("document.querySelector('#player .said').textContent")
        low, high = T[k].min() - 273.15, T[k].max() - 273.15
        scale = shown("K", 0.0, "degC")
        assert scale.unit in said
        found = said.partition(" s: ")[2].split()
        assert float(found[0]) == pytest.approx(low, abs=0.03)
        assert float(found[2]) == pytest.approx(high, abs=0.03 + 5e-4 * high)
        assert f"t = {t[k]:g} s" in said


@needs_browser
def test_fields_of_both_halves_arrows_mesh_and_magnification_change_the_picture(page: Browser) -> None:
    page.value(SLIDE % 9)
    seen = [page.value(PIXELS)]
    groups = page.value("[...document.querySelectorAll('#player optgroup')].map((g) => g.label)")
    assert groups == ["thermal half", "mechanical half"]
    for change in ("s[0].value = [...s[0].options].find((o) => o.text === 'von Mises stress').value",
                   "s[1].selectedIndex = 1", "s[2].selectedIndex = 4"):
        page.value(f"""(() => {{ const s = document.querySelectorAll("#player select"); {change};
          for (const one of s) one.dispatchEvent(new Event("change")); }})()""")
        seen.append(page.value(PIXELS))
    # fifth of 1, 2, 5, 10, 20: a picture that is not to scale says so in words
    said = page.value("document.querySelector('#player .said').textContent")
    assert "Deformations are drawn 20 times as large as they are" in said
    for k in range(3):
        page.value(f"document.querySelectorAll('#player input[type=checkbox]')[{k}].click()")
        seen.append(page.value(PIXELS))
    page.value("[...document.querySelectorAll('#player button')].find((b) => b.textContent === 'Contact').click()")
    seen.append(page.value(PIXELS))
    # The blocks of this run are rigid, and what bodies do as a whole is not magnified.
    assert seen.pop(3) == seen[2]
    assert len(set(seen)) == len(seen)
    assert page.troubles == []


@needs_browser
def test_the_whole_view_holds_the_bodies_at_all_times(page: Browser) -> None:
    """The upper block slides by more than its own width, and not at first; a narrow window has no room to spare."""
    page.resize(380, 900)
    page.value("[...document.querySelectorAll('#player button')].find((b) => b.textContent === 'Whole').click()")
    edge = """(() => { const c = document.querySelector("canvas.bodies"), x = c.getContext("2d");
      const at = (...box) => [...x.getImageData(...box).data];
      const all = [at(0, 0, c.width, 1), at(0, c.height - 1, c.width, 1), at(0, 0, 1, c.height),
        at(c.width - 1, 0, 1, c.height)].flat();
      return [...new Set(all)].length; })()"""
    for k in (0, 15, 20):
        page.value(SLIDE % k)
        assert page.value(edge) == 1, "something is drawn at the very edge"
    assert page.troubles == []


@needs_browser
def test_charts_are_drawn_anew_for_paper(page: Browser) -> None:
    """Letters of a chart of the width of a screen, made smaller to fit a sheet, cannot be read."""
    widths = "[...document.querySelectorAll('svg.plot')].map((e) => e.viewBox.baseVal.width)"
    before = page.value(widths)
    page.value("window.dispatchEvent(new Event('beforeprint'))")
    # What observes the size of the page draws too, a frame later.
    page.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert set(page.value(widths)) == {700}
    page.value("window.dispatchEvent(new Event('afterprint'))")
    assert page.value(widths) == before
    assert max(before) > 1000
    assert page.troubles == []


@pytest.mark.slow
@needs_browser
def test_what_is_never_pressed_has_no_chart_of_pressure(browser: Browser, ran: Results, tmp_path: Path) -> None:
    charts = """[...document.querySelectorAll('[data-line] svg.plot')].map((e) => e.getAttribute('aria-label')
      .split(' ')[0])"""
    browser.open(ran.path.with_suffix(".html"))
    assert browser.value(charts) == ["pressure", "gap"]
    apart = Results(ran.path)
    for along in apart.contact.values():
        along.t_N[:] = 0.0
    browser.open(write_report(apart, tmp_path / "apart.html"))
    assert browser.value(charts) == ["gap"]
    assert "the pressure is 0 throughout the run" in browser.value("document.querySelector('[data-line]').textContent")
    assert browser.troubles == []


@pytest.mark.slow
@needs_browser
def test_numbers_beside_an_axis_are_whole_and_clear_of_its_name(browser: Browser, tmp_path: Path) -> None:
    results = write_run(tmp_path / "run.h5", Case(frames=3))
    with h5py.File(results.path, "r+") as f:
        for name in results.probe_names:
            f[f"probes/{name}"][:] *= -1.2345e21
    browser.open(write_report(Results(results.path), tmp_path / "run.html"))
    told = browser.value("""[...document.querySelectorAll("svg.plot")].map((plot) => {
      const box = (e) => e.getBoundingClientRect(), own = box(plot);
      const ticks = [...plot.querySelectorAll("text.tick[text-anchor=end]")].filter(
        (e) => box(e).right < own.left + 120);
      const name = [...plot.querySelectorAll("text.name")].find((e) => e.hasAttribute("transform"));
      return [Math.max(...ticks.map((e) => e.textContent.length)), Math.min(...ticks.map((e) => box(e).left)),
        box(name).right]; })""")
    assert max(length for length, _, _ in told) >= 5
    for _, left, right in told:
        assert left >= right, "a number lies across the name of its axis"


@needs_browser
def test_the_value_under_the_pointer_is_that_of_the_field(page: Browser, ran: Results) -> None:
    page.value(SLIDE % 0)
    box = page.value("""(() => { const c = document.querySelector("canvas.bodies").getBoundingClientRect();
      return [c.left, c.top, c.width, c.height]; })()""")
    T = ran.field("thermal.T")[1][0] - 273.15
    seen = {}
    for j in np.linspace(0.05, 0.95, 40):
        # The view holds the slide as well, by 1.1 edges to the right: both blocks are left of its middle now.
        page.mouse("mouseMoved", box[0] + 0.5 * box[2] - 0.22 * box[3], box[1] + j * box[3])
        text = page.value("""(() => { const t = document.querySelector("#player .tip");
          return t.hidden ? "" : t.children[0].textContent + "|" + t.children[1].textContent; })()""")
        if text:
            value, body = text.split("|")
            seen.setdefault(body, []).append(float(value.split()[0]))
    assert set(seen) == {"lower", "upper"}
    for values in seen.values():
        assert min(values) >= T.min() - 0.1
        assert max(values) <= T.max() + 0.1
    assert min(seen["upper"]) > max(seen["lower"]), "the upper block is the hot one"


@needs_browser
def test_drag_zooms_all_charts_and_keys_work(page: Browser) -> None:
    ticks = "[...document.querySelectorAll('[data-chart=\"%d\"] text.tick')].map((t) => t.textContent).join()"
    before = [page.value(ticks % k) for k in (0, 1)]
    page.value("document.querySelector('[data-chart=\"0\"]').scrollIntoView({block: 'center'})")
    box = page.value("""(() => { const c = document.querySelector('[data-chart="0"] svg.plot').getBoundingClientRect();
      return [c.left, c.top, c.width, c.height]; })()""")
    y = box[1] + 0.5 * box[3]
    page.mouse("mousePressed", box[0] + 0.4 * box[2], y)
    for share in (0.45, 0.5, 0.6):
        page.mouse("mouseMoved", box[0] + share * box[2], y)
    page.mouse("mouseReleased", box[0] + 0.6 * box[2], y)
    assert [page.value(ticks % k) for k in (0, 1)] != before
    assert all(page.value(ticks % k) != before[k] for k in (0, 1))
    page.value("document.querySelector('[data-chart=\"0\"] svg.plot').focus()")
    page.key("Escape")
    assert [page.value(ticks % k) for k in (0, 1)] == before
    page.key("Home")
    assert page.value("document.querySelector('#player output').textContent") == "t = 0 s"
    page.value("document.querySelector('canvas.bodies').focus()")
    page.key("ArrowRight")
    assert page.value("document.querySelector('#player output').textContent") != "t = 0 s"
    assert page.troubles == []


@needs_browser
def test_play_goes_on_by_itself_and_the_address_keeps_what_was_chosen(page: Browser, ran: Results) -> None:
    page.value(SLIDE % 2)
    page.value("document.querySelector('#player button').click()")
    page.wait("Number(document.querySelector('#player input[type=range]').value) >= 4")
    page.value("document.querySelector('#player button').click()")
    page.value(SLIDE % 3)
    state = page.value("location.hash")
    page.open(ran.path.with_suffix(".html"), state)
    assert page.value("document.querySelector('#player input[type=range]').value") == "3"


@needs_browser
def test_without_scripts_the_pictures_are_there(browser: Browser, ran: Results) -> None:
    browser.call("Emulation.setScriptExecutionDisabled", value=True)
    try:
        browser.call("Page.navigate", url=f"file://{ran.path.with_suffix('.html').resolve()}")
        browser.wait("document.images.length > 5 && [...document.images].every((i) => i.offsetHeight > 0)")
    finally:
        browser.call("Emulation.setScriptExecutionDisabled", value=False)


def test_a_slave_surface_is_found_by_its_body_and_place(ran: Results) -> None:
    mesh, along = ran.mesh(), ran.contact["interface"]
    pair = ran.header["pairs"][0]
    mesh.nodes[mesh.node_body == 1] -= [0.0, mesh.nodes[mesh.node_body == 1, 1].min() - L]  # the blocks touch
    along.X[:, 1] = L
    nodes = nodes_of(ran, mesh, pair, along)
    assert (mesh.node_body[nodes] == 1).all()
    assert np.array_equal(mesh.nodes[nodes], along.X)
