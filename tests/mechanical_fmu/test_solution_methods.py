"""Solution methods, pieces of a step, skipping, heat out."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact.half.model import Discard
from contact.half.state import from_bytes, frozen_copy, to_bytes
from contact.rpc.link import open_link

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NoLink, block, blocks, done, elastic, hold, inputs_of, press

GRID = np.linspace(0.0, 1.0, 7)
HELD = [hold("block.left", 0), hold("block.left", 1)]
PLASTIC = {"plastic": {"s_y": 250e6, "hardening": {"law": "linear", "H": 2e9}}}


@pytest.fixture
def link():
    link = open_link("direct")
    yield link
    link.close()


def bent(method, **material):
    load = {"t": [0, 1], "value": [0, 9e6 if material else 2e9]}
    return elastic(block(4.0 * GRID, GRID), [*HELD, press("block.top", load)], material, method=method)


@pytest.mark.parametrize("material", [{}, PLASTIC])
def test_all_methods_find_the_same_equilibrium(material):
    found = {}
    for method in ("newton", "modified_newton", "bfgs"):
        half = bent(method, **material)
        state, _ = half.start(inputs_of(half), 0.0, NoLink())
        state, outputs = done(half.step(state, inputs_of(half), 0.0, 1.0, NoLink()))
        found[method] = (state.u, outputs["iterations"], outputs["cuts"])
    size = np.abs(found["newton"][0]).max()
    for method in ("modified_newton", "bfgs"):
        assert np.abs(found[method][0] - found["newton"][0]).max() <= (1e-6 if not material else 1e-4) * size, method
        assert found[method][1] > found["newton"][1]
    assert found["bfgs"][1] < found["modified_newton"][1]
    assert size > 1e-3


def test_the_method_is_switched_by_number():
    half = bent("newton")
    state, _ = half.start(inputs_of(half), 0.0, NoLink())
    count = [done(half.step(state, inputs_of(half) | {"control.method": n}, 0.0, 1.0, NoLink()))[1]["iterations"]
             for n in (0, 1, 2, 3)]
    assert count[0] == count[1] < count[3] < count[2]
    answer = half.step(state, inputs_of(half) | {"control.method": 5}, 0.0, 1.0, NoLink())
    assert isinstance(answer, Discard)
    assert "control.method 5 is none of 0 to 4" in answer.message


def test_contact_under_old_tangents(link):
    """Two blocks pressed and slid: modified Newton and BFGS find what full Newton does."""
    drive = [hold("lower.bottom", 1), hold("lower.left", 0), hold("upper.top", 1, {"t": [0, 1], "value": [0, -1e-3]}),
             hold("upper.left", 0, {"t": [0, 1], "value": [0, 0.05]})]
    found = []
    for method in ("newton", "modified_newton", "bfgs"):
        half = elastic(blocks(4, 5), drive, method=method)
        state, _ = half.start(inputs_of(half), 0.0, link)
        _, outputs = done(half.step(state, inputs_of(half), 0.0, 1.0, link))
        found.append(outputs["contact.t_N"])
    assert found[0].min() < -1e7
    assert np.abs(found[1] - found[0]).max() <= 1e-5 * np.abs(found[0]).max()
    assert np.abs(found[2] - found[0]).max() <= 1e-5 * np.abs(found[0]).max()


def test_a_step_too_large_is_done_in_pieces_and_counted():
    """A slender beam bent far by a dead load at once: more than one solve can do."""
    load = {"on": "block.right", "t_y": {"t": [0, 1], "value": [0, 1e8]}}
    pieces, whole = (elastic(block(20.0 * np.linspace(0, 1, 21), [0, 1]), [*HELD, load], element="enhanced", cuts=n)
                     for n in (6, 0))
    state, _ = pieces.start(inputs_of(pieces), 0.0, NoLink())
    assert isinstance(whole.step(state, inputs_of(whole), 0.0, 1.0, NoLink()), Discard)
    once, outputs = done(pieces.step(state, inputs_of(pieces), 0.0, 1.0, NoLink()))
    assert outputs["cuts"] > 0
    half_way, _ = done(whole.step(state, inputs_of(whole), 0.0, 0.5, NoLink()))
    twice, _ = done(whole.step(half_way, inputs_of(whole), 0.5, 0.5, NoLink()))
    assert np.abs(once.u - twice.u).max() <= 1e-9 * np.abs(twice.u).max()


def test_heat_of_a_step_in_pieces_is_that_of_all_of_them():
    """The same beam, compressing while it bends: heat goes out once, from the whole step."""
    load = {"on": "block.right", "t_y": {"t": [0, 1], "value": [0, 1e8]}}
    soft = {"plastic": {"s_y": 2e9, "hardening": {"law": "linear", "H": 5e10}}}
    halves = [elastic(block(20.0 * np.linspace(0, 1, 21), [0, 1]), [*HELD, load], soft, element="enhanced", cuts=n)
              for n in (6, 0)]
    state, _ = halves[0].start(inputs_of(halves[0]), 0.0, NoLink())
    _, once = done(halves[0].step(state, inputs_of(halves[0]), 0.0, 1.0, NoLink()))
    assert once["cuts"] == 2
    made = []
    for t, h in ((0.0, 0.25), (0.25, 0.25), (0.5, 0.5)):
        state, outputs = done(halves[1].step(state, inputs_of(halves[1]), t, h, NoLink()))
        made.append(outputs["E_M"])
    total = sum(made)
    assert min(heat.sum() for heat in made[1:]) > 0.01 * total.sum()
    assert np.abs(once["E_M"] - total).max() <= 1e-6 * np.abs(total).max()


def test_a_body_that_collapses_is_named_with_the_share_reached():
    """Perfectly plastic and pulled beyond what it can carry: no step is small enough."""
    pull = {"t": [0, 1], "value": [0, -6e8]}
    half = elastic(block([0, 0.5, 1], [0, 0.5, 1]), [hold("block.left", 0), hold("block.bottom", 1),
                                                     press("block.right", pull)],
                   {"plastic": {"s_y": 250e6}}, cuts=5)
    state, _ = half.start(inputs_of(half), 0.0, NoLink())
    answer = half.step(state, inputs_of(half), 0.0, 1.0, NoLink())
    assert isinstance(answer, Discard)
    assert "body block" in answer.message
    assert "of the step's change was reached" in answer.message
    # Plane strain, nu .3: yields somewhat above s_y and carries no more than 2/sqrt 3 of it.
    assert 250.0 / 600.0 <= answer.dt_suggest <= 2.0 / np.sqrt(3.0) * 250.0 / 600.0


def test_plastic_heat_is_the_same_in_one_step_and_in_pieces_of_it():
    """Stretched along x only, perfectly plastic: heat = chi s_y V (2/3 ln lambda - s_y/3G), however it is cut."""
    made = []
    for n in (1, 4):
        half = elastic(block([0, 1, 2], [0, 1]),
                       [hold("block.left", 0), hold("block.bottom", 1), hold("block.top", 1),
                        hold("block.right", 0, {"t": [0, 1], "value": [0, 0.02]})], {"plastic": {"s_y": 250e6}})
        state, _ = half.start(inputs_of(half), 0.0, NoLink())
        total = 0.0
        for i in range(n):
            before = state
            state, outputs = done(half.step(state, inputs_of(half), i / n, 1.0 / n, NoLink()))
            again, same = done(half.step(before, inputs_of(half), i / n, 1.0 / n, NoLink()))
            assert outputs["E_M"].tobytes() == same["E_M"].tobytes()
            assert to_bytes(frozen_copy(state)) == to_bytes(frozen_copy(again))
            total += outputs["E_M"].sum()
        made.append(total)
    flow = 2.0 / 3.0 * np.log(1.01) - 250e6 / (3.0 * 2e11 / 2.6)
    assert made == pytest.approx([0.9 * 250e6 * 2.0 * flow] * 2, rel=1e-6)


def test_only_a_scene_that_can_make_heat_has_the_output():
    names = {v.name for v in elastic(block([0, 1], [0, 1])).variables}
    assert not {"E_M", "E_S", "skipped", "control.mode"} & names


def test_compression_heats_and_the_frozen_entropy_is_stiffer():
    """Pressed with the sides held: E = beta T p/M, beta = 3 K alpha; frozen, M becomes M (1 + delta) and E is E_S."""
    p, T, rho, c = 1e6, 300.0, 7800.0, 460.0
    held = [hold(f"block.{s}", 0) for s in ("left", "right")] + [hold("block.bottom", 1)]
    half = elastic(block(GRID, GRID), [*held, press("block.top", {"t": [0, 1], "value": [0, p]})],
                   {"rho": rho, "c": c}, tolerance=1e-11, thermoelastic_heat=True, adiabatic=True)
    inputs = inputs_of(half, T)
    state, _ = half.start(inputs, 0.0, NoLink())
    _, isothermal = done(half.step(state, inputs, 0.0, 1.0, NoLink()))
    _, frozen = done(half.step(state, inputs | {"control.mode": 1}, 0.0, 1.0, NoLink()))
    E, nu, alpha = 2e11, 0.3, 1.2e-5
    M, beta = E * (1 - nu) / ((1 + nu) * (1 - 2 * nu)), E / (1 - 2 * nu) * alpha
    delta = beta**2 * T / (rho * c * M)
    assert isothermal["E_M"].sum() == pytest.approx(beta * T * p / M, rel=1e-4)
    assert not isothermal["E_S"].any()
    assert not frozen["E_M"].any()
    assert frozen["E_S"].sum() == pytest.approx(beta * T * p / (M * (1 + delta)), rel=1e-4)
    soft, stiff = (1.0 - o["x"][6, 1] for o in (isothermal, frozen))
    assert soft / stiff - 1.0 == pytest.approx(delta, rel=1e-3)


@pytest.mark.parametrize("element", ["mean_dilatation", "enhanced"])
def test_what_moves_heat_in_a_sheet_is_its_whole_volume(element):
    """A pulled strip in plane stress cools by alpha T s a volume: the width and the thickness that it loses count, too.
    At frozen entropy its Young's modulus is E/(1 - alpha^2 E T/(rho c_s)).  Cells of two kinds, each with a history."""
    s, T, rho, c, E, alpha = 2e8, 300.0, 7800.0, 460.0, 2e11, 1.2e-5
    mesh = block(GRID, GRID)
    cut, rest = mesh.quads[:7], mesh.quads[7:]
    mesh = replace(mesh, quads=rest, triangles=np.concatenate([cut[:, [0, 1, 2]], cut[:, [0, 2, 3]]]),
                   quad_body=mesh.quad_body[7:], triangle_body=np.zeros(14, np.int32))
    half = elastic(mesh, [hold("block.left", 0), hold("block.bottom", 1),
                          {"on": "block.right", "t_x": {"t": [0, 1], "value": [0, s]}}], {"rho": rho, "c": c},
                   tolerance=1e-11, thermoelastic_heat=True, adiabatic=True, state="plane_stress", element=element)
    inputs = inputs_of(half, T)
    state, start = half.start(inputs, 0.0, NoLink())
    _, isothermal = done(half.step(state, inputs, 0.0, 1.0, NoLink()))
    _, frozen = done(half.step(state, inputs | {"control.mode": 1}, 0.0, 1.0, NoLink()))
    assert isothermal["E_M"].sum() == pytest.approx(-alpha * T * s, rel=2e-3)  # s/E is 1e-3
    assert isothermal["E_M"][-14:] == pytest.approx(np.full(14, -alpha * T * s / 72.0), rel=2e-3)
    # c is at constant volume, 9 K alpha^2 T/rho less than at constant stress.
    delta = alpha**2 * E * T / (rho * c + 9.0 * E / 1.2 * alpha**2 * T)
    # Colder by delta s/(alpha E): d(ln theta) = (1 - 2 nu - 3 delta) s/E.
    ratio = frozen["E_S"].sum() / isothermal["E_M"].sum()
    assert 1.0 - ratio == pytest.approx(3.0 * delta / 0.4, rel=5e-3)
    right = np.argmax(start["x"][:, 0])
    soft, stiff = (o["x"][right, 0] - start["x"][right, 0] for o in (isothermal, frozen))
    assert 1.0 - stiff / soft == pytest.approx(delta, rel=5e-3)


def test_a_step_that_changes_too_little_is_skipped_and_nothing_drifts():
    half = elastic(block(GRID, GRID), [hold("block.left", 0), hold("block.bottom", 1)],
                   skip={"u": 1e-6, "most": 3}, tolerance=1e-11)
    state, _ = half.start(inputs_of(half, 300.0), 0.0, NoLink())
    counts, T = [], 300.0
    for i in range(6):
        T += 0.01
        state, outputs = done(half.step(state, inputs_of(half, T), float(i), 1.0, NoLink()))
        counts.append(outputs["skipped"])
    assert counts == [1, 2, 3, 3, 4, 5]
    state, outputs = done(half.step(state, inputs_of(half, 310.0), 6.0, 1.0, NoLink()))
    assert outputs["skipped"] == 5
    fresh = elastic(block(GRID, GRID), [hold("block.left", 0), hold("block.bottom", 1)], tolerance=1e-11)
    first, _ = fresh.start(inputs_of(fresh, 310.0), 0.0, NoLink())
    assert np.abs(first.u - state.u).max() <= 1e-12
    data = to_bytes(frozen_copy(state))
    assert to_bytes(from_bytes(data, {"contact", "mechanical_fmu"})) == data
    assert replace(state, skipped=0).all_skipped == 5


def test_skipped_changes_add_up_until_they_matter():
    """A hundredth of a kelvin moves a metre by 1.2e-7 m: two go unseen below 3e-7, the third does not."""
    half = elastic(block(GRID, GRID), [hold("block.left", 0), hold("block.bottom", 1)], skip={"u": 3e-7, "most": 10})
    state, _ = half.start(inputs_of(half, 300.0), 0.0, NoLink())
    counts = []
    for i in range(6):
        state, outputs = done(half.step(state, inputs_of(half, 300.0 + 0.01 * (i + 1)), float(i), 1.0, NoLink()))
        counts.append(outputs["skipped"])
    assert counts == [1, 2, 2, 3, 4, 4]


def test_slow_creep_is_never_skipped():
    half = elastic(block(GRID, GRID), [hold("block.left", 0), hold("block.bottom", 1)],
                   {"creep": {"A": 1e-40, "n": 4.0}}, skip={"u": 1.0, "most": 3})
    state, _ = half.start(inputs_of(half, 300.0), 0.0, NoLink())
    _, outputs = done(half.step(state, inputs_of(half, 300.0), 0.0, 1.0, NoLink()))
    assert outputs["skipped"] == 0
