"""Every law is seen green on what is right and red under a planted fault: by which tests."""

from __future__ import annotations

import ast
import sys
from functools import cache
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
from random_scenes.invariants import INVARIANTS  # noqa: E402

FRAME = ("frame", "test_right_scenes_keep_the_laws", "test_a_fault_breaks_its_law")
SIGNS = "test_right_scenes_keep_all_signs_and_sums"
SEEN = {
    **{f"frame: {how}": FRAME for how in ("shift", "turn", "mirror", "renumber", "order of bodies", "order of pairs",
                                          "unit of temperature", "unit of length", "physically similar",
                                          "start of time")},
    "roles: slave and master": ("roles", "test_right_scenes_keep_the_laws", "test_a_fault_breaks_its_law"),
    "roles: heat across even gaps": ("roles", "test_heat_between_rings_has_one_area", "test_a_fault_breaks_its_law"),
    "superposed turn": ("motion", "test_a_scene_feels_nothing_of_a_turn",
                        "test_a_pressure_that_does_not_follow_is_found"),
    "within its data": ("thermal", "test_a_plate_stays_within_its_data",
                        "test_both_laws_find_a_film_that_aims_too_high"),
    "maximum principle": ("thermal", "test_a_plate_stays_within_its_data_in_windows_of_any_length",
                          "test_both_laws_find_a_film_that_aims_too_high"),
    "no cycles": ("cycles", "test_what_goes_to_rest_is_right", "test_a_half_that_is_off_every_other_window_is_found"),
    "no passing through": ("contact", "test_bodies_that_meet_are_right",
                           "test_a_penalty_that_is_not_the_one_told_is_found"),
    "long windows tell the same": ("contact", "test_bodies_that_meet_are_right",
                                   "test_contact_that_long_windows_lose_is_found"),
    "what is open does not press": ("contact", "test_bodies_that_meet_are_right",
                                    "test_a_corner_that_lends_its_pressure_is_found"),
    "rest": ("rest", "test_nothing_driven_nothing_moves", "test_a_film_that_heats_from_nothing_is_found"),
    "free of stress": ("rest", "test_a_body_that_hangs_free_has_no_stress",
                       "test_stress_of_a_load_that_nobody_stated_is_found"),
    "contact presses": ("signs", SIGNS, "test_contact_that_pulls_is_found"),
    "Coulomb's bound": ("signs", SIGNS, "test_more_friction_than_coulomb_allows_is_found"),
    "work makes heat": ("signs", SIGNS, "test_friction_and_flow_that_cool_are_found"),
    "forces add up": ("signs", SIGNS, "test_a_load_that_nobody_stated_is_found"),
    "heats add up": ("signs", SIGNS, "test_a_body_with_another_mass_is_found"),
    "entropy does not fall": ("signs", SIGNS, "test_heat_that_flows_from_cold_to_hot_is_found"),
    "estimated error": ("refine", "test_errors_are_as_estimated", "test_errors_understated_are_found"),
    "settles": ("refine", "test_answers_settle", "test_heat_that_grows_with_every_window_and_cell_is_found"),
    "one system": ("monolithic", "test_iterated_windows_solve_the_one_system",
                   "test_geometry_of_another_time_is_found"),
    "steady": ("monolithic", "test_damped_methods_come_to_rest", "test_methods_that_damp_no_more_are_found"),
    "same bits": ("work", "test_fmus_bytes_processes_and_resumed_runs_have_the_same_bits",
                  "test_what_a_resumed_run_forgets_is_found"),
}
"""Law -> (test_invariants_*.py, test on what is right, test under a planted fault)."""


@cache
def _tests_of(topic: str) -> dict[str, ast.FunctionDef]:
    tree = ast.parse((HERE / f"test_invariants_{topic}.py").read_text(encoding="utf-8"))
    return {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_every_law_is_tested():
    assert set(SEEN) == {law.name for law in INVARIANTS}
    assert len({law.name for law in INVARIANTS}) == len(INVARIANTS)


@pytest.mark.parametrize("law", SEEN)
def test_its_tests_stand_and_count(law):
    topic, green, red = SEEN[law]
    for name in (green, red):
        test = _tests_of(topic)[name]
        marks = ast.unparse(ast.Module(body=[ast.Expr(d) for d in test.decorator_list], type_ignores=[]))
        assert "xfail" not in marks
        assert "skip" not in marks
        assert any(isinstance(node, ast.Assert) for node in ast.walk(test)), f"{name} asserts nothing"
    assert "monkeypatch" in {a.arg for a in _tests_of(topic)[red].args.args} or "replace(" in ast.unparse(
        _tests_of(topic)[red]), f"{red} plants nothing"
