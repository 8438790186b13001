"""Contact that conducts far better than cells, between nodes that do not face each other: averages hold, nothing locks.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).parent))

from thermal_scenes import Box, Ran, run, scene, spec, the_context

from contact.half.interface import Interface, Pair
from contact.laws import parse_law
from thermal_fmu.averages import NodeAverages
from thermal_fmu.exchange import ConductionGroup, exchange_flow

PRESSED = -1e6
ROUND_OFF = 1e-16  # of the heat that could flow: 1e-13 of what does up to a thousand times the cells


def blocks(a: int, b: int, swap: bool = False, geometry: str = "plane") -> Interface:
    """Two unit squares of a x a and b x b cells, "a" on "b", beside the axis or one metre from it."""
    sides = ("b.top", "a.bottom") if swap else ("a.bottom", "b.top")
    x = 1.0 if geometry == "axisymmetric" else 0.0
    return scene(Box(x, x + 1, 0, 1, a, a), Box(x, x + 1, -1, 0, b, b), geometry=geometry,
                 pairs=(Pair("p", *sides, gap_max=1.0, eps_N=1.0),))


def solved(mesh: Interface, boundary: list[dict[str, Any]], law: Any, method: str = "steady", dt: Any = 1.0,
           n: int = 1) -> Ran:
    own = law if isinstance(law, dict) else {"law": "constant", "h": law}
    model = spec(boundary, pairs={"p": {"conduction": {"closed": own, "open": None}}}, method=method)
    model["bodies"]["b"] = {"material": "m", "T0": 0.0}
    return run(mesh, model, dt, n, t_N=np.full(len(mesh.contact_nodes), PRESSED))


ENDS = [{"on": "a.top", "temperature": 1.0}, {"on": "b.bottom", "temperature": 0.0}]


@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("ratio", [2.0, 2e2, 2e5])
@pytest.mark.parametrize("cells", [(4, 7), (5, 3)])
def test_an_even_flow_is_exact_at_any_conductance(cells: tuple[int, int], ratio: float, swap: bool,
                                                  geometry: str) -> None:
    mesh, h = blocks(*cells, swap, geometry), ratio * 2.0
    ran = solved(mesh, ENDS, h)
    y, q = mesh.nodes[:, 1], 1.0 / (2.0 + 1.0 / h)
    exact = np.where(np.array(mesh.node_body) == 0, 1.0 - q * (1.0 - y), q * (1.0 + y))
    assert np.abs(ran.T[-1] - exact).max() < 1e-10
    assert ran.imbalance() < ROUND_OFF * max(ratio, 1e3)


def lateral(h: float, a: int, b: int, swap: bool) -> float:
    """The largest error at nodes of the surfaces of a steady field cos(pi x) times hyperbolic functions of y."""
    mesh = blocks(a, b, swap)
    x = np.linspace(0, 1, 4 * a * b + 1)
    top = {"terms": [{"t": 1.0, "x": {"at": x.tolist(), "value": np.cos(np.pi * x).tolist()}}]}
    ran = solved(mesh, [{"on": "a.top", "temperature": top}, {"on": "b.bottom", "temperature": 0.0}], h)
    ch, sh = np.cosh(np.pi), np.sinh(np.pi)
    A, _, C = np.linalg.solve([[ch, sh, 0], [0, 1, -ch], [-h, np.pi, h * sh]], [1, 0, 0])
    X, surface = mesh.nodes, np.abs(mesh.nodes[:, 1]) < 1e-12
    exact = np.where(np.array(mesh.node_body) == 0, A, C * sh) * np.cos(np.pi * X[:, 0])
    return float(np.abs(ran.T[-1] - exact)[surface].max())


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("ratio", [2e1, 2e3, 2e5])
def test_the_order_is_two_at_any_conductance(ratio: float, swap: bool) -> None:
    """Pointwise, 4 and 7 cells lose all but what is linear along the surface."""
    errors = [lateral(ratio * 2.0, 4 * f, 7 * f, swap) for f in (1, 2, 4)]
    match = lateral(ratio * 2.0, 4, 4, False)
    assert errors[0] < 1.3 * match
    assert all(one / two > 3.4 for one, two in pairwise(errors)), errors


@pytest.mark.few("cells0-200000.0-midpoint", "cells1-200000.0-backward_euler")
@pytest.mark.parametrize("method", ["backward_euler", "midpoint"])
@pytest.mark.parametrize("ratio", [2e3, 2e5])
@pytest.mark.parametrize("cells", [(4, 7), (7, 4), (4, 5)])
def test_a_jump_beside_it_stays_within_its_data(cells: tuple[int, int], ratio: float, method: str) -> None:
    """By the linear form up to 1 % of the jump outside."""
    h = 1.0 / cells[0]
    for r in (0.1, 1.0, 10.0):
        ran = solved(blocks(*cells), [{"on": "a.left", "temperature": 1.0}], ratio / h, method, r * h**2, 12)
        assert ran.T.min() >= -1e-8
        assert ran.T.max() <= 1.0 + 1e-8
        assert ran.imbalance() < ROUND_OFF * max(ratio, 1e3)


@pytest.mark.few("20000.0-cells2")
@pytest.mark.parametrize("cells", [(4, 7), (7, 4), (5, 3)])
@pytest.mark.parametrize("ratio", [2e2, 2e4])
def test_what_crosses_goes_with_time_and_not_with_steps(ratio: float, cells: tuple[int, int]) -> None:
    """Beside a jump, in steps of 1e-6 h^2/a: two halves of a step move what the whole one does."""
    h = 1.0 / cells[0]
    H, sides = 1e-6 * h**2, [{"on": "a.left", "temperature": 1.0}, {"on": "b.left", "temperature": 1.0}]
    crossed = []
    for n in (1, 2):
        ran = solved(blocks(*cells), sides, ratio / h, "midpoint",
                     np.append(np.full(4, H), np.full(n, H / n)), 0)
        assert ran.T.min() >= -1e-8
        crossed.append(sum(o["heat.contact.slave"] for o in ran.outputs[4:]))
    assert crossed[1] == pytest.approx(crossed[0], rel=2e-3)


TABLE = {"law": "table", "x": [0.0, 1.0], "h": [50.0, 5000.0], "variable": "T"}


def stiff_group() -> tuple[ConductionGroup, int]:
    """A group of 4 and 7 edges whose conductance grows with T past what is pointwise."""
    mesh = blocks(4, 7)
    model = spec([], pairs={"p": {"conduction": {"closed": TABLE, "open": None}}})
    model["bodies"]["b"] = {"material": "m", "T0": 0.0}
    context = the_context(mesh, model, t_N=np.full(len(mesh.contact_nodes), PRESSED))
    (group,) = context.substep.conduction_groups
    return group, len(mesh.nodes)


def flows(group: ConductionGroup, T: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heat out of every node (n,), and its derivative (n, n)."""
    flow, slope, averaged = exchange_flow(group, 1.0, T)
    assert averaged is not None
    f, K = np.zeros(T.size), np.zeros((T.size, T.size))
    np.add.at(f, group.nodes, flow + averaged.flow)
    for nodes, values in ((group.nodes, slope), (averaged.nodes, averaged.slope)):
        np.add.at(K, (nodes[:, :, None], nodes[:, None, :]), values)
    return f, K


def test_its_derivative_is_the_derivative() -> None:
    group, n = stiff_group()
    T = np.random.default_rng(1).uniform(0.3, 0.9, n)
    K, eps = flows(group, T)[1], 1e-6
    by_difference = np.stack([(flows(group, T + eps * e)[0] - flows(group, T - eps * e)[0]) / (2 * eps)
                              for e in np.eye(n)], axis=1)
    assert np.abs(K - by_difference).max() < 1e-7 * np.abs(K).max()


def test_it_is_symmetric_and_never_stiffer_than_pointwise() -> None:
    """At a conductance that does not depend on T; pointwise minus averaged has no negative eigenvalue (Jensen)."""
    group, n = stiff_group()
    group = replace(group, law=parse_law({"law": "constant", "h": 3000.0}))
    T = np.random.default_rng(2).uniform(0.0, 1.0, n)
    f, K = flows(group, T)
    assert abs(f.sum()) < 1e-12 * np.abs(f).sum()
    assert np.abs(K - K.T).max() < 1e-13 * np.abs(K).max()
    _, slope, _ = exchange_flow(replace(group, pointwise=None), 1.0, T)
    P = np.zeros((n, n))
    np.add.at(P, (group.nodes[:, :, None], group.nodes[:, None, :]), slope)
    least = 1e-12 * np.abs(P).max()
    assert np.linalg.eigvalsh(K).min() > -least
    assert np.linalg.eigvalsh(P - K).min() > -least
    assert np.linalg.eigvalsh(P - K).max() > 1e6 * least


def test_below_the_threshold_nothing_is_averaged(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even what would be averaged over is looked for, and the answer is, to the bit, that of pointwise exchange."""
    def none(_: NodeAverages) -> Any:
        raise AssertionError("averages were looked for")

    monkeypatch.setattr(NodeAverages, "patches", property(none))
    solved(blocks(4, 7), ENDS, 20.0)
    group, n = stiff_group()
    group = replace(group, law=parse_law({"law": "constant", "h": 20.0}))
    T = np.linspace(0.0, 1.0, n)
    for one, other in zip(exchange_flow(group, 1.0, T), exchange_flow(replace(group, pointwise=None), 1.0, T),
                          strict=True):
        assert one is other or np.array_equal(one, other)
