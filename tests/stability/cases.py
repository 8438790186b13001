"""The cases of coupling as values: halves and first state of each, the window to measure in, what is looked at.

Each case is at rest, or goes to rest, where its page says; it is started a share of its range away from there.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq

from coupler.scenario.options import Acceleration, Iteration, OnMax, Seen, Tolerance, Tolerances
from coupler.schemes.accounts import EnergyAccount
from coupler.schemes.levels import Level
from coupler.schemes.state import CoupledState

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "coupler"))
from bar_halves import DELTA, conducting_bar, moving_bar
from conduction_halves import ALUMINIUM, STEEL, ratio, takes_flow, takes_temperature, together
from coupled_run import start
from fake_halves import A_LAG, B_LAG, T_STAR, FakeHalf, gap_of, lumped, shrinking
from rod_halves import SHIFT, Growth, Rod, conducting, growing

Array = NDArray[np.float64]
Made = tuple[tuple[FakeHalf, FakeHalf], CoupledState]

TIGHT = Tolerances(temperature=Tolerance(atol=1e-8, rtol=1e-8), gap=Tolerance(atol=1e-10, rtol=1e-8),
                   pressure=Tolerance(atol=1.0, rtol=1e-8), solid_fraction=Tolerance(atol=1e-8, rtol=1e-8))
HOW = Iteration(acceleration=Acceleration.IQN_ILS, max_iterations=60, on_max=OnMax.STOP, tolerance=TIGHT)
DAMPED = HOW.changed(level=Seen.END)
WINDOWS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
DISTURBANCES = {"small": 1e-3, "large": 0.3}


@dataclass(frozen=True)
class Case:
    """make : disturbance (share of the range) -> halves and first state.  unit [s] : windows are counted in it.

    limit : what `unit` is: the closed form of the largest stable window of the lagged exchange, or only a time scale.
    watch : level -> what is compared.  settled [s] : at rest by then; 0: compared where 60 windows end.
    exact : disturbance, time -> what is watched, where it is known.  how : of iterated windows.
    """

    name: str
    make: Callable[[float], Made]
    unit: float
    limit: bool
    watch: Callable[[Level], Array]
    settled: float
    exact: Callable[[float, float], Array] | None = None
    how: Iteration = field(default_factory=lambda: HOW)


def temperatures(level: Level) -> Array:
    return level.T


def moved(level: Level) -> Array:
    return np.append(level.T - SHIFT, level.x[:, 1])


def first(T: Array, x: Array, *t_N: float, accounts: tuple[str, ...] = ()) -> CoupledState:
    """The first state of a case.  T : (n,), x : (m, 2), t_N; accounts : of heat, one a temperature."""
    now = Level(0.0, np.asarray(T, dtype=float), x, np.array(t_N), np.zeros(len(t_N)), np.zeros(len(t_N)))
    kept = {name: EnergyAccount(np.zeros(len(now.T))) for name in accounts or ("E_M",)}
    return replace(start(0.0, 0.0), now=now, accounts=kept)


def bar(d: float, k: tuple[float, ...] = (1.0, 2.0), sees: str = "held", delta: float = DELTA) -> Made:
    """E1: modes at rest, displaced by d."""
    waves, U, none = np.array(k), np.full(len(k), d), np.zeros(len(k))
    halves = conducting_bar(waves, none), moving_bar(waves, U, none, sees, delta)
    return halves, first(none + SHIFT, np.column_stack([none, U]), accounts=("E_M", "E_S"))


def rod(pipe: Rod, growth: Growth, T: Array, method: str) -> Made:
    """Rod halves from temperatures T : (n + 1,)."""
    gap, t_N = growth.told(T)
    halves = conducting(pipe, T, method), growing(growth, pipe.n, T, pipe.shift)
    return halves, first(T + pipe.shift, np.array([[0.0, gap]]), t_N)


def along(n: int) -> Array:
    return np.linspace(0.0, 1.0, n + 1)


# E3b and E3c, without units: resistance eps + g where open, eps or a stated one where it touches.
E3B = Rod(lambda x, p: (1.0 / (0.1 + x) if x > 0.0 else 10.0, 0.0), T_left=0.0, T_w=1.0)
E3B_GROWTH = Growth(4.0, 12.0)
E3C_EPS = 0.05
E3C = Rod(lambda x, p: (1.0 / (E3C_EPS + max(x, 0.0)), 0.0), T_left=1.0, T_w=0.0)
E3C_GROWTH = Growth(30.5, 40.0)


def at_gap(gap: float) -> Array:
    """Steady temperatures of E3b at a gap: linear up to Bi/(1 + Bi)."""
    return along(E3B.n) / (1.1 + gap)


def e3c_steady() -> tuple[float, float]:
    """Gap and T_L at rest."""
    g = brentq(lambda g: 30.5 - 20.0 * (1.0 + (E3C_EPS + g) / (1.0 + E3C_EPS + g)) - g, 0.1, 5.0, xtol=1e-14)
    return float(g), float((E3C_EPS + g) / (1.0 + E3C_EPS + g))


def e3c_slope() -> float:
    """C: heat out of the tip for a mean temperature higher by 1, at rest."""
    g, T_L = e3c_steady()
    return 40.0 * T_L / (E3C_EPS + g) ** 2


def e3c_limit(method: str) -> float:
    """Largest stable step with the gap of the start: z = -1 is an eigenvalue (backward Euler); 2/C (midpoint)."""
    C, Bi = e3c_slope(), 1.0 / (E3C_EPS + e3c_steady()[0])
    if method == "midpoint":
        return 2.0 / C

    def left(dt: float) -> float:
        m = np.sqrt(2.0 / dt)
        return float(m * np.cosh(m) + Bi * np.sinh(m) - C * (np.cosh(m) - 1.0) / m)

    return float(brentq(left, 0.02, 1.0))


def chatter(d: float, method: str = "backward_euler") -> Made:
    """E3c, d below its rest."""
    T = 1.0 - (1.0 - e3c_steady()[1]) * along(E3C.n) - d * np.sin(np.pi / 2.0 * along(E3C.n))
    return rod(E3C, E3C_GROWTH, T, method)


def nudged(d: float, method: str = "sdirk2", towards: int = 1) -> Made:
    """E3b, from the unstable gap .7411277; towards +1: warmer, so closer."""
    return rod(E3B, E3B_GROWTH, at_gap(0.7411277) * (1.0 + towards * d), method)


def lagged_gap(d: float, method: str = "backward_euler") -> Made:
    """E4, below its rest by d of the range 400 to 933 K."""
    T = T_STAR - d * 533.0
    return (lumped(T, method), shrinking(T)), start(T, gap_of(T))


def joined(d: float, dirichlet_first: bool = True) -> Made:
    """E5: a skin of 1 cm on both sides of the joint d * 100 K warmer; aluminium is given the temperature, or steel."""
    one, other = (ALUMINIUM, STEEL) if dirichlet_first else (STEEL, ALUMINIUM)
    warm = skin(d)
    halves = takes_flow(other, warm), takes_temperature(one, warm)
    return halves, first(warm[-1:] + SHIFT, np.zeros((1, 2)))


def skin(d: float) -> Array:
    """(50,) first temperatures of either bar of E5, the joint last."""
    return 100.0 * d * np.maximum(0.0, 1.0 - (49 - np.arange(50)) / 5.0)


def joint_at(d: float, t: float) -> Array:
    """Of E5, exact in time: the temperature of the joint at t [s], told with the shift."""
    (M, K), n = together(ALUMINIUM, STEEL), ALUMINIUM.n
    warm = np.concatenate([skin(d), skin(d)[-2::-1]])
    return (expm(-t * np.linalg.solve(M, K)) @ warm)[n - 1:n] + SHIFT


def e5_limit() -> float:
    """The step at which plain iteration, aluminium given the temperature, contracts by 1 [s]."""
    return float(brentq(lambda dt: ratio(ALUMINIUM, STEEL, dt) - 1.0, 1e-4, 1e-1))


# D9: rest is T_B 400 at d 600 um.  D13: rest is T 349.74 at p 1.797 MPa.
D9 = Rod(lambda x, p: (500.0 * (1.0 - min(max(x / 1e-3, 0.0), 1.0)), 0.0), n=20, L=0.1, k=10.0, rho_c=1e6, T_left=600.0,
         T_w=300.0, shift=0.0)
D9_GROWTH = Growth(1e-3, 2e-6, 300.0)
D13 = Rod(lambda x, p: (0.0, 0.0) if p >= 0.0 else (1000.0 - 2e-4 * p, 0.0), n=80, L=0.1, k=45.0, rho_c=7850.0 * 460.0,
          T_left=500.0, T_w=300.0, shift=0.0)
D13_GROWTH = Growth(60e-6, 1.2e-6, 300.0, 2e9 / 0.1)


def clearance(d: float, method: str = "sdirk2") -> Made:
    """D9, warmer than at rest by d of 300 K, where its tip is free to be."""
    T = 600.0 - 200.0 * along(D9.n) + 300.0 * d * np.sin(np.pi / 2.0 * along(D9.n))
    return rod(D9, D9_GROWTH, T, method)


def closing(d: float, method: str = "sdirk2") -> Made:
    """D13, cooler than at rest by d of 200 K: from .13 on it starts apart."""
    T = 500.0 - 150.25915 * along(D13.n) - 200.0 * d * np.sin(np.pi / 2.0 * along(D13.n))
    return rod(D13, D13_GROWTH, T, method)


CASES = {case.name: case for case in (
    Case("E1", bar, 2.0 / (1.0 + DELTA), True, moved, 90.0, lambda d, t: np.zeros(4)),
    Case("E3b", nudged, 1.0, False, temperatures, 30.0, how=DAMPED),
    Case("E3c", chatter, e3c_limit("backward_euler"), True, temperatures, 3.0, how=DAMPED),
    Case("E4", lagged_gap, 2.0 / (B_LAG - A_LAG), True, temperatures, 100.0, how=DAMPED),
    Case("E4 midpoint", lambda d: lagged_gap(d, "midpoint"), 2.0 / B_LAG, True, temperatures, 100.0),
    Case("E5", joined, e5_limit(), True, temperatures, 0.0, joint_at, DAMPED),
    Case("D9", clearance, 1000.0, False, temperatures, 5000.0, how=DAMPED),
    Case("D13", closing, 802.0, False, temperatures, 4000.0, how=DAMPED),
)}
