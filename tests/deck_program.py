"""A program of the tests' own: reads deck.json, solves, writes results.json.  It shares no code with the halves.

    python deck_program.py

Heat: a step of implicit Euler with bilinear quads, mass shared among nodes (`lumped` for mass at nodes).  Deformation:
small strains, plane strain, thermal expansion.  What is prescribed is given back as heat or force.
"""

import json
from pathlib import Path

import numpy as np

GAUSS = [(a, b) for a in (-(3**-0.5), 3**-0.5) for b in (-(3**-0.5), 3**-0.5)]


def gradients(X, xi, eta):
    """N (4,), gradients (4, 2), area of a point of a quad X : (4, 2)."""
    s, t = np.array([-1, 1, 1, -1]), np.array([-1, -1, 1, 1])
    dN = np.stack([s * (1 + t * eta), t * (1 + s * xi)], axis=1) / 4
    J = X.T @ dN
    return (1 + s * xi) * (1 + t * eta) / 4, dN @ np.linalg.inv(J), np.linalg.det(J)


def solved(A, b, fixed, values):
    """x with x[fixed] = values, and A x - b at the fixed places."""
    free = np.setdiff1d(np.arange(len(b)), fixed)
    x = np.zeros(len(b))
    x[fixed] = values
    x[free] = np.linalg.solve(A[np.ix_(free, free)], b[free] - A[np.ix_(free, fixed)] @ x[fixed])
    return x, A[fixed] @ x - b[fixed]


def heat(deck):
    x, T = np.array(deck["x"]), np.array(deck["T"])
    n = len(x)
    M, K = np.zeros((n, n)), np.zeros((n, n))
    for cell, part in zip(deck["quads"], deck["parts"], strict=True):
        k, rho_c = deck["materials"][part]
        at = np.ix_(cell, cell)
        for xi, eta in GAUSS:
            N, G, dA = gradients(x[cell], xi, eta)
            K[at] += k * dA * G @ G.T
            M[at] += rho_c * dA * (np.diag(N) if deck["lumped"] else np.outer(N, N))
    fixed = np.array(deck["nodes"], dtype=int)
    T_end, q = solved(M / deck["dt"] + K, M @ T / deck["dt"] + deck["heat"], fixed, np.array(deck["T_nodes"]))
    return {"T": T_end.tolist(), "heat": (q + np.array(deck["heat"])[fixed]).tolist()}


def deform(deck):
    X, T = np.array(deck["x"]), np.array(deck["T"])
    n = len(X)
    K, b = np.zeros((2 * n, 2 * n)), np.array(deck["force"], dtype=float).ravel()
    for cell, part in zip(deck["quads"], deck["parts"], strict=True):
        E, nu, alpha, T_ref = deck["materials"][part]
        lam, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
        C = np.array([[lam + 2 * mu, lam, 0], [lam, lam + 2 * mu, 0], [0, 0, mu]])
        dofs = np.array([[2 * i, 2 * i + 1] for i in cell]).ravel()
        # The mean temperature of a cell, as ours: it expands as a whole.
        free = (3 * lam + 2 * mu) * alpha * (T[cell].mean() - T_ref) * np.array([1.0, 1.0, 0.0])
        for xi, eta in GAUSS:
            _, G, dA = gradients(X[cell], xi, eta)
            B = np.zeros((3, 8))
            B[0, ::2], B[1, 1::2], B[2, ::2], B[2, 1::2] = G[:, 0], G[:, 1], G[:, 1], G[:, 0]
            K[np.ix_(dofs, dofs)] += dA * B.T @ C @ B
            b[dofs] += dA * B.T @ free
    fixed = np.array(deck["fixed"], dtype=int)
    u, f = solved(K, b, fixed, np.array(deck["u_fixed"]))
    return {"u": u.reshape(-1, 2).tolist(), "reaction": f.tolist()}


if __name__ == "__main__":
    stated = json.loads(Path("deck.json").read_text())
    Path("results.json").write_text(json.dumps({"heat": heat, "deform": deform}[stated["kind"]](stated)))
