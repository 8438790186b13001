"""Decks that are wrong, odd or hostile: one error with file, line, text and what to do; never another."""

from __future__ import annotations

import contextlib
import random
import sys
from pathlib import Path

import pytest

from coupler.deck import convert
from coupler.errors import UNPRINTABLE, ScenarioError
from coupler.scenario.document import read_document

sys.path.insert(0, str(Path(__file__).parent))
from decks import converted, coupled_deck, heat_deck

PRESCRIBED = "*BOUNDARY\nBOTTOM, 11, 11, 100.\n"


@pytest.mark.parametrize(("old", "new", "said"), [
    ("TYPE=DC2D4, ELSET=LOWER", "TYPE=C3D8, ELSET=LOWER", "elements of type C3D8"),
    ("TYPE=DC2D4, ELSET=LOWER", "TYPE=CPE8R, ELSET=LOWER", "first order"),
    ("TYPE=DC2D4, ELSET=LOWER", "TYPE=DCAX4, ELSET=LOWER", "in one deck"),
    ("*SURFACE, NAME=SLAVE", "*SURFACE, TYPE=NODE, NAME=SLAVE", "surfaces of type NODE"),
    ("UPPER, S1", "UPPER, S2", "lies inside"),
    ("UPPER, S1", "UPPER, S5", "no face"),
    ("UPPER, S1", "UPER, S1", "Did you mean 'UPPER'"),
    ("2, 1.D-1, 0.", "2, NaN, 0.", "must be a number"),
    ("2, 1.D-1, 0.", "2, 1E999, 0.", "too large"),
    ("2, 1.D-1, 0.", "2, 1_0, 0.", "must be a number"),
    ("2, 1.D-1, 0.", "2, <width>, 0.", "nothing is evaluated|not evaluated"),
    ("2, 1.D-1, 0.", "2, .1, 0., 1.", "plane z = constant"),
    ("2, 1.D-1, 0.", "1, 1.D-1, 0.", "there twice"),
    ("1, 1, 2, 5, 4", "1, 1, 2, 5", "its number and 4 nodes"),
    ("1, 1, 2, 5, 4", "1, 1, 2, 5, 99", "no node 99"),
    ("1, 1, 2, 5, 4", "1, 1, 2, 1, 4", "no area"),
    ("ELSET=UPPER, MATERIAL=STEEL", "ELSET=UPPER, MATERIAL=STEL", "Did you mean 'STEEL'"),
    ("*SOLID SECTION, ELSET=UPPER, MATERIAL=STEEL\n1.\n", "", "has no section"),
    ("*DENSITY\n7800.\n", "", "lacks [*]DENSITY"),
    ("*GAP CONDUCTANCE\n1000.", "*GAP CONDUCTANCE\n-1000.", "not negative"),
    ("INTERACTION=TOUCH\nSLAVE", "INTERACTION=TUCH\nSLAVE", "SURFACE INTERACTION"),
    ("*HEAT TRANSFER, DIRECT", "*DYNAMIC", "no equilibrium"),
    ("*HEAT TRANSFER, DIRECT\n1., 10.", "*HEAT TRANSFER, DIRECT\n1., -10.", "greater than zero"),
    ("*HEAT TRANSFER, DIRECT\n1., 10.", "*HEAT TRANSFER, DIRECT\n1.E-9, 10.", "increments"),
    ("*HEAT TRANSFER, DIRECT\n1., 10.\n", "", "one procedure"),
    ("*HEADING", "1, 2\n*HEADING", "before the first keyword"),
    ("*HEADING", "*INCLUDE, INPUT=../deck.inp\n*HEADING", "beside the deck"),
    ("*HEADING", "*INCLUDE, INPUT=/etc/passwd\n*HEADING", "beside the deck"),
    ("*HEADING", "*INCLUDE, INPUT=deck.inp\n*HEADING", "includes itself"),
    ("*HEADING", "*INCLUDE, INPUT=none.inp\n*HEADING", "no such file"),
    ("*HEADING", "*INCLUDE\n*HEADING", "which file"),
    ("*HEADING", "*PHYSICAL CONSTANTS, ABSOLUTE ZERO=-459.67\n*HEADING", "absolute zero"),
    ("1, 3\n", "1, 99999999999\n", "whole number"),
    ("1, 3\n", "3, 1\n", "first to last"),
    ("*SPECIFIC HEAT\n500.\n", "*SPECIFIC HEAT\n500., 20.\n600., 20.\n", "temperatures must increase"),
])
def test_each_error_names_file_line_and_text(tmp_path, old, new, said):
    text = heat_deck(PRESCRIBED)
    assert old in text
    with pytest.raises(ScenarioError, match=said) as caught:
        converted(tmp_path, text.replace(old, new, 1))
    assert caught.value.file.endswith("deck.inp")
    assert caught.value.line > 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["deck.inp"]


def test_a_part_used_twice_and_one_that_turns_are_refused(tmp_path):
    part = "*PART, NAME=P\n*END PART\n*ASSEMBLY, NAME=A\n*INSTANCE, NAME=I, PART=P\n0., 0., 0.\n{0}*END INSTANCE\n"
    again = "*INSTANCE, NAME=J, PART=P\n*END INSTANCE\n"
    with pytest.raises(ScenarioError, match="two instances"):
        converted(tmp_path, part.format("") + again + heat_deck(PRESCRIBED))
    with pytest.raises(ScenarioError, match="not turned"):
        converted(tmp_path, part.format("0., 0., 0., 0., 0., 1., 30.\n") + heat_deck(PRESCRIBED))


def test_two_materials_in_one_piece_are_refused(tmp_path):
    more = ("*MATERIAL, NAME=BRASS\n*CONDUCTIVITY\n100.\n*SPECIFIC HEAT\n400.\n*DENSITY\n8500.\n*ELSET, ELSET=ONE\n1\n"
            "*ELSET, ELSET=TWO\n2\n*SOLID SECTION, ELSET=TWO, MATERIAL=BRASS\n1.\n")
    text = heat_deck(PRESCRIBED, mesh=more).replace("ELSET=LOWER, MATERIAL", "ELSET=ONE, MATERIAL")
    with pytest.raises(ScenarioError, match=r"STEEL and of BRASS|BRASS and of STEEL"):
        converted(tmp_path, text)


def test_case_blanks_continuations_and_includes_change_nothing(tmp_path):
    text = heat_deck(PRESCRIBED)
    tree, _ = converted(tmp_path, text)
    cell = ("1, 1, 2, 5, 4", "1,1,2,\n5 ,4,")
    head, tail = text.split("*MATERIAL", 1)
    odd = (head.lower().replace("*element, type=dc2d4,", "*Element ,  type = dc2d4,\n   ")
           .replace(*cell).replace("\n", "\r\n") + "** a comment\r\n\r\n*Include, input=rest.inp\r\n")
    found, told = converted(tmp_path, ("\ufeff" + odd).encode(), rest="*material" + tail.replace("LOWER", "lower"))
    assert not told.missed
    assert found["materials"] == tree["materials"]
    assert found["thermal"]["boundary"] == [{"at": "lower.bottom", "temperature": 100.0}]


def test_lines_of_an_included_file_are_told_with_its_name(tmp_path):
    with pytest.raises(ScenarioError) as caught:
        converted(tmp_path, heat_deck(PRESCRIBED, mesh="*INCLUDE, INPUT=more.inp\n"), more="\n*NSET, NSET=X\nNOWHERE\n")
    assert (caught.value.file, caught.value.line) == (str(tmp_path / "more.inp"), 3)


def test_files_that_include_each_other_over_and_over_are_bounded(tmp_path):
    files = {f"f{i}": f"*INCLUDE, INPUT=f{i + 1}.inp\n" * 3 for i in range(15)} | {"f15": "** end\n" * 10}
    with pytest.raises(ScenarioError, match="more than 1000 files"):
        converted(tmp_path, "*HEADING\n*INCLUDE, INPUT=f0.inp\n", **files)


@pytest.mark.parametrize("raw", [b"", b"\n** nothing\n", "*HEADING\n".encode("utf-16"), b"*HEADING\n\xff\xfe\x00",
                                 b"*", b",", b"*STEP\n*END STEP\n", b"*NODE\n1,0,0\n", b"*ELEMENT,TYPE=CPE4\n",
                                 b"*NODE,INPUT=\n"])
def test_what_is_no_deck_is_refused(tmp_path, raw):
    with pytest.raises(ScenarioError):
        converted(tmp_path, raw)


def test_text_of_a_deck_cannot_leave_its_comment(tmp_path):
    evil = "*NODE FILE, X=\x85slideline: 9\u2028thermal: {}\x0bmechanical\n"
    _, told = converted(tmp_path, heat_deck(PRESCRIBED + evil, model="*MPC, NAME=\x1b[31m\nTIE, A, B\n"))
    text = told.files[0].read_text(encoding="utf-8")
    assert [line for line in text.splitlines() if line.startswith("slideline")] == ["slideline: 2"]
    assert not set(text) & set("\x85\u2028\x0b\x1b")


@pytest.mark.parametrize("name", ["a\nslideline: 7\n.inp", "a\udcff.inp"])
def test_names_of_decks_cannot_leave_their_comment_either(tmp_path, name):
    deck = tmp_path / name
    deck.write_text(heat_deck(PRESCRIBED, model="*INITIAL CONDITIONS, TYPE=\x1b[31m\x85slideline: 3\n"))
    told = convert(deck, tmp_path / "scene.yaml")
    text = told.files[0].read_text(encoding="utf-8")
    assert read_document(told.files[0]).tree["slideline"] == 2
    assert all(line.isprintable() for line in text.split("\n"))
    assert all(line.isprintable() for line in told.lines)


def test_includes_lie_beside_the_deck_as_it_was_named(tmp_path):
    inner = tmp_path / "inner"
    inner.mkdir()
    (inner / "deck.inp").write_text("*INCLUDE, INPUT=more.inp\n" + heat_deck(PRESCRIBED))
    (inner / "more.inp").write_text("** beside the deck\n")
    (tmp_path / "secret").write_text("secret\n")
    outer = tmp_path / "outer"
    outer.mkdir()
    (outer / "deck.inp").symlink_to(inner / "deck.inp")
    (outer / "more.inp").symlink_to(tmp_path / "secret")
    with pytest.raises(ScenarioError, match="beside the deck"):
        convert(outer / "deck.inp", outer / "scene.yaml")
    (outer / "more.inp").unlink()
    (outer / "more.inp").symlink_to("more.inp")
    with pytest.raises(ScenarioError, match="no such file"):
        convert(outer / "deck.inp", outer / "scene.yaml")
    (outer / "more.inp").unlink()
    (outer / "more.inp").write_text("** beside the link\n")
    assert not convert(outer / "deck.inp", outer / "scene.yaml").missed


def test_a_range_costs_what_the_deck_has_and_not_what_it_asks_for(tmp_path):
    _, told = converted(tmp_path, heat_deck(PRESCRIBED).replace("1, 3\n", "2, 9999999998, 2\n", 1))
    assert "4999999993 numbers" in told.missed[0].why


@pytest.mark.parametrize(("times", "windows"), [
    ("1.E-7, 1000.", {"until": 1000.0, "first": 1e-7, "last": 20.0}),
    ("1.E-7, 1000., , 5.", {"until": 1000.0, "first": 1e-7, "last": 5.0}),
    ("10., 1000.", {"until": 1000.0, "size": 10.0}),
    ("1., 1000., , 1.", {"until": 1000.0, "size": 1.0})])
def test_windows_grow_where_a_step_may_choose_its_increments(tmp_path, times, windows):
    tree, _ = converted(tmp_path, heat_deck(PRESCRIBED).replace(", DIRECT\n1., 10.", f"\n{times}"))
    assert tree["coupling"]["windows"] == [windows]


@pytest.mark.parametrize(("times", "said"), [
    ("1.E-9, 1.E3, , 1.E-9", "increments"), ("1.E-200, 1.E200, , 1.E-200", "increments"),
    ("1.E307, 1.7E308", "no end")])
def test_steps_that_no_run_could_take_are_refused(tmp_path, times, said):
    step = f"*STEP\n*HEAT TRANSFER\n{times}\n*END STEP\n"
    text = heat_deck(PRESCRIBED).replace("*HEAT TRANSFER, DIRECT\n1., 10.", f"*HEAT TRANSFER\n{times}") + step
    with pytest.raises(ScenarioError, match=said):
        converted(tmp_path, text)


def test_the_mesh_does_not_take_the_scenarios_place(tmp_path):
    deck = tmp_path / "deck.inp"
    deck.write_text(heat_deck(PRESCRIBED))
    with pytest.raises(ScenarioError, match=r"End the scenario in [.]yaml"):
        convert(deck, tmp_path / "scene.msh")
    assert [p.name for p in tmp_path.iterdir()] == ["deck.inp"]


def test_a_latin_1_deck_is_read(tmp_path):
    tree, _ = converted(tmp_path, heat_deck(PRESCRIBED).replace("Two blocks", "Zwei Bl\u00f6cke").encode("latin-1"))
    assert tree["title"] == "Zwei Bl\u00f6cke"


@pytest.mark.few("1")
@pytest.mark.parametrize("seed", range(3))
def test_cut_decks_end_in_a_scenario_or_in_our_own_error(tmp_path, seed):
    rng = random.Random(seed)
    inside = "*BOUNDARY\nBOTTOM, 1, 2\n*FILM\nUPPER, F3, 20., 9.\n*CLOAD\n16, 2, -3.\n*DLOAD\nUPPER, P3, 1.\n"
    whole = coupled_deck(inside, material="*PLASTIC\n3.E8, 0., 20.\n4.E8, .1, 20.\n")
    for _ in range(15):
        a, b = sorted(rng.randrange(len(whole)) for _ in range(2))
        text = whole[:a] + whole[min(b, a + 40):]
        with contextlib.suppress(ScenarioError):  # any other error fails the test
            converted(tmp_path, text)


@pytest.mark.few("0")
@pytest.mark.parametrize("seed", range(4))
def test_decks_of_changed_bytes_end_in_a_scenario_or_in_our_own_error(tmp_path, seed):
    rng = random.Random(seed)
    inside = "*BOUNDARY\nBOTTOM, 1, 2\n*FILM\nUPPER, F3, 20., 9.\n*CLOAD\n16, 2, -3.\n*DLOAD\nUPPER, P3, 1.\n"
    whole = coupled_deck(inside, material="*PLASTIC\n3.E8, 0., 20.\n4.E8, .1, 20.\n").encode()
    said = []
    for _ in range(40):
        data = bytearray(whole)
        for _ in range(rng.choice([1, 2, 5])):
            at = rng.randrange(len(data))
            if rng.random() < 0.5:
                data[at] ^= 1 << rng.randrange(8)
            else:
                data[at:at + rng.randrange(3)] = rng.choice(
                    [b"\x1b[2J", b"9" * 30, b"\x00", b"\xff", b"*", b",", b"\r", b"<x>"])
        try:
            converted(tmp_path, bytes(data))
        except ScenarioError as exc:
            said.append(str(exc))
    assert len(said) > 10
    assert not [text for text in said if UNPRINTABLE.search(text)]
