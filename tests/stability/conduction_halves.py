"""Two bars end to end, one a half: it is given a temperature and tells a heat flow, or the other way (case E5).

Linear elements, consistent storage, backward Euler, far ends held at 0.  x[0, 1] is the heat flow over a step into
the one that tells its temperature, in MW/m2; T[0] is the temperature of the joint + 1000.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "coupler"))
from fake_halves import T_IN, T_OUT, X_IN, X_OUT, FakeHalf, blocks_of

Array = NDArray[np.float64]
SHIFT, MEGA = 1000.0, 1e6


@dataclass(frozen=True)
class Bar:
    """k [W/mK], rho_c [J/m3K], n cells along L [m].  Free nodes run from beside the far end to the joint."""

    k: float
    rho_c: float
    n: int = 50
    L: float = 0.1
    _kept: dict[float, tuple[Array, Array]] = field(default_factory=dict, compare=False)

    def system(self, dt: float) -> tuple[Array, Array]:
        """M/dt + K and M/dt of the free nodes, (n, n) [W/m2K]."""
        if dt not in self._kept:
            M, K = self.matrices
            self._kept[dt] = (M / dt + K, M / dt)
        return self._kept[dt]

    @property
    def matrices(self) -> tuple[Array, Array]:
        """Storage M [J/m2K] and conduction K [W/m2K] of the free nodes, (n, n)."""
        h, n = self.L / self.n, self.n
        M, K = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
        for i in range(n):
            M[i:i + 2, i:i + 2] += self.rho_c * h / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
            K[i:i + 2, i:i + 2] += self.k / h * np.array([[1.0, -1.0], [-1.0, 1.0]])
        return M[1:, 1:], K[1:, 1:]

    def stiffness(self, dt: float) -> float:
        """Heat flow into the joint that warms it by 1 K within a step [W/m2K]."""
        return float(1.0 / np.linalg.inv(self.system(dt)[0])[-1, -1])


ALUMINIUM, STEEL = Bar(210.0, 2.75e6), Bar(45.0, 3.744e6)


def ratio(dirichlet: Bar, neumann: Bar, dt: float) -> float:
    """What plain iteration multiplies a difference by, with the other sign."""
    return dirichlet.stiffness(dt) / neumann.stiffness(dt)


def together(one: Bar, other: Bar) -> tuple[Array, Array]:
    """M and K of both as one bar, from beside one's far end over the joint, node n - 1, to beside the other's."""
    n = one.n
    whole = np.zeros((2, n + other.n - 1, n + other.n - 1))
    back = np.arange(n + other.n - 2, n - 2, -1)
    for sums, own, others in zip(whole, one.matrices, other.matrices, strict=True):
        sums[:n, :n] += own
        sums[np.ix_(back, back)] += others
    return whole[0], whole[1]


def takes_flow(bar: Bar, T: Array) -> FakeHalf:
    """The thermal half: given a heat flow it tells the temperature of the joint.  T : (n,) free nodes at first."""

    def rule(state: Array, inputs: dict[str, Array], t: float, h: float) -> tuple[Array, dict[str, Array]]:
        A, storage = bar.system(h)
        b = storage @ state
        b[-1] += MEGA * float(inputs["x"][0, 1])
        new = np.linalg.solve(A, b)
        return new, {"T": new[-1:] + SHIFT}

    return FakeHalf("takes flow", blocks_of(T_OUT, X_IN), rule, np.array(T, dtype=float))


def takes_temperature(bar: Bar, T: Array) -> FakeHalf:
    """The other: given the temperature of the joint at the end of the step it tells the flow out of it."""

    def rule(state: Array, inputs: dict[str, Array], t: float, h: float) -> tuple[Array, dict[str, Array]]:
        A, storage = bar.system(h)
        joint, b = float(inputs["T"][0]) - SHIFT, storage @ state
        free = np.linalg.solve(A[:-1, :-1], b[:-1] - A[:-1, -1] * joint)
        new = np.append(free, joint)
        flow = float(b[-1] - A[-1] @ new)
        return new, {"x": np.array([[0.0, flow / MEGA]])}

    return FakeHalf("takes temperature", blocks_of(T_IN, X_OUT), rule, np.array(T, dtype=float))
