"""Steady states by load increments."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import EXPECTED, Box, FlatContact, inputs_of, run, scene, spec, the_context

from contact.half.functions import property_from
from contact.half.model import Discard
from thermal_fmu.half import load
from thermal_fmu.methods import METHODS
from thermal_fmu.newton import NotConvergedError
from thermal_fmu.step import take_step
from thermal_fmu.substeps import steady_by_increments

SIGMA = 5.670374419e-8
# Loses a hundredfold of its conductivity between 500 and 600 K: Newton's method from 300 K meets a wall.
BREAKS = {"T": [300, 500, 600, 2000], "value": [50, 50, 0.5, 0.5], "form": "cubic"}
STEADY = METHODS["steady"]


def furnace(k, T_inf, n=40, **more):
    """A wall held at 300 K, facing a furnace of T_inf."""
    bar = scene(Box(0, 1, 0, 1, n))
    return bar, spec([{"on": "a.left", "temperature": 300.0},
                      {"on": "a.right", "radiation": {"emissivity": 1.0, "T": T_inf}}], k=k, T0=300.0,
                     method="steady", **more)


def test_what_fails_in_one_go_succeeds_by_increments():
    """Against the integral of k: int_300^T_s k dT = sigma (T_inf^4 - T_s^4); the quadrature of k costs .05 K."""
    bar, model = furnace(BREAKS, 1000.0, n=80)
    context = the_context(bar, model)
    s = np.full(len(bar.nodes), 300.0)
    with pytest.raises(NotConvergedError):
        take_step(context, STEADY, s, None, 0.0, 1.0)
    k = property_from(BREAKS)
    exact = brentq(lambda T: float(k.increase(np.array(300.0), np.array(T))) - SIGMA * (1000.0**4 - T**4), 300, 1000)
    found = [run(bar, model | {"increments": n}, 1.0, 1) for n in (1, 10)]
    for ran in found:
        assert abs(ran.T[-1, 80] - exact) < 0.1
        assert ran.imbalance() < EXPECTED["A16"]["tolerance"]
    assert np.abs(found[0].T[-1] - found[1].T[-1]).max() < 1e-6
    assert found[1].outputs[-1]["heat.radiation"] > 0.0


def test_increments_lead_to_the_same_state_and_prescribed_values_move_along(monkeypatch):
    """k = 10(1 + .002 T), the hot side rises 100 -> 500 in 8 increments; each one is easier than the whole."""
    from thermal_fmu import substeps

    bar = scene(Box(0, 1, 0, 1, 20))
    model = spec([{"on": "a.left", "temperature": 100.0},
                  {"on": "a.right", "temperature": 500.0}], k={"polynomial": [10.0, 0.02]}, T0=100.0,
                 method="steady")
    walls = []
    right = substeps.solve_stage

    def seen(problem, guess, *rest):
        walls.append(guess[20])
        return right(problem, guess, *rest)

    monkeypatch.setattr(substeps, "solve_stage", seen)
    walked, whole = (run(bar, model | {"increments": n}, 1.0, 1) for n in (8, 1))
    assert np.allclose(walls, 100.0 + 50.0 * np.arange(1, 8))
    assert np.abs(walked.T - whole.T).max() < 1e-8
    assert abs(walked.T[-1, 10] - EXPECTED["A7"]["T_half"]) < 1e-6
    assert walked.outputs[-1]["iterations"] > whole.outputs[-1]["iterations"]


def test_one_increment_that_converges_changes_no_bit():
    bar, model = furnace({"polynomial": [5.0, 0.01]}, 1500.0)
    context = the_context(bar, model)
    s = np.full(len(bar.nodes), 300.0)
    a = take_step(context, STEADY, s, None, 0.0, 1.0)
    b = steady_by_increments(context, 1, s, None, 0.0, 1.0)
    assert a.s.tobytes() == b.s.tobytes()
    assert a.iterations == b.iterations


def test_where_the_path_turns_back_the_end_is_tried_from_the_start():
    """k dips a thousandfold between 500 and 540 K: by increments the path folds, at full load it is well behaved."""
    dip = {"T": [300, 500, 520, 540, 2000], "value": [50, 50, 0.01, 50, 50], "form": "cubic"}
    bar, model = furnace(dip, 2000.0, n=20)
    assert abs(run(bar, model | {"increments": 10}, 1.0, 1).T[-1, 20] - run(bar, model, 1.0, 1).T[-1, 20]) < 1e-6


def test_what_no_increment_solves_is_discarded_with_a_reason():
    """A conductivity that turns negative at 500 K on the way to 2000 K; and a body nothing holds."""
    bar, model = furnace({"polynomial": [50.0, -0.1]}, 2000.0)
    loose = spec([{"on": "a.right", "flux": 1.0}], method="steady")
    for given in (model, loose):
        half, link = load(bar, given), FlatContact()
        state, _ = half.start(inputs_of(bar, half), 0.0, link)
        done = half.step(state, inputs_of(bar, half), 0.0, 1.0, link)
        assert isinstance(done, Discard), done
    assert half.step(state, inputs_of(bar, half) | {"control.method": 3}, 0.0, 1.0, link).state is not None


@pytest.mark.parametrize(("T_inf", "moved", "again"), [
    (2000.0, 1.0, 1.0), ({"t": [0, 10], "value": [300, 2000]}, 1.0, 0.5), (2000.0, 1.01, 0.5)],
    ids=["loads stay", "loads rise", "bodies moved"])
def test_what_has_no_steady_state_asks_for_a_shorter_step_only_where_that_may_help(T_inf, moved, again):
    """A conductivity that turns negative: a suggestion as long as the step says that none would do."""
    bar, model = furnace({"polynomial": [50.0, -0.1]}, T_inf)
    half, link = load(bar, model), FlatContact()
    state, _ = half.start(inputs_of(bar, half), 0.0, link)
    done = half.step(state, inputs_of(bar, half) | {"x": bar.nodes * moved}, 9.0, 1.0, link)
    assert isinstance(done, Discard)
    assert done.dt_suggest == again


def test_what_moved_before_is_asked_twice_and_no_more():
    """Warm elastic bodies rest, but not as drawn.  What moves on, or is heated by mechanics, may differ."""
    bar, model = furnace({"polynomial": [50.0, -0.1]}, 2000.0)
    half, link = load(bar, model), FlatContact()
    state, _ = half.start(inputs_of(bar, half), 0.0, link)

    def suggested(h, moved=1.01, t=0.0, **more):
        done = half.step(state, inputs_of(bar, half) | {"x": bar.nodes * moved} | more, t, h, link)
        assert isinstance(done, Discard)
        return done.dt_suggest

    assert suggested(1.0) == 0.5
    assert suggested(0.5) == 0.5
    assert suggested(0.25, moved=1.02) == 0.125
    assert suggested(0.25, moved=1.02, t=0.1) == 0.125
    heat = {"E_M": np.full(bar.quads.shape[0], 1e-9)}
    assert [suggested(h, **heat) for h in (1.0, 0.5)] == [0.5, 0.25]
    assert [suggested(h, **{"control.event": int(h)}) for h in (1.0, 2.0)] == [0.5, 2.0]


def test_the_method_is_a_rule_too():
    """control.method 5 in a transient model: the steady state at once."""
    bar = scene(Box(0, 1, 0, 1, 10))
    half, link = load(bar, spec([{"on": "a.left", "temperature": 1.0}], T0=0.0)), FlatContact()
    state, _ = half.start(inputs_of(bar, half), 0.0, link)
    done = half.step(state, inputs_of(bar, half) | {"control.method": 5}, 0.0, 1e-3, link)
    assert np.abs(done.state.s - 1.0).max() < 1e-12


@pytest.mark.parametrize(("key", "value", "text"), [
    ("increments", 0, "increments: must be a whole number"), ("increments", 2.5, "increments: must be a whole number"),
    ("theta", 0.4, "theta: must lie between 0.5 and 1, not 0.4"), ("theta", "half", "theta: a number is needed"),
    ("adaptive", {}, "at least one of tolerance, max_dT"),
    ("adaptive", {"tolerance": 0.0}, "adaptive.tolerance: must be greater"),
    ("adaptive", {"tolerance": 1.0, "last": 1.0}, "adaptive.last: unknown key.* Did you mean 'least'"),
    ("adaptive", {"max_dT": 1.0}, "a steady solution has no steps in time"),
    ("method", "euler", "method: not known here, not 'euler'"),
])
def test_bad_stepping_is_named(key, value, text):
    bar, model = furnace(1.0, 400.0)
    with pytest.raises(ValueError, match=text):
        load(bar, model | {key: value})


def test_heat_that_goes_in_and_out_at_rest_is_balanced():
    """A slab between two walls: a net sum of 0 would be compared with itself; each way is its own term."""
    bar = scene(Box(0, 1, 0, 1, 4))
    ran = run(bar, spec([{"on": "a.left", "temperature": 400.0},
                         {"on": "a.right", "temperature": 300.0}], T0=300.0, method="steady"), 1.0, 1)
    assert ran.outputs[-1]["heat.temperature.in"] == pytest.approx(100.0, rel=1e-12)
    assert ran.outputs[-1]["heat.temperature.out"] == pytest.approx(-100.0, rel=1e-12)
    assert ran.imbalance() <= EXPECTED["A16"]["tolerance"]
