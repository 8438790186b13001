"""Internal forces by another solver: in every other way the half is the half `elastic`."""

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
from mechanical_fmu import MechanicalVolume, mechanical_half
from mechanical_fmu.elastic_half import load
from mechanical_fmu.volume import PointStep

sys.path.insert(0, str(Path(__file__).parent.parent / "coupler"))
from foreign_scenes import first_inputs, scenes


class Linear(MechanicalVolume):
    """Small strains in bilinear quads of plane strain, dilatation as its mean over the cell, thermal expansion."""

    def start(self, mesh, materials):
        self.mesh, self.materials = mesh, materials

    def forces(self, u, T):
        t, n = table_of("quad"), len(u)
        K, r = lil_matrix((2 * n, 2 * n)), np.zeros(2 * n)
        for cell, part in zip(self.mesh.quads, self.mesh.quad_part, strict=True):
            m, X = self.materials[part], self.mesh.nodes[cell]
            T_m = np.array([T[cell].mean()])
            E, nu = m.E(T_m)[0], m.nu(T_m)[0]
            mu, kappa = E / (2 + 2 * nu), E / (3 - 6 * nu)
            dofs = (2 * cell[:, None] + np.arange(2)).ravel()
            points = []
            for dN, w in zip(t.dN, t.w, strict=True):
                J = X.T @ dN
                G = dN @ np.linalg.inv(J)
                B = np.zeros((4, 8))  # e_11, e_22, g_12, e_33
                B[0, 0::2], B[1, 1::2], B[2, 0::2], B[2, 1::2] = G[:, 0], G[:, 1], G[:, 1], G[:, 0]
                points.append((B, w * np.linalg.det(J)))
            volume = sum(dV for _, dV in points)
            mean = sum(dV * (B[0] + B[1]) for B, dV in points) / volume
            k, force = kappa * volume * np.outer(mean, mean), np.zeros(8)
            for B, dV in points:
                dev = B.copy()
                dev[[0, 1, 3]] -= (B[0] + B[1]) / 3
                k += dV * dev.T @ np.diag([2 * mu, 2 * mu, mu, 2 * mu]) @ dev
            force = k @ u.ravel()[dofs] - 3 * m.alpha(T_m)[0] * (T_m[0] - m.T_ref) * kappa * volume * mean
            K[np.ix_(dofs, dofs)] += k
            r[dofs] += force
        return r, K.tocsr()


def pair_of_halves(folder, monkeypatch, volume, **overrides):
    own, foreign = scenes(folder, "mechanical", monkeypatch, **overrides)
    return (load(own.interface, own.models["mechanical"]),
            mechanical_half(volume, foreign.interface, foreign.models["mechanical"]))


def course(half, steps=3):
    link, inputs = open_link("direct"), first_inputs(half)
    given = {**inputs, "T": np.full(np.shape(inputs["T"]), 293.15)}
    state, _ = half.start(given, 0.0, link)
    for k in range(steps):
        given["T"] = np.full(np.shape(inputs["T"]), 293.15 + 5.0 * (k + 1))
        done = half.step(state, given, float(k), 1.0, link)
        assert isinstance(done, Done), done
        state = done.state
    return done.outputs


def test_it_moves_and_presses_as_the_half_it_is_put_into(tmp_path, monkeypatch):
    """Strains are 3e-4, and so is what the linear solver and ours differ by."""
    own, given = pair_of_halves(tmp_path, monkeypatch, Linear())
    a, b = course(own), course(given)
    X = first_inputs(own).get("x", own.system.interface.nodes)
    moved = np.abs(a["x"] - X).max()
    assert moved > 1e-6
    assert np.abs(a["x"] - b["x"]).max() < 2e-3 * moved
    assert a["contact.t_N"].min() < -1e7
    assert np.abs(a["contact.t_N"] - b["contact.t_N"]).max() < 2e-3 * -a["contact.t_N"].min()
    assert "sigma" in a
    assert "sigma" not in b, "stress is the other solver's to know"
    assert np.abs(a["strain"] - b["strain"]).max() < 2e-3 * np.abs(a["strain"]).max()
    assert b["iterations"] <= 3 * a["iterations"] + 3


def test_the_felupe_half_of_the_page_solves_our_equations(tmp_path, monkeypatch):
    """Blocks 10 K hotter than drawn, between plates: the same element, law and expansion, so round-off apart."""
    pytest.importorskip("felupe")
    page = (Path(__file__).parents[2] / "docs/write_a_half.md").read_text(encoding="utf-8")
    names = {"__name__": "felupe_volume"}
    exec(re.search(r"<!-- file: swap_halves/felupe_volume.py -->\n```python\n(.*?)```", page, re.S)[1], names)
    own, given = pair_of_halves(tmp_path, monkeypatch, names["Felupe"]())
    a, b = course(own), course(given)
    assert a["contact.t_N"].min() < -1e7
    assert np.abs(a["contact.t_N"] - b["contact.t_N"]).max() < 1e-9 * -a["contact.t_N"].min()
    assert np.abs(a["x"] - b["x"]).max() < 1e-14
    # Any strain, any temperatures: forces and stiffness themselves.
    rng = np.random.default_rng(1)
    n = len(own.system.interface.nodes)
    u, T = rng.normal(size=(n, 2)) * 1e-4, rng.uniform(280.0, 900.0, n)
    ours, theirs = (half.system.volume.evaluate(u, half.system.moduli(T), PointStep(1.0)) for half in (own, given))
    assert np.abs(ours.f - theirs.f).max() < 1e-12 * np.abs(ours.f).max()


class Wrong(Linear):
    def __init__(self, change):
        self.change = change

    def forces(self, u, T):
        return self.change(*super().forces(u, T)) if u.any() else super().forces(u, T)


@pytest.mark.parametrize(("change", "says"), [
    (lambda r, K: (r * np.nan, K), "r has 62 numbers, 0 of them finite"),
    (lambda r, K: (r[:4], K), "r has 4 numbers"),
    (lambda r, K: (r, csr_matrix((2, 2))), r"K has shape \(2, 2\)")])
def test_what_is_no_volume_is_a_discard_that_says_so(change, says, tmp_path, monkeypatch):
    _, given = pair_of_halves(tmp_path, monkeypatch, Wrong(change))
    link, inputs = open_link("direct"), first_inputs(given)
    warm = {**inputs, "T": np.full(np.shape(inputs["T"]), 293.15)}
    state, _ = given.start(warm, 0.0, link)
    warm["T"] = warm["T"] + 50.0
    done = given.step(state, warm, 0.0, 1.0, link)
    assert isinstance(done, Discard)
    assert re.search(says, done.message), done.message


@pytest.mark.parametrize(("change", "says"), [
    ({"materials.steel.creep": {"A": 1e-20, "n": 3}}, r"materials\.steel\.creep"),
    ({"mechanical.elastic.bodies": {"upper": {"rigid": True}}, "mechanical.elastic.boundary": [
        {"on": "lower.bottom", "u_x": 0, "u_y": 0}, {"body": "upper", "u_x": 0, "u_y": 0, "angle": 0}]},
     r"bodies\.upper\.rigid"),
    ({"mechanical.elastic.thermoelastic_heat": True}, "thermoelastic_heat")])
def test_what_a_volume_cannot_be_asked_for_is_refused_at_load(change, says, tmp_path, monkeypatch):
    with pytest.raises(ValueError, match=f"{says}.*a MechanicalVolume has forces"):
        pair_of_halves(tmp_path, monkeypatch, Linear(), **change)
