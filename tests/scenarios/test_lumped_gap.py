"""Cases E4, E8, D9, D13 built of lumped bodies and rods: where staggering holds, cycles, and what is exact."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from small_scenes import CLEARANCE, CLOSING, LUMPED_GAP, ROOT, at, solve

CASES = tomllib.loads((ROOT / "tests/expected.toml").read_text(encoding="utf-8"))
E4 = CASES["E4"]
K_G, G_M = 0.06, 10e-6
# Strains so small that lengths do not change: the cases of the page are on reference lengths, rods on current ones.
SMALL = 1e-3


def lumped(folder: Path, share: float, windows: int, scheme: str = "staggered",
           **coupling: str) -> tuple[np.ndarray, np.ndarray]:
    """T and gap of E4 from 840 K, backward Euler, windows of `share` of the critical one.  coupling : more of it."""
    size = share * E4["dt_c"]["backward_euler"]
    text = LUMPED_GAP.format(T0=840, method="backward_euler", scheme=scheme, size=size, end=windows * size)
    for key, value in coupling.items():
        text = text.replace("coupling: {", f"coupling: {{{key}: {value}, ").replace(
            "coupling:\n", f"coupling:\n  {key}: {value}\n")
    results = solve(folder, text)
    return results.probe("T")[1], results.probe("gap")[1]


@pytest.mark.slow
def test_below_the_critical_window_it_converges(tmp_path: Path) -> None:
    T, gap = lumped(tmp_path, 0.8, 120)
    assert T[-1] == pytest.approx(E4["T"], abs=1e-6)
    assert gap[-1] == pytest.approx(E4["g"], abs=0.5e-11)
    assert K_G / (gap[-1] + G_M) == pytest.approx(E4["h"], abs=0.5e-3)


@pytest.mark.few("10.0-cycle_at_10")
@pytest.mark.parametrize(("share", "key"), [(1.2, "cycle_at_1_2"), (10.0, "cycle_at_10")])
def test_beyond_it_cycles_between_two_states(tmp_path: Path, share: float, key: str) -> None:
    T, _ = lumped(tmp_path, share, 60, on_unstable="warn")
    assert sorted(T[-2:]) == pytest.approx(E4[key], abs=1e-3)
    assert T[-4:-2] == pytest.approx(T[-2:], abs=1e-4)


@pytest.mark.few("1.2")
@pytest.mark.parametrize("share", [1.2, 10.0, 100.0])
def test_beyond_it_windows_are_cut_or_iterated_unasked(tmp_path: Path, share: float) -> None:
    T, gap = lumped(tmp_path, share, 60)
    assert T[-1] == pytest.approx(E4["T"], abs=2e-3)
    assert gap[-1] == pytest.approx(E4["g"], rel=1e-4)


def test_iterated_windows_find_it_at_any_size(tmp_path: Path) -> None:
    """Ten times the critical window, by Aitken's factor; the default tolerance of T is met at the end of each."""
    T, gap = lumped(tmp_path, 10.0, 30, "iterated")
    assert T[-1] == pytest.approx(E4["T"], abs=1e-3)
    assert gap[-1] == pytest.approx(E4["g"], rel=1e-4)


@pytest.mark.slow
def test_order_of_the_extrapolated_gap(tmp_path: Path) -> None:
    """E8: midpoint, gap predicted to the middle of a window.

    The first window is held flat and damped, which costs an error of its own order: the slope is steeper at first.
    """
    case, errors = CASES["E8"], []
    for n in (40, 80, 160):
        folder = tmp_path / str(n)
        folder.mkdir()
        text = LUMPED_GAP.format(T0=840, method="midpoint", scheme="extrapolated", size=20 / n, end=20)
        results = solve(folder, text)
        errors.append(abs(results.probe("T")[1][-1] - case["T"]))
    assert -np.polyfit(np.arange(3), np.log2(errors), 1)[0] == pytest.approx(case["order_extrapolated"], abs=0.1)
    assert errors[-1] < 3e-5


def test_a_rod_that_closes_its_clearance(tmp_path: Path) -> None:
    """D9, windows long enough to be at rest at once; exact but for strains of 4e-6."""
    case = CASES["D9"]
    results = solve(tmp_path, CLEARANCE, **{
        "materials.metal.alpha": 2e-5 * SMALL, "bodies.wall.mesh.rectangle.origin": [0.1 + 1e-3 * SMALL, 0],
        "contact.gap.conduction.open.x": [0, 1e-3 * SMALL]})
    T, d = results.probe("T")[1][-1], results.probe("gap")[1][-1] / SMALL
    h = 500.0 * (1.0 - d / 1e-3)
    assert pytest.approx(case["T_B"], abs=1e-3) == T
    assert d == pytest.approx(case["d"], rel=1e-5)
    assert h == pytest.approx(case["h"], rel=1e-5)
    assert h * (T - 300.0) == pytest.approx(case["q"], rel=1e-5)
    # At full size the rod is .4 % longer, and conducts so much less.
    full = solve(tmp_path, CLEARANCE)
    assert full.probe("T")[1][-1] == pytest.approx(case["T_B"] - 0.21, abs=0.01)


def closing(folder: Path, scheme: str) -> dict[str, np.ndarray]:
    """D13 in windows of 1 to 4 s (.1 s about the contact), in small strains, and on to rest."""
    results = solve(folder, CLOSING, **{
        "materials.metal.alpha": 1.2e-5 * SMALL, "materials.metal.E": 2e9 / SMALL,
        "bodies.wall.mesh.rectangle.origin": [0.1 + 6e-5 * SMALL, 0], "bodies.rod.mesh.rectangle.cells": [140, 1],
        "coupling.scheme": scheme, "coupling.end": 20000,
        "coupling.windows": [{"until": 39, "size": 1.0}, {"until": 40, "size": 0.1}, {"until": 60, "size": 1.0},
                             {"until": 400, "size": 4.0}, {"until": 20000, "first": 4.0, "last": 1000.0}]})
    t = CASES["D13"]["t"]
    gap, p = results.probe("gap")[1] / SMALL, results.probe("p")[1]
    first = int(np.argmax(p > 0.0))
    # From the last gap to the first overlap, p L/E: a straight line is good to 1e-3 s in .1 s.
    overlap = p[first] * 0.1 / 2e9
    touch = results.t[first] - (results.t[first] - results.t[first - 1]) * overlap / (gap[first - 1] + overlap)
    return {"T": at(results, "T", t), "p": at(results, "p", t), "contact": np.array(touch),
            "rest": np.array([results.probe("T")[1][-1], p[-1]])}


def test_a_rod_that_grows_into_contact(tmp_path: Path) -> None:
    """D13, 140 cells, extrapolated.

    Contact 5 ms early (it falls with the square of the cells' size); at 50 s, soon after, p is .25 % high, later .05 %.
    """
    case, found = CASES["D13"], closing(tmp_path, "extrapolated")
    assert found["contact"] == pytest.approx(case["t_touch"], abs=0.01)
    assert found["T"] == pytest.approx(case["T"], abs=0.02)
    assert found["p"][0] == pytest.approx(1e6 * case["p"][0], rel=3e-3)
    assert found["p"][1:] == pytest.approx([1e6 * p for p in case["p"][1:]], rel=6e-4)
    assert found["rest"] == pytest.approx([case["T_steady"], 1e6 * case["p_steady"]], rel=1e-6)


@pytest.mark.slow
def test_its_touch_is_found_to_a_ten_thousandth_of_a_second(tmp_path: Path) -> None:
    """D13 by the rod halves, in small strains: 1000 cells leave 8e-5 s, and no try is put back.

    Windows are short after the jump at the left end and a quarter of a second at the touch; in windows of a second
    sdirk2 leaves 5e-4 s.  The gap is so small here that the search meets its round-off.
    """
    results = solve(tmp_path, CLOSING, **{
        "materials.metal.alpha": 1.2e-5 * SMALL, "materials.metal.E": 2e9 / SMALL,
        "bodies.wall.mesh.rectangle.origin": [0.1 + 6e-5 * SMALL, 0], "bodies.rod.mesh.rectangle.cells": [1000, 1],
        "coupling.end": 41, "coupling.events": {"locate": True},
        "coupling.windows": [{"until": 2, "first": 5e-4, "last": 0.05}, {"until": 41, "first": 0.05, "last": 0.25}]})
    case, w = CASES["D13"], results.windows
    (k, text), = ((k, text) for k, text in results.events.items() if w.taken[k])
    assert text == "pair tip closes"
    assert float(w.t[k] + w.H[k]) == pytest.approx(case["t_touch"], abs=case["event_tolerance"])
    assert (~w.taken).sum() <= case["extra_solve_pairs"]
