"""Bodies that begin as another run left them: displacements, what points remember, contact with its friction."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from coupler import Results
from coupler.errors import ScenarioError

sys.path.insert(0, str(Path(__file__).parent))
from start_scenes import STEEL, edited, loaded, solved

PLASTIC = {**STEEL, "plastic": {"s_y": 3.0e7, "hardening": {"law": "linear", "H": 2.0e9}}}
# A foot is pressed onto a plate, pushed along it (yielding and slipping), and held: at the end nothing changes.
PRESS = {"t": [0, 2, 12], "value": [0, 4.0e7, 4.0e7]}
PUSH = {"t": [0, 2, 6, 10, 12], "value": [0, 0, 4.0e-5, -2.0e-5, -2.0e-5]}
SCENE: dict[str, Any] = {
    "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
    "materials": {"steel": STEEL, "soft": PLASTIC},
    "bodies": {
        "plate": {"mesh": {"rectangle": {"origin": [-0.02, -0.02], "size": [0.08, 0.02], "cells": [8, 3]}},
                  "material": "steel", "T0": 300.0},
        "foot": {"mesh": {"rectangle": {"origin": [0, 0], "size": [0.04, 0.02], "cells": [5, 3]}},
                 "material": "soft", "T0": 300.0}},
    "contact": {"base": {"slave": "foot.bottom", "master": "plate.top", "gap_max": 0.001,
                         "friction": {"mu": 0.2}}},
    "thermal": {"half": "thermal", "method": "backward_euler"},
    "mechanical": {"half": "elastic", "elastic": {"boundary": [
        {"on": "plate.bottom", "u_x": 0, "u_y": 0},
        {"on": "foot.top", "u_x": PUSH}, {"on": "foot.top", "pressure": PRESS}]}},
    "coupling": {"scheme": "staggered", "end": 12.0, "windows": [{"until": 12.0, "size": 1.0}]},
    "probes": {"p": {"p": {"max": "foot.bottom"}}, "peeq": {"mechanical.flow.foot": "value"},
               "slide": {"u_x": "foot.bottom.left"}, "shear": {"mechanical.contact.t_T": {"max": "foot.bottom"}},
               "sigma": {"mechanical.sigma_v": {"max": "plate"}}},
    "output": {"fields": {"every": 1}, "checkpoint": None}}


def later(doc: dict[str, Any], t: float) -> dict[str, Any]:
    """The same scene from t [s] on: its signals moved."""
    def moved(at: Any) -> Any:
        if isinstance(at, list):
            return [moved(one) for one in at]
        if isinstance(at, dict) and at.keys() == {"t", "value"}:
            value = float(np.interp(t, at["t"], at["value"]))
            rest = [(s - t, v) for s, v in zip(at["t"], at["value"], strict=True) if s > t]
            return {"t": [0.0, *(s for s, _ in rest)], "value": [value, *(v for _, v in rest)]}
        return {k: moved(v) for k, v in at.items()} if isinstance(at, dict) else at

    return moved(doc)


# Without expansion mechanics knows nothing of heat, and shows what it remembers itself.
RIGID_TO_HEAT = edited(SCENE, materials__steel__alpha=0.0, materials__soft__alpha=0.0)


def ended(doc: dict[str, Any], end: float) -> dict[str, Any]:
    return edited(doc, coupling__end=end, coupling__windows=[{"until": end, "size": 1.0}])


def after(doc: dict[str, Any], end: float = 12.0, cut: float = 5.0) -> dict[str, Any]:
    """The scene from `cut` to `end`, from what first.h5 left."""
    doc = ended(later(doc, cut), end - cut)
    for body in doc["bodies"].values():
        body["u0"] = body["T0"] = {"from": "first.h5", "t": "end"}
    return doc


def differ(one: Results, two: Results, cut: float = 5.0, after: float = 0.0) -> dict[str, float]:
    """Of each probe, the largest difference of the two runs as a share of its range in the first.

    after : [s] of the second, from which it counts.
    """
    out = {}
    for name in SCENE["probes"]:
        t, whole = one.probe(name)
        s, rest = two.probe(name)
        late = t >= cut + after
        out[name] = float(np.abs(np.interp(t[late], s + cut, rest) - whole[late]).max() / np.ptp(whole))
    return out


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with whole.h5, 12 s of the scene without expansion, and first.h5, its first 5 s."""
    folder = tmp_path_factory.mktemp("warm")
    solved(folder, RIGID_TO_HEAT, "whole")
    solved(folder, ended(RIGID_TO_HEAT, 5.0), "first")
    return folder


@pytest.fixture
def beside(first: Path, tmp_path: Path) -> Path:
    """A copy of that folder, which may be spoilt."""
    return Path(shutil.copytree(first, tmp_path / "copy"))


def refusal(folder: Path, doc: dict[str, Any]) -> ScenarioError:
    with pytest.raises(ScenarioError) as told:
        loaded(folder, doc)
    return told.value


def test_a_run_cut_in_two_is_the_uncut_one(beside):
    """Yielding, slipping and sticking: all that mechanics remembers is there again, to its tolerance of 1e-8."""
    whole, two = Results(beside / "whole.h5"), solved(beside, after(RIGID_TO_HEAT), "two")
    assert np.ptp(whole.probe("peeq")[1]) > 1e-4
    far = differ(whole, two)
    assert max(far.values()) < 1e-8, far
    notes = " ".join(two.header["notes"])
    assert "body foot starts with the displacements of first.h5 at 5 s, and with what its points remember (plastic): " \
        "the mesh is the same, every value as it was" in notes
    assert "without shear" not in notes
    assert {(s["body"], s.get("what", "T")) for s in two.header["starts"]} == {
        (body, what) for body in ("plate", "foot") for what in ("T", "u")}


@pytest.mark.slow
def test_with_expansion_the_heat_on_its_way_is_all_that_is_lost(tmp_path):
    """Heat made in a window is delivered in the next: that of the last one, here 6 mK, does not cross the cut."""
    whole = solved(tmp_path, SCENE, "whole")
    solved(tmp_path, ended(SCENE, 5.0), "first")
    two = solved(tmp_path, after(SCENE), "two")
    T, of_two = whole.field("thermal.T")[1][5:], two.field("thermal.T")[1]
    assert np.abs(of_two - T)[0].max() < 1e-9
    assert np.abs(of_two - T).max() < 0.01
    assert max(v for n, v in differ(whole, two, after=1.0).items()) < 3e-5


@pytest.mark.slow
def test_creep_of_enhanced_cells_in_plane_stress_goes_on(tmp_path):
    """What every law and element remembers has its place: here creep strain, modes and the thickness."""
    doc = edited(SCENE, materials__soft={**STEEL, "alpha": 0.0, "creep": {"K": 6.0e8, "m": 0.2}},
                 materials__steel__alpha=0.0, mechanical__elastic__element="enhanced",
                 mechanical__elastic__state="plane_stress", bodies__foot__mesh__rectangle__triangles=True)
    whole = solved(tmp_path, doc, "whole")
    solved(tmp_path, ended(doc, 5.0), "first")
    assert np.ptp(whole.probe("peeq")[1]) > 1e-6
    two = solved(tmp_path, after(doc), "two")
    assert max(differ(whole, two, after=1.0).values()) < 1e-7
    with h5py.File(tmp_path / "first.h5") as f:
        assert {"cells.foot.triangles.creep+plane_stress", "cells.plate.quads.elastic+enhanced+plane_stress"} <= set(
            f["end"])


def test_the_first_frame_is_the_last_one(beside):
    first, two = Results(beside / "first.h5"), solved(beside, ended(after(RIGID_TO_HEAT), 1.0), "two")
    for field in ("mechanical.u", "mechanical.sigma", "mechanical.p"):
        then, now = first.field(field)[1][-1], two.field(field)[1][0]
        np.testing.assert_allclose(now, then, rtol=0, atol=2e-8 * np.abs(then).max())


def test_the_start_hears_of_a_load_that_changed(beside):
    """Another load than the run ended with acts in the first window, not before it."""
    doc = after(RIGID_TO_HEAT)
    doc["mechanical"]["elastic"]["boundary"][2]["pressure"] = 6.0e7
    p = solved(beside, ended(doc, 2.0), "two").probe("p")[1]
    then = Results(beside / "first.h5").probe("p")[1][-1]
    assert p[0] == pytest.approx(then, rel=1e-8)
    assert p[1] > 1.2 * then


def test_a_body_of_another_name_and_a_pair_that_is_not_there(beside):
    doc = after(RIGID_TO_HEAT)
    text = json.dumps(doc).replace("foot", "shoe")
    doc = json.loads(text)
    for key in ("T0", "u0"):
        doc["bodies"]["shoe"][key]["body"] = "foot"
    far = differ(Results(beside / "whole.h5"), solved(beside, doc, "two"), after=1.0)
    assert max(far.values()) < 1e-8
    doc["contact"] = {"other": doc["contact"]["base"]}
    assert "pair other begins without shear: first.h5 has no pair of this name" in " ".join(loaded(beside, doc).notes)
    doc["contact"] = {"base": {**doc["contact"]["other"], "slave": "plate.top", "master": "shoe.bottom"}}
    assert "pair base begins without shear: its surface on plate was another one" in " ".join(
        loaded(beside, doc).notes)


def test_an_elastic_body_goes_to_another_mesh_with_the_error_told(tmp_path):
    """Displacements of a bar in tension are linear, exact on any mesh.  Of a bent one the note says what is lost."""
    bar = edited(SCENE, bodies={"foot": SCENE["bodies"]["foot"]}, contact={}, materials__soft=STEEL, probes={},
                 mechanical__elastic__boundary=[{"on": "foot.left", "u_x": 0}, {"at": "foot.left.bottom", "u_y": 0},
                                                {"on": "foot.right", "t_x": 1.0e8}])
    solved(tmp_path, ended(bar, 2.0), "first")
    finer = after(bar, 2.0, 0.0)
    finer["bodies"]["foot"]["mesh"]["rectangle"]["cells"] = [9, 4]
    scenario = loaded(tmp_path, finer)
    assert float(scenario.starts["foot mechanics"].source["worst"]) < 1e-15
    u = solved(tmp_path, finer, "two").field("mechanical.u")[1]
    np.testing.assert_allclose(u[0], u[-1], rtol=0, atol=1e-6 * np.abs(u).max())
    bent = edited(bar, mechanical__elastic__boundary=[{"on": "foot.left", "u_x": 0, "u_y": 0},
                                                      {"on": "foot.right", "t_y": 1.0e8}])
    solved(tmp_path, ended(bent, 2.0), "first")
    note = " ".join(loaded(tmp_path, finer).notes)
    worst = float(loaded(tmp_path, finer).starts["foot mechanics"].source["worst"])
    assert 1e-9 < worst < 1e-4
    assert f"interpolated there and back, they change by up to {worst:.3g} m" in note
    # A frame in the middle of the run, too: elastic bodies remember nothing.
    middle = edited(finer, bodies__foot__u0={"from": "first.h5", "t": 0.5})
    assert "at 0.5 s" in " ".join(loaded(tmp_path, middle).notes)


def test_what_cannot_be_taken_over_is_refused_by_name(beside):
    doc = after(RIGID_TO_HEAT)
    u0 = doc["bodies"]["foot"]["u0"]
    told = refusal(beside, edited(doc, bodies__foot__u0={**u0, "t": 2.0}))
    assert "keeps what the points of 'foot' remember (plastic) at its end alone, t = 5 s" in str(told)
    told = refusal(beside, edited(doc, bodies__foot__mesh__rectangle__cells=[6, 3]))
    assert "remember (plastic) cannot be taken to another mesh" in str(told)
    assert told.key == "bodies.foot.u0"
    told = refusal(beside, edited(doc, mechanical={"half": "rigid"}, probes={}, contact={}))
    assert "the mechanical half 'rigid' starts from no other run" in str(told)
    told = refusal(beside, edited(doc, mechanical__elastic__dynamics={}))
    assert "with inertia a body starts as it is drawn" in str(told)
    told = refusal(beside, edited(doc, mechanical__elastic__bodies={"plate": {"rigid": True}}))
    assert "body 'plate' is rigid" in str(told)
    liquid = {"T_s": 900.0, "T_l": 950.0, "eta": 1.0e5, "bulk": 5.0e10}
    told = refusal(beside, edited(doc, materials__soft__liquid=liquid))
    assert "no results file keeps the shape it was poured in" in str(told)
    with pytest.raises(Exception, match="starts with the history of plastic, which its material"):
        solved(beside, edited(doc, materials__soft=STEEL), "two")


def test_a_file_that_keeps_no_end_or_another_one_is_refused(beside):
    with h5py.File(beside / "first.h5", "r+") as f:
        f["end/u"][3] = np.nan
    assert "what it keeps of its end does not fit its mesh" in str(refusal(beside, after(RIGID_TO_HEAT)))
    with h5py.File(beside / "first.h5", "r+") as f:
        del f["end"]
    assert "first.h5 keeps no end of its mechanics" in str(refusal(beside, after(RIGID_TO_HEAT)))


@pytest.mark.slow
def test_each_body_has_what_its_own_points_remember(tmp_path):
    """Two bodies of one law, whose cells stand in one history."""
    doc = edited(RIGID_TO_HEAT, bodies__plate__material="soft",
                 probes={**SCENE["probes"], "below": {"mechanical.flow.plate": "value"}})
    whole = solved(tmp_path, doc, "whole")
    first = solved(tmp_path, ended(doc, 5.0), "first")
    two = solved(tmp_path, after(doc), "two")
    then, now = first.field("mechanical.peeq")[1][-1], two.field("mechanical.peeq")[1][0]
    assert min(then[:24].max(), then[24:].max()) > 1e-5
    np.testing.assert_allclose(now, then, rtol=1e-12)
    assert max(differ(whole, two, after=1.0).values()) < 1e-7
