"""Nothing goes up and down by itself: green on what is right, red under a planted fault."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from random_scenes.by_hand import box, plate, two_blocks
from random_scenes.direct_half import DirectHalf
from random_scenes.invariants_cycles import CYCLES, cycles_in, period_of, swings_of
from random_scenes.scene import Scene
from random_scenes.story import told

RNG = np.random.default_rng(0)


def rod(scheme: str = "staggered", size: float = 20.0) -> Scene:
    """A bar held at 500 K that grows towards a wall at 300 K across a gas gap of 0.33 mm."""
    k_g, held = 0.01, [{"on": "bar.left", "temperature": 500}, {"on": "wall.right", "temperature": 300}]
    rollers = [{"on": "bar.left", "u_x": 0}, {"on": "bar.bottom", "u_y": 0}, {"on": "wall.right", "u_x": 0},
               {"on": "wall.bottom", "u_y": 0}]
    doc = {"slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
           "materials": {"m": {"rho": 1000, "c": 500, "k": 50, "E": 1e10, "nu": 0.3, "alpha": 2e-5, "T_ref": 300}},
           "bodies": {"bar": {"material": "m", "T0": 300}, "wall": {"material": "m", "T0": 300}},
           "contact": {"tip": {"slave": "bar.right", "master": "wall.left", "gap_max": 0.01, "conduction": {
               "closed": {"law": "constant", "h": k_g / 1e-6}, "open": {"law": "gas", "k_g": k_g, "g_m": 1e-6}}}},
           "thermal": {"half": "thermal", "method": "backward_euler", "boundary": held},
           "mechanical": {"half": "elastic", "elastic": {"boundary": rollers}},
           "coupling": {"scheme": scheme, "on_unstable": "warn", "end": 30 * size,
                        "windows": [{"until": 30 * size, "size": size}]}}
    return Scene(doc, {"bar": box(0, 0, 0.1, 0.01, (10, 1)), "wall": box(0.1 + 3.3e-4, 0, 0.01, 0.01, (2, 1))})


@pytest.mark.few("plate")
@pytest.mark.parametrize("scene", [
    plate({"on": "plate.left", "temperature": 500}, size=4.0, end=60.0),
    two_blocks(gap=1e-5, end=20.0),
    rod(scheme="iterated", size=5.0),
], ids=["plate", "blocks", "rod"])
def test_what_goes_to_rest_is_right(scene):
    story = told(scene)
    assert story.outcome == "completed", story.message
    assert not CYCLES.check(scene, story, RNG)


@pytest.mark.slow
def test_a_half_that_is_off_every_other_window_is_found(monkeypatch):
    right = DirectHalf.advance
    count = {"thermal": 0, "mechanical": 0}

    def off_by_turns(half, t, h, inputs, outputs):
        done = right(half, t, h, inputs, outputs)
        count[half.name] += 1
        if half.name == "thermal" and count["thermal"] % 2:
            return replace(done, outputs={n: v + 2.0 if n == "T" else v for n, v in done.outputs.items()})
        return done

    monkeypatch.setattr(DirectHalf, "advance", off_by_turns)
    scene = plate({"on": "plate.left", "temperature": 500}, size=20.0, end=800.0)
    found = CYCLES.check(scene, told(scene), RNG)
    assert any("temperature" in f.what for f in found)


@pytest.mark.slow
def test_an_explicit_exchange_in_long_windows_cycles():
    scene = rod()
    found = CYCLES.check(scene, told(scene), RNG)
    assert {f.what.split()[0] for f in found} == {"temperature", "gap", "pressure"}


@pytest.mark.parametrize("period", [2, 3, 5, 7])
def test_cycles_of_every_period_are_seen_and_a_decay_is_not(period):
    k = np.arange(40.0)[:, None]
    cycle = 300.0 + 5.0 * np.cos(2.0 * np.pi * k / period)
    assert any(s.lasting for s in swings_of("temperature", cycle, 200.0, 0))
    assert period_of(cycle[:, 0], 5.0) == period
    decay = 300.0 + 100.0 * np.exp(-k / 5.0) + 5.0 * np.exp(-k) * np.cos(2.0 * np.pi * k / period)
    assert not any(s.lasting for s in swings_of("temperature", decay, 200.0, 0))
    assert period_of(300.0 + 100.0 * np.exp(-k[:, 0] / 40.0), 5.0) == 0


@pytest.mark.few("60.0-True-False", "60.0-False-True")
@pytest.mark.parametrize(("error", "lasting", "is_told"), [
    (0.0, False, False), (20.0, False, False), (60.0, False, True), (60.0, True, False)])
def test_an_error_bar_tells_of_what_dies_out_within_it_alone(error, lasting, is_told):
    scene = plate({"on": "plate.left", "temperature": 500}, size=20.0, end=800.0)
    quiet = told(scene)
    number = np.arange(len(quiet.levels))
    turns = np.where(lasting | (number < 8), 25.0 * (-1.0) ** number, 0.0)
    wild = replace(quiet, levels=tuple(replace(v, T=v.T + d) for v, d in zip(quiet.levels, turns, strict=True)),
                   words=("estimated error of the probes: probe middle may be off by 12 %",), may_be_off={"K": error})
    found = [f for f in cycles_in(wild, quiet) if f.what.startswith("temperature")]
    assert found
    assert all(wild.says(*f.named_by) for f in found) == is_told
