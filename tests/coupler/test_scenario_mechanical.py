"""The mechanical half in a scenario: what model.json becomes, and what is refused where."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from mechanical_fmu.problem import parse_elastic

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, error_of, load_text

STEEL = "steel: {rho: 8000, c: 500, k: 30, E: 2.0e11, nu: 0.3, alpha: 1.2e-5, T_ref: 20}"
FLOWS = STEEL[:-1] + """,
    plastic: {s_y: {T: [20, 600], value: [250.0e6, 90.0e6]}, chi: 0.8,
              hardening: {law: voce, Q: 1.0e8, b: 12, H: 1.0e9},
              kinematic: {C: 1.0e10, gamma: 50}, overstress: {K: 1.0e6, m: 0.5}}}"""
MELTS = STEEL[:-1] + """,
    plastic: {hardening: {law: table, T: [20, 900], strain: [0, 0.1], stress: [[3.0e8, 4.0e8], [1.0e8, 1.0e8]],
                          form: cubic, beyond: slope}, factor: 1.0},
    creep: {A: 1.0e-40, n: 4, Q: 2.0e5}, liquid: {eta: 1.0e5, bulk: 5.0e10, T_s: 1400, T_l: 1450, shrinkage: 0.01}}"""
ENTRIES = """\
      - {on: lower.bottom, u_x: 0, u_y: 0}
      - {on: upper.top, u_y: push}
      - {at: upper.top.left, u_x: 0}
"""
WHOLE = """\
      - {body: upper, u_x: 0, angle: 0}
      - {body: upper, f_y: -1000, name: weight}
      - {body: upper, moment: 5}
      - {on: lower.bottom, u_x: 0, u_y: 0}
      - {on: lower.right, t_x: push, t_y: 3}
      - {at: lower.top.left, f_x: 7, f_y: 8}
      - {body: lower, b_x: 9}
    method: bfgs
    cuts: 2
    element: enhanced
    state: plane_stress
    bodies:
      upper: {rigid: true, v0: [1, 2], omega0: 3}
      lower: {element: mean_dilatation}
    gravity: {y: -9.81, name: g}
    dynamics: {rho_inf: 0.8, mass: lumped}
    thermoelastic_heat: true
    adiabatic: true
"""


def model_of(folder, *changes):
    text = GOOD
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    scenario = load_text(folder, text)
    # What a scenario writes, the half must take.
    return scenario.models["mechanical"], parse_elastic(scenario.interface, scenario.models["mechanical"])


def test_a_scenario_without_any_of_it_says_none_of_it(tmp_path):
    model, spec = model_of(tmp_path)
    assert set(model) == {"half", "format", "tolerance", "materials", "bodies", "boundary", "pairs", "method", "cuts",
                          "element", "start", "state", "thermoelastic_heat", "adiabatic"}
    assert set(model["materials"]["steel"]) == {"E", "nu", "alpha", "T_ref"}
    assert spec.dynamics is None
    assert spec.stated.method == "newton"


def test_everything_arrives(tmp_path):
    model, spec = model_of(tmp_path, (ENTRIES, WHOLE))
    moved = [("displacement", d.on, d.component) for d in spec.displacements]
    assert moved == [("displacement", "upper", 0), ("displacement", "upper", 2), ("displacement", "lower.bottom", 0),
                     ("displacement", "lower.bottom", 1)]
    dead = [(d.kind, d.on, d.component) for d in spec.dead]
    assert dead == [("force", "upper", 1), ("force", "upper", 2), ("traction", "lower.right", 0),
                    ("traction", "lower.right", 1), ("force", "lower.top.left", 0), ("force", "lower.top.left", 1),
                    ("body_force", "lower", 0), ("gravity", "lower", 1), ("gravity", "upper", 1)]
    assert spec.load_names == ("weight", "g")
    assert model["bodies"] == {
        "lower": {"material": "steel", "element": "mean_dilatation", "rigid": False, "v0": [0.0, 0.0], "omega0": 0.0},
        "upper": {"material": "steel", "rigid": True, "v0": [1.0, 2.0], "omega0": 3.0}}
    assert (spec.bodies[1].v0, spec.bodies[1].omega0) == ((1.0, 2.0), 3.0)
    assert (model["method"], model["cuts"], model["state"], model["element"]) == ("bfgs", 2, "plane_stress", "enhanced")
    assert model["dynamics"] == {"rho_inf": 0.8, "mass": "lumped", "contact_mass": "behind"}
    assert spec.dynamics is not None
    assert spec.dynamics.lumped
    assert model["materials"]["steel"]["rho"] == 8000
    assert model["materials"]["steel"]["c"] == 500


def test_materials_that_flow_arrive_in_kelvin(tmp_path):
    flow, _ = model_of(tmp_path, (STEEL, FLOWS))
    plastic = flow["materials"]["steel"]["plastic"]
    assert plastic["s_y"] == {"T": [293.15, 873.15], "value": [250e6, 90e6], "form": "linear"}
    assert plastic["hardening"] == {"law": "voce", "Q": 1e8, "b": 12.0, "H": 1e9}
    assert (plastic["kinematic"], plastic["overstress"], plastic["chi"]) == (
        {"C": 1e10, "gamma": 50.0}, {"K": 1e6, "m": 0.5}, 0.8)
    melt, spec = model_of(tmp_path, (STEEL, MELTS))
    material = melt["materials"]["steel"]
    assert material["plastic"]["hardening"]["T"] == [293.15, 1173.15]
    assert (material["liquid"]["T_s"], material["liquid"]["T_l"]) == (1673.15, 1723.15)
    assert material["creep"] == {"A": 1e-40, "n": 4.0, "Q": 2e5, "heat": 1.0}
    assert spec.materials[0].kind


@pytest.mark.parametrize(("old", "new", "text"), [
    (STEEL, STEEL[:-1] + ", plastic: {chi: 0.9}}", "the yield stress is missing"),
    (STEEL, STEEL[:-1] + ", plastic: {s_y: 1.0e8, hardening: {law: voce, Q: 1.0e8}}}",
     "plastic.hardening.b: a required key is missing"),
    (STEEL, STEEL[:-1] + ", plastic: {s_y: 1.0e8, hardening: {law: linear, H: 1.0e8, b: 3}}}",
     "plastic.hardening.b: unknown key"),
    (STEEL, STEEL[:-1] + ", creep: {A: 1, m: 0.5}}", "either A and n, or K and m"),
    (STEEL, STEEL[:-1] + ", liquid: {eta: 1, bulk: 1, T_s: 900, T_l: 800}}", "melting must not begin above"),
    (STEEL, STEEL[:-1] + ", plastic: {s_y: -1}}", "plastic.s_y: must be greater than zero"),
    (STEEL, STEEL[:-1] + ", plastic: {s_y: {T: [0, 9], value: [1, 0]}}}", "plastic.s_y.value.1: must be greater"),
    (STEEL, STEEL[:-1] + ", plastic: {s_y: 1, factor: -1}}", "plastic.factor: must not be negative"),
    (STEEL, STEEL[:-1] + ", plastic: {s_y: 1, hardening: {law: linear, H: -1}}}", "falls with plastic strain"),
    (STEEL, STEEL[:-1] + ", plastic: {s_y: 1, hardening: {law: voce, Q: -1, b: 2, H: 1}}}", "falls with plastic"),
    (STEEL, STEEL[:-1] + ", plastic: {hardening: {law: table, strain: [0, 1], stress: [2, 1]}}}", "falls with"),
    (STEEL, STEEL[:-1] + ", plastic: {hardening: {law: table, T: [0, 1], strain: [0, 1], stress: [[2, 2], [2, 1]]}}}",
     "softening: true"),
    (STEEL, STEEL[:-1] + ", plastic: {s_y: 1, kinematic: {C: 0}}}", "kinematic.C: must be greater than zero"),
    (STEEL, STEEL[:-1] + ", plastic: {s_y: 1, kinematic: {C: 1, gamma: -1}}}", "gamma: must not be negative"),
    (STEEL, STEEL[:-1] + ", plastic: {s_y: 1, overstress: {K: -1, m: 1}}}", "overstress.K: must not be negative"),
    (STEEL, STEEL[:-1] + ", creep: {A: -1, n: 3}}", "creep.A: must not be negative"),
    (STEEL, STEEL[:-1] + ", creep: {K: 0, m: 0.5}}", "creep.K: must be greater than zero"),
    (STEEL, STEEL[:-1] + ", creep: {K: 1, m: 2}}", "creep.m: must be greater than zero and at most 1"),
    (STEEL, STEEL[:-1] + ", liquid: {eta: 0, bulk: 1, T_s: 900, T_l: 910}}", "liquid.eta: must be greater than zero"),
    (STEEL, STEEL[:-1] + ", liquid: {eta: 1, bulk: 0, T_s: 900, T_l: 910}}", "liquid.bulk: must be greater than zero"),
    (STEEL, STEEL[:-1] + ", liquid: {eta: 1, bulk: 1, T_s: 900, T_l: 910, shrinkage: 2}}",
     "shrinkage: must lie between -0.5 and 0.5"),
    (STEEL, STEEL[:-1] + ", latent: {L: 1, T_m: 700}, liquid: {eta: 1, bulk: 1, T_s: 900, T_l: 910}}",
     "One material melts once"),
    (STEEL, STEEL.replace("nu: 0.3", "nu: {T: [0, 1], value: [0.3, 0.5]}"), "nu.value.1: must lie between -1 and 0.5"),
    ("{on: upper.top, u_y: push}", "{on: upper.top, u_y: push, t_x: 1}", "one kind of condition"),
    ("{on: upper.top, u_y: push}", "{on: upper.top, f_y: push}", "a force acts at a point"),
    ("{on: upper.top, u_y: push}", "{on: upper.top, b_y: push}", "a body force acts on a body"),
    ("{on: upper.top, u_y: push}", "{on: upper.top, angle: push}", "only a rigid body has an angle"),
    ("{on: upper.top, u_y: push}", "{body: upper, angle: push}", "body 'upper' is not rigid"),
    ("{on: upper.top, u_y: push}", "{body: uper, b_y: 1}", "there is no body 'uper'"),
    (ENTRIES, ENTRIES + "    bodies: {upper: {rigid: true}}\n", "moves as a whole"),
    (ENTRIES, ENTRIES + "    bodies: {upper: {v0: [1, 0]}}\n", "without dynamics a body has no velocity"),
    (ENTRIES, ENTRIES + "    dynamics: {}\n    skip: {u: 1.0e-6}\n", "with inertia every step must be solved"),
    (ENTRIES, ENTRIES + "    dynamics: {beta: 0.25, alpha: -0.1}\n", "is enough"),
    (ENTRIES, ENTRIES + "    tolerance: 2\n", "It is a share of the forces"),
    (ENTRIES, ENTRIES.replace("push}", "push, name: p}") + "    gravity: {y: -9, name: p}\n",
     "already that of a boundary"),
    (ENTRIES, ENTRIES + "    cuts: 2.5\n", "cuts: must be a whole number, 0 or more"),
    (ENTRIES, ENTRIES + "    method: newtn\n", "newton"),
])
def test_what_does_not_fit_is_refused_before_any_solver(tmp_path, old, new, text):
    error = error_of(tmp_path, old, new)
    assert text in str(error)
    assert error.line is not None
    assert error.line > 1


def test_what_gravity_needs_is_asked_for(tmp_path):
    text = GOOD.replace("rho: 8000, ", "").replace(ENTRIES, ENTRIES + "    gravity: {y: -9.81}\n")
    with pytest.raises(Exception, match="lacks rho"):
        load_text(tmp_path, text.replace("half: thermal", "half: thermal"))


def test_frozen_entropy_asks_for_one_heat_capacity(tmp_path):
    text = GOOD.replace("c: 500", "c: {solid: 500, liquid: 600}, latent: {L: 2.0e5, T_m: 1500}")
    load_text(tmp_path, text)
    with pytest.raises(Exception, match=r"materials\.steel\.c: frozen entropy needs one heat capacity"):
        load_text(tmp_path, text.replace(ENTRIES, ENTRIES + "    adiabatic: true\n"))


def test_where_one_body_melts_for_both_halves_all_that_melt_do(tmp_path):
    """Else the thermal half would say that the other is solid for ever."""
    melts = STEEL[:-1] + ", liquid: {eta: 1, bulk: 1, T_s: 900, T_l: 910}}"
    two = GOOD.replace(STEEL, melts + "\n  ice: {rho: 900, c: 2000, k: 2, E: 9.0e9, nu: 0.3, alpha: 0, "
                       "latent: {L: 3.0e5, T_m: 0}}")
    load_text(tmp_path, two)
    head, tail = two.rsplit("material: steel", 1)
    with pytest.raises(Exception, match=r"materials\.steel\.liquid: the thermal half says what has melted"):
        load_text(tmp_path, head + "material: ice" + tail)
