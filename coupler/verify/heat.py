"""Checks whether the heat of a thermal half goes the right way: with time, into cells, through gaps and pressure."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface, Pair
from coupler.fmu.half import Array, Status
from coupler.verify.bench import Bench, first_outputs, took
from coupler.verify.border import Finding, failed, not_applicable, passed
from coupler.verify.matter import KnownScene
from coupler.verify.needs import GIVE_SCENE

SHORT = 1e-3  # of a substep
CHANGED = 1e-6  # of the largest change: less is none
ALMOST = 0.9  # of a change: as much
PRESSED = 1e7  # Pa
WARMED = 1.0  # K by which cells are heated
HEAT_OFF = 0.02  # of WARMED: what conduction and films take in a short substep
LAYERS = 2  # of cells around prescribed nodes; no element notices these from farther away
OPENED = 0.25  # of a pair's gap_max
OF_EDGE = 0.1  # of the mean edge of its slave: not further


def takes_time(bench: Bench, check: str) -> Finding:
    """Check that a thermal half changes less in a short substep: one that ignores h changes as much."""
    first = first_outputs(bench)["T"]
    with bench.half() as whole, bench.half() as short:
        dT = bench.step(whole, 1)["T"] - first
        little = took(short.advance(0.0, SHORT * bench.h, bench.inputs(1), bench.outputs))["T"] - first
    moved = np.abs(dT) > CHANGED * max(float(np.abs(dT).max()), 1e-9)
    # Prescribed temperatures jump at once, so some nodes may; that all do is a half that knows no time.
    if 2 * moved.sum() <= len(dT):
        return not_applicable(check, "next to nothing happens in a substep", "")
    if (np.abs(little) >= ALMOST * np.abs(dT))[moved].all():
        i = int(np.argmax(np.abs(dT)))
        return failed(check, f"a substep of {SHORT * bench.h:.3g} s changes T[{i + 1}] by {little[i]:.4g} K, one of "
                      f"{bench.h:.3g} s by {dT[i]:.4g} K", "A substep goes from t to t + h: its h is an argument")
    return passed(check)


def answers_pressure(bench: Bench, check: str) -> Finding:
    """Check that a thermal half lets more heat through a pair that is pressed than through one that is pulled.

    The difference of temperature between the sides of a pair after one substep, under 10 MPa either way: conductance
    does not fall with pressure, and t_N is a pressure where it is below 0.
    """
    t_N = bench.starts["contact.t_N"]
    assert bench.scene is not None, "needs.SCENE"
    i, first = bench.scene.interface, first_outputs(bench)["T"]
    sides = [(np.unique(i.surfaces[pair.slave]), np.unique(i.surfaces[pair.master])) for pair in i.pairs]
    left: list[Array] = []
    # fault: verify-half: pressure is offered with one sign alone -> for sign in (-1.0, -1.0): |
    #   coupler/test_plain_run
    for sign in (-1.0, 1.0):
        with bench.half() as half:
            inputs = {**bench.starts, "contact.t_N": np.full(t_N.shape, sign * PRESSED)}
            done = half.advance(0.0, bench.h, inputs, bench.outputs)
        T = first if done.status is not Status.OK else done.outputs["T"]  # it may refuse a pull
        left.append(np.array([abs(T[a].mean() - T[b].mean()) for a, b in sides]))
    begun = np.array([abs(first[a].mean() - first[b].mean()) for a, b in sides])
    off = np.where(begun > 1.0, left[0] - left[1], 0.0)
    if not off.size or np.abs(off).max() <= CHANGED * max(float(begun.max()), 1.0):
        return not_applicable(check, "nothing that faces each other at the start answers to pressure", "")
    k = int(np.argmax(off))
    if off[k] > CHANGED * begun[k]:
        return failed(check, f"pair {i.pairs[k].name}: pressed by {PRESSED:g} Pa its sides are {left[0][k]:.6g} K "
                      f"apart after a substep, pulled as much {left[1][k]:.6g} K",
                      "t_N is <= 0 where sides press: p = -t_N")
    return passed(check)



def answers_gap(bench: Bench, check: str) -> Finding:
    """Check that a thermal half lets no more heat through a pair whose sides are apart than through one that overlaps.

    The difference of temperature between the sides after one substep, with the slave's body moved either way.
    """
    assert bench.scene is not None, "needs.SCENE"
    i, first, answered = bench.scene.interface, first_outputs(bench)["T"], False
    for pair in i.pairs:
        a, b = np.unique(i.surfaces[pair.slave]), np.unique(i.surfaces[pair.master])
        begun = abs(first[a].mean() - first[b].mean())
        if begun <= 1.0 or i.node_body[a[0]] == i.node_body[b[0]]:
            continue
        left = []
        for x in _apart(i, pair, bench.starts["x"]):
            with bench.half() as half:
                done = half.advance(0.0, bench.h, {**bench.starts, "x": x}, bench.outputs)
            left += [] if done.status is not Status.OK else [abs(done.outputs["T"][a].mean()
                                                                 - done.outputs["T"][b].mean())]
        if len(left) < 2 or abs(left[0] - left[1]) <= CHANGED * begun:
            continue  # it may refuse an overlap
        answered = True
        # fault: verify-half: a half that conducts across a gap and not where sides touch passes -> if False: |
        #   coupler/test_plain_run
        if left[0] < left[1]:
            return failed(check, f"pair {pair.name}: apart its sides are {left[0]:.6g} K apart after a substep, "
                          f"overlapping {left[1]:.6g} K", "A gap resists heat: it is larger the farther x are apart")
    return passed(check) if answered else not_applicable(check, "nothing that faces each other answers to a gap", "")


def _apart(i: Interface, pair: Pair, x: Array) -> Iterator[Array]:
    """Coordinates with the slave's body away from the master, then as far into it."""
    edges = i.surfaces[pair.master]
    t = x[edges[:, 1]] - x[edges[:, 0]]
    normal = np.array([t[:, 1].sum(), -t[:, 0].sum()])
    normal /= max(float(np.hypot(*normal)), 1e-300)
    edge = x[i.surfaces[pair.slave]]
    far = min(OPENED * pair.gap_max, OF_EDGE * float(np.hypot(*(edge[:, 1] - edge[:, 0]).T).mean()))
    moved = (i.node_body == i.node_body[i.surfaces[pair.slave][0, 0]])[:, None]
    for sign in (1.0, -1.0):
        yield x + np.where(moved, sign * far * normal, 0.0)


def _heatable(bench: Bench) -> tuple[KnownScene, NDArray[np.integer]] | None:
    """The scene and the cells that are free to warm up; None where nothing takes heat.

    They are more than LAYERS cells away from prescribed temperatures, which keep what reaches them.
    """
    scene = bench.scene
    assert isinstance(scene, KnownScene), "needs.MATTER"
    # fault: verify-half: a body with a prescribed temperature is not asked how much heat warms it -> held =
    #   np.isin(scene.interface.node_body, np.unique(scene.interface.node_body[~np.isfinite(scene.T_low)])) |
    #   coupler/test_heat_near_held
    held = ~np.isfinite(scene.T_low)
    for _ in range(LAYERS):
        beside = [cell for cell in scene.cells if held[cell].any()]
        held[np.concatenate(beside) if beside else []] = True
    body = scene.cell_body
    known = np.array([np.isfinite(scene.rho_c[body == b]).all() for b in range(len(scene.interface.bodies))])
    cells = np.flatnonzero(known[body] & ~np.array([held[cell].any() for cell in scene.cells]))
    return (scene, cells) if cells.size and bench.starts["E_M"].shape == (len(body),) else None


def _rise(bench: Bench, E: Array) -> Array:
    """What heat E : (n_cells,) [J] changes in T (n_nodes,) [K] in a short substep."""
    found = []
    for heat in (E, np.zeros_like(E)):
        with bench.half() as half:
            done = half.advance(0.0, SHORT * bench.h, {**bench.starts, "E_M": heat}, bench.outputs)
        found.append(took(done)["T"])
    return found[0] - found[1]


def warms(bench: Bench, check: str) -> Finding:
    """Check that heat Q raises a body by Q/(rho c V): its cells by 1 K, in so short a substep that nothing leaves.

    Where a temperature is prescribed only cells away from it are heated: what the whole body then holds is counted.
    """
    found = _heatable(bench)
    if found is None:
        return not_applicable(check, "no body is known that is free to warm up", GIVE_SCENE)
    scene, cells = found
    of = np.zeros(len(scene.cells))
    of[cells] = (scene.rho_c * scene.volumes)[cells]
    dT = _rise(bench, WARMED * of)
    rise = np.array([dT[cell].mean() for cell in scene.cells])
    for b in np.unique(scene.cell_body[cells]):
        share = np.where(scene.cell_body == b, of, 0.0)
        holds = np.where(scene.cell_body == b, scene.rho_c * scene.volumes, 0.0)
        mean = float(rise @ holds / share.sum())
        # fault: verify-half: heat that is lost or counted twice passes -> if False: | coupler/test_plain_run
        if abs(mean - WARMED) > HEAT_OFF * WARMED:
            return failed(check, f"{WARMED * share.sum():.6g} J in body {scene.interface.bodies[b]!r} warm it by "
                          f"{mean:.6g} K, not Q/(rho c V) = {WARMED:g} K",
                          "E_M are joules of the substep in each cell, of a metre of depth or of the whole turn; "
                          "a cell holds rho c V of them a kelvin")
    return passed(check)


def cells_in_order(bench: Bench, check: str) -> Finding:
    """Check that what heats a cell warms its own nodes most: the first, the middle and the last that may warm up."""
    found = _heatable(bench)
    if found is None:
        return not_applicable(check, "no body is known that is free to warm up", GIVE_SCENE)
    scene, cells = found
    for e in np.unique(cells[[0, len(cells) // 2, -1]]):
        E = np.zeros(len(scene.cells))
        E[e] = WARMED * scene.rho_c[e] * scene.volumes[e]
        dT = _rise(bench, E)
        # fault: verify-half: temperatures in another order pass -> if False: | coupler/test_plain_run
        if dT[scene.cells[e]].max() < (1.0 - CHANGED) * dT.max():
            return failed(check, f"heat in cell {e + 1} warms node {int(np.argmax(dT)) + 1} most, which is none of its "
                          f"nodes ({', '.join(str(n + 1) for n in scene.cells[e])})",
                          "Give and take nodes and cells in the order of interface.h5")
    return passed(check)
