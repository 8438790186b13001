"""Checks whether bodies of a mechanical half expand and move as bodies do."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.fmu.half import Array
from coupler.verify.bench import MOVING, Bench, took
from coupler.verify.border import Finding, failed, not_applicable, passed
from coupler.verify.matter import KnownScene

OFF = 0.02  # of the expansion: what another material law makes of it
STILL = 1e-3  # of the expansion: less is none
RIGID = 1e-6  # strain of a body that moves as a whole


def _free(bench: Bench) -> KnownScene:
    """The scene, which has bodies that are free to expand."""
    assert isinstance(bench.scene, KnownScene), "needs.FREE"
    return bench.scene


def _at(bench: Bench, T: Array, n: int = 1) -> Iterator[Mapping[str, Array]]:
    """Outputs of n substeps at temperatures T : (n_nodes,) [K]; of bodies where they are NaN those of the start."""
    T = np.where(np.isfinite(T), T, bench.starts["T"])
    with bench.half() as half:
        for k in range(n):
            yield took(half.advance(k * bench.h, bench.h, {**bench.starts, "T": T}, bench.outputs))


def _alone(scene: KnownScene, got: Mapping[str, Array]) -> Iterator[int]:
    """The bodies that are free to expand and that nothing presses on."""
    i, t_N = scene.interface, got.get("contact.t_N", np.zeros(0))
    pressed = np.unique(i.node_body[i.pair_nodes[t_N != 0.0]]) if t_N.size else ()
    yield from (int(b) for b in np.flatnonzero(np.isfinite(scene.stretch)) if b not in pressed)


def _gradient(scene: KnownScene, b: int, x: Array) -> Array:
    """The deformation gradient (2, 2) of a body, the mean over its nodes."""
    nodes = np.flatnonzero(scene.interface.node_body == b)
    X = scene.interface.nodes[nodes]
    return np.asarray(np.linalg.lstsq(X - X.mean(axis=0), x[nodes] - x[nodes].mean(axis=0), rcond=None)[0].T)


def expands(bench: Bench, check: str) -> Finding:
    """Check that a free body that is warm all over is longer by alpha (T - T_ref), and without stress in its plane.

    In plane strain by (1 + nu) as much.
    """
    scene = _free(bench)
    (got,) = _at(bench, scene.hot)
    looked = [b for b in _alone(scene, got) if scene.stretch[b] != 0.0]
    off = {b: _gradient(scene, b, got["x"]) - np.eye(2) for b in looked}
    if all(np.abs(F).max() <= STILL * abs(scene.stretch[b]) for b, F in off.items()):
        return not_applicable(check, "no body of it that is free changes its size with temperature",
                              "such a half knows no alpha")
    for b, F in off.items():
        e, name = float(scene.stretch[b]), scene.interface.bodies[b]
        # fault: verify-half: a body that expands otherwise than by alpha passes -> if False: |
        #   coupler/test_plain_run
        if np.abs(F - e * np.eye(2)).max() > OFF * abs(e):
            return failed(check, f"body {name!r}, free and warm all over, is longer by {F[0, 0]:.4g} along x and "
                          f"{F[1, 1]:.4g} along y, not {e:.4g}", "T are kelvin, in the order of interface.h5; alpha "
                          "counts from T_ref; in plane strain a body expands by (1 + nu) alpha (T - T_ref)")
        if "sigma" in got and (s := _stress(scene, b, got["sigma"])) > OFF * scene.modulus[b] * abs(e):
            return failed(check, f"body {name!r}, free and warm all over, has a stress of {s:.4g} Pa in its plane",
                          "What is free to expand has no stress: take alpha (T - T_ref) from the strain")
    return passed(check)


def _stress(scene: KnownScene, b: int, sigma: Array) -> float:
    return float(np.abs(sigma[scene.cell_body == b, :3]).max())


def rigid(bench: Bench, check: str) -> Finding:
    """Check that a free body at T_ref moves as a whole, and that nothing presses across a gap."""
    scene = _free(bench)
    i = scene.interface
    for k, got in enumerate(_at(bench, scene.cold, MOVING), start=1):
        for b in _alone(scene, got):
            F = _gradient(scene, b, got["x"])
            # fault: verify-half: a body that strains without a cause passes -> if (strain := 0.0) > RIGID: |
            #   coupler/test_plain_run
            if (strain := float(np.abs(F.T @ F - np.eye(2)).max() / 2.0)) > RIGID:
                return failed(check, f"substep {k}: body {i.bodies[b]!r}, free and at T_ref, has a strain of "
                              f"{strain:.3g}", "Without load and at T_ref a body keeps the size of its mesh")
        if "contact.t_N" in got and "contact.gap" in got:
            far = (got["contact.gap"] > STILL * scene.span) & (got["contact.t_N"] != 0.0) & scene.free
            far &= ~_past_an_end(i, got)
            # fault: verify-half: pressure across a gap passes -> if False: | coupler/test_plain_run
            if far.any():
                q = int(np.argmax(far))
                return failed(check, f"substep {k}: contact.t_N[{q + 1}] is {got['contact.t_N'][q]:.6g} Pa across a "
                              f"gap of {got['contact.gap'][q]:.3g} m", "Only what touches presses")
    return passed(check)


def _past_an_end(i: Interface, got: Mapping[str, Array]) -> NDArray[np.bool_]:
    """The pair nodes that face nothing themselves, but some of whose edges' length does: that may press."""
    reach = {pair.name: pair.gap_max for pair in i.pairs}
    nothing = np.zeros(len(i.pair_nodes), bool)
    for side in i.pair_sides:
        nothing[side.at] = got["contact.gap"][side.at] >= reach[side.pair]
    # fault: verify-half: pressure at an end that overhangs is refused -> return nothing & False |
    #   coupler/test_verify_fmu::test_our_own_halves_keep_to_the_border
    return nothing & (got.get("contact.covered", np.ones(len(nothing))) > 0.0)


def nodes_in_order(bench: Bench, check: str) -> Finding:
    """Check that a warm node makes the cells around it grow most: an early, a middle and a late one."""
    scene = _free(bench)
    (still,) = _at(bench, scene.cold)
    before, answered = scene.areas(still["x"]), False
    nodes = np.flatnonzero(np.isfinite(scene.hot))
    for n in np.unique(nodes[[len(nodes) // 4, len(nodes) // 2, 3 * len(nodes) // 4]]):
        T = scene.cold.copy()
        T[n] = scene.hot[n]
        (got,) = _at(bench, T)
        grown = scene.areas(got["x"]) / before - 1.0
        if grown.max() <= STILL * abs(scene.stretch[scene.interface.node_body[n]]):
            continue
        answered, e = True, int(np.argmax(grown))
        # fault: verify-half: temperatures taken in another order pass -> if False: | coupler/test_plain_run
        if n not in scene.cells[e]:
            return failed(check, f"node {n + 1} warmed, cell {e + 1} grows most, which does not have it",
                          "Give and take nodes in the order of interface.h5")
    return passed(check) if answered else not_applicable(check, "no cell grows where a node is warm", "")
