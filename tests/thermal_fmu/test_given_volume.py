"""Conduction and storage by another solver: in every other way the half is the half `thermal`."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_matrix, lil_matrix

from contact.half.functions import table_of
from contact.half.model import Discard, Done
from contact.rpc.link import open_link
from thermal_fmu import ThermalVolume, thermal_half
from thermal_fmu.half import ThermalHalf

sys.path.insert(0, str(Path(__file__).parent.parent / "coupler"))
from foreign_scenes import first_inputs, scenes


class Quads(ThermalVolume):
    """Bilinear quads by plain loops.  made : f [W].  asked : how often."""

    made = None

    def start(self, mesh, materials):
        self.mesh, self.materials, self.asked = mesh, materials, 0

    def matrices(self, x, T):
        self.asked += 1
        t, n = table_of("quad"), len(x)
        M, K = np.zeros(n), lil_matrix((n, n))
        for cell, part in zip(self.mesh.quads, self.mesh.quad_part, strict=True):
            m, of_cell = self.materials[part], np.zeros((4, 4))
            for N, dN, w in zip(t.N, t.dN, t.w, strict=True):
                J = x[cell].T @ dN
                G, dV = dN @ np.linalg.inv(J), w * np.linalg.det(J)
                M[cell] += m.rho * dV * N * m.c(T[cell])
                of_cell += dV * G @ G.T
            # Heat flows down the integral of k (thermal_fmu.potentials), which here is linear between two nodes.
            k = m.k(T[cell])
            of_cell *= 0.5 * (k[:, None] + k[None, :])
            np.fill_diagonal(of_cell, 0.0)
            K[np.ix_(cell, cell)] += of_cell - np.diag(of_cell.sum(axis=1))
        return M, K.tocsr(), self.made


def pair_of_halves(folder, monkeypatch, volume, **overrides):
    own, foreign = scenes(folder, "thermal", monkeypatch, **overrides)
    return (ThermalHalf(own.interface, own.models["thermal"]),
            thermal_half(volume, foreign.interface, foreign.models["thermal"]))


def course(half, steps=4, h=0.5, moved=1e-4):
    """T after every step, and the last outputs, of a body that moves and is pressed more and more."""
    link, inputs = open_link("direct"), first_inputs(half)
    X = np.array(inputs["x"])
    upper = X[:, 1] >= 0.01
    state, out = half.start(inputs, 0.0, link)
    found = []
    for k in range(steps):
        x = X.copy()
        x[upper, 0] += moved * k
        x *= 1.0 + 0.02 * k
        given = {**inputs, "x": x, "contact.t_N": np.full(np.shape(inputs["contact.t_N"]), -1e6 * k)}
        done = half.step(state, given, k * h, h, link)
        assert isinstance(done, Done), done
        state, out = done.state, done.outputs
        found.append(np.array(out["T"]))
    return np.array(found), out


@pytest.mark.few("midpoint")
@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "backward_euler"])
def test_it_gives_the_temperatures_of_the_half_it_is_put_into(method, tmp_path, monkeypatch):
    own, given = pair_of_halves(tmp_path, monkeypatch, Quads(), **{"thermal.method": method})
    T_own, out_own = course(own)
    T_given, out = course(given)
    assert np.ptp(T_own) > 150.0
    assert np.abs(T_own - T_given).max() < 1e-8
    # What cells miss the half knows of its own alone.
    told = ("mesh.T_missed.", "mesh.T_high_off.", "mesh.T_low_off.")
    own_alone = {n for n in out_own if n.startswith("mesh.") and not n.startswith("mesh.halved.")}
    assert own_alone == {n + body for n in told for body in ("lower", "upper")}
    assert out.keys() == {n for n in out_own if not n.startswith("mesh.")}
    for name in (n for n in out if n.startswith("heat.")):
        assert out[name] == pytest.approx(out_own[name], abs=1e-6 * abs(out_own["heat.stored.upper"])), name


@pytest.mark.slow
def test_where_conductivity_varies_it_is_the_same_too(tmp_path, monkeypatch):
    varies = {"materials.steel.k": {"T": [250, 600], "value": [20, 60]},
              "materials.steel.c": {"T": [250, 600], "value": [400, 700]}}
    own, given = pair_of_halves(tmp_path, monkeypatch, Quads(), **varies)
    (T_own, _), (T_given, _) = course(own), course(given)
    # c is linear in T, so the mean of both temperatures has the exact enthalpy.
    assert np.abs(T_own - T_given).max() < 1e-6


def test_a_matrix_of_capacities_counts_by_its_rows(tmp_path, monkeypatch):
    class Full(Quads):
        def matrices(self, x, T):
            M, K, f = super().matrices(x, T)
            spread = 0.3 * np.minimum(M[0], M[1])
            full = lil_matrix((len(M), len(M)))
            full.setdiag(M)
            full[0, 0], full[0, 1], full[1, 0], full[1, 1] = M[0] - spread, spread, spread, M[1] - spread
            return full.tocsr(), K, f

    halves = [pair_of_halves(tmp_path, monkeypatch, volume)[1] for volume in (Quads(), Full())]
    T = [course(half)[0] for half in halves]
    assert np.abs(T[0] - T[1]).max() < 1e-9


def test_constant_matrices_are_asked_for_once_a_place(tmp_path, monkeypatch):
    volume = Quads()
    _, given = pair_of_halves(tmp_path, monkeypatch, volume)
    course(given, steps=3, moved=0.0)
    assert volume.asked == 3, "the reference, and twice stretched"


def test_heat_that_the_volume_makes_is_a_source_and_the_account_closes(tmp_path, monkeypatch):
    volume = Quads()
    _, given = pair_of_halves(tmp_path, monkeypatch, volume)
    without = course(given, steps=1)[1]
    volume.made = np.full(len(volume.mesh.nodes), 2.0)
    volume_2 = Quads()
    _, again = pair_of_halves(tmp_path, monkeypatch, volume_2)
    volume_2.made = volume.made
    out = course(again, steps=1)[1]
    assert out["heat.source"] - without["heat.source"] == pytest.approx(0.5 * volume.made.sum())
    terms = sum(v for n, v in out.items() if n.startswith("heat.") and not n.startswith("heat.stored"))
    stored = sum(v for n, v in out.items() if n.startswith("heat.stored"))
    assert terms == pytest.approx(stored, rel=1e-9)


def test_the_same_state_gives_the_same_bits_whatever_was_asked_before(tmp_path, monkeypatch):
    link = open_link("direct")
    _, hot = pair_of_halves(tmp_path, monkeypatch, Quads())
    state, _ = hot.start(first_inputs(hot), 0.0, link)
    first = hot.step(state, first_inputs(hot), 0.0, 0.5, link)
    hot.step(first.state, first_inputs(hot), 0.5, 0.1, link)
    again = hot.step(state, first_inputs(hot), 0.0, 0.5, link)
    assert np.array_equal(first.outputs["T"], again.outputs["T"])


class Wrong(Quads):
    def __init__(self, change):
        self.change = change

    def matrices(self, x, T):
        return self.change(*super().matrices(x, T))


def far(M, K, f):
    K = K.tolil()
    K[0, K.shape[0] - 1] = 1.0
    return M, K.tocsr(), f


@pytest.mark.parametrize(("change", "says"), [
    (lambda M, K, f: (0.0 * M, K, f), "M has 31 row sums of 0 to 0 J/K; one above 0"),
    (lambda M, K, f: (M, csr_matrix((3, 3)), f), r"K has shape \(3, 3\), but there are 31 unknowns"),
    (lambda M, K, f: (M, K * np.nan, f), "K is not finite"),
    (far, "K couples unknowns 1 and 31, which no cell has both of")])
def test_what_is_no_volume_is_a_discard_that_says_so(change, says, tmp_path, monkeypatch):
    _, given = pair_of_halves(tmp_path, monkeypatch, Wrong(change))
    link, inputs = open_link("direct"), first_inputs(given)
    state, _ = given.start(inputs, 0.0, link)
    done = given.step(state, inputs, 0.0, 1.0, link)
    assert isinstance(done, Discard)
    assert re.search(says, done.message), done.message


@pytest.mark.parametrize(("change", "says"), [
    ({"materials.steel.latent": {"L": 1e5, "T_m": 900}}, "does not melt"),
    ({"materials.steel.k": {"k_1": 30, "k_2": 10}}, "one conductivity, not one along each axis")])
def test_what_a_volume_is_not_told_is_refused_at_load(change, says, tmp_path, monkeypatch):
    with pytest.raises(ValueError, match=says):
        pair_of_halves(tmp_path, monkeypatch, Quads(), **change)
