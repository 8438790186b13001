"""Heat and deformation of two bodies that face each other along a line, as one system: no staggering, no search.

A reference for small strains on a mesh of triangles whose two sides match node by node: linear conduction and plane
strain with thermal expansion, a penalty at the two Gauss points of every edge, conductance from pressure or gap there,
backward Euler, all unknowns (T, u) of a step by one Newton iteration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface

Floats = NDArray[np.float64]
GAUSS = 0.5 + np.array([-1.0, 1.0]) / np.sqrt(12.0)


@dataclass(frozen=True)
class Matter:
    """k [W/mK], rho_c [J/m3K], E [Pa], nu, alpha [1/K], T_ref [K]."""

    k: float
    rho_c: float
    E: float
    nu: float
    alpha: float
    T_ref: float


@dataclass(frozen=True)
class Line:
    """Where the bodies face each other: slave, master (n,) nodes one above the other; eps_N [Pa/m];
    closed, opened : conductance [W/m2K] from pressure [Pa], from gap [m]."""

    slave: NDArray[np.intp]
    master: NDArray[np.intp]
    eps_N: float
    closed: Callable[[Floats], Floats]
    opened: Callable[[Floats], Floats]


@dataclass(frozen=True)
class Held:
    """Unknowns that are prescribed: T nodes and values [K], degrees of freedom of u held at zero."""

    T_nodes: NDArray[np.intp]
    T: Floats
    dofs: NDArray[np.intp]


def linear_parts(interface: Interface, m: Matter) -> tuple[Floats, Floats, Floats, Floats]:
    """Capacity C, conduction K : (n, n), stiffness S : (2n, 2n), and B : (2n, n), forces of expansion by T."""
    n = len(interface.nodes)
    C, K, S, B = np.zeros((n, n)), np.zeros((n, n)), np.zeros((2 * n, 2 * n)), np.zeros((2 * n, n))
    D = m.E / ((1 + m.nu) * (1 - 2 * m.nu)) * np.array(
        [[1 - m.nu, m.nu, 0.0], [m.nu, 1 - m.nu, 0.0], [0.0, 0.0, 0.5 - m.nu]])
    heat = D @ [1.0, 1.0, 0.0] * (1 + m.nu) * m.alpha
    for cell in interface.triangles:
        P = interface.nodes[cell]
        J = np.column_stack([P[1] - P[0], P[2] - P[0]])
        area = 0.5 * np.linalg.det(J)
        G = np.linalg.inv(J).T @ np.array([[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])
        strain = np.zeros((3, 6))
        strain[0, 0::2], strain[1, 1::2], strain[2, 0::2], strain[2, 1::2] = G[0], G[1], G[1], G[0]
        dofs = (2 * cell[:, None] + [0, 1]).ravel()
        C[np.ix_(cell, cell)] += m.rho_c * area / 3.0 * np.eye(3)
        K[np.ix_(cell, cell)] += m.k * area * G.T @ G
        S[np.ix_(dofs, dofs)] += area * strain.T @ D @ strain
        B[np.ix_(dofs, cell)] += area / 3.0 * np.outer(strain.T @ heat, np.ones(3))
    return C, K, S, B


def across(line: Line, X: Floats, z: Floats) -> Floats:
    """What crosses the line, (4, n): heat into the slave's and the master's nodes [W], force on them along y [N].

    X : (n_nodes, 2) [m].  z : (4, n): T of slave and master, u_y of slave and master.  The slave lies above.
    """
    out = np.zeros_like(z)
    n = z.shape[1]
    ends = np.stack([np.arange(n - 1), np.arange(1, n)])
    A = 0.5 * np.abs(np.diff(X[line.slave, 0]))
    N = np.stack([1.0 - GAUSS, GAUSS])
    gap = (X[line.slave, 1] - X[line.master, 1]) + z[2] - z[3]
    g = np.einsum("aq,ae->qe", N, gap[ends])
    # Where surfaces part within an edge the pressure is that up to there: two points on either side of it.
    first, last = gap[ends]
    part = np.where(first * last < 0.0, first / np.where(first == last, 1.0, first - last), 1.0)
    xi = np.concatenate([part * GAUSS[:, None], part + (1.0 - part) * GAUSS[:, None]])
    weight = np.concatenate([np.tile(A * part, (2, 1)), np.tile(A * (1.0 - part), (2, 1))])
    p = line.eps_N * np.maximum(-((1.0 - xi) * first + xi * last), 0.0) * weight
    pushed, faced = np.zeros(n), np.zeros(n)
    for a, share in enumerate((1.0 - xi, xi)):
        np.add.at(pushed, ends[a], (share * p).sum(axis=0))
        np.add.at(faced, ends[a], N[a].sum() * A)
    p_N = np.einsum("aq,ae->qe", N, (pushed / faced)[ends])
    h = np.where(touched(gap)[ends].any(axis=0), line.closed(p_N), line.opened(np.maximum(g, 0.0)))
    q = h * A * np.einsum("aq,ae->qe", N, (z[1] - z[0])[ends])
    for a in range(2):
        np.add.at(out[0], ends[a], (N[a][:, None] * q).sum(axis=0))
    out[2] = pushed
    out[1], out[3] = -out[0], -out[2]
    return out


def touched(gap: Floats) -> NDArray[np.bool_]:
    """(n,) whether a node has a pressure, however small: one that overlaps presses on its neighbours' edges too."""
    over = gap < 0.0
    over[1:] |= gap[:-1] < 0.0
    over[:-1] |= gap[1:] < 0.0
    return over


class Monolithic:
    """One step at a time; dt = inf is the steady state."""

    def __init__(self, interface: Interface, matter: Matter, line: Line, held: Held) -> None:
        self.X, self.line, self.held = interface.nodes, line, held
        self.n, self.T_ref = len(interface.nodes), matter.T_ref
        self.C, self.K, self.S, self.B = linear_parts(interface, matter)
        self.at = np.stack([line.slave, line.master, self.n + 2 * line.slave + 1, self.n + 2 * line.master + 1])
        self.fixed = np.concatenate([held.T_nodes, self.n + held.dofs])
        self.values = np.concatenate([held.T, np.zeros(held.dofs.size)])

    def step(self, before: Floats, dt: float) -> Floats:
        """Unknowns (T, u) : (3 n,) a step of dt [s] later.  Raises RuntimeError where Newton does not converge."""
        n = self.n
        A = np.zeros((3 * n, 3 * n))
        A[:n, :n] = self.C / dt + self.K
        A[n:, n:], A[n:, :n] = self.S, -self.B
        b = np.concatenate([self.C @ before[:n] / dt, -self.B @ np.full(n, self.T_ref)])
        z = before.copy()
        z[self.fixed] = self.values
        scale = np.concatenate([np.full(n, np.abs(self.K @ z[:n]).sum()), np.full(2 * n, np.abs(self.B).sum())])
        for _ in range(60):
            r = b - A @ z
            r[self.at] += across(self.line, self.X, z[self.at])
            r[self.fixed] = 0.0
            if np.abs(r / scale).max() < 1e-13:
                return z
            tangent = A - self._of_line(z)
            tangent[self.fixed] = 0.0
            tangent[self.fixed, self.fixed] = 1.0
            z = z + np.linalg.solve(tangent, r)
        raise RuntimeError(f"60 iterations leave {np.abs(r / scale).max():.1e}")

    def _of_line(self, z: Floats) -> Floats:
        """Derivative of what crosses the line, by differences: it is of 4 n_line unknowns only."""
        found, zc = np.zeros((3 * self.n, 3 * self.n)), z[self.at]
        for i in range(4):
            for k in range(zc.shape[1]):
                h = 1e-4 if i < 2 else 1e-14
                ahead, behind = zc.copy(), zc.copy()
                ahead[i, k] += h
                behind[i, k] -= h
                change = (across(self.line, self.X, ahead) - across(self.line, self.X, behind)) / (2.0 * h)
                found[self.at.ravel(), self.at[i, k]] = change.ravel()
        return found
