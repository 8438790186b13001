"""Energy that steps with inertia make of nothing, or lose: told by the half, beside that of motion and strain."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mechanical_fmu.recovery import energies

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NoLink, block, done, elastic, inputs_of

RHO, E = 1000.0, 1e7


def stepped(dynamics: dict[str, Any], h: float, n: int, boundary: list[dict[str, Any]] | None = None,
            bodies: dict[str, Any] | None = None, **more: Any) -> tuple[Any, Any, Any]:
    """A rod of 0.4 m after n steps of h [s]: its half, its state and its outputs."""
    half = elastic(block(np.linspace(0.0, 0.4, 9), np.linspace(0.0, 0.1, 3), node_sets={"pivot": [1]}), boundary or [],
                   {"E": E, "nu": 0.0, "rho": RHO, "alpha": 0.0}, tolerance=1e-11, dynamics=dynamics,
                   bodies={"block": {"material": "m"} | (bodies or {})}, **more)
    state, outputs = half.start(inputs_of(half), 0.0, NoLink())
    for k in range(n):
        state, outputs = done(half.step(state, inputs_of(half), k * h, h, NoLink()))
    return half, state, outputs


def strain_energy(half: Any, state: Any) -> float:
    """Of small strains, from the stress [J]."""
    moduli = half.system.moduli(np.full(len(half.system.interface.nodes), 300.0))
    stress = half.system.volume.stress(np.array(state.u), moduli)
    return sum(float(energies(s, m, c.weight).sum())
               for (s, _), m, c in zip(stress, moduli, half.system.volume.kinds, strict=True))


METHODS: list[dict[str, Any]] = [{}, {"rho_inf": 0.5}, {"alpha": -0.1}]


@pytest.mark.parametrize("dynamics", METHODS)
def test_what_a_spinning_rod_gains_or_loses_is_told(dynamics: dict[str, Any]) -> None:
    """Nothing acts on it, so its energy stays as it is: motion and strain.  It turns by 0.06 rad a step."""
    w = 3.0
    half, state, outputs = stepped(dynamics, 0.02, 40, bodies={"omega0": w})
    start = 0.5 * w * w * RHO * 0.04 * (0.4**2 + 0.1**2) / 12.0
    true = outputs["energy.kinetic"] + strain_energy(half, state) - start
    assert abs(true) > 1e-4 * start
    assert outputs["energy.made"] == pytest.approx(true, rel=0.02, abs=1e-5 * start)


@pytest.mark.parametrize("dynamics", METHODS)
def test_what_is_pulled_and_driven_is_accounted_for(dynamics: dict[str, Any]) -> None:
    """A load that jumps, gravity and a driven end do work: of that nothing is made; what a method damps is lost."""
    pull = [{"on": "block.left", "u_x": {"t": [0.0, 1.0], "value": [0.0, 0.5]}}, {"on": "block.bottom", "u_y": 0.0},
            {"on": "block.right", "t_x": {"t": [0.0, 0.002, 0.002, 1.0], "value": [0.0, 0.0, 1e4, 1e4]}}]
    _, _, outputs = stepped(dynamics, 2e-4, 40, pull, gravity={"x": 20.0})
    if dynamics:
        assert -0.2 * outputs["energy.kinetic"] < outputs["energy.made"] < 0.0
    else:
        assert abs(outputs["energy.made"]) < 1e-3 * outputs["energy.kinetic"]


def test_a_swing_that_is_damped_loses_what_it_lost() -> None:
    """A rod that swings about its end, `rho_inf: 0` in long steps: motion, strain and height."""
    g = 9.81
    half, state, outputs = stepped({"rho_inf": 0.0}, 0.01, 60, [{"on": "pivot", "u_x": 0.0, "u_y": 0.0}],
                                   gravity={"y": -g})
    lifted = float((np.array(half.system.masses.lumped).reshape(-1, 2)[:, 1] * np.array(state.u)[:, 1]).sum()) * g
    true = outputs["energy.kinetic"] + strain_energy(half, state) + lifted
    assert true < 0.0
    assert outputs["energy.made"] == pytest.approx(true, rel=0.05)
