"""Materials of model.json: what is refused and how, and what points get at a temperature."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from mechanical_fmu.laws.catalogue import flow_stress
from mechanical_fmu.material import MaterialRangeError, moduli
from mechanical_fmu.problem import parse_material

sys.path.insert(0, str(Path(__file__).parent))
from point_driver import material, parameters

PLASTIC = {"s_y": 2e8}
CREEP = {"A": 1e-40, "n": 4.0}
LIQUID = {"eta": 1e3, "bulk": 5e10, "T_s": 1000.0, "T_l": 1100.0}
TABLE = {"law": "table", "strain": [0.0, 0.1, 1.0], "stress": [2e8, 3e8, 4e8]}
REFUSED = [
    ({"nu": 0.5}, r"materials.m.nu: must lie between -1 and 0.5"),
    ({"nu": {"T": [300, 600], "value": [0.3, 0.5]}}, r"materials.m.nu.value.1: must lie between -1 and 0.5"),
    ({"E": -1.0}, r"materials.m.E: must be greater than zero, not -1.0"),
    ({"plastik": PLASTIC}, r"materials.m.plastik: unknown key. Did you mean 'plastic'\? Known here: E, T_ref"),
    ({"plastic": {}}, r"materials.m.plastic: the yield stress is missing"),
    ({"plastic": {"s_y": -2e8}}, r"plastic.s_y: must be greater than zero, not -200000000.0"),
    ({"plastic": {"s_y": {"T": [300, 900], "value": [2e8, 0.0]}}}, r"plastic.s_y.value.1: must be greater than zero"),
    ({"plastic": {**PLASTIC, "hardening": {"law": "vose"}}},
     r"hardening.law: not known here, not 'vose'. Did you mean 'voce'"),
    ({"plastic": {**PLASTIC, "hardening": TABLE}}, r"plastic.hardening: a table begins with the yield stress"),
    ({"plastic": {**PLASTIC, "hardening": {"law": "linear", "H": -1e8}}}, r"falls with plastic strain.*softening"),
    ({"plastic": {**PLASTIC, "hardening": {"law": "voce", "Q": -1e8, "b": 2.0}}}, r"falls with plastic strain"),
    ({"plastic": {"hardening": {**TABLE, "stress": [2e8, 1e8, 4e8]}}}, r"falls with plastic strain"),
    ({"plastic": {"hardening": {**TABLE, "stress": [2e8, 3e8]}}},
     r"hardening.stress: 3 positive values are needed, one for each strain"),
    ({"plastic": {"hardening": {**TABLE, "strain": [0.1, 0.2, 1.0]}}}, r"hardening.strain: must begin at 0, increase"),
    ({"plastic": {"hardening": {**TABLE, "T": [300.0, 600.0]}}},
     r"hardening.stress: one list for each of the 2 temperatures is needed"),
    ({"plastic": {**PLASTIC, "softening": 1}}, r"plastic.softening: true or false is needed here, not 1"),
    ({"plastic": {**PLASTIC, "chi": 1.1}}, r"plastic.chi: must lie between 0 and 1, not 1.1"),
    ({"plastic": {**PLASTIC, "overstress": {"K": 1e7, "m": 2.0}}},
     r"overstress.m: must be greater than zero and at most 1, not 2.0"),
    ({"plastic": {**PLASTIC, "kinematic": {"C": -1e9}}}, r"kinematic.C: must be greater than zero"),
    ({"plastic": {**PLASTIC, "kinematic": {"C": 1e9}}, "creep": CREEP}, r"creep does not go with a kinematic"),
    ({"creep": {"A": -1e-40, "n": 4.0}}, r"creep.A: must not be negative, not -1e-40"),
    ({"creep": {"A": 1e-40, "n": 0.0}}, r"creep.n: must be greater than zero"),
    ({"creep": {"K": 0.0, "m": 0.5}}, r"creep.K: must be greater than zero"),
    ({"liquid": {**LIQUID, "T_s": 1200.0}}, r"liquid.T_s: melting must not begin above where it ends, not 1200.0"),
    ({"liquid": {**LIQUID, "eta": 0.0}}, r"liquid.eta: must be greater than zero, not 0.0"),
]


@pytest.mark.parametrize(("change", "why"), REFUSED)
def test_bad_input_is_refused_with_its_place(change, why):
    with pytest.raises(ValueError, match=why):
        parse_material("m", {"E": 2e11, "nu": 0.3, **change})


def test_the_materials_of_the_guide_are_materials():
    text = (Path(__file__).parents[2] / "docs/materials.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    assert len(blocks) == 2
    for block in blocks:
        spec = json.loads(json.dumps(YAML(typ="safe").load(block)))
        assert material(**spec).kind > 0


def test_softening_that_is_meant_is_taken():
    m = material(plastic={**PLASTIC, "hardening": {"law": "linear", "H": -1e8}, "softening": True})
    assert flow_stress(*parameters(m)[:2], 0.5) == (2e8 - 0.5e8, -1e8)
    assert flow_stress(*parameters(m)[:2], 3.0) == (0.0, 0.0)


def test_a_polynomial_that_leaves_its_range_is_told_with_the_temperature():
    m = material(plastic={"s_y": {"polynomial": [3e8, -1e6], "T_ref": 300.0}})
    with pytest.raises(MaterialRangeError, match="material m: the yield stress is -1e\\+08 Pa at 700 K"):
        parameters(m, 700.0)
    m = material(nu={"polynomial": [0.3, 1e-3], "T_ref": 300.0})
    with pytest.raises(MaterialRangeError, match="material m: 1/2 - nu is"):
        parameters(m, 600.0)


@pytest.mark.parametrize("form", ["linear", "cubic"])
def test_curves_at_temperatures_between_beyond_and_past_their_ends(form):
    strain, rows = [0.0, 0.1, 0.2], [[2e8, 3e8, 3.5e8], [1e8, 1.5e8, 1.75e8]]
    for beyond, slope in (("flat", 0.0), ("slope", None)):
        m = material(plastic={"hardening": {"law": "table", "strain": strain, "T": [300.0, 500.0], "stress": rows,
                                            "form": form, "beyond": beyond}, "factor": 0.5})
        for T, share in ((200.0, 0.0), (300.0, 0.0), (350.0, 0.25), (500.0, 1.0), (800.0, 1.0)):
            p, tables, *_ = parameters(m, T)
            for e, cold in ((0.0, 2e8), (0.1, 3e8), (0.2, 3.5e8)):
                assert flow_stress(p, tables, e)[0] == pytest.approx(0.5 * cold * (1 - 0.5 * share), rel=1e-12)
            if form == "linear":
                for e, cold in ((0.04, 2.4e8), (0.15, 3.25e8)):
                    assert flow_stress(p, tables, e)[0] == pytest.approx(0.5 * cold * (1 - 0.5 * share), rel=1e-12)
            for e in (0.05, 0.13, 0.19, 1.5):
                found = (flow_stress(p, tables, e + 1e-6)[0] - flow_stress(p, tables, e - 1e-6)[0]) / 2e-6
                assert flow_stress(p, tables, e)[1] == pytest.approx(found, rel=1e-5, abs=1.0)
            last = flow_stress(p, tables, 1.5)[1]
            assert last == 0.0 if slope == 0.0 else last > 0.0


def test_materials_share_one_array_of_curves():
    a = material(plastic={"hardening": TABLE})
    b = material(plastic={"hardening": {**TABLE, "stress": [1e8, 2e8, 3e8]}})
    plain = material()
    found = moduli((a, plain, b), np.array([2, 0, 1], dtype=np.intp), np.full(3, 300.0))
    assert flow_stress(found.p[0], found.tables, 0.1)[0] == 2e8
    assert flow_stress(found.p[1], found.tables, 0.1)[0] == 3e8


def test_elastic_materials_cost_no_parameters_and_keep_their_bits():
    E, nu, alpha, T = 2.06e11, 0.29, 1.3e-5, np.array([311.0, 733.0])
    found = moduli((material(E=E, nu=nu, alpha=alpha, T_ref=300.0),), np.zeros(2, dtype=np.intp), T)
    assert found.p.shape[0] == 0
    assert found.tables.size == 0
    assert np.array_equal(found.mu, np.full(2, E) / (2.0 * (1.0 + nu)))
    assert np.array_equal(found.kappa, np.full(2, E) / (3.0 * (1.0 - 2.0 * nu)))
    assert np.array_equal(found.e_th[:, 0], 3.0 * np.log(1.0 + np.full(2, alpha) * (T - 300.0)))
