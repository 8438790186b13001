"""The thermal keys of a scenario: what they become in model.json, and how a wrong one is answered."""

from __future__ import annotations

import re
import sys
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact.half.functions import field_from
from contact.half.interface import Interface, Pair
from coupler.errors import ScenarioError
from coupler.scenario.notes import crossing_at_reach, role_notes, thermal_notes

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, error_of, line_of, load_text

# The good scenario with every thermal key in it.
RICH = GOOD
for old, new in (
    ("  idle: ", "  lamp: {t: [0, 3, 8], value: [0, 1, 1]}\n  idle: "),
    ("k: 30,", "k: {k_1: {solid: 210, liquid: 95}, k_2: {T: [0, 700], value: [10, 20]}, angle: 30, turns: false},"),
    ("c: 500,", "c: {solid: 500, liquid: {polynomial: [600, 0.1], T_ref: 660}}, "
                "latent: {L: 4.0e5, T_s: 650, T_l: 660},"),
    ("    T0: 100\n", "    T0: 100\n    Q_T: {terms: [{t: lamp, x: {at: [0, 1], value: [0, 2]}}]}\n"
                      "    Q_T_factor: {T: [0, 100], value: [1, 2]}\n"),
    ("  half: thermal\n", "  half: thermal\n  method: theta\n  theta: 0.6\n  sigma_SB: 5.67e-8\n"
                          "  adaptive: {tolerance: 0.1, max_dT: 5, least: 1.0e-3}\n"),
    ("temperature: oven", "temperature: {terms: [{t: oven}, {t: 10, x: {polynomial: [0, 1]}}]}"),
    ("flux: 1000,", "flux: {terms: [{x: {polynomial: [1, 2]}, y: {at: [0, 2], value: [0, 9]}}]},"),
    ("{h: 40, T: 200,", "{h: {terms: [{t: 40, x: {at: [0, 2], value: [1, 2]}}]}, "
                        "h_factor: {T: [0, 50], value: [0, 1]}, T: {terms: [{t: 200}, {t: lamp}]},"),
    ("mechanical:\n  half", "    - {on: upper.bottom, radiation: {emissivity: {T: [0, 100], value: [0.1, 0.8]}, T: 27, "
                            "gap: {d_near: 1.0e-3, d_far: 5.0e-3}}, name: sky}\nmechanical:\n  half"),
    ("g_m: 25.0e-6}\n", "g_m: 25.0e-6}\n    radiation: {emissivity_slave: 0.1, emissivity_master: {T: [0, 9], value: "
                        "[0.2, 1]}, gap: {d_near: 1.0e-3, d_far: 5.0e-3}}\n    friction: {share: 0.5}\n"),
):
    assert GOOD.count(old) == 1, old
    RICH = RICH.replace(old, new)


def error_in(folder: Path, old: str, new: str) -> ScenarioError:
    assert RICH.count(old) == 1, f"{old!r} must stand exactly once in the rich scenario"
    with pytest.raises(ScenarioError) as caught:
        load_text(folder, RICH.replace(old, new))
    return caught.value


def test_materials_become_si_kelvin_and_radians(tmp_path: Path) -> None:
    steel = load_text(tmp_path, RICH).models["thermal"]["materials"]["steel"]
    assert steel["k"] == {"k_1": {"solid": 210.0, "liquid": 95.0},
                          "k_2": {"T": [273.15, 973.15], "value": [10.0, 20.0], "form": "linear"},
                          "angle": pytest.approx(pi / 6),
                          "turns": False}
    assert steel["c"]["liquid"] == {"polynomial": [600.0, 0.1], "T_ref": pytest.approx(933.15)}
    assert steel["latent"] == {"L": 4e5, "T_s": pytest.approx(923.15), "T_l": pytest.approx(933.15)}


def test_one_melting_point_stands_for_both_limits_and_axes_turn_by_default(tmp_path: Path) -> None:
    text = RICH.replace("T_s: 650, T_l: 660", "T_m: 660").replace(", angle: 30, turns: false", "").replace("degC", "K")
    steel = load_text(tmp_path, text).models["thermal"]["materials"]["steel"]
    assert steel["latent"] == {"L": 4e5, "T_m": 660.0}
    assert (steel["k"]["angle"], steel["k"]["turns"]) == (0.0, True)


def test_a_sum_of_temperatures_gets_one_term_to_kelvin(tmp_path: Path) -> None:
    oven, flux, film, sky = load_text(tmp_path, RICH).models["thermal"]["boundary"]
    *own, more = oven["temperature"]["terms"]
    assert own == [{"t": {"t": [0.0, 20.0], "value": [20.0, 400.0]}}, {"t": 10.0, "x": {"polynomial": [0.0, 1.0]}}]
    assert more == {"t": 273.15}
    assert field_from(oven["temperature"]).at(lower_bottom(2.0), 20.0) == pytest.approx([673.15 + 20.0])
    assert flux["flux"] == {"terms": [{"t": 1.0, "x": {"polynomial": [1.0, 2.0]},
                                        "y": {"at": [0.0, 2.0], "value": [0.0, 9.0]}}]}
    film = film["convection"]
    assert film["h"]["terms"] == [{"t": 40.0, "x": {"at": [0.0, 2.0], "value": [1.0, 2.0]}}]
    assert film["h_factor"] == {"T": [273.15, 323.15], "value": [0.0, 1.0], "form": "linear"}
    assert field_from(film["T"]).at(lower_bottom(0.0), 5.0) == pytest.approx([474.15])
    assert sky == {"on": "upper.bottom", "name": "sky", "radiation": {
        "T": 300.15, "gap": {"d_near": 1e-3, "d_far": 5e-3},
        "emissivity": {"T": [273.15, 373.15], "value": [0.1, 0.8], "form": "linear"}}}


def lower_bottom(x: float) -> np.ndarray:
    return np.array([[x, 0.0]])


def test_a_sum_in_kelvin_gets_no_further_term(tmp_path: Path) -> None:
    oven = load_text(tmp_path, RICH.replace("degC", "K")).models["thermal"]["boundary"][0]
    assert len(oven["temperature"]["terms"]) == 2


def test_sources_pairs_and_stepping(tmp_path: Path) -> None:
    s = load_text(tmp_path, RICH)
    thermal = s.models["thermal"]
    upper = thermal["bodies"]["upper"]
    assert upper["Q_T"]["terms"][0]["t"] == {"t": [0.0, 3.0, 8.0], "value": [0.0, 1.0, 1.0]}
    assert upper["Q_T_factor"] == {"T": [273.15, 373.15], "value": [1.0, 2.0], "form": "linear"}
    assert "Q_T_factor" not in thermal["bodies"]["lower"]
    assert {k: thermal[k] for k in ("method", "theta", "sigma_SB")} == {
        "method": "theta", "theta": 0.6, "sigma_SB": 5.67e-8}
    # Differences of temperature: not converted.
    assert thermal["adaptive"] == {"tolerance": 0.1, "max_dT": 5.0, "least": 1e-3}
    pair = thermal["pairs"]["face"]
    assert pair["friction"]["share"] == 0.5
    assert pair["radiation"] == {"emissivity_slave": 0.1,
                                 "emissivity_master": {"T": [273.15, 282.15], "value": [0.2, 1.0], "form": "linear"},
                                 "gap": {"d_near": 1e-3, "d_far": 5e-3}}
    assert s.notes == ("pair face: near radiation ends at a gap of 0.005 m, and lower.top has no radiation of its own: "
                       "farther apart, and where it faces nothing, it gives off none",)


def test_kinks_of_signals_inside_fields_count(tmp_path: Path) -> None:
    assert load_text(tmp_path, RICH).coupling.kinks == (3.0, 8.0, 10.0, 20.0, 25.0, 30.0)


def test_what_is_left_out_is_not_in_the_model(tmp_path: Path) -> None:
    thermal = load_text(tmp_path, GOOD).models["thermal"]
    assert set(thermal) == {"half", "format", "method", "tolerance", "sigma_SB", "materials", "bodies", "boundary",
                            "pairs"}
    assert set(thermal["materials"]["steel"]) == {"rho", "k", "c"}
    assert set(thermal["bodies"]["upper"]) == {"material", "T0", "Q_T"}
    assert set(thermal["pairs"]["face"]) == {"conduction"}


def test_steady_increments(tmp_path: Path) -> None:
    text = GOOD.replace("half: thermal\n", "half: thermal\n  method: steady\n  increments: 4\n")
    assert load_text(tmp_path, text).models["thermal"]["increments"] == 4


FAR = "gap: {d_near: 1.0e-3, d_far: 5.0e-3}}, name: sky}"
AXES = "{k_1: {solid: 210, liquid: 95}, k_2: {T: [0, 700], value: [10, 20]}, angle: 30, turns: false}"
LATENT = "latent: {L: 4.0e5, T_s: 650, T_l: 660}"
STEPS = "  method: theta\n  theta: 0.6\n"
ADAPTIVE = "  adaptive: {tolerance: 0.1, max_dT: 5, least: 1.0e-3}\n"
SOURCE = "{terms: [{t: lamp, x: {at: [0, 1], value: [0, 2]}}]}"
OVEN = "{terms: [{t: oven}, {t: 10, x: {polynomial: [0, 1]}}]}"
H = "{terms: [{t: 40, x: {at: [0, 2], value: [1, 2]}}]}"

Q, SKY, NEAR = "bodies.upper.Q_T", "thermal.boundary.3.radiation", "contact.face.radiation"
K, MELTS = "materials.steel.k", "materials.steel.latent"

# old text, new text, dotted key, words that the message or its remedy must hold
WRONG = {
    "an emissivity that begins above one": ("{T: [0, 100], value: [0.1, 0.8]}", "{polynomial: [0.9, 0.01]}",
                                            f"{SKY}.emissivity", "is 1.9 at the T0 of body 'upper'"),
    "a master emissivity that begins at zero": ("emissivity_master: {T: [0, 9], value: [0.2, 1]}",
                                                "emissivity_master: {polynomial: [0, 0.1], T_ref: 20}",
                                                f"{NEAR}.emissivity_master", "is 0 at the T0 of body 'lower'"),
    "an h_factor that begins below zero": ("{T: [0, 50], value: [0, 1]}", "{polynomial: [1, -0.1]}",
                                           "thermal.boundary.2.convection.h_factor", "must not be negative"),
    "a sum of nothing": (SOURCE, "{terms: []}", f"{Q}.terms", "at least one term"),
    "a term of nothing": (SOURCE, "{terms: [{}]}", f"{Q}.terms.0", "at least one of t, x, y"),
    "a term without its list": (SOURCE, "{t: lamp, x: {at: [0], value: [1]}}", f"{Q}.t", "terms"),
    "an unknown axis": (SOURCE, "{terms: [{t: lamp, z: {at: [0], value: [1]}}]}", f"{Q}.terms.0.z", "t, x, y"),
    "a misspelt sum": (SOURCE, "{term: [{t: lamp}]}", f"{Q}.term", "Did you mean 'terms'"),
    "an unknown signal in a term": (SOURCE, "{terms: [{t: lamq}]}", f"{Q}.terms.0.t", "Did you mean 'lamp'"),
    "a unit in a term": (SOURCE, "{terms: [{t: 3 W/m2}]}", f"{Q}.terms.0.t",
                         "a heat source [W/m3] is needed here, not a heat flux [W/m2]"),
    "places that decrease": ("x: {at: [0, 1], value: [0, 2]}", "x: {at: [1, 0], value: [0, 2]}",
                             f"{Q}.terms.0.x.at.1", "must increase"),
    "fewer places than values": ("x: {at: [0, 1], value: [0, 2]}", "x: {at: [0], value: [0, 2]}",
                                 f"{Q}.terms.0.x", "1 place, but 2 values"),
    "a profile without coefficients": ("t: 10, x: {polynomial: [0, 1]}", "t: 10, x: {polynomial: []}",
                                       "thermal.boundary.0.temperature.terms.1.x.polynomial", "coefficient"),
    "an unknown key of a profile": ("x: {at: [0, 1], value: [0, 2]}", "x: {at: [0], values: [0]}",
                                    f"{Q}.terms.0.x.values", "Did you mean 'value'"),
    "a factor without a source": (f"    Q_T: {SOURCE}\n", "", "bodies.upper.Q_T_factor", "Q_T is missing"),
    "a sum of temperatures below 0 K": (OVEN, "{terms: [{t: -300}, {t: oven}]}", "thermal.boundary.0.temperature.terms",
                                        "constant term"),
    "ambient below 0 K": ("T: 27,", "T: -274,", f"{SKY}.T", "absolute zero"),
    "a negative h in a sum": (H, "{terms: [{t: 40, x: {at: [0, 2], value: [1, -1]}}]}",
                              "thermal.boundary.2.convection.h.terms", "reaches -40 on lower.top"),
    "a negative factor of h": ("value: [0, 1]}, T: {terms", "value: [-1, 1]}, T: {terms",
                               "thermal.boundary.2.convection.h_factor.value.0", "greater than zero"),
    "a factor of h of zero": ("value: [0, 1]}, T: {terms", "value: [0, 0]}, T: {terms",
                              "thermal.boundary.2.convection.h_factor.value.0", "greater than zero"),
    "an emissivity of zero": ("value: [0.1, 0.8]", "value: [0, 0.8]", f"{SKY}.emissivity.value.0",
                              "at most 1"),
    "an emissivity above one": ("emissivity_slave: 0.1", "emissivity_slave: 1.1", f"{NEAR}.emissivity_slave",
                                "at most 1"),
    "an emissivity above one in a table": ("[0.2, 1]", "[0.2, 2]", f"{NEAR}.emissivity_master.value.1",
                                           "at most 1"),
    "no emissivity": ("{emissivity: {T: [0, 100], value: [0.1, 0.8]}, T: 27", "{T: 27",
                      f"{SKY}.emissivity", "missing"),
    "a misspelt emissivity": ("emissivity_slave", "emissivity_slav", f"{NEAR}.emissivity_slav",
                              "Did you mean 'emissivity_slave'"),
    "far before near": (FAR, FAR.replace("d_far: 5", "d_far: 1"), "thermal.boundary.3.radiation.gap.d_far", "greater"),
    "a negative gap": (FAR, FAR.replace("1.0e-3", "-1"), "thermal.boundary.3.radiation.gap.d_near", "negative"),
    "radiation at a point": ("{on: upper.bottom, radiation", "{at: upper.bottom.left, radiation",
                             "thermal.boundary.3.at", "on a surface"),
    "radiation on no surface": ("{on: upper.bottom, radiation", "{on: upper.botom, radiation",
                                "thermal.boundary.3.on", "Did you mean 'upper.bottom'"),
    "more than the whole": ("share: 0.5", "share: 1.5", "contact.face.friction.share",
                            "between 0 and 1"),
    "a negative share": ("share: 0.5", "share: -1", "contact.face.friction.share", "between 0 and 1"),
    "theta below a half": ("theta: 0.6", "theta: 0.4", "thermal.theta", "between 0.5 and 1"),
    "theta above one": ("theta: 0.6", "theta: 1.1", "thermal.theta", "between 0.5 and 1"),
    "theta left out": (STEPS, "  method: theta\n", "thermal.method", "Add theta"),
    "theta of another method": (STEPS, "  theta: 0.6\n", "thermal.theta", "belongs to method theta"),
    "increments in time": (STEPS, "  increments: 3\n", "thermal.increments", "belongs to method steady"),
    "no increments": (STEPS, "  method: steady\n  increments: 0\n", "thermal.increments", "1 or more"),
    "millions of increments": (f"{STEPS}  sigma_SB: 5.67e-8\n{ADAPTIVE}", "  method: steady\n  increments: 1000000\n",
                               "thermal.increments", "at most 100000"),
    "adaptive without time": (STEPS, "  method: steady\n", "thermal.adaptive", "Use increments"),
    "adaptive by nothing": (ADAPTIVE, "  adaptive: {least: 1}\n", "thermal.adaptive", "tolerance, max_dT"),
    "an unknown key of adaptive": (ADAPTIVE, "  adaptive: {tol: 1}\n", "thermal.adaptive.tol", "tolerance"),
    "a negative tolerance": ("{tolerance: 0.1,", "{tolerance: -0.1,", "thermal.adaptive.tolerance",
                             "greater than zero"),
    "no Stefan-Boltzmann constant": ("sigma_SB: 5.67e-8", "sigma_SB: 0", "thermal.sigma_SB", "greater than zero"),
    "an unknown method": ("method: theta", "method: thetta", "thermal.method", "Did you mean 'theta'"),
    "only one phase": ("{solid: 210, liquid: 95}", "{solid: 210}", f"{K}.k_1.liquid", "missing"),
    "a misspelt phase": ("{solid: 210, liquid: 95}", "{solid: 210, liqid: 95}", f"{K}.k_1.liqid", "'liquid'"),
    "a negative phase": ("{solid: 210, liquid: 95}", "{solid: 210, liquid: -95}", f"{K}.k_1.liquid", "greater"),
    "phases of what does not melt": (f", {LATENT}", "", f"{K}.k_1", "Add latent"),
    "a misspelt axis": ("{k_1: {solid", "{k1: {solid", f"{K}.k1", "Did you mean 'k_1'"),
    "only one axis": (AXES, "{k_1: 3, angle: 3}", f"{K}.k_2", "missing"),
    "an axis of zero": (AXES, "{k_1: 3, k_2: 0}", f"{K}.k_2", "greater than zero"),
    "a turn that is no truth": ("turns: false", "turns: 3", f"{K}.turns", "true or false"),
    "an angle in words": ("angle: 30", "angle: steep", f"{K}.angle", "number"),
    "latent heat of nothing": (LATENT, "latent: {L: 0, T_m: 660}", f"{MELTS}.L", "greater than zero"),
    "latent heat nowhere": (LATENT, "latent: {L: 1}", MELTS, "either `T_m`, or both"),
    "latent heat in two ways": (LATENT,
                                "latent: {L: 1, T_m: 660, T_s: 650, T_l: 660}", MELTS, "either"),
    "half a range of melting": (LATENT, "latent: {L: 1, T_s: 650}", MELTS, "either"),
    "liquidus below solidus": ("T_s: 650, T_l: 660", "T_s: 670, T_l: 660", "materials.steel.latent.T_l", "solidus"),
    "melting below 0 K": ("T_s: 650,", "T_s: -280,", "materials.steel.latent.T_s", "absolute zero"),
    "a table below 0 K": ("k_2: {T: [0, 700]", "k_2: {T: [-300, 700]", f"{K}.k_2.T.0", "absolute zero"),
    "a liquid that is negative where it melts": ("[600, 0.1]", "[-1, 0.1]", "materials.steel.c.liquid",
                                                 "melting point"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_input_is_named(case: str, tmp_path: Path) -> None:
    old, new, key, words = WRONG[case]
    error = error_in(tmp_path, old, new)
    assert error.key == key
    assert words in f"{error.message} {error.remedy}"
    assert error.line > 0
    assert len(str(error)) < 600


@pytest.mark.parametrize(("old", "new", "piece"), [
    ("T: 27,", "T: -274,", "T: -274"), (OVEN, "{terms: [{t: -300}]}", "- {on: lower.bottom, temperature"),
    ("T_s: 650,", "T_s: -280,", "T_s: -280"), ("share: 0.5", "share: 2", "share: 2")])
def test_the_line_is_that_of_the_wrong_value(old: str, new: str, piece: str, tmp_path: Path) -> None:
    assert error_in(tmp_path, old, new).line == line_of(piece, RICH.replace(old, new))


@pytest.mark.parametrize(("old", "new", "words"), [
    (f", {FAR}", "}, name: sky}", "both act at every gap"),
    (FAR, FAR.replace("5.0e-3", "6.0e-3"), "fade over different gaps"),
    ("{law: constant, h: 2000}", "{law: constant, h: 1000}", "jumps from 2000 to 1000"),
    ("gap_max: 0.1", "gap_max: 4.0e-3", "near radiation fades up to d_far = 0.005 m, but"),
    ("gap_max: 0.1", "gap_max: 4.0e-3", "convection on lower.top fades up to d_full"),
])
def test_what_is_no_error_is_noted(old: str, new: str, words: str, tmp_path: Path) -> None:
    assert RICH.count(old) == 1
    assert any(words in note for note in load_text(tmp_path, RICH.replace(old, new)).notes)


def test_a_start_at_the_melting_temperature_is_said_to_be_molten(tmp_path: Path) -> None:
    def notes(T0: float) -> list[str]:
        melts = GOOD.replace("steel: {", "steel: {latent: {L: 1.0e5, T_m: 50}, ", 1)
        given = re.sub(r"T0: [-0-9.]+", f"T0: {T0}", melts)
        assert given != melts
        return [note for note in load_text(tmp_path, given).notes if "molten" in note]

    assert len(notes(50.0)) == 2
    assert "body upper starts at 323.15 K, the melting temperature of steel" in " ".join(notes(50.0))
    assert notes(49.99) == notes(50.01) == []


def cylinder_above_a_floor(depth: float, **pair) -> Interface:
    """60 degrees to either side of a cylinder of 0.1 m, 2 mm above a plane; `pair` says who is the slave.

    depth : [m] of a hollow in that plane, 0.4 m wide.
    """
    n, R = 192, 0.1
    angle = np.linspace(-60.0, 60.0, n + 1) * pi / 180.0
    arcs = [np.stack([r * np.sin(angle), 0.102 - r * np.cos(angle)], axis=1) for r in (R, 0.9 * R)]
    at = np.linspace(-0.6, 0.6, 2 * n + 1)
    floor = -depth * np.maximum(1.0 - np.abs(at) / 0.2, 0.0)
    lines = [np.stack([at, floor + y], axis=1) for y in (-0.01, 0.0)]
    a, b = np.arange(n), np.arange(2 * n)
    m = 2 * (n + 1)
    top, low = m + 2 * n + 1 + b, m + b
    quads = np.concatenate([np.stack([a, a + 1, n + 2 + a, n + 1 + a], axis=1),
                            np.stack([low, low + 1, top + 1, top], axis=1)]).astype(np.int32)
    surfaces = {"round.below": np.stack([a, a + 1], axis=1).astype(np.int32),
                "flat.top": np.stack([top + 1, top], axis=1).astype(np.int32)}
    return Interface("plane", np.concatenate(arcs + lines), quads, np.empty((0, 3), np.int32),
                     np.repeat([0, 1], [n, 2 * n]).astype(np.int32), np.empty(0, np.int32), ("round", "flat"),
                     ("m", "m"), surfaces, {}, (Pair(**{"name": "gap", "gap_max": 1.0, "eps_N": 0.0, **pair}),))


@pytest.mark.parametrize(("slave", "master"), [("round.below", "flat.top"), ("flat.top", "round.below")])
def test_roles_that_matter_are_told(slave: str, master: str) -> None:
    """At a hollow that two flanks see at once; above a plane, with both passes and without a law there is nothing."""
    model = {"pairs": {"gap": {"conduction": {"closed": None, "open": {"law": "gas", "k_g": 0.03, "g_m": 0.0}}}},
             "bodies": {"round": {"T0": 300.0}, "flat": {"T0": 300.0}}}
    hollow = {"depth": 0.1, "slave": slave, "master": master}
    (note,) = role_notes(cylinder_above_a_floor(**hollow), model)
    told = re.match(rf"pair gap: .* (\S+) W/K with {slave} as the slave and (\S+) with {master}, (\S+) % apart", note)
    assert told, note
    one, other, apart = (float(v) for v in told.groups())
    assert apart == pytest.approx(100.0 * abs(one - other) / max(one, other), rel=0.05)
    assert apart > 1.0
    assert not role_notes(cylinder_above_a_floor(**hollow, two_pass=True), model)
    assert not role_notes(cylinder_above_a_floor(**hollow), {"bodies": model["bodies"]})
    assert not role_notes(cylinder_above_a_floor(**{**hollow, "depth": 0.0}), model)


def test_a_surface_that_folds_is_told_once() -> None:
    near = {"emissivity_slave": 0.5, "emissivity_master": 0.5, "gap": {"d_near": 1e-3, "d_far": 5e-3}}
    notes = thermal_notes({"pairs": {"fold": {"radiation": near}}}, [Pair("fold", "a.top", "a.top", 0.1, 0.0)], 300.0)
    assert len(notes) == 1
    assert "a.top has no radiation of its own" in notes[0]


def test_surfaces_without_radiation_of_their_own_are_told_in_one_sentence() -> None:
    near = {"emissivity_slave": 0.5, "emissivity_master": 0.5, "gap": {"d_near": 1e-3, "d_far": 5e-3}}
    pairs = [Pair("side", "a.right", "b.wall", 0.1, 0.0), Pair("base", "a.bottom", "b.floor", 0.1, 0.0)]
    notes = thermal_notes({"pairs": {p.name: {"radiation": near} for p in pairs}}, pairs, 300.0)
    assert len(notes) == 1
    assert "pairs side and base: " in notes[0]
    assert "a.right, b.wall, a.bottom and b.floor have no radiation of their own" in notes[0]


def test_a_place_has_one_temperature(tmp_path: Path) -> None:
    """The later one would be taken in silence; a corner of two surfaces is no such case."""
    once = "    - {on: lower.bottom, temperature: oven}\n"
    error = error_of(tmp_path, once, once + "    - {on: lower.bottom, temperature: 20}\n")
    assert (error.key, error.line) == ("thermal.boundary.1.on", line_of(once.strip(), GOOD) + 1)
    assert "already prescribed by entry 0" in error.message
    load_text(tmp_path, GOOD.replace(once, once + "    - {on: lower.left, temperature: 20}\n"))


def test_a_steady_temperature_must_be_held(tmp_path: Path) -> None:
    """By a surface of the body, or through a pair; a flux holds nothing."""
    steady = GOOD.replace("half: thermal\n", "half: thermal\n  method: steady\n")
    load_text(tmp_path, steady)
    oven, film = "{on: lower.bottom, temperature: oven}", "{on: lower.top, convection: {h: 40"
    flux = steady.replace(oven, "{on: lower.bottom, flux: 3}").replace(film, film.replace("lower", "upper"))
    load_text(tmp_path, flux)
    start, stop = steady.index("    conduction:"), steady.index("thermal:\n")
    apart = steady[:start] + steady[stop:]
    with pytest.raises(ScenarioError, match="nothing fixes the temperature of body 'upper'") as caught:
        load_text(tmp_path, apart)
    assert caught.value.key == "bodies.upper"
    load_text(tmp_path, apart.replace("T0: 100\n", "T0: 100\n    Q_T: 3\n    Q_T_factor: {polynomial: [1, -0.1]}\n"))
    load_text(tmp_path, apart.replace("method: steady", "method: sdirk2"))


def test_an_h_factor_may_begin_at_zero(tmp_path: Path) -> None:
    load_text(tmp_path, RICH.replace("h_factor: {T: [0, 50], value: [0, 1]}", "h_factor: {polynomial: [-2, 0.1]}"))


def test_a_film_under_another_body_is_told(tmp_path: Path) -> None:
    def told(text: str) -> list[str]:
        return [note for note in load_text(tmp_path, text).notes if "covers it, too" in note]

    bare = GOOD.replace(", gap: {d_cut: 1.0e-3, d_full: 6.0e-3}", "")
    assert told(GOOD) == []
    (note,) = told(bare)
    assert note.startswith("convection on lower.top acts where upper.bottom covers it, too. With a gap")
    assert told(bare.replace("{on: lower.top, conv", "{on: upper.bottom, conv"))[0].startswith("convection on upper.bo")
    assert told(bare.replace("{on: lower.top, conv", "{on: lower.right, conv")) == []
    assert told(bare.replace("origin: [0, 1]", "origin: [0, 1.05]")) == []
    # What it advises is taken.
    assert told(bare.replace("T: 200}", "T: 200, gap: {d_cut: 0, d_full: 1 mm}}")) == []


def test_a_pair_that_lets_no_heat_pass_is_told() -> None:
    """A hot block pressed on a cold one: without `conduction` both keep their temperatures, which nobody meant."""
    pair, law = Pair("face", "a.top", "b.bottom", 0.1, 0.0), {"law": "constant", "h": 1000.0}

    def notes(T0: float, pairs: dict[str, Any], pair: Pair = pair, **more: Any) -> list[str]:
        return thermal_notes({"bodies": {"a": {"material": "m", "T0": 300.0}, "b": {"material": "m", "T0": T0}},
                              "pairs": pairs} | more, [pair], 300.0)

    told = ["pair face: no heat crosses between a and b, because the pair has no conduction"]
    warmed = [{"on": "a.bottom", "temperature": 400.0}]
    assert notes(400.0, {"face": {}}) == notes(300.0, {"face": {}}, boundary=warmed) == told
    assert notes(300.0, {"face": {}}) == notes(300.0, {"face": {}}, boundary=[{"on": "c.top", "flux": 1.0}]) == []
    assert notes(400.0, {}) == [], "a half of another package knows"
    assert notes(400.0, {"face": {"conduction": {"closed": law, "open": None}}}) == []
    assert notes(400.0, {"face": {"conduction": {"closed": None, "open": None}}}) == [], "it is said that none crosses"
    assert notes(400.0, {"face": {}}, Pair("face", "a.top", "b.bottom", 0.1, 0.0, tied=True)) == []
    assert notes(400.0, {"face": {}}, Pair("face", "a.top", "a.bottom", 0.1, 0.0)) == []


def test_what_crosses_at_gap_max_is_known_where_it_is_no_little_part() -> None:
    """By gas, by radiation, by both; what fades before, or is next to nothing there, leaves no heat out."""
    pair = Pair("face", "a.top", "b.bottom", 1e-3, 0.0)

    def at_reach(**laws: Any) -> float | None:
        return crossing_at_reach({"pairs": {"face": laws}}, [pair], 500.0).get("face")

    def gas(g_m: float) -> dict[str, Any]:
        return {"closed": None, "open": {"law": "gas", "k_g": 0.03, "g_m": g_m}}

    near = {"emissivity_slave": 0.8, "emissivity_master": {"T": [400.0, 600.0], "value": [0.4, 0.6]}}
    radiates = 4.0 * 5.670374419e-8 * 500.0**3 / (1.0 / 0.8 + 1.0 / 0.5 - 1.0)
    assert at_reach(conduction=gas(1e-4)) == pytest.approx(0.03 / 1.1e-3)
    assert at_reach(conduction=gas(1e-6)) is None, "0.1 % of what crosses in touch"
    assert at_reach(radiation=near) == pytest.approx(radiates)
    assert at_reach(radiation=near, conduction=gas(1e-4)) == pytest.approx(radiates + 0.03 / 1.1e-3)
    assert at_reach(radiation=near | {"gap": {"d_near": 1e-4, "d_far": 1e-3}}) is None
    assert at_reach() is None
