"""A load that jumps at t = 0 acts just after it, as one that jumps later acts after that: heat, settlement and all."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from start_scenes import STEEL, edited, loaded, solved

SOFT = {**STEEL, "plastic": {"s_y": 3.0e7, "hardening": {"law": "linear", "H": 2.0e9}}}
PUSHED: dict[str, Any] = {
    "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane", "materials": {"steel": STEEL, "soft": SOFT},
    "bodies": {
        "plate": {"mesh": {"rectangle": {"origin": [-0.02, -0.02], "size": [0.08, 0.02], "cells": [8, 3]}},
                  "material": "steel", "T0": 300.0},
        "foot": {"mesh": {"rectangle": {"origin": [0, 0], "size": [0.04, 0.02], "cells": [5, 3]}},
                 "material": "soft", "T0": 300.0}},
    "contact": {"base": {"slave": "foot.bottom", "master": "plate.top", "gap_max": 0.001, "friction": {"mu": 0.2}}},
    "thermal": {"half": "thermal", "method": "backward_euler"},
    "mechanical": {"half": "elastic", "elastic": {"boundary": [
        {"on": "plate.bottom", "u_x": 0, "u_y": 0}, {"on": "foot.top", "u_x": "push"},
        {"on": "foot.top", "pressure": "press"}]}},
    "coupling": {"scheme": "staggered", "end": 4.0, "windows": [{"until": 4.0, "size": 1.0}]},
    "probes": {"p": {"p": {"max": "foot.bottom"}}, "flow": {"mechanical.flow.foot": "value"},
               "slide": {"u_x": "foot.bottom.left"}, "T": {"T": {"max": "foot"}}},
    "output": {"fields": {"every": 1}, "checkpoint": None}}
CREEPING = edited(PUSHED, materials__soft={**STEEL, "creep": {"K": 6.0e8, "m": 0.2}})


def jumping(doc: dict[str, Any], t: float, **more: Any) -> dict[str, Any]:
    """The scene pressed and pushed at once at t [s], and run for 4 s from then on."""
    signals = {name: {"t": [t, t], "value": [0.0, value]} for name, value in (("press", 6.0e7), ("push", 4.0e-5))}
    return edited(doc, signals=signals, coupling__end=4.0 + t, coupling__windows=[{"until": 4.0 + t, "size": 1.0}],
                  **more)



@pytest.mark.few("creep")
@pytest.mark.parametrize("doc", [PUSHED, CREEPING], ids=["plastic", "creep"])
def test_a_jump_at_the_start_is_one_that_comes_later(tmp_path, doc):
    now, later = solved(tmp_path, jumping(doc, 0.0), "now"), solved(tmp_path, jumping(doc, 2.0), "later")
    for name in doc["probes"]:
        here, there = now.probe(name)[1], later.probe(name)[1][2:]
        np.testing.assert_allclose(here, there, rtol=1e-7, atol=1e-9 * np.abs(there).max(), err_msg=name)
    assert now.probe("p")[1][0] == 0.0
    made = [sum(r.totals[n]["made"] for n in ("mechanical_heat", "friction_heat") if n in r.totals)
            for r in (now, later)]
    assert made[0] == pytest.approx(made[1], rel=1e-7)
    assert made[0] > 1.0
    assert not [note for note in now.header["notes"] if "in equilibrium" in note]


def test_equilibrium_is_asked_for(tmp_path):
    """Then the start is solved under the load after its jump, and what that makes of heat is told, not delivered."""
    asked = solved(tmp_path, jumping(PUSHED, 0.0, mechanical__elastic__start="equilibrium"), "asked")
    p, flow = asked.probe("p")[1], asked.probe("flow")[1]
    assert p[0] == pytest.approx(p[-1], rel=1e-2)
    # Friction slips on by a percent where it is solved again.
    assert flow[0] == pytest.approx(flow[-1], rel=2e-2)
    (note,) = [note for note in asked.header["notes"] if "in equilibrium" in note]
    assert "the start was found in equilibrium under the loads and fits there: " in note
    assert "not in the heat balance" in note


def test_a_load_without_a_jump_has_always_been_there(tmp_path):
    """A constant holds before t = 0 too.  Where that makes heat, the note says so, and how to write the other."""
    doc = edited(jumping(PUSHED, 0.0), signals={"press": 6.0e7, "push": {"t": [0, 4], "value": [0.0, 4.0e-5]}})
    results = solved(tmp_path, doc, "always")
    assert results.probe("p")[1][0] > 1e7
    (note,) = [note for note in results.header["notes"] if "in equilibrium" in note]
    assert "{t: [0, 0], value: [0, ...]}" in note
    elastic = edited(doc, materials__soft=STEEL, contact__base__friction=None, probes={})
    assert not [n for n in solved(tmp_path, elastic, "elastic").header["notes"] if "in equilibrium" in n]


@pytest.mark.few("1e-05")
@pytest.mark.parametrize("gap", [0.0, 1e-5])
def test_what_only_the_load_would_hold_begins_where_it_is_drawn(tmp_path, gap):
    """A block on another, or above it, that is pressed from t = 0 on: before, nothing presses and nothing moves."""
    doc = edited(jumping(PUSHED, 0.0), mechanical__elastic__boundary=[
        {"on": "plate.bottom", "u_x": 0, "u_y": 0}, {"on": "foot.left", "u_x": 0},
        {"on": "foot.top", "pressure": "press"}], signals__push=None,
                 bodies__foot__mesh__rectangle__origin=[0, gap])
    results = solved(tmp_path, doc, "free")
    assert results.probe("p")[1][0] == 0.0
    assert np.abs(results.field("mechanical.u")[1][0]).max() <= 1.01e-9 * 0.04  # round-off of the drawing
    assert results.probe("p")[1][1] > 4e7


def test_the_key_is_known(tmp_path):
    with pytest.raises(Exception, match=r"before_jumps.*equilibrium"):
        loaded(tmp_path, jumping(PUSHED, 0.0, mechanical__elastic__start="rest"))
