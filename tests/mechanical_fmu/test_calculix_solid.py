"""The mechanical half `ccx`, where CalculiX is installed: a thermoelastic press fit."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from contact.rpc.link import open_link
from mechanical_fmu import calculix
from mechanical_fmu.elastic_half import load as load_own

sys.path.append(str(Path(__file__).parent.parent / "coupler"))
from foreign_scenes import first_inputs, scenes

needs_ccx = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed (calculix-ccx)")
PRESS_FIT = {"mechanical.elastic.boundary": [{"on": "lower.left", "u_x": 0}, {"on": "upper.left", "u_x": 0},
                                             {"on": "lower.bottom", "u_y": 0}, {"on": "upper.top", "u_y": 0}]}


def warmed(half):
    link, inputs = open_link("direct"), first_inputs(half)
    state, _ = half.start(inputs, 0.0, link)
    T = np.array(inputs["T"]) + 40.0
    return half.step(state, {**inputs, "T": T}, 0.0, 1.0, link).outputs


@pytest.mark.parametrize(("changed", "said"), [
    ({"options": {"program": "no_such_ccx"}}, "no_such_ccx is not on the PATH. Install CalculiX (Debian"),
    ({"options": {"program": sys.executable, "contact": "both"}}, "options.contact must be one of"),
    ({"options": {"program": sys.executable}, "state": "plane_stress"}, "plane strain")])
def test_what_it_cannot_do_is_one_error(changed, said, tmp_path, monkeypatch):
    _, foreign = scenes(tmp_path, "mechanical", monkeypatch, **PRESS_FIT)
    with pytest.raises(ValueError, match=re.escape(said)):
        calculix.load(foreign.interface, {**foreign.models["mechanical"], **changed})


@needs_ccx
@pytest.mark.parametrize("contact", ["force", "displacement"])
def test_a_press_fit_is_that_of_our_half(contact, tmp_path, monkeypatch):
    """Free to slide and to bulge.  Other elements, and another law of large strains, of which these have 0.1 %."""
    own, foreign = scenes(tmp_path, "mechanical", monkeypatch, **PRESS_FIT)
    ours = warmed(load_own(own.interface, own.models["mechanical"]))
    out = warmed(calculix.load(foreign.interface, {**foreign.models["mechanical"], "options": {"contact": contact}}))
    u, u_own = out["x"] - own.interface.nodes, ours["x"] - own.interface.nodes
    assert np.abs(u - u_own).max() < 0.002 * np.abs(u_own).max()
    assert out["reaction.lower"][1] == pytest.approx(ours["reaction.lower"][1], rel=1e-3)
    assert out["reaction.lower"][1] == pytest.approx(-out["reaction.upper"][1], rel=1e-5)
    assert not np.array_equal(u, u_own)
    assert 1 < out["program.runs"] < 12
