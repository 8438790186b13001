"""Temperatures stay within their data: after a touch, in long and short windows, under films and on stretched cells."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).parent))

from random_scenes.invariants_cycles import CYCLES
from random_scenes.invariants_thermal import WITHIN
from random_scenes.kept import Kept
from random_scenes.scene import Scene
from random_scenes.story import COMPLETED, Story, told
from thermal_scenes import Box, FlatContact, imbalance, inputs_of, scene, spec

from thermal_fmu.cells import cell_mesh, shapes_of
from thermal_fmu.half import load
from thermal_fmu.limiter import NodesAtEnd, went_beyond

MENDED = Path(__file__).resolve().parents[1] / "random_scenes/faults"
LAWS = (WITHIN, CYCLES)
STEEL = {"rho": 7800, "c": 480, "k": 45}


def story(doc: dict[str, Any], **recipes: Any) -> Story:
    whole = {"slideline": 2, "units": {"temperature": "K"}, "geometry": "plane", **doc}
    found = told(Scene(whole, recipes))
    assert found.outcome == COMPLETED, found.message
    assert not [word for word in found.words if "do not trust" in word]
    return found


def bars(h: float, scheme: str | None) -> np.ndarray:
    """(windows,) the hot surface of two aluminium bars from 50 s on, when they touch; moved at 20 um/s."""
    found = story({
        "materials": {"al": {"rho": 2700, "c": 900, "k": 210}},
        "bodies": {"a": {"material": "al", "T0": 500}, "b": {"material": "al", "T0": 300}},
        "contact": {"p": {"slave": "a.right", "master": "b.left", "gap_max": 0.02,
                          "conduction": {"closed": {"law": "constant", "h": h}, "open": None}}},
        "thermal": {"half": "thermal", "boundary": []},
        "mechanical": {"half": "rigid", "rigid": {"motion": {"a": {"u_x": {"t": [0, 100], "value": [0, 2e-3]}}},
                                                  "pressure": {"p": 1e6}}},
        "coupling": {"end": 70, "windows": [{"until": 70, "size": 1}], **({"scheme": scheme} if scheme else {})}},
        a={"patch": [[0, 0], [0.1, 0], [0.1, 0.01], [0, 0.01]], "cells": [40, 1]},
        b={"patch": [[0.101, 0], [0.201, 0], [0.201, 0.01], [0.101, 0.01]], "cells": [40, 1]})
    x = np.array(found.interface.nodes)
    surface = np.flatnonzero(np.abs(x[:, 0] - 0.1) < 1e-9)[0]
    return found.T[np.array([level.t for level in found.levels]) > 50.5, surface]


@pytest.mark.few("staggered-1000000.0")
@pytest.mark.parametrize("h", [1e5, 1e6])
@pytest.mark.parametrize("scheme", [None, "staggered", "extrapolated", "iterated", "auto"])
def test_contact_that_closes_in_a_run_does_not_ring(h: float, scheme: str | None) -> None:
    """500, 329, 475, 338, 465 K before; a window after the touch 400 to 408 K, and 401.4 K at last."""
    T = bars(h, scheme)
    T = T[T < 499.0]
    assert T.size >= 18
    assert T.min() > 400.0
    assert T.max() < 408.0
    assert (np.diff(T) < 0.0).all()


def plate(boundary: list[dict[str, Any]], dt: float, n: int = 20, method: str | None = None, T0: float = 300.0,
          cells: tuple[int, int] = (4, 4)) -> np.ndarray:
    """(windows, nodes) temperatures of a steel plate of 1 cm in n windows of dt [s]."""
    return story({"materials": {"st": STEEL}, "bodies": {"p": {"material": "st", "T0": T0}},
                  "thermal": {"half": "thermal", "boundary": boundary, **({"method": method} if method else {})},
                  "mechanical": {"half": "rigid"},
                  "coupling": {"end": n * dt, "windows": [{"until": n * dt, "size": dt}]}},
                 p={"patch": [[0, 0], [0.01, 0], [0.01, 0.01], [0, 0.01]], "cells": list(cells)}).T


@pytest.mark.few("midpoint-0.01", "sdirk2-0.001")
@pytest.mark.parametrize("dt", [1.0, 0.1, 0.01, 0.001])
@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "backward_euler"])
def test_short_windows_beside_a_jump_do_not_undershoot(dt: float, method: str) -> None:
    """300.0, 287.3, 191.1, 168.7 K before."""
    T = plate([{"on": "p.left", "temperature": 800}], dt, method=method)
    assert T.min() >= 300.0 - 1e-9
    assert T.max() <= 800.0 + 1e-9


def test_a_quench_has_no_peak() -> None:
    """1396 K from 1200 before."""
    T = plate([{"on": "p.left", "temperature": 300}], 1e-3, T0=1200.0)
    assert T.max() <= 1200.0 + 1e-9


def test_short_windows_of_a_body_that_radiates_go_through() -> None:
    """It ended at "radiates at -33 K" before."""
    T = plate([{"on": "p.left", "temperature": 1500}, {"on": "p.right", "radiation": {"emissivity": 0.8, "T": 300}},
               {"on": "p.top", "radiation": {"emissivity": 0.8, "T": 300}}], 1e-3)
    assert T.min() >= 300.0 - 1e-9


@pytest.mark.few("1.0-100.0")
@pytest.mark.parametrize("Bi", [1.0, 100.0])
@pytest.mark.parametrize("dt", [1.0, 0.01])
def test_films_of_any_biot_number_stay_within(Bi: float, dt: float) -> None:
    T = plate([{"on": "p.left", "convection": {"h": Bi * 45 / 0.0025, "T": 800}}], dt, cells=(4, 8))
    assert T.min() >= 300.0 - 1e-6 * 500
    assert T.max() <= 800.0 + 1e-6 * 500


@pytest.mark.few("cells2")
@pytest.mark.parametrize("cells", [(4, 16), (4, 40), (16, 4), (8, 8)])
def test_stretched_cells_stay_within(cells: tuple[int, int]) -> None:
    """A jump along the surface: 1.7 K below 300 K before, by backward Euler at aspect 4 and 10."""
    hot = {"terms": [{"t": 300}, {"t": 500, "x": {"at": [0, 0.0049, 0.0051, 0.01], "value": [1, 1, 0, 0]}}]}
    T = plate([{"on": "p.bottom", "temperature": hot}], 0.3, n=10, method="backward_euler", cells=cells)
    assert T.min() >= 300.0 - 1e-9
    assert T.max() <= 800.0 + 1e-9


@pytest.mark.few("midpoint_rings_after_a_touch")
@pytest.mark.parametrize("name", ["midpoint_overshoots_in_long_windows", "midpoint_rings_after_a_touch",
                                  "undershoot_in_short_windows"])
def test_a_fault_of_before_is_mended(name: str) -> None:
    kept = Kept.read(MENDED / f"{name}.yaml")
    assert kept.judged({i.name: i for i in LAWS}[kept.invariant]).verdict == "holds"


def test_a_step_that_is_taken_again_loses_no_heat(monkeypatch: pytest.MonkeyPatch) -> None:
    """After a wall has jumped unseen a step is taken again in four, and the ledger closes to round-off."""
    monkeypatch.setattr("thermal_fmu.substeps.held_value_jumps", lambda *_: False)
    bar, link = scene(Box(0, 1, 0, 1, 20)), FlatContact()
    half = load(bar, spec([{"on": "a.right", "temperature": 400.0, "name": "wall"}], T0=400.0))
    inputs = inputs_of(bar, half)
    state, _ = half.start(inputs, 0.0, link)
    outputs = []
    for i in range(12):
        done = half.step(state, inputs | ({"load.wall": 0.75} if i >= 5 else {}), 0.02 * i, 0.02, link)
        state = done.state
        outputs.append(dict(done.outputs))
    iterations = [o["iterations"] for o in outputs]
    assert max(iterations[:5]) == 0.0
    assert 5.0 in iterations[5:8]
    assert imbalance(outputs) < 1e-12


def test_what_went_beyond() -> None:
    """A stiff node that rose while heat leaves it overshot; one that is not stiff, or only by a little, did not."""
    def beyond(into: float, s: float = 350.0, diagonal: float = 10.0) -> bool:
        one = np.ones(3)
        return went_beyond(NodesAtEnd(np.array([300.0, 300.0, 400.0]), np.array([s, 300.0, 400.0]), one > 0,
                                      np.array([into, 0.0, 0.0]), one, diagonal * one), 0.5)

    assert beyond(-100.0)
    assert not beyond(100.0)
    assert not beyond(-100.0, diagonal=1.5)
    assert not beyond(-0.1)
    assert beyond(-0.1, s=400.1)


def test_a_node_that_rings_does_not_go_on() -> None:
    """It moves back, or less than half of what it did, or had not moved; outside all temperatures none may go on."""
    def beyond(before: float, s: float = 350.0) -> bool:
        one = np.ones(3)
        return went_beyond(NodesAtEnd(np.array([300.0, 300.0, 400.0]), np.array([s, 300.0, 400.0]), one > 0,
                                      np.array([-100.0, 0.0, 0.0]), one, 10.0 * one, np.array([before, 0.0, 0.0])), 0.5)

    assert not beyond(30.0)
    assert not beyond(13.0)
    assert not beyond(99.0)
    assert beyond(12.0)
    assert beyond(101.0)
    assert beyond(0.0)
    assert beyond(-50.0)
    assert beyond(60.0, s=401.0)


def slide_off(windows: int) -> tuple[np.ndarray, np.ndarray]:
    """(windows,) ends and (windows, nodes) temperatures of a hot block that slides off a cold one in 40 s."""
    found = story({
        "materials": {"st": STEEL}, "bodies": {"a": {"material": "st", "T0": 500}, "b": {"material": "st", "T0": 300}},
        "contact": {"p": {"slave": "a.bottom", "master": "b.top", "gap_max": 0.02,
                          "conduction": {"closed": {"law": "constant", "h": 2e4}, "open": None}}},
        "thermal": {"half": "thermal", "boundary": [{"on": "a.top", "temperature": 500},
                                                    {"on": "b.bottom", "temperature": 300}]},
        "mechanical": {"half": "rigid", "rigid": {"pressure": {"p": 1e6}, "motion": {
            "a": {"u_x": {"t": [0, 2, 44], "value": [0, 0, 0.01]}}}}},
        "coupling": {"end": 44, "scheme": "extrapolated", "windows": [{"until": 44, "size": 44 / windows}]}},
        a={"patch": [[0, 0], [0.01, 0], [0.01, 0.01], [0, 0.01]], "cells": [4, 4]},
        b={"patch": [[0, -0.01], [0.01, -0.01], [0.01, 0], [0, 0]], "cells": [4, 4]})
    return np.array([level.t for level in found.levels]), found.T


@pytest.mark.slow
def test_a_node_follows_a_contact_that_shrinks() -> None:
    """15.9 of 200 K off at the last touch before, when nodes were held to the balance of the middle of each window."""
    t, T = slide_off(22)
    fine_t, fine = slide_off(8 * 22)
    off = np.abs(T - fine[np.searchsorted(fine_t, t - 1e-9)]).max(axis=1)
    assert off[2:].max() <= 0.03 * 200.0


@pytest.mark.parametrize("inner", [0.0, 0.01, 1.0])
@pytest.mark.parametrize("aspect", [0.05, 0.3, 0.7, 1.0, 1.5, 3.0, 20.0])
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_no_rectangle_couples_with_the_wrong_sign(aspect: float, geometry: str, inner: float) -> None:
    """A rectangle twice as long along an axis of revolution as across had 6 % there before."""
    outer = inner + 0.02 * aspect
    mesh = cell_mesh(scene(Box(inner, outer, 0.0, 0.02, 1, 1), geometry=geometry))
    shape, = shapes_of(mesh, np.array([[inner, 0], [outer, 0], [inner, 0.02], [outer, 0.02]]))
    K = np.einsum("q,qia,qja->ij", shape.dC[0], shape.G[0], shape.G[0])
    assert K[~np.eye(4, dtype=bool)].max() <= 1e-12 * K.max()
    assert np.abs(K.sum(axis=0)).max() <= 1e-12 * K.max()
