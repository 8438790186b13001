"""Heat inside bodies by a program that answers at nodes alone."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from contact.half.model import Discard, Done
from contact.half.program import Program, ProgramError
from contact.rpc.link import open_link
from thermal_fmu import HeatAnswer, ThermalProgram, thermal_program_half
from thermal_fmu.half import ThermalHalf

sys.path.append(str(Path(__file__).parent.parent))
sys.path.append(str(Path(__file__).parent.parent / "coupler"))
import deck_program
from foreign_scenes import first_inputs, scenes

SPAN = 200.0  # K, of the temperatures of the scene


class DeckHeat(ThermalProgram):
    """The tests' program, called here.  conducts : k it has for what the scene says.  runs : so far."""

    def __init__(self, takes="heat", lumped=False, conducts=1.0):
        self.takes, self.lumped, self.conducts, self.runs = takes, lumped, conducts, 0

    def start(self, mesh, materials):
        self.mesh = mesh
        self.materials = [(self.conducts * m.k.constant, m.rho * m.c.constant) for m in materials]

    def step(self, task):
        self.runs += 1
        nodes = task.nodes if self.takes == "temperature" else []
        found = self.answer({
            "kind": "heat", "x": task.x.tolist(), "T": task.T.tolist(), "dt": task.dt, "heat": task.heat.tolist(),
            "quads": self.mesh.quads.tolist(), "parts": self.mesh.quad_part.tolist(), "materials": self.materials,
            "lumped": self.lumped, "nodes": np.asarray(nodes).tolist(),
            "T_nodes": task.T_nodes.tolist() if len(nodes) else []})
        return HeatAnswer(np.array(found["T"]), np.array(found["heat"]) if len(nodes) else None)

    def answer(self, deck):
        return deck_program.heat(deck)


class RunHeat(DeckHeat):
    """The same as a program of its own."""

    def answer(self, deck):
        program = Program("deck", Path(sys.executable))
        words = [str(Path(__file__).parent.parent / "deck_program.py")]
        return json.loads(program.run(words, {"deck.json": json.dumps(deck)}, ["results.json"])["results.json"])


def halves(folder, monkeypatch, program, **overrides):
    own, foreign = scenes(folder, "thermal", monkeypatch, **overrides)
    return (ThermalHalf(own.interface, own.models["thermal"]),
            thermal_program_half(program, foreign.interface, foreign.models["thermal"]))


def course(half, steps=3, h=0.5):
    """T after every step, and the last outputs, of bodies pressed more and more."""
    link, inputs = open_link("direct"), first_inputs(half)
    state, out = half.start(inputs, 0.0, link)
    found = []
    for k in range(steps):
        given = {**inputs, "contact.t_N": np.full(np.shape(inputs["contact.t_N"]), -1e6 * k)}
        done = half.step(state, given, k * h, h, link)
        assert isinstance(done, Done), done
        state, out = done.state, done.outputs
        found.append(np.array(out["T"]))
    return np.array(found), out


@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "backward_euler"])
def test_a_program_that_solves_as_our_cells_do_gives_their_temperatures(method, tmp_path, monkeypatch):
    program = DeckHeat(lumped=True)
    own, half = halves(tmp_path, monkeypatch, program, **{"thermal.method": method})
    (T_own, out_own), (T, out) = course(own), course(half)
    assert np.ptp(T_own) > 0.9 * SPAN
    assert np.abs(T - T_own).max() < 1e-5 * SPAN
    for name in (n for n in out if n.startswith("heat.")):
        assert out[name] == pytest.approx(out_own[name], abs=1e-5 * abs(out_own["heat.stored.upper"])), name
    assert out["program.runs"] > 0


@pytest.mark.parametrize("takes", ["heat", "temperature"])
def test_the_answer_is_the_programs_whatever_the_scene_says_of_the_inside(takes, tmp_path, monkeypatch):
    """k three times that of the scene in the program: the answer is that of a scene with this k."""
    program = DeckHeat(takes, lumped=True, conducts=3.0)
    _, half = halves(tmp_path, monkeypatch, program)
    T = course(half)[0]
    own, _ = halves(tmp_path, monkeypatch, DeckHeat(), **{"materials.steel.k": 90.0, "materials.brass.k": 330.0})
    first, _ = halves(tmp_path, monkeypatch, DeckHeat())
    T_own = course(own)[0]
    assert np.abs(T_own - course(first)[0]).max() > 4.0, "it matters"
    assert np.abs(T - T_own).max() < 1e-5 * SPAN


def test_heat_in_and_temperature_out_is_temperature_in_and_heat_out(tmp_path, monkeypatch):
    """Of a program that shares storage among nodes, about which plain iteration would diverge; its heat adds up."""
    runs, found = [], []
    for takes in ("heat", "temperature"):
        program = DeckHeat(takes)
        own, half = halves(tmp_path, monkeypatch, program, **{"thermal.method": "backward_euler"})
        T, out = course(half, h=0.02)
        found.append(T)
        runs.append(program.runs)
        stored = sum(v for n, v in out.items() if n.startswith("heat.stored"))
        moved = sum(v for n, v in out.items() if n.startswith("heat.") and not n.startswith("heat.stored"))
        assert moved == pytest.approx(stored, abs=1e-5 * out["heat_moved"])
    assert np.abs(found[0] - found[1]).max() < 1e-5 * SPAN
    assert np.abs(found[0] - course(own, h=0.02)[0]).max() > 0.5, "storage at nodes is another answer"
    assert max(runs) < 3 * 20


def test_a_program_in_a_process_of_its_own_says_the_same_to_the_bit(tmp_path, monkeypatch):
    T = [course(halves(tmp_path, monkeypatch, program, **{"thermal.method": "backward_euler"})[1], steps=1)[0]
         for program in (DeckHeat(lumped=True), RunHeat(lumped=True))]
    np.testing.assert_array_equal(T[0], T[1])


def test_a_step_taken_again_is_the_same_to_the_bit(tmp_path, monkeypatch):
    """What is known of the program is in the state: a rollback goes back to it."""
    _, half = halves(tmp_path, monkeypatch, DeckHeat())
    link, inputs = open_link("direct"), first_inputs(half)
    state, _ = half.start(inputs, 0.0, link)
    one = half.step(state, inputs, 0.0, 0.5, link)
    two = half.step(one.state, inputs, 0.5, 0.5, link)
    half.step(state, inputs, 0.0, 0.1, link)
    again = half.step(one.state, inputs, 0.5, 0.5, link)
    np.testing.assert_array_equal(two.outputs["T"], again.outputs["T"])
    assert two.outputs["program.runs"] == again.outputs["program.runs"]


def test_what_was_learnt_of_a_program_spares_runs(tmp_path, monkeypatch):
    _, half = halves(tmp_path, monkeypatch, DeckHeat(), **{"thermal.method": "backward_euler"})
    link, inputs = open_link("direct"), first_inputs(half)
    state, _ = half.start(inputs, 0.0, link)
    runs = []
    for k in range(6):
        done = half.step(state, inputs, 0.1 * k, 0.1, link)
        state = done.state
        runs.append(done.outputs["program.runs"])
    assert runs[-1] < runs[0]


def test_a_program_that_fails_ends_the_step_with_its_own_words(tmp_path, monkeypatch):
    class Failing(DeckHeat):
        def answer(self, deck):
            raise ProgramError("deck ended with exit code 3: no licence")

    _, half = halves(tmp_path, monkeypatch, Failing())
    link, inputs = open_link("direct"), first_inputs(half)
    state, _ = half.start(inputs, 0.0, link)
    done = half.step(state, inputs, 0.0, 0.5, link)
    assert isinstance(done, Discard)
    assert "no licence" in done.message
    assert done.dt_suggest == 0.5, "no shorter step would help"


def test_numbers_that_are_none_are_told(tmp_path, monkeypatch):
    class Mad(DeckHeat):
        def answer(self, deck):
            return {"T": [float("nan")] * len(deck["T"]), "heat": []}

    _, half = halves(tmp_path, monkeypatch, Mad())
    link, inputs = open_link("direct"), first_inputs(half)
    done = half.step(half.start(inputs, 0.0, link)[0], inputs, 0.0, 0.5, link)
    assert "finite numbers" in done.message


@pytest.mark.parametrize(("override", "said"), [({"thermal.method": "steady"}, "takes steps in time"),
                                                ({"thermal.adaptive": {"tolerance": 0.1}}, "inner steps")])
def test_what_no_program_can_do_is_refused_at_the_start(override, said, tmp_path, monkeypatch):
    with pytest.raises(ValueError, match=said):
        halves(tmp_path, monkeypatch, DeckHeat(), **override)
