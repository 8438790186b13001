"""Deformation of bodies by a program that answers at nodes alone."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from contact.half.model import Discard, Done
from contact.half.program import ProgramError
from contact.rpc.link import open_link
from mechanical_fmu import DisplacementAnswer, MechanicalProgram, mechanical_program_half
from mechanical_fmu.elastic_half import ElasticHalf
from mechanical_fmu.elastic_half import load as load_own

sys.path.append(str(Path(__file__).parent.parent))
sys.path.append(str(Path(__file__).parent.parent / "coupler"))
import deck_program
from foreign_scenes import first_inputs, scenes

SIDES = [{"on": f"{body}.{side}", "u_x": 0} for body in ("lower", "upper") for side in ("left", "right")]
PRESS_FIT = {"mechanical.elastic.boundary": [*SIDES, {"on": "lower.bottom", "u_y": 0}, {"on": "upper.top", "u_y": 0}]}
LENGTHS, E = np.array([0.01, 0.02]), np.array([2e11, 1e11])
NU, ALPHA = np.array([0.3, 0.34]), np.array([1.2e-5, 1.9e-5])
T_REF, WARMER = 293.15, 40.0


class DeckSolid(MechanicalProgram):
    """The tests' program, called here.  stiff : E it has for what the scene says.  runs : so far."""

    def __init__(self, takes="force", stiff=1.0):
        self.takes, self.stiff, self.runs = takes, stiff, 0

    def start(self, mesh, materials):
        self.mesh = mesh
        self.materials = [(self.stiff * m.E.constant, m.nu.constant, m.alpha.constant, m.T_ref) for m in materials]

    def solve(self, task):
        self.runs += 1
        found = self.answer({
            "kind": "deform", "x": self.mesh.nodes.tolist(), "T": task.T.tolist(), "force": task.force.tolist(),
            "quads": self.mesh.quads.tolist(), "parts": self.mesh.quad_part.tolist(), "materials": self.materials,
            "fixed": task.fixed.tolist(), "u_fixed": task.u_fixed.tolist()})
        return DisplacementAnswer(np.array(found["u"]), np.array(found["reaction"]))

    def answer(self, deck):
        return deck_program.deform(deck)


def half_of(folder, monkeypatch, program, **overrides) -> ElasticHalf:
    _, foreign = scenes(folder, "mechanical", monkeypatch, **{**PRESS_FIT, **overrides})
    return mechanical_program_half(program, foreign.interface, foreign.models["mechanical"])


def pressed(half, warmer=WARMER, steps=2):
    """The last outputs of bodies that are warmed in steps."""
    link, inputs = open_link("direct"), first_inputs(half)
    state, _ = half.start(inputs, 0.0, link)
    for k in range(1, steps + 1):
        T = np.full(np.shape(inputs["T"]), T_REF + k * warmer / steps)
        done = half.step(state, {**inputs, "T": T}, k - 1.0, 1.0, link)
        assert isinstance(done, Done), done
        state = done.state
    return done.outputs


def closed_form(E):
    """Pressure of layers that can lengthen in one direction alone, which their supports forbid, at small strains."""
    M = E * (1 - NU) / ((1 + NU) * (1 - 2 * NU))
    return float((LENGTHS * (1 + NU) / (1 - NU) * ALPHA * WARMER).sum() / (LENGTHS / M).sum())


@pytest.mark.few("force-0.4", "displacement-2.5")
@pytest.mark.parametrize(("takes", "stiff"), [("force", 1.0), ("displacement", 1.0), ("force", 0.4),
                                              ("displacement", 2.5)])
def test_a_press_fit_has_the_pressure_of_the_programs_own_law(takes, stiff, tmp_path, monkeypatch):
    """Its strains are small and linear, ours finite: 0.035 % apart at the same E, and far apart at another."""
    program = DeckSolid(takes, stiff)
    out = pressed(half_of(tmp_path, monkeypatch, program))
    p = -np.array(out["contact.t_N"])
    assert p == pytest.approx(np.full(p.size, closed_form(stiff * E)), rel=2e-4)
    assert out["reaction.lower"][1] == pytest.approx(-out["reaction.upper"][1], rel=1e-5)
    assert out["reaction.lower"][1] == pytest.approx(0.02 * closed_form(stiff * E), rel=2e-4)
    assert 0 < program.runs < 40


def test_the_cells_around_it_would_say_something_else(tmp_path, monkeypatch):
    own, _ = scenes(tmp_path, "mechanical", monkeypatch, **PRESS_FIT)
    p = -np.array(pressed(load_own(own.interface, own.models["mechanical"]))["contact.t_N"])
    assert p.mean() != pytest.approx(closed_form(E), rel=2.5e-4)


def test_a_step_taken_again_is_the_same_to_the_bit(tmp_path, monkeypatch):
    half = half_of(tmp_path, monkeypatch, DeckSolid())
    link, inputs = open_link("direct"), first_inputs(half)
    state, _ = half.start(inputs, 0.0, link)
    warm = {**inputs, "T": np.full(np.shape(inputs["T"]), T_REF + 30.0)}
    one = half.step(state, warm, 0.0, 1.0, link)
    half.step(one.state, inputs, 1.0, 1.0, link)
    again = half.step(state, warm, 0.0, 1.0, link)
    np.testing.assert_array_equal(one.outputs["x"], again.outputs["x"])


def test_a_program_that_fails_is_run_once_and_ends_the_step_with_its_own_words(tmp_path, monkeypatch):
    program = DeckSolid()
    half = half_of(tmp_path, monkeypatch, program)
    link, inputs = open_link("direct"), first_inputs(half)
    state, _ = half.start(inputs, 0.0, link)

    def failing(deck):
        raise ProgramError("deck ended with exit code 3: no licence")

    program.answer, program.runs = failing, 0
    warm = {**inputs, "T": np.full(np.shape(inputs["T"]), T_REF + 30.0)}
    done = half.step(state, warm, 0.0, 0.5, link)
    assert isinstance(done, Discard)
    assert "no licence" in done.message
    assert done.dt_suggest == 0.5, "no shorter step would help"
    assert program.runs == 1


def test_a_body_that_contact_alone_holds_is_given_its_displacement(tmp_path, monkeypatch):
    loose = {"mechanical.elastic.boundary": [*SIDES, {"on": "lower.bottom", "u_y": 0},
                                             {"on": "upper.top", "pressure": 1.0e7}]}
    with pytest.raises(ValueError, match="contact alone holds a body"):
        half_of(tmp_path, monkeypatch, DeckSolid(), **loose)
    out = pressed(half_of(tmp_path, monkeypatch, DeckSolid("displacement"), **loose))
    assert -np.array(out["contact.t_N"]) == pytest.approx(np.full(len(out["contact.t_N"]), 1e7), rel=1e-3)
