"""Solves that reuse old factors: as accurate as new ones, and the same bits from hot and cold caches."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import Box, FlatContact, imbalance, inputs_of, scene, spec

from contact.half.interface import Pair
from contact.half.state import from_bytes, to_bytes
from thermal_fmu import linear
from thermal_fmu.half import load
from thermal_fmu.kernels import times, with_blocks


def blocks(k=30.0):
    """Two blocks of 480 unknowns together, pressed."""
    mesh = scene(Box(0, 0.1, 0, 0.1, 15, 14), Box(0, 0.1, 0.1, 0.2, 17, 13),
                 pairs=(Pair("p", "b.bottom", "a.top", 0.05, 1e9),))
    model = spec([{"on": "a.bottom", "temperature": 300.0},
                  {"on": "b.top", "convection": {"h": 200.0, "T": 800.0}}], k=k, c=500.0, rho=8000.0, T0=300.0,
                 pairs={"p": {"conduction": {"closed": {"law": "constant", "h": 3000.0}, "open": None}}})
    model["bodies"]["b"] = {"material": "m", "T0": 900.0}
    return mesh, model


def slide(half, mesh, state, first, last, growth=1.01):
    """Steps of a slide with a step that grows slowly; states and outputs."""
    link, done = FlatContact(), []
    for i in range(first, last):
        x = mesh.nodes + np.where(mesh.node_body == 1, 4e-4 * i, 0.0)[:, None] * np.array([1.0, 0.0])
        given = inputs_of(mesh, half, x=x, t_N=np.full(len(mesh.pair_nodes), -1e6))
        done.append(half.step(state, given, 5.0 * i, 5.0 * growth**i, link))
        state = done[-1].state
    return done


def begun(half, mesh):
    return half.start(inputs_of(mesh, half), 0.0, FlatContact())[0]


@pytest.mark.few("k(T)")
@pytest.mark.parametrize("k", [30.0, {"polynomial": [20.0, 0.02]}], ids=["linear", "k(T)"])
def test_old_factors_serve_and_change_nothing_that_matters(monkeypatch, k):
    """30 substeps on a few factors, equal to 1e-8 K to those with new ones every time; each heat balance closes."""
    mesh, model = blocks(k)
    reusing = load(mesh, model)
    with_old = slide(reusing, mesh, begun(reusing, mesh), 0, 30)
    assert reusing._factors.made < 15
    monkeypatch.setattr(linear, "SMALLEST", 10**9)
    fresh = load(mesh, model)
    with_new = slide(fresh, mesh, begun(fresh, mesh), 0, 30)
    assert fresh._factors.made >= 30
    for a, b in zip(with_old, with_new, strict=True):
        assert np.abs(a.outputs["T"] - b.outputs["T"]).max() < 1e-8
        assert imbalance([a.outputs]) < 1e-10
    assert sum(d.outputs["iterations"] for d in with_old) <= sum(d.outputs["iterations"] for d in with_new) + 5


def test_sliding_bodies_keep_their_factors(monkeypatch):
    """Steps of one length: what changes at surfaces alone is corrected there, and needs no new factors."""
    mesh, model = blocks()
    reusing = load(mesh, model)
    with_old = slide(reusing, mesh, begun(reusing, mesh), 0, 30, growth=1.0)
    made = reusing._factors.made
    slide(reusing, mesh, with_old[-1].state, 30, 45, growth=1.0)
    assert reusing._factors.made == made <= 4
    monkeypatch.setattr(linear, "SMALLEST", 10**9)
    fresh = load(mesh, model)
    with_new = slide(fresh, mesh, begun(fresh, mesh), 0, 30, growth=1.0)
    for a, b in zip(with_old, with_new, strict=True):
        assert np.abs(a.outputs["T"] - b.outputs["T"]).max() < 1e-8
        assert imbalance([a.outputs]) < 1e-10


def test_surfaces_are_corrected_exactly():
    """The correction solves the matrix of today, whatever its symmetry; what changed inside bodies is noticed."""
    rng = np.random.default_rng(2)
    n, nodes = 60, np.array([3, 7, 8, 20, 41, 59], np.int32)
    then = np.where(rng.random((n, n)) < 0.1, rng.normal(size=(n, n)), 0.0) + 8.0 * np.eye(n)
    now = then.copy()
    now[np.ix_(nodes[:4], nodes[:4])] += rng.normal(size=(4, 4))
    A, B = csr_matrix(then), csr_matrix(now)
    factors, anchor = linear.Factors(nodes), linear.AnchorMatrix(A.indptr, A.indices, A.data)
    E = factors.change(anchor, B)
    assert np.abs(E - (now - then)[np.ix_(nodes, nodes)]).max() < 1e-15
    b = rng.normal(size=n)
    assert np.abs(B @ factors.factored(anchor).corrected(E)(b) - b).max() < 1e-12
    now[1, 1] += 0.1
    assert factors.change(anchor, csr_matrix(now)) is None
    assert factors.change(anchor, csr_matrix(1.01 * then)) is None, "another step"


def test_solves_about_an_anchor_add_up_until_responses_pay():
    """Each solve that W would have spared is counted in the anchor; at half of the surface nodes W is worked out."""
    n, nodes = 450, np.arange(0, 450, 22, dtype=np.int32)
    then = csr_matrix(diags([-np.ones(n - 1), 2.5 * np.ones(n), -np.ones(n - 1)], [-1, 0, 1]))
    factors, anchor = linear.Factors(nodes), linear.AnchorMatrix(then.indptr, then.indices, then.data)
    b, counts = np.cos(np.arange(n)), [0]
    while "W" not in vars(factors.factored(anchor)):
        change = np.zeros(n)
        change[nodes[: 2 + len(counts) % 3]] = 0.3
        found = linear.solve(csr_matrix(then + diags(change)), b, 1e-9, anchor, factors)
        assert factors.made == 1, "no new factors"
        anchor = found.anchor
        counts.append(anchor.spent)
        assert len(counts) < 20
    *before, last, after = counts
    assert (np.diff([*before, last]) >= 2).all()
    assert 2 * last >= nodes.size > 2 * before[-1]
    assert after == last, "with W nothing is to be spared any more"


@pytest.mark.few("pardiso-1.01", "superlu-1.0")
@pytest.mark.parametrize("growth", [1.01, 1.0])
@pytest.mark.parametrize("choice", ["superlu", "pardiso"])
def test_hot_and_cold_caches_give_the_same_bits(monkeypatch, choice, growth):
    """From one state: with its factors at hand, with others, in a new half, from bytes."""
    if choice == "pardiso":
        pytest.importorskip("pypardiso")
    monkeypatch.setenv("SLIDELINE_SOLVER", choice)
    mesh, model = blocks()
    half = load(mesh, model)
    middle = slide(half, mesh, begun(half, mesh), 0, 8, growth)[-1].state
    hot = slide(half, mesh, middle, 8, 14, growth)
    slide(half, mesh, begun(half, mesh), 0, 3, 1.1)
    restored = from_bytes(to_bytes(middle), {"thermal_fmu"})
    others = (slide(half, mesh, middle, 8, 14, growth), slide(load(mesh, model), mesh, restored, 8, 14, growth))
    assert middle.anchor is not None
    for other in others:
        for a, b in zip(hot, other, strict=True):
            assert all(np.asarray(a.outputs[n]).tobytes() == np.asarray(b.outputs[n]).tobytes() for n in a.outputs)


def test_gmres_solves_or_says_that_it_takes_too_long():
    from scipy.sparse import csr_matrix, diags, eye

    n = 50
    A = csr_matrix(diags([np.full(n - 1, -1.0), np.full(n, 2.5), np.full(n - 1, -1.1)], [-1, 0, 1]))
    b = np.cos(np.arange(n))
    near = linear.Factors().of(linear.AnchorMatrix(*(lambda B: (B.indptr, B.indices,
                                                                B.data))(csr_matrix(A + 0.01 * eye(n)))))
    found = linear._gmres(A, b, 1e-12, near)
    assert np.linalg.norm(b - A @ found.x) < 2e-12
    assert linear._gmres(A, b, 1e-12, lambda v: v) is None
    assert not linear._gmres(A, 0.0 * b, 1e-12, near).x.any()


def test_blocks_are_added_to_a_matrix() -> None:
    """As a dense matrix would have it, but for fixed rows and columns; columns stay in order, each once."""
    rng = np.random.default_rng(1)
    n = 30
    dense = np.where(rng.random((n, n)) < 0.1, rng.normal(size=(n, n)), 0.0) + np.eye(n)
    A = csr_matrix(dense)
    nodes, fixed = rng.integers(0, n, (20, 4)).astype(np.int32), rng.random(n) < 0.2
    values = rng.normal(size=(20, 4, 4))
    for block, at in zip(values, nodes, strict=True):
        for i, row in enumerate(at):
            for j, column in enumerate(at):
                dense[row, column] += 0.0 if fixed[row] or fixed[column] else block[i, j]
    indptr, indices, data = with_blocks(A.indptr, A.indices, A.data, nodes, values, fixed)
    assert np.abs(csr_matrix((data, indices, indptr), shape=A.shape).toarray() - dense).max() < 1e-14
    assert all((np.diff(indices[a:b]) > 0).all() for a, b in pairwise(indptr))
    x = rng.normal(size=n)
    assert np.abs(times(indptr, indices, data, x) - dense @ x).max() < 1e-14
