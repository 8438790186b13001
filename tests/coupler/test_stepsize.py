"""The size of the next window: what the controller does with errors, and that it settles."""

from __future__ import annotations

import math

import numpy as np
import pytest

from coupler.control.window_size import (
    AIM,
    GROW,
    GROW_FAR,
    SHRINK,
    Memory,
    StepLimits,
    failed,
    forgotten,
    proposed,
    rejected,
)

WIDE = StepLimits(1e-9, 1e9)


def settled(order: int, H: float, n: int = 30) -> list[float]:
    """Sizes where the error is (H/2)^(order + 1) tolerances."""
    memory, sizes = Memory(), []
    for _ in range(n):
        H, memory = proposed(memory, H, (H / 2) ** (order + 1), order, WIDE)
        sizes.append(H)
    return sizes


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("H", [0.01, 1.0, 50.0])
def test_it_settles_near_its_aim(order: int, H: float) -> None:
    sizes = settled(order, H)
    error = (sizes[-1] / 2) ** (order + 1)
    assert AIM / 2.1 < error < 1.5 * AIM
    assert sizes[-1] == sizes[-2] == sizes[-3]


def test_noise_does_not_move_it() -> None:
    memory, H = Memory(AIM), 3.0
    for wiggle in np.random.default_rng(1).uniform(-0.2, 0.2, 40):
        H, memory = proposed(memory, H, AIM * (1 + wiggle), 2, WIDE)
    assert H == 3.0


def test_the_proportional_part_leans_against_what_grows() -> None:
    rising, _ = proposed(Memory(0.02 * AIM), 1.0, 0.4 * AIM, 2, WIDE)
    falling, _ = proposed(Memory(10.0 * AIM), 1.0, 0.4 * AIM, 2, WIDE)
    assert rising < 1.0 < falling


@pytest.mark.parametrize("order", [1, 2])
def test_far_below_its_aim_one_window_leads_near_it(order: int) -> None:
    """Where errors stay as small as they are, only size matters: the next has at least half of the error aimed at."""
    memory = Memory(0.2 * AIM)
    H, _ = proposed(memory, 1.0, 0.2 * AIM, order, WIDE)
    assert 0.5 * AIM < 0.2 * AIM * H ** (order + 1) < AIM


def test_limits() -> None:
    assert proposed(Memory(), 1.0, 0.0, 2, WIDE)[0] == GROW
    assert proposed(Memory(1e-4), 1.0, 0.0, 2, WIDE)[0] == GROW_FAR
    assert proposed(Memory(AIM), 1.0, 0.0, 2, WIDE)[0] == GROW
    assert proposed(Memory(), 1.0, 1e9, 2, WIDE)[0] == SHRINK
    assert proposed(Memory(), 1.0, 0.0, 2, StepLimits(0.1, 1.5))[0] == 1.5
    assert proposed(Memory(), 1.0, 1e9, 2, StepLimits(0.5, 1.5))[0] == 0.5
    assert proposed(Memory(), 1.0, None, 2, WIDE)[0] == 1.0
    assert forgotten(Memory(1.0, True)) == Memory()


def test_right_after_a_rejection_nothing_grows() -> None:
    size, memory = proposed(failed(Memory(0.5)), 1.0, 1e-3, 2, WIDE)
    assert size == 1.0
    assert not memory.failed
    assert proposed(memory, 1.0, 1e-3, 2, WIDE)[0] > 1.0


def test_a_rejected_window_is_always_shorter() -> None:
    sizes = [rejected(1.0, error, 2) for error in (1.0 + 1e-9, 2.0, 10.0, 1e9)]
    assert sizes[0] == pytest.approx(AIM ** (1 / 3))
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[-1] == SHRINK
    assert rejected(1.0, 10.0, 2) == pytest.approx((AIM / 10.0) ** (1 / 3))
    assert math.isnan(Memory().error)
