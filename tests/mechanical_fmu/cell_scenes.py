"""Cells alone: a volume, what holds and pulls it, and a plain Newton's method, for tests of elements."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.sparse.linalg import splu

from contact.half.interface import Interface
from contact.half.linalg import pattern_of
from mechanical_fmu.cells import Treatment, cells_of
from mechanical_fmu.laws.catalogue import POINT
from mechanical_fmu.laws.law import PLASTIC
from mechanical_fmu.material import Moduli
from mechanical_fmu.volume import DeformableMesh, PointStep

EXPECTED = tomllib.loads((Path(__file__).parent.parent / "expected.toml").read_text(encoding="utf-8"))
MOST = 40
NO_TRIANGLES = np.empty((0, 3), np.int32)
# The formulations of a plane scene, each with the cells it exists for.
PLANE = {"mean dilatation": Treatment(), "enhanced": Treatment(enhanced=True),
         "plane stress": Treatment(plane_stress=True), "enhanced plane stress": Treatment(0, True, True)}


def of(treatment, plastic):
    return replace(treatment, kind=PLASTIC if plastic else 0)


def quads(nodes, cells, geometry="plane", body=None):
    """An interface of quads only."""
    body = np.zeros(len(cells), np.int32) if body is None else np.asarray(body, np.int32)
    names = tuple(f"b{i}" for i in range(body.max() + 1))
    return Interface(geometry, np.asarray(nodes, float), np.asarray(cells, np.int32), NO_TRIANGLES, body,
                     np.empty(0, np.int32), names, ("m",) * len(names), {}, {}, ())


def grid(n, m, map_=lambda s, t: (s, t)):
    """Nodes (s fastest last) and quads of the unit square cut n by m, mapped; node (i, j) is i (m + 1) + j."""
    s, t = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, m + 1), indexing="ij")
    number = np.arange((n + 1) * (m + 1)).reshape(n + 1, m + 1)
    cells = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 4)
    return np.stack(map_(s.ravel(), t.ravel()), axis=1), cells


def volume_of(interface, *treatments):
    return DeformableMesh(cells_of(interface, treatments), len(interface.nodes))


@dataclass(frozen=True)
class Stuff:
    """A material: E [Pa], nu, free linear strain, and for plastic points yield stress and modulus dR/de."""

    E: float
    nu: float
    free: float = 0.0
    yield_stress: float = np.inf
    H: float = 0.0


def moduli_of(volume, *stuffs):
    """Moduli of every kind; one material a body."""
    out = []
    for cells in volume.kinds:
        E, nu, free, yield_stress, H = (np.array([getattr(s, name) for s in stuffs])[cells.body]
                                        for name in ("E", "nu", "free", "yield_stress", "H"))
        mu = E / 2 / (1 + nu)
        p = np.zeros(len(mu), POINT)
        p["shear_modulus"], p["plastic_heat"], p["solid_fraction"], p["hardening_modulus"] = mu, 0.9, 1.0, H
        p["yield_stress"] = np.minimum(yield_stress, 1e300)
        out.append(Moduli(mu, E / 3 / (1 - 2 * nu), 3 * np.log(1 + free)[:, None], p))
    return tuple(out)


@dataclass(frozen=True)
class Found:
    """Equilibrium.  r : (n_nodes, 2) what holds it.  residuals : of every iterate, relative.  step : for the stress."""

    u: np.ndarray
    r: np.ndarray
    residuals: list
    history: np.ndarray
    heat: np.ndarray
    step: PointStep


def equilibrium(volume, moduli, held, force=None, start=None, tolerance=1e-12, floor=1e-300):
    """held : {(node, component): u}.  force : (n_nodes, 2) dead.  start : a Found to go on from.

    tolerance : of r relative to the forces of supports and loads, or to floor [N] where they are less.
    """
    n = 2 * volume.n_nodes
    pattern = pattern_of(n, *(cells.dofs for cells in volume.kinds))
    fixed = np.array([2 * node + i for node, i in held], int)
    free = np.setdiff1d(np.arange(n), fixed)
    u = np.zeros(n) if start is None else start.u.ravel().copy()
    step = PointStep(1.0) if start is None else PointStep(1.0, start.history)
    target = np.array(list(held.values()))
    f = np.zeros(n) if force is None else np.asarray(force, float).ravel()
    residuals, gap = [], target - u[fixed]
    while True:
        found = volume.evaluate(u.reshape(-1, 2), moduli, step, tangent=True)
        r = found.f.ravel() - f
        scale = max(np.abs(r[fixed]).max(initial=0), np.abs(f).max(), floor)
        residuals.append(np.abs(r[free]).max(initial=0) / scale)
        if len(residuals) > 1 and residuals[-1] <= tolerance:
            return Found(u.reshape(-1, 2), r.reshape(-1, 2), residuals, found.history, found.heat, step)
        assert len(residuals) <= MOST, residuals
        K = pattern.matrix(found.entries).tocsc()
        d = np.zeros(n)
        d[fixed] = gap
        d[free] = splu(K[free][:, free]).solve(-(r + K @ d)[free])
        u, gap = u + d, np.zeros_like(gap)


def distorted(nodes):
    """Move the inner nodes of the unit square, and put it 1 to 2 m from the axis."""
    x, y = nodes.T
    bump = np.sin(np.pi * x) * np.sin(np.pi * y)
    return np.stack([1.0 + x + 0.08 * bump * np.cos(7 * y), y + 0.08 * bump * np.sin(5 * x)], axis=1)


def mesh(kind="quads", geometry="plane", n=4):
    """A distorted square of one body, of quads or triangles."""
    nodes, cells = grid(n, n)
    if kind == "quads":
        return quads(distorted(nodes), cells, geometry)
    halves = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]]).astype(np.int32)
    return replace(quads(distorted(nodes), cells, geometry), quads=np.empty((0, 4), np.int32),
                   quad_body=np.empty(0, np.int32), triangles=halves, triangle_body=np.zeros(len(halves), np.int32))


def rim(n):
    """Node numbers on the edge of an n by n grid."""
    number = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    return np.unique(np.concatenate([number[0], number[-1], number[:, 0], number[:, -1]]))
