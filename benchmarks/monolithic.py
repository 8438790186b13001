"""Both fields by one Newton iteration, as a reference of another method: E1, E4, D13 and the casting in one dimension.

    python benchmarks/monolithic.py

Nothing is exchanged: a step is one nonlinear system in all unknowns, of the midpoint rule (E1, E4) or of backward Euler
(D13, casting), differentiated by differences.  tests/scenarios/monolithic.py is the same for bodies in the plane.
What is printed are numbers of the cases at a time, by step, beside those of the page that the coupler is held to.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scene import pin, table

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "stability"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "coupler"))

Array = NDArray[np.float64]
System = Callable[[Array, Array, float], Array]  # unknowns at the start and the end of a step of dt -> residual


def step(system: System, z: Array, dt: float, scale: Array) -> Array:
    """The unknowns dt [s] later.  scale : (n,) of the unknowns, for differences and the end of the iteration.

    Raises RuntimeError where 200 iterations do not end.
    """
    new = z.copy()
    for _ in range(200):
        r = system(z, new, dt)
        J = np.empty((len(z), len(z)))
        for i in range(len(z)):
            ahead = new.copy()
            ahead[i] += 1e-7 * scale[i]
            J[:, i] = (system(z, ahead, dt) - r) / (1e-7 * scale[i])
        change = np.linalg.solve(J, -r)
        new = new + change
        if np.abs(change / scale).max() < 1e-9:
            return new
    raise RuntimeError("200 iterations do not end")


def bar(k: float, delta: float) -> System:
    """E1, one wave number: U, V, Theta by the midpoint rule."""

    def system(z: Array, new: Array, dt: float) -> Array:
        (u, v, T), (nu, nv, nT) = z, new
        mu, mv, mT = 0.5 * (z + new)
        return np.array([nu - u - dt * mv, nv - v - dt * (-k**2 * mu + k * mT),
                         nT - T - dt * (-k**2 * mT - delta * k * mv)])

    return system


def lumped_gap() -> System:
    """E4: T and gap; the gap at the middle of the step is that of the temperature there."""
    from fake_halves import G_M, K_G, T_S, T_W, C, G, gap_of

    def system(z: Array, new: Array, dt: float) -> Array:
        T, g = 0.5 * (z + new)
        flow = G * (T_S - T) - K_G / (max(g, 0.0) + G_M) * (T - T_W)
        return np.array([(C * (new[0] - z[0]) - dt * flow) / C, (new[1] - gap_of(new[0])) * 1e6])

    return system


def closing_rod() -> System:
    """D13: temperatures of the free nodes, and the gap (negative: what pressure takes up)."""
    from cases import D13, D13_GROWTH

    M, K = D13.matrices

    def system(z: Array, new: Array, dt: float) -> Array:
        T = np.append(D13.T_left, new[:-1])
        gap, _ = D13_GROWTH.told(T)
        at = -D13_GROWTH.stiffness * max(-new[-1], 0.0)
        h, s = D13.law(float(new[-1]), at)
        r = M[1:, 1:] @ (new[:-1] - z[:-1]) / dt + (K @ T)[1:]
        r[-1] += h * (T[-1] - D13.T_w) + s
        return np.append(r / K[1, 1], (new[-1] - gap) * 1e6)

    return system


def casting(n: int) -> System:
    """The freezing rod: s of the nodes, and the gap."""
    from freezing_halves import G_M, K_G, LATENT, Freezing, gap_of, parts

    rod = Freezing(n)

    def system(z: Array, new: Array, dt: float) -> Array:
        T, f, H = parts(new[:-1])
        flow, _ = rod.flow(new[:-1], K_G / (max(float(new[-1]), 0.0) + G_M))
        r = (H - parts(z[:-1])[2]) / LATENT - dt * flow / (rod.mass * LATENT)
        return np.append(r, (new[-1] - gap_of(T, f)) * 1e6)

    return system


def march(system: System, z: Array, times: Array, scale: Array) -> Array:
    for t0, t1 in pairwise(times):
        z = step(system, z, float(t1 - t0), scale)
    return z


def rows() -> list[dict[str, str]]:
    """Case, step, what is found and what the page has."""
    from bar_halves import DELTA
    from cases import D13
    from fake_halves import gap_of
    from freezing_halves import MUSH, T_0, parts, share_solid

    found = []
    for n in (40, 80, 160):
        z = march(lumped_gap(), np.array([840.0, gap_of(840.0)]), np.linspace(0.0, 20.0, n + 1), np.array([1.0, 1e-6]))
        found.append({"case": "E8", "steps": str(n), "found": f"T {z[0]:.9f}", "page": "831.718602253"})
    for dt in (1.0, 5.0, 50.0):
        z = march(bar(1.0, DELTA), np.array([1.0, 0.0, 0.0]), dt * np.arange(101), np.ones(3))
        found.append({"case": "E1", "steps": f"100 of {dt:g}", "found": f"size {np.linalg.norm(z):.2e}",
                      "page": "decays at every step"})
    for n in (100, 200):
        z = np.append(np.full(D13.n, 300.0), 60e-6)
        z = march(closing_rod(), z, 50.0 * np.linspace(0.0, 1.0, n + 1), np.append(np.ones(D13.n), 1e-6))
        found.append({"case": "D13", "steps": str(n), "found": f"T {z[-2]:.3f} p {-2e4 * min(z[-1], 0):.4f} MPa",
                      "page": "301.514, .1510 MPa at 50 s"})
    for n in (25, 50):
        z = march(casting(n), np.append(np.full(n + 1, T_0 + MUSH), 0.0), graded(n), np.append(np.ones(n + 1), 1e-6))
        solid = share_solid(parts(z[:-1])[1])
        found.append({"case": "F2-1D", "steps": f"{4 * n}, {n} cells", "found": f"{solid:.4f} gap {1e6 * z[-1]:.2f} um",
                      "page": ".1234, 55.7 um at 5 s"})
    return found


def graded(n: int) -> Array:
    """Times up to 5 s, half of the steps in the first second."""
    return np.concatenate([np.linspace(0.0, 1.0, 2 * n + 1)[:-1], np.linspace(1.0, 5.0, 2 * n + 1)])


def main() -> None:
    pin()
    print(table(rows()))


if __name__ == "__main__":
    main()
