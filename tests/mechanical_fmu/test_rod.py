"""The mechanical rod: free expansion, gap and pressure in closed form, freezing, what it refuses."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact.half.interface import Interface, Pair
from contact.half.model import Discard
from contact.rpc.link import open_link
from mechanical_fmu.small_halves import load_rod

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import done

L, H, GAP = 0.1, 0.02, 60e-6
ALPHA, T_REF = 1.2e-5, 300.0


def scene(gap: float = GAP, rows: int = 2, height: float = H) -> Interface:
    """Rod `a` from 0 to L in 8 cells, rod `b` beyond the gap, half as long, in 3."""
    nodes, quads, surfaces, first = [], [], {}, 0
    for name, x0, x1, n, top in (("a", 0.0, L, 8, H), ("b", L + gap, 1.5 * L + gap, 3, height)):
        X, Y = np.meshgrid(np.linspace(x0, x1, n + 1), np.linspace(0.0, top, rows + 1))
        grid = first + np.arange(X.size).reshape(X.shape)
        nodes.append(np.stack([X.ravel(), Y.ravel()], axis=1))
        quads.append(np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4))
        for side, line in (("right", grid[:, -1]), ("left", grid[::-1, 0]), ("bottom", grid[0])):
            surfaces[f"{name}.{side}"] = np.stack([line[:-1], line[1:]], axis=1).astype(np.int32)
        first += X.size
    body = np.repeat([0, 1], [len(q) for q in quads]).astype(np.int32)
    return Interface("plane", np.concatenate(nodes), np.concatenate(quads).astype(np.int32),
                     np.empty((0, 3), np.int32), body, np.empty(0, np.int32), ("a", "b"), ("m", "m"), surfaces, {},
                     (Pair("p", "a.right", "b.left", 0.01, 0.0),))


def spec(**more: Any) -> dict[str, Any]:
    return {"half": "mechanical_rod", "format": 2,
            "materials": {"m": {"alpha": ALPHA, "T_ref": T_REF, "E": 2e9}, "n": {"alpha": 2 * ALPHA, "T_ref": T_REF,
                                                                              "E": 5e9}},
            "bodies": {"a": {"material": "m"}, "b": {"material": "n"}},
            "held": {"a": {"left": 0.0}, "b": {"right": 0.0}}, **more}


def answer(interface: Interface, model: dict[str, Any], T: np.ndarray, t: float = 1.0, **given: Any) -> dict[str, Any]:
    half, link = load_rod(interface, model), open_link("direct")
    T0 = np.full(len(interface.nodes), T_REF)
    start = {"T": T0, **{key: np.zeros(T0.size) for key in given}}
    state, _ = half.start(start, 0.0, link)
    return dict(done(half.step(state, {"T": T, **given}, 0.0, t, link))[1])


def test_a_free_rod_takes_the_integral_of_its_strain():
    """A linear temperature: u = alpha (D x^2/(2 L)), the trapezoidal rule of it exact at the nodes."""
    interface = scene()
    X = interface.nodes[:, 0]
    out = answer(interface, spec(), T_REF + np.where(X <= L, 50.0 * X / L, 0.0))
    a = X <= L
    u = out["x"][:, 0] - X
    assert u[a] == pytest.approx(ALPHA * 50.0 * X[a] ** 2 / (2 * L), rel=1e-12)
    assert (u[~a] == 0.0).all()
    assert (out["x"][:, 1] == interface.nodes[:, 1]).all()
    assert out["contact.gap"] == pytest.approx(GAP - ALPHA * 25.0 * L, rel=1e-9)
    assert (out["contact.t_N"] == 0.0).all()
    assert out["contact.touching"] == 0.0


def test_the_pressure_closes_the_overlap_of_free_rods():
    """p (L/E_a + L/(2 E_b)) = overlap, and the surfaces then touch."""
    interface = scene()
    out = answer(interface, spec(), np.full(len(interface.nodes), T_REF + 100.0))
    overlap = ALPHA * 100.0 * L + 2 * ALPHA * 100.0 * 0.5 * L - GAP
    p = overlap / (L / 2e9 + 0.5 * L / 5e9)
    assert out["contact.t_N"] == pytest.approx(-p, rel=1e-12)
    assert np.abs(out["contact.gap"]).max() < 1e-15
    tip = L + L * (ALPHA * 100.0 - p / 2e9)
    assert out["x"][interface.surfaces["a.right"].ravel(), 0] == pytest.approx(tip, rel=1e-14)
    assert out["contact.touching"] > 0


def test_a_rod_held_at_both_ends_presses_by_itself():
    """p = (alpha dT - (u_right - u_left)/L) E, with the modulus of its temperature."""
    interface = scene()
    model = spec(held={"a": {"left": {"t": [0, 2], "value": [0, 2e-6]}, "right": 1e-6}, "b": {"right": 0.0}})
    model["materials"]["m"]["E"] = {"T": [300, 400], "value": [3e9, 1e9]}
    out = answer(interface, model, np.where(interface.nodes[:, 0] <= L, T_REF + 50.0, T_REF))
    assert out["p.a"] == pytest.approx((ALPHA * 50.0 + (1e-6 - 1e-6) / L) * 2e9, rel=1e-12)
    assert out["x"][interface.surfaces["a.right"].ravel(), 0] == pytest.approx(L + 1e-6, rel=1e-15)


def test_freezing_shrinks_what_was_poured():
    """The mesh is the mould's shape: it shrinks by .0225026 f_s from there, and by alpha as it cools below T_ref."""
    interface = scene(0.0)
    shrinkage = 0.0225026
    model = spec()
    model["materials"]["m"] = {"alpha": 2.6e-5, "T_ref": T_REF, "E": 2e9,
                              "liquid": {"eta": 1.0, "bulk": 1.0, "T_s": 933.0, "T_l": 933.0, "shrinkage": shrinkage}}
    rod = interface.node_body == 0
    f_s = np.where(rod, interface.nodes[:, 0] / L, 1.0)
    T = np.where(rod, T_REF - 100.0, T_REF)
    out = answer(interface, model, T, f_s=f_s)
    assert out["contact.gap"] == pytest.approx(shrinkage * L / 2 + 2.6e-5 * 100.0 * L, rel=1e-9)


def test_a_modulus_that_is_not_positive_is_a_discard():
    interface = scene()
    model = spec()
    model["materials"]["m"]["E"] = {"polynomial": [1e9, -1e7], "T_ref": 300.0}
    half, link = load_rod(interface, model), open_link("direct")
    T = np.full(len(interface.nodes), T_REF)
    state, _ = half.start({"T": T}, 0.0, link)
    answered = half.step(state, {"T": T + 200.0}, 0.0, 1.0, link)
    assert isinstance(answered, Discard)
    assert "modulus" in answered.message


@pytest.mark.parametrize(("change", "words"), [
    ({"held": {"b": {"right": 0.0}}}, "nothing holds body 'a'"),
    ({"held": {"a": {}, "b": {"right": 0.0}}}, "held.a: a rod must be held"),
    ({"held": {"a": {"left": 0.0, "right": 0.0}, "b": {"left": 0.0}}}, "nothing could give way"),
    ({"materials": {"m": {"alpha": 1e-5}, "n": {"alpha": 0.0}}}, "no T_ref"),
    ({"half": "rod"}, "is not mechanical_rod"),
])
def test_refusals(change: dict[str, Any], words: str):
    with pytest.raises(ValueError, match=words):
        load_rod(scene(), spec(**change))


def test_ends_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="equal heights"):
        load_rod(scene(height=0.5 * H), spec())
    whole = scene()
    wrong = Interface(**{**vars(whole), "pairs": (Pair("p", "a.bottom", "b.left", 0.01, 0.0),)})
    with pytest.raises(ValueError, match=r"a\.bottom.*is not the left or right end"):
        load_rod(wrong, spec())
