"""What a mesh did wrong while heat flowed otherwise than now is told for as long as it is there."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from test_extremes import film, stepped
from thermal_scenes import Box, scene, spec

from contact.half.interface import Pair
from contact.half.state import from_bytes, to_bytes
from thermal_fmu.earlier import MOST, Earlier
from thermal_fmu.halved import halved


def mean(mesh, T):
    """Over a bar along x."""
    x, of = mesh.nodes[:, 0], np.asarray(T)
    order = np.argsort(x, kind="stable")
    return float(np.trapezoid(of[order], x[order]) / np.ptp(x))


def courses(model, dt, looks, n=3, box=(0, 1, 0, 0.3)):
    """The true error of the mean of a bar of n cells and of its hot side, and what is told of them, at each look."""
    mesh = scene(Box(*box, n, 1))
    fine = halved(halved(halved(mesh).interface).interface).interface
    found = []
    for k in looks:
        out, exact = (stepped(of, model, dt, k) for of in (mesh, fine))
        found.append([[mean(mesh, out["T"]) - mean(fine, exact["T"]), -mean(mesh, out["mesh.halved.T_mean"])],
                      [out["T"][0] - exact["T"][0], -out["mesh.halved.T"][0]]])
    return np.array(found)


@pytest.mark.parametrize("method", ["sdirk2", "backward_euler"])
def test_a_film_that_gave_too_much_is_told_until_it_has_evened_out(method):
    """A bar of three cells is insulated but for a film: what it was given too much it keeps for long.

    By what flows at the end alone 0.4 of the largest was told, and 0.04 of what was left after 40 steps.
    """
    model = spec([film("a.left", 4.0, T=1.0)], method=method)
    of_mean, of_side = courses(model, 0.005, (2, 5, 10, 20, 40, 80)).transpose(1, 2, 0)
    true, told = of_mean
    assert true.max() > 0.01
    assert (told[1:] > 0.75 * true[1:]).all(), (true, told)
    assert (told < 1.3 * true).all(), (true, told)
    true, told = np.abs(of_side).max(axis=1)
    assert 0.6 * true < told < 1.7 * true


def test_what_evens_out_is_forgotten():
    """A bar between two films comes to rest, and is right there."""
    model = spec([film("a.left", 4.0, T=1.0), film("a.right", 4.0)], method="sdirk2")
    true, told = np.abs(courses(model, 0.01, (3, 10, 30, 100, 400)).transpose(1, 2, 0)[0])
    assert 0.6 * true.max() < told.max() < 1.5 * true.max()
    assert told[-1] < 0.02 * told.max(), told


def test_a_ramp_after_a_long_rest():
    """Errors grow since the data bent, not since the start; before, nothing had moved."""
    ramp = {"t": [0.0, 5.0, 5.05, 100.0], "value": [0.0, 0.0, 1.0, 1.0]}
    model = spec([{"on": "a.left", "convection": {"h": 4.0, "T": ramp}}], method="sdirk2")
    true, told = courses(model, 0.025, (202, 204, 208, 216)).transpose(1, 2, 0)[0]
    assert true.max() > 0.015
    assert 0.5 * true.max() < told.max() < 1.5 * true.max(), (true, told)


@pytest.mark.parametrize("n", [3, 12])
def test_a_flux_that_grows_is_no_error(n):
    """What loads bring more than before smaller cells take as the half's do."""
    ramp = {"t": [0.0, 1.0], "value": [0.0, 1.0]}
    model = spec([{"on": "a.left", "flux": ramp}], method="sdirk2")
    of_mean, of_side = courses(model, 0.02, (5, 20, 50), n=n).transpose(1, 2, 0)
    assert np.abs(of_mean).max() < 1e-3
    true, told = np.abs(of_side)
    assert (true < 0.5 / n).all()
    assert (told < 2.0 * true.max()).all(), (true, told)


@pytest.mark.parametrize("n", [3, 6])
def test_a_flux_that_stops_is_told_as_it_evens_out(n):
    """What it brought while it was there is no error, what cells made of it is."""
    off = {"t": [0.0, 0.3, 0.31, 1.0], "value": [1.0, 1.0, 0.0, 0.0]}
    model = spec([{"on": "a.left", "flux": off}], method="sdirk2")
    of_mean, (true, told) = courses(model, 0.02, (10, 14, 17, 20, 30), n=n).transpose(1, 2, 0)
    assert np.abs(of_mean).max() < 1e-6
    # 0.5 where conduction was taken for all that had changed.
    assert (np.abs(told - true) < 0.2 * np.abs(true).max()).all(), (true, told)


def test_beside_a_body_that_freezes_nothing_is_made_up():
    """A mould takes the heat that a front gives: what is not known there is no heat of the mould's own."""
    def course(n, looks):
        mesh = scene(Box(0, 0.03, 0, 0.005, 3 * n, 1), Box(0.03, 0.06, 0, 0.005, n, 1),
                     pairs=(Pair("p", "a.right", "b.left", 0.1, 0.0),))
        model = spec([], T0=960.0, rho=2600.0, k=100.0, c=1000.0, method="sdirk2",
                     pairs={"p": {"conduction": {"closed": {"law": "constant", "h": 5000.0}, "open": None}}})
        model["materials"]["m"]["latent"] = {"L": 390e3, "T_m": 933.0}
        model["materials"]["steel"] = {"rho": 7850.0, "k": 40.0, "c": 480.0}
        model["bodies"]["b"] = {"material": "steel", "T0": 400.0}
        pressed = lambda of: {"t_N": -np.ones(len(of.pair_nodes))}  # noqa: E731
        outs = [stepped(mesh, model, 0.05, k, pressed) for k in looks]
        at = np.flatnonzero(mesh.node_body == 1)
        return [float(np.asarray(out["T"])[at].mean()) for out in outs], [
            float(np.abs(np.asarray(out["mesh.halved.T"])[at]).max()) for out in outs]

    looks = (3, 10, 30, 90)
    _, told = course(6, looks)
    assert max(told) < 45.0, told
    assert told[-1] < 10.0, told


def test_what_it_remembers_is_part_of_the_state():
    earlier = Earlier().then(0.0, np.array([1.0, 2.0]), 1.0)
    for k in range(1, 40):
        earlier = earlier.after(1.0, np.array([float(k), 2.0]), np.array([1.0 + k, 2.0]))
        earlier = earlier.then(float(k), np.array([1.0 + k, 2.0]), 1.0)
        assert earlier.t.size == min(k + 1, MOST)
        assert earlier.t[0] == 0.0
        assert earlier.t[-1] == k
    ages = 40.0 - earlier.t
    assert (ages[:-1] / ages[1:] > 1.4).all(), ages
    first = earlier.t[earlier.t >= 20.0][0]
    began = earlier.since(20.0, 39.0)
    assert np.array_equal(began.s, [1.0 + first, 2.0])
    assert began.way == pytest.approx([0.5 * (39.0 - first) ** 2, 0.0])
    assert earlier.since(39.5, 39.5) is None
    again = from_bytes(to_bytes(earlier), {"thermal_fmu"})
    assert np.array_equal(again.t, earlier.t)
    assert np.array_equal(again.s, earlier.s)


def test_a_small_heat_beside_a_large_one_is_told():
    """What passes the far end is a millionth of what comes in, and wrong by most of itself."""
    def heats(n, k):
        mesh = scene(Box(0, 1, 0, 0.1, n, 1))
        model = spec([film("a.left", 50.0, T=1.0) | {"name": "in"}, film("a.right", 0.001) | {"name": "out"}],
                     method="sdirk2")
        out = stepped(mesh, model, 0.005, k)
        return np.array([float(out["condition.heat.out"]), float(out["mesh.halved.condition.heat.out"]),
                         float(out["condition.heat.in"])])

    some, exact = heats(3, 10), heats(48, 10)
    true = abs(some[0] - exact[0])
    assert 0.3 * abs(some[0]) < true < 1e-5 * some[2]
    assert 0.3 * true < abs(some[1]) < 6.0 * true, (true, some)
