"""Friction of bodies with inertia: its heat is the energy that they lose, in steps of any length, however they hop."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from contact.half.interface import Interface, Pair
from contact.rpc.link import open_link
from mechanical_fmu.advance import Departure, in_pieces
from mechanical_fmu.dynamics import BodyMotion, Rubbing, rubbed

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NO_CELLS, done, elastic, hold, inputs_of, rectangle
from test_impact import stiff

MU, G, RHO, V0, SIDE = 0.3, 9.81, 7800.0, 1.0, 0.05
MASS = RHO * SIDE * SIDE


def sliding(rigid: bool, swapped: bool = False, floor: object = 0.0, v0: tuple[float, float] = (V0, 0.0),
            eps_N: float = 2e11 / 0.02, **more: object):
    """A block that slides to the right on a floor, drawn in touch.  floor : its own way to the right [m]."""
    n1, c1, s1 = rectangle(np.linspace(-0.1, 0.5, 31), np.array([-0.01, 0.0]))
    n2, c2, s2 = rectangle(np.linspace(0.0, SIDE, 4), np.linspace(0.0, SIDE, 4), first=len(n1))
    body = np.r_[np.zeros(len(c1), np.int32), np.ones(len(c2), np.int32)]
    surfaces = {f"floor.{k}": v for k, v in s1.items()} | {f"block.{k}": v for k, v in s2.items()}
    sides = ("floor.top", "block.bottom") if swapped else ("block.bottom", "floor.top")
    interface = Interface("plane", np.concatenate([n1, n2]), np.concatenate([c1, c2]).astype(np.int32), NO_CELLS[3],
                          body, body[:0], ("floor", "block"), ("m", "m"), surfaces, {},
                          (Pair("foot", *sides, 0.01, eps_N, mu=MU),))
    bodies = {"floor": {"material": "m", "rigid": True}, "block": {"material": "m", "v0": list(v0), "rigid": rigid}}
    held = [hold("floor", 0, floor), hold("floor", 1), hold("floor", 2)]
    return elastic(interface, held, {"rho": RHO}, tolerance=1e-10, bodies=bodies,
                   **{"dynamics": {}, "gravity": {"y": -G}} | more)


def slid(half, steps) -> tuple[float, float, float]:
    """Its way [m], the energy that was lost and the heat that friction made [J]."""
    link, t, heat = open_link("direct"), 0.0, 0.0
    state, _ = half.start(inputs_of(half), t, link)
    before, u0 = stiff(half, state).sum(), np.array(state.u)
    for h in steps:
        state, out = done(half.step(state, inputs_of(half), t, h, link))
        t, heat = t + h, heat + float(out["contact.E_friction"].sum())
    link.close()
    moved = (np.array(state.u) - u0)[half.system.interface.node_body == 1].mean(axis=0)
    return float(moved[0]), float(before - stiff(half, state).sum() - MASS * G * moved[1]), heat


UNEVEN = tuple(2e-4 * (1.0 + k % 7) * (4.0 if k % 5 == 0 else 1.0) for k in range(40))  # [s]


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize(("steps", "off"), [((5e-4,) * 30, 1e-3), ((1e-3,) * 30, 1e-3), (UNEVEN, 0.06)])
def test_the_heat_of_friction_is_the_energy_lost(steps: tuple[float, ...], off: float, swapped: bool) -> None:
    """In steps of 1 ms, beside a swing on its contact of 20 us, two thirds of it were missing, or more."""
    way, lost, heat = slid(sliding(True, swapped), steps)
    t = sum(steps)
    assert way == pytest.approx(V0 * t - 0.5 * MU * G * t**2, rel=2e-3)
    assert heat == pytest.approx(lost, rel=1e-6)
    assert heat == pytest.approx(MU * MASS * G * way, rel=off)  # at the end of a hop as much is in that


def test_it_is_so_in_steps_of_several_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Contact tells slip since the start of a step: counted again in each piece, it heated twice, and made it hop."""
    half = sliding(True, cuts=3, dynamics={"rho_inf": 0.5})
    monkeypatch.setattr(type(half), "_in_pieces", cut_in_two)
    way, _, heat = slid(half, (2e-3,) * 20)
    assert heat == pytest.approx(MU * MASS * G * way, rel=0.01)


def cut_in_two(half, state, task, method, failed=None):
    motion = BodyMotion(*(np.array(a) for a in (state.u, state.v, state.a, state.f, state.push)), state.stored,
                        state.rubbing)
    assert failed is None
    settings = replace(half.settings, method=method)
    return in_pieces(half.system, task, Departure(motion, np.array(state.history)), settings, 3, ArithmeticError("cut"))


def test_an_elastic_block_heats_by_what_it_loses() -> None:
    way, lost, heat = slid(sliding(False, dynamics={"rho_inf": 0.8}), (2e-3,) * 20)
    assert heat == pytest.approx(MU * MASS * G * way, rel=0.02)
    assert 0.98 * heat < lost < 1.05 * heat  # the time method damps its swings


def test_explicit_steps_heat_by_all_their_pieces() -> None:
    way, _, heat = slid(sliding(False, method="explicit"), (1e-3,) * 4)
    assert heat == pytest.approx(MU * MASS * G * way, rel=0.02)


@pytest.mark.parametrize(("before", "heat"), [(10.0, 0.01), (0.0, 0.005), (-10.0, 0.0), (-30.0, 0.0)])
def test_slip_that_turned_round_was_helped_on_by_the_friction_of_before(before: float, heat: float) -> None:
    """A block that stopped within a long step, and went back a little, had 4.6 % more heat than energy."""
    slip = np.array([1e-3])
    tractions = SimpleNamespace(slip=slip, t_N=np.array([-1e5]), E_friction=np.array([10.0 * 1e-3]))
    system = SimpleNamespace(contact=SimpleNamespace(slips=True))
    then = Rubbing(np.array([before]), np.array([0.0]), np.array([0.0]))
    now, made = rubbed(system, then, SimpleNamespace(tractions=tractions), 1e-3, 1e-3)
    assert made == pytest.approx([heat])
    assert (now.force[0], now.rate[0]) == pytest.approx((10.0, 1.0))


def test_only_a_half_without_inertia_heats_by_the_end_of_steps() -> None:
    names = {v.name for v in sliding(True).variables}
    assert "contact.E_friction" in names
    assert "contact.E_friction.at" not in names
