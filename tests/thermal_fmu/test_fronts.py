"""What a front that goes from node to node puts temperatures off by: told as it is, against Neumann's solution."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import erf, erfc

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import Box, FlatContact, inputs_of, scene, spec

from contact.half.functions import property_from
from contact.half.model import Done
from thermal_fmu.fronts import FRONT_OFF, shifted
from thermal_fmu.half import load
from thermal_fmu.phase_change import PhaseChange

RHO, K, C, L, T_M = 2600.0, (240.0, 100.0), (900.0, 1100.0), 3.9e5, 933.0
LENGTH, COLD, POURED = 0.2, 773.0, 973.0


def metal(T_s, T_l, L=L):
    return PhaseChange(L, T_s, T_l, property_from(C[0]), property_from(C[1]))


def test_a_node_at_a_melting_point_is_off_by_where_the_front_stands():
    """(1/2 - f) dT, but for what 40 K of solid or liquid store besides the latent heat: 5 %."""
    change, f = metal(T_M, T_M), np.linspace(0.02, 0.98, 25)
    s = change.T_s + (1.0 - f) * change.W
    off = shifted(change, s, np.full(f.size, 40.0)) - T_M
    assert off == pytest.approx((0.5 - f) * 40.0, abs=0.06 * 40.0)
    assert shifted(change, s, np.zeros(f.size)) == pytest.approx(T_M)


def test_a_range_of_melting_that_many_cells_resolve_puts_nothing_off():
    change = metal(893.0, 973.0)
    T = np.array([800.0, 900.0, 933.0, 960.0, 1000.0])
    assert shifted(change, change.unknown(T), np.full(5, 4.0)) == pytest.approx(T, abs=1e-9)


def neumann(x, t):
    """T : (n,) [K] of a half space poured at POURED whose side is held at COLD."""
    a = [k / RHO / c for k, c in zip(K, C, strict=True)]
    ratio = np.sqrt(a[0] / a[1])

    def balance(z):
        return (K[0] * (T_M - COLD) * np.exp(-z**2) / erf(z) / np.sqrt(a[0])
                - K[1] * (POURED - T_M) * np.exp(-(z * ratio) ** 2) / erfc(z * ratio) / np.sqrt(a[1])
                - z * RHO * L * np.sqrt(np.pi * a[0]))

    z = brentq(balance, 1e-3, 2.0)
    s = x / (2.0 * np.sqrt(a[0] * t))
    return np.where(s < z, COLD + (T_M - COLD) * erf(s) / erf(z),
                    POURED - (POURED - T_M) * erfc(s * ratio) / erfc(z * ratio))


def frozen(box, dt, n):
    """(n, n_nodes) each [K]: T, what is told that it is off by, and what it is off by."""
    mesh = scene(box)
    model = spec([{"on": "a.left", "temperature": COLD}], T0=POURED, rho=RHO, method="sdirk2",
                 k={"solid": K[0], "liquid": K[1]}, c={"solid": C[0], "liquid": C[1]})
    model["materials"]["m"]["latent"] = {"L": L, "T_m": T_M}
    half, found = load(mesh, model), []
    state, _ = half.start(inputs_of(mesh, half), 0.0, FlatContact())
    for i in range(n):
        done = half.step(state, inputs_of(mesh, half), i * dt, dt, FlatContact())
        assert isinstance(done, Done), done
        state, T = done.state, np.asarray(done.outputs["T"])
        found.append((T, np.asarray(done.outputs[FRONT_OFF]), neumann(mesh.nodes[:, 0], (i + 1) * dt) - T))
    return (mesh.nodes[:, 0], *np.array(found).transpose(1, 0, 2))


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize(("cells", "dt"), [(40, 0.3), (20, 1.0)])
def test_what_a_front_puts_nodes_off_by_is_told_as_it_is(cells, dt, triangles):
    """At each place the most of what is told is 0.7 to 1.5 times what is true where the front has passed, and nowhere
    less than half of it.
    """
    x, _, told, true = frozen(Box(0, LENGTH, 0, 0.01, cells, 1, triangles=triangles), dt, 80)
    late = slice(8, None)
    most_told, most_true = (np.abs(of[late]).max(axis=0) for of in (told, true))
    passed, half_space = (x > 0.0) & (x < 0.032), (x > 0.0) & (x < 0.14)
    assert (most_told[passed] > 0.7 * most_true[passed]).all()
    assert (most_told[passed] < 1.5 * most_true[passed]).all()
    assert (most_told > 0.5 * most_true)[half_space].all()


def test_steps_of_a_front_are_over_before_they_are_felt_far_ahead():
    """0.91 and 0.38 K are told of 0.45 and 0.27 K."""
    x, _, told, true = frozen(Box(0, LENGTH, 0, 0.01, 40, 1), 1.0, 80)
    for ahead in (0.08, 0.1):
        at = int(np.abs(x - ahead).argmin())
        most_told, most_true = (np.abs(of[20:, at]).max() for of in (told, true))
        assert 0.5 * most_true < most_told < 3.0 * most_true


def test_told_at_the_moment_with_its_sign():
    """What is told of nodes beside a front goes up and down with what they are off by."""
    _, _, told, true = frozen(Box(0, LENGTH, 0, 0.01, 40, 1), 0.3, 80)
    beside = np.abs(told) > 0.5 * np.abs(told).max(axis=1, keepdims=True)
    beside[:8] = False
    assert np.corrcoef(told[beside], true[beside])[0, 1] > 0.85


def at_the_end(cells, wall, start, latent):
    """(n,) each [K]: T at the insulated end of 50 mm that freezes or melts from the other, and what it is off by."""
    mesh = scene(Box(0, 0.05, 0, 0.01, cells, 1))
    model = spec([{"on": "a.left", "temperature": wall}], T0=start, rho=RHO, method="sdirk2",
                 k={"solid": K[0], "liquid": K[1]}, c={"solid": C[0], "liquid": C[1]})
    model["materials"]["m"]["latent"] = {"L": L} | latent
    half, found, n = load(mesh, model), [], 250
    state, _ = half.start(inputs_of(mesh, half), 0.0, FlatContact())
    for i in range(n):
        done = half.step(state, inputs_of(mesh, half), 0.4 * i, 0.4, FlatContact())
        assert isinstance(done, Done), done
        state, at = done.state, int(mesh.nodes[:, 0].argmax())
        found.append((np.asarray(done.outputs["T"])[at], np.asarray(done.outputs[FRONT_OFF])[at]))
    return np.array(found).T


@pytest.mark.parametrize(("wall", "start", "latent"), [
    (723.0, 943.0, {"T_m": T_M}), (1333.0, 923.0, {"T_m": T_M}), (723.0, 943.0, {"T_s": 928.0, "T_l": T_M})])
def test_the_last_place_to_freeze_or_melt_is_late(wall, start, latent):
    """36, 39 and 20 K are told of 40, 51 and 36 K: it stays at its melting point until it goes at once."""
    T, told = at_the_end(10, wall, start, latent)
    true = np.abs(at_the_end(80, wall, start, latent)[0] - T)
    assert 0.5 * true.max() < np.abs(told).max() < 1.2 * true.max()


def test_a_surface_that_begins_to_freeze_is_not_the_last_to_melt():
    """At most half of what temperatures differ by across its cell is told of it, while less than a quarter is solid."""
    mesh = scene(Box(0, 0.05, 0, 0.01, 10, 1))
    model = spec([{"on": "a.left", "convection": {"h": 3000.0, "T": 300.0}}], T0=POURED, rho=RHO, method="sdirk2",
                 k={"solid": K[0], "liquid": K[1]}, c={"solid": C[0], "liquid": C[1]})
    model["materials"]["m"]["latent"] = {"L": L, "T_m": T_M}
    half, seen, left = load(mesh, model), 0, int(mesh.nodes[:, 0].argmin())
    state, _ = half.start(inputs_of(mesh, half), 0.0, FlatContact())
    for i in range(20):
        done = half.step(state, inputs_of(mesh, half), 0.1 * i, 0.1, FlatContact())
        assert isinstance(done, Done), done
        state, out = done.state, done.outputs
        if 0.0 < np.asarray(out["f_s"])[left] < 0.25:
            T = np.asarray(out["T"])
            assert abs(np.asarray(out[FRONT_OFF])[left]) <= 0.5 * (np.sort(np.unique(T.round(9)))[1] - T_M) + 1e-6
            seen += 1
    assert seen


def test_nothing_is_told_where_nothing_melts():
    half = load(scene(Box(0, 1, 0, 1, 2, 2)), spec([]))
    assert FRONT_OFF not in {v.name for v in half.variables}
