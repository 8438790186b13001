"""What a deck says and what the scenario made of it says: place by place, number by number."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from coupler.deck.lexer import DeckLine
from coupler.deck.materials import expansion_from
from coupler.deck.steps import Amplitude, DeckStep, after
from coupler.errors import ScenarioError
from coupler.scenario import load_scenario

sys.path.insert(0, str(Path(__file__).parent))
from decks import COUPLED, HEAT, MESH, PAIR, SECTIONS, SOLID, START, STEEL, converted, coupled_deck, heat_deck


def test_a_deck_becomes_a_scenario_that_passes_its_check(tmp_path):
    tree, told = converted(tmp_path, heat_deck("*BOUNDARY\nBOTTOM, 11, 11, 100.\n"))
    assert not told.missed
    assert tree["title"] == "Two blocks"
    assert tree["mechanical"] == {"half": "rigid"}
    assert tree["bodies"]["UPPER"]["T0"] == 400.0
    assert tree["contact"]["SLAVE-MASTER"]["conduction"] == {
        "closed": {"law": "constant", "h": 1000.0},
        "open": {"law": "table", "x": [0.0, 0.01, 0.02], "h": [1000.0, 1000.0, 0.0]}}  # nothing presses
    assert tree["thermal"]["boundary"] == [{"at": "LOWER.BOTTOM", "temperature": 100.0}]
    assert tree["coupling"]["windows"] == [{"until": 10.0, "size": 1.0}]
    scene = load_scenario(told.files[0]).interface
    assert {name: len(edges) for name, edges in scene.surfaces.items()} == {"LOWER.MASTER": 2, "UPPER.SLAVE": 2}
    assert np.allclose(scene.nodes[scene.surfaces["UPPER.SLAVE"]][..., 1], 0.1, atol=0)


def test_what_is_not_understood_is_told_and_written_at_the_top(tmp_path):
    _, told = converted(tmp_path, heat_deck("*NODE FILE\nNT\n*CFLUX\nTOP, 11, 5.\n", model="*MPC\nTIE, A, B\n"))
    lines = (tmp_path / "deck.inp").read_text().splitlines()
    assert [m.text for m in told.missed] == ["*MPC", "*NODE FILE", "*CFLUX"]
    assert [lines[m.line - 1] for m in told.missed] == [m.text for m in told.missed]
    head = told.files[0].read_text()
    assert all(f"#   {m}\n" in head for m in told.missed)
    assert "tied" in told.missed[0].why


@pytest.mark.parametrize(("options", "far"), [("", 0.2), (", POSITION TOLERANCE=1.D-3", 1e-3), (", ADJUST=NO", 0.2)])
def test_a_tie_is_a_tied_pair(tmp_path, options, far):
    """In place of the deck's contact pair: as far as told, or two slave edges; of ADJUST a note."""
    text = heat_deck()
    begin, end = text.index("*SURFACE INTERACTION"), text.index("*CONTACT PAIR")
    rest = text[end:].split("\n", 2)
    tree, told = converted(tmp_path, f"{text[:begin]}*TIE, NAME=JOINT{options}\n{rest[1]}\n{rest[2]}")
    assert tree["contact"] == {"SLAVE-MASTER": {"slave": "UPPER.SLAVE", "master": "LOWER.MASTER", "gap_max": far,
                                                "tied": True}}
    assert not told.missed
    assert any("no node is moved" in note for note in told.notes) is ("ADJUST" not in options)
    assert load_scenario(told.files[0]).interface.pairs[0].tied


@pytest.mark.parametrize(("line", "why"), [
    ("*TIE, NAME=J\nSLAVE\n", "a slave and a master surface"), ("*TIE, NAME=J\nSLAVE, SLAVE\n", "belong to one body"),
    ("*TIE, NAME=J\nSLAVE, NOWHERE\n", "there is no surface"),
    ("*TIE, POSITION TOLERANCE=-1.\nSLAVE, MASTER\n", "must be a number from 0"),
    ("*TIE, POSITION TOLERANCE=NaN\nSLAVE, MASTER\n", "must be a number from 0")])
def test_ties_that_are_wrong_are_refused(tmp_path, line, why):
    with pytest.raises(ScenarioError, match=why):
        converted(tmp_path, heat_deck(model=line))


def test_options_that_are_not_understood_are_told_one_by_one(tmp_path):
    text = heat_deck().replace("*CONTACT PAIR,", "*CONTACT PAIR, SMALL SLIDING, ADJUST=1.E-3,")
    _, told = converted(tmp_path, text)
    assert [m.why.split()[2] for m in told.missed] == ["SMALL", "ADJUST"]


@pytest.mark.parametrize(("kind", "geometry", "state"), [
    ("CPE4", "plane", None), ("CPE4RHT", "plane", None), ("CPS4R", "plane", "plane_stress"),
    ("CAX4IT", "axisymmetric", None)])
def test_kinds_of_cells(tmp_path, kind, geometry, state):
    tree, _ = converted(tmp_path, coupled_deck("*BOUNDARY\nNALL, 1, 2\n", kind=kind))
    assert tree["geometry"] == geometry
    assert tree["mechanical"]["elastic"].get("state") == state
    assert tree["mechanical"]["elastic"].get("element") == ("enhanced" if "I" in kind else None)


def test_one_material_for_each_first_temperature(tmp_path):
    tree, _ = converted(tmp_path, coupled_deck("*BOUNDARY\nBOTTOM, 1, 2\nTOP, 1, 1\n"))
    of = {name: tree["materials"][body["material"]] for name, body in tree["bodies"].items()}
    assert (of["LOWER"]["T_ref"], of["UPPER"]["T_ref"]) == (20.0, 400.0)


def test_expansion_counts_from_the_first_temperature():
    alpha = {"T": [0.0, 1000.0], "value": [1e-5, 2e-5]}
    found = expansion_from(alpha, 20.0, 300.0)
    total = {T: np.interp(T, alpha["T"], alpha["value"]) * (T - 20.0) for T in (300.0, *found["T"])}
    for T, value in zip(found["T"], found["value"], strict=True):
        assert value * (T - 300.0) == pytest.approx(total[T] - total[300.0], rel=1e-8)
    assert expansion_from(alpha, 20.0, 20.0) == alpha
    at_point = expansion_from(alpha, 20.0, 500.0)
    assert at_point["value"][at_point["T"].index(500.0)] == pytest.approx(1.5e-5 + 480.0 * 1e-8, rel=1e-6)
    at_end = expansion_from(alpha, 20.0, 1000.0)  # which it leaves downwards only
    assert at_end["value"][-1] == pytest.approx(2e-5 + 980.0 * 1e-8, rel=1e-3)
    at_start = expansion_from(alpha, 20.0, 0.0)
    assert at_start["value"][0] == pytest.approx(1e-5 - 20.0 * 1e-8, rel=2e-3)


def test_plastic_tables_meet_at_all_strains_and_make_no_heat_of_their_own(tmp_path):
    plastic = "*PLASTIC\n3.E8, 0., 20.\n4.E8, .1, 20.\n1.E8, 0., 800.\n1.2E8, .2, 800.\n"
    tree, _ = converted(tmp_path, coupled_deck("*BOUNDARY\nBOTTOM, 1, 2\nTOP, 1, 1\n", material=plastic))
    assert tree["materials"]["STEEL"]["plastic"] == {
        "hardening": {"law": "table", "strain": [0.0, 0.1, 0.2], "T": [20.0, 800.0],
                      "stress": [[3e8, 4e8, 4e8], [1e8, 1.1e8, 1.2e8]]}, "chi": 0.0}
    heat = plastic + "*INELASTIC HEAT FRACTION\n.8\n"
    tree, _ = converted(tmp_path, coupled_deck("*BOUNDARY\nBOTTOM, 1, 2\nTOP, 1, 1\n", material=heat))
    assert tree["materials"]["STEEL"]["plastic"]["chi"] == 0.8


@pytest.mark.parametrize(("said", "closed", "opened"), [
    ("*GAP CONDUCTANCE, PRESSURE\n9., 0.\n5., 1.E6\n", {"law": "table", "x": [0.0, 1e6], "h": [9.0, 5.0]}, None),
    ("*GAP CONDUCTANCE\n5., 0.\n9., 1.E6\n", {"law": "table", "x": [0.0, 1e6], "h": [5.0, 9.0]}, None),
    ("*GAP CONDUCTANCE\n9., 0.\n0., .3\n",
     {"law": "constant", "h": 9.0}, {"law": "table", "x": [0.0, 0.3], "h": [9.0, 0.0]}),
    ("*GAP CONDUCTANCE\n9., 0., 20.\n5., 0., 500.\n",
     {"law": "table", "variable": "T", "x": [20.0, 500.0], "h": [9.0, 5.0]}, None),
    ("*GAP CONDUCTANCE, PRESSURE\n5., 0.\n9., 1.E6\n*GAP CONDUCTANCE\n5., 0.\n0., .3\n",
     {"law": "table", "x": [0.0, 1e6], "h": [5.0, 9.0]}, {"law": "table", "x": [0.0, 0.3], "h": [5.0, 0.0]})])
def test_conductance_over_pressure_gap_or_temperature(tmp_path, said, closed, opened):
    text = coupled_deck("*BOUNDARY\nBOTTOM, 1, 2\nTOP, 1, 1\n").replace("*GAP CONDUCTANCE\n1000.\n", said)
    tree, _ = converted(tmp_path, text)
    pair = tree["contact"]["SLAVE-MASTER"]
    assert pair["conduction"] == {"closed": closed, "open": opened}
    assert pair["gap_max"] == (0.3 if opened else 0.2)  # two edges of .1 m, or the end of the table


def test_friction_stiffness_and_gap_radiation(tmp_path):
    more = ("*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n4.E12\n*FRICTION\n.2, 1.E11\n"
            "*GAP HEAT GENERATION\n1., .7\n*GAP RADIATION\n.8, .6\n1., .01\n0., .5\n")
    text = coupled_deck("*BOUNDARY\nBOTTOM, 1, 2\nTOP, 1, 1\n").replace("*GAP COND", more + "*GAP COND")
    pair = converted(tmp_path, text)[0]["contact"]["SLAVE-MASTER"]
    assert pair["penalty"] == 4e12
    assert pair["friction"] == {"mu": 0.2, "stick": 1e11, "share": 0.7}
    assert pair["radiation"] == {"emissivity_slave": 0.8, "emissivity_master": 0.6,
                                 "gap": {"d_near": 0.01, "d_far": 0.5}}
    assert pair["gap_max"] == 0.5


def test_loads_stand_on_faces_surfaces_and_volumes(tmp_path):
    inside = ("*FILM\nUPPER, F3, 20., 100.\n*SFILM\nSLAVE, F, 30., 5.\n*RADIATE\nUPPER, R3, 25., .7\n"
              "*DFLUX\n2, S2, 1000.\n12, S2, 1000.\n*DFLUX\nLOWER, BF, 3.E4\n*DSFLUX\nMASTER, S, 7.\n")
    tree, told = converted(tmp_path, heat_deck(inside))
    assert not told.missed
    entries = tree["thermal"]["boundary"]
    assert {"on": "UPPER.UPPER_F3", "convection": {"h": 100.0, "T": 20.0}} in entries
    assert {"on": "UPPER.SLAVE", "convection": {"h": 5.0, "T": 30.0}} in entries
    assert {"on": "UPPER.UPPER_F3", "radiation": {"emissivity": 0.7, "T": 25.0}} in entries
    assert {"on": "LOWER.flux_faces", "flux": 1000.0} in entries
    assert {"on": "UPPER.flux_faces", "flux": 1000.0} in entries
    assert {"on": "LOWER.MASTER", "flux": 7.0} in entries
    assert tree["bodies"]["LOWER"]["Q_T"] == 3e4
    x = load_scenario(told.files[0]).interface
    assert np.array_equal(x.nodes[np.unique(x.surfaces["LOWER.flux_faces"])], [[0.2, 0.0], [0.2, 0.1]])


def test_forces_are_shared_by_a_set_and_by_the_thickness(tmp_path):
    held = "*BOUNDARY\nBOTTOM, 1, 2\nTOP, 1, 1\n"
    inside = held + "*CLOAD\nTOP, 2, -30.\n*DLOAD\nUPPER, P3, 1.E5\nNONE, GRAV, 9.81, 0., -1., 0.\n"
    text = coupled_deck(inside.replace("NONE", "")).replace("MATERIAL=STEEL\n1.", "MATERIAL=STEEL\n.5")
    elastic = converted(tmp_path, text)[0]["mechanical"]["elastic"]
    assert {"at": "UPPER.TOP", "f_y": -180.0} in elastic["boundary"]  # three nodes, half a metre
    assert {"on": "UPPER.UPPER_P3", "pressure": 1e5} in elastic["boundary"]
    assert elastic["gravity"] == {"y": -9.81}


def test_the_last_word_holds_node_by_node(tmp_path):
    inside = "*BOUNDARY\nBOTTOM, 11, 11, 100.\n2, 11, 11, 50.\n"
    entries = converted(tmp_path, heat_deck(inside))[0]["thermal"]["boundary"]
    assert sorted(e["temperature"] for e in entries) == [50.0, 100.0]
    assert all(e["at"] != "LOWER.BOTTOM" for e in entries)


def test_two_steps_an_amplitude_and_a_ramp(tmp_path):
    inside = "*AMPLITUDE, NAME=UP\n0., 0., 5., 1.\n*DFLUX, AMPLITUDE=UP\nUPPER, S3, 8.\n"
    later = "*STEP, AMPLITUDE=RAMP\n*HEAT TRANSFER, DIRECT\n2., 10.\n*DFLUX, OP=NEW\nLOWER, S1, 6.\n*END STEP\n"
    tree, _ = converted(tmp_path, heat_deck(inside) + later)
    flux = {e["on"]: e["flux"] for e in tree["thermal"]["boundary"]}
    assert flux["UPPER.UPPER_S3"] == {"t": [0.0, 5.0, 10.0, 20.0], "value": [0.0, 8.0, 8.0, 0.0]}
    assert flux["LOWER.LOWER_S1"] == {"t": [10.0, 20.0], "value": [0.0, 6.0]}
    assert tree["coupling"]["windows"] == [{"until": 10.0, "size": 1.0}, {"until": 20.0, "size": 2.0}]


def test_a_load_that_jumps_on_in_a_later_step():
    def step_of(start, ramp):
        return DeckStep("STATIC", start, 9.0, 1.0, 1.0, True, False, ramp, DeckLine("", 0, "", ()), ())

    step, ramp = step_of(4.0, False), step_of(0.0, True)
    assert after(None, step, 3.0, None, 0.0).signal == {"t": [4.0, 4.0], "value": [0.0, 3.0]}
    assert after(None, ramp, 3.0, None, 1.0).signal == {"t": [0.0, 9.0], "value": [1.0, 3.0]}
    total = Amplitude(((0.0, 0.0), (8.0, 4.0)), total=True, absolute=False)
    assert after(None, step, 2.0, total, 0.0).signal == {"t": [4.0, 4.0, 8.0], "value": [0.0, 4.0, 8.0]}


def test_a_ramp_that_ends_where_the_next_step_jumps():
    row = DeckLine("", 0, "", ())
    first, second = (DeckStep("STATIC", t, t + 2.0, 1.0, 1.0, True, False, False, row, ()) for t in (0.0, 2.0))
    up = Amplitude(((0.0, 0.0), (2.0, 1.0)), total=True, absolute=False)
    other = Amplitude(((0.0, 0.0), (2.0, 0.5), (4.0, 1.0)), total=True, absolute=False)
    course = after(after(None, first, 3.0, up, 0.0), second, 8.0, other, 0.0)
    assert course.signal == {"t": [0.0, 2.0, 2.0, 4.0], "value": [0.0, 3.0, 4.0, 8.0]}


def test_parts_with_one_instance_each(tmp_path):
    part = ("*PART, NAME=P{}\n*NODE\n1, 0., 0.\n2, 1., 0.\n3, 1., 1.\n4, 0., 1.\n*ELEMENT, TYPE=DC2D4, ELSET=E\n"
                 "1, 1, 2, 3, 4\n*ELSET, ELSET=E\n1\n*SOLID SECTION, ELSET=E, MATERIAL=STEEL\n,\n*END PART\n")
    low, high = part.format("A"), part.format("B")
    assembly = ("*ASSEMBLY, NAME=ALL\n*INSTANCE, NAME=Low, PART=PA\n*END INSTANCE\n*INSTANCE, NAME=High, PART=PB\n"
                "0., 1., 0.\n*END INSTANCE\n*NSET, NSET=FLOOR, INSTANCE=Low\n1, 2\n*ELSET, ELSET=UP, INSTANCE=High\n1\n"
                "*SURFACE, NAME=SLAVE\nUP, S1\n*SURFACE, NAME=MASTER\nLow.E, S3\n*END ASSEMBLY\n")
    start = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nLow.1, 5.\nFLOOR, 5.\n"
    text = low + high + assembly + STEEL + PAIR + start + HEAT.format(inside="*BOUNDARY\nFLOOR, 11, 11, 9.\n")
    tree, told = converted(tmp_path, text)
    assert list(tree["bodies"]) == ["Low", "High"]
    assert tree["thermal"]["boundary"] == [{"at": "Low.FLOOR", "temperature": 9.0}]
    x = load_scenario(told.files[0]).interface.nodes
    assert x[:, 1].max() == 2.0
    assert any("5 to" in m.why or "0 to 5" in m.why for m in told.missed)  # two of Low's nodes begin at 5


def test_a_static_deck_has_an_idle_thermal_half(tmp_path):
    step = "*STEP, NLGEOM\n*STATIC, DIRECT\n.5, 1.\n*BOUNDARY\nBOTTOM, 1, 2\nTOP, 1, 1\nTOP, 2, 2, -1.E-6\n*END STEP\n"
    tree, told = converted(tmp_path, MESH.format(type="CPE4") + SOLID + SECTIONS + PAIR + step)
    assert tree["materials"]["STEEL"]["rho"] * tree["materials"]["STEEL"]["c"] == 1e12
    assert "conduction" not in tree["contact"]["SLAVE-MASTER"]
    assert any("no heat" in m.why for m in told.missed)
    top = next(e for e in tree["mechanical"]["elastic"]["boundary"] if e["at"] == "UPPER.TOP" and "u_y" in e)
    assert top["u_y"] == {"t": [0.0, 1.0], "value": [0.0, -1e-6]}


@pytest.mark.parametrize(("constants", "unit"), [
    ("*PHYSICAL CONSTANTS, ABSOLUTE ZERO=-273.15, STEFAN BOLTZMANN=5.67E-8\n", "degC"),
    ("*PHYSICAL CONSTANTS, ABSOLUTE ZERO=0.\n", "K"), ("", "degC")])
def test_the_unit_of_temperature(tmp_path, constants, unit):
    tree, told = converted(tmp_path, heat_deck(model=constants))
    assert tree["units"]["temperature"] == unit
    assert tree["thermal"].get("sigma_SB") == (5.67e-8 if "STEFAN" in constants else None)
    assert any("ABSOLUTE ZERO" in note for note in told.notes) == (not constants)


def test_names_the_scenario_cannot_take_are_changed_and_stay_apart(tmp_path):
    text = heat_deck("*BOUNDARY\nlow er, 11, 11, 3.\n").replace("LOWER", "Low er").replace("BOTTOM", "9low.er")
    with pytest.raises(ScenarioError, match="no set of nodes"):
        converted(tmp_path, text)
    tree, _ = converted(tmp_path, text.replace("low er, 11", '"9LOW.ER", 11'))
    assert list(tree["bodies"]) == ["Low_er", "UPPER"]
    assert tree["thermal"]["boundary"][0]["at"] == "Low_er._9low_er"


def test_a_deck_of_its_own_is_never_overwritten(tmp_path):
    (tmp_path / "scene.msh").write_text("mine")
    from coupler.deck import convert

    (tmp_path / "deck.inp").write_text(heat_deck())
    with pytest.raises(ScenarioError, match="already"):
        convert(tmp_path / "deck.inp", tmp_path / "scene.yaml")
    assert (tmp_path / "scene.msh").read_text() == "mine"


def test_what_fails_its_check_leaves_nothing_behind(tmp_path):
    with pytest.raises(ScenarioError, match=r"deck\.inp.*does not pass its check.*Poisson"):
        converted(tmp_path, coupled_deck("*BOUNDARY\nBOTTOM, 1, 2\nTOP, 1, 1\n").replace("2.E11, .3", "2.E11, .5"))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["deck.inp"]


def test_coupled_steps_iterate_and_uncoupled_ones_do_not(tmp_path):
    text = MESH.format(type="CPE4") + SOLID + SECTIONS + START + COUPLED.format(inside="*BOUNDARY\nNALL, 1, 2\n")
    assert converted(tmp_path, text)[0]["coupling"]["scheme"] == "iterated"
    tree = converted(tmp_path, text.replace("*COUPLED", "*UNCOUPLED"))[0]
    assert tree["coupling"]["scheme"] == "staggered"


LINES = "*ELEMENT, type=T3D2, ELSET=Line1\n21, 1, 2\n22, 2, 3\n*ELSET,ELSET=all\n21, 22, 1, 2\n"


def test_lines_of_a_mesh_generator_are_left_out_with_a_notice(tmp_path):
    """As gmsh writes them: the lines of the outline are trusses without a section, and groups name their numbers."""
    plain, _ = converted(tmp_path, heat_deck())
    tree, told = converted(tmp_path, heat_deck(mesh=LINES))
    assert tree == plain
    assert [(m.text, "left out" in m.why) for m in told.missed] == [("*ELEMENT, type=T3D2, ELSET=Line1", True)]


def test_trusses_are_refused(tmp_path):
    with pytest.raises(ScenarioError, match=r"deck\.inp:\d+: this section makes trusses of lines"):
        converted(tmp_path, heat_deck(mesh=LINES, model="*SOLID SECTION, ELSET=LINE1, MATERIAL=STEEL\n1.\n"))
