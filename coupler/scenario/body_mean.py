"""The mean over a body: what each of its nodes counts for."""

from __future__ import annotations

import numpy as np

from contact.half.interface import Interface
from coupler.scenario.body_mesh import Floats, Ints

GAUSS = 1 / np.sqrt(3)


def body_mean(interface: Interface, body: str) -> tuple[Ints, Floats]:
    """Nodes and weights of the mean over a body: integral of N_i dV over V, reference; dV = dA or r dA.

    body : one of interface.bodies.  Exact for cells of any shape: N_i r det J has degree 3 along each side.
    """
    number = interface.bodies.index(body)
    quads = interface.quads[interface.quad_body == number]
    triangles = interface.triangles[interface.triangle_body == number]
    shares = [_of_quads(interface.nodes[quads], interface.axisymmetric),
              _of_triangles(interface.nodes[triangles], interface.axisymmetric)]
    nodes, where = np.unique(np.concatenate([quads.ravel(), triangles.ravel()]), return_inverse=True)
    weights = np.bincount(where, weights=np.concatenate([s.ravel() for s in shares]))
    return nodes.astype(np.int32), weights / weights.sum()


def _of_quads(x: Floats, axisymmetric: bool) -> Floats:
    """Integrals of N_i dV, (n, 4), of quads with corners x : (n, 4, 2)."""
    share = np.zeros(x.shape[:2])
    a, b = np.array([-1, 1, 1, -1]), np.array([-1, -1, 1, 1])
    for xi, eta in ((i * GAUSS, j * GAUSS) for i in (-1, 1) for j in (-1, 1)):
        N = (1 + a * xi) * (1 + b * eta) / 4
        along = np.einsum("i,nik->nk", a * (1 + b * eta) / 4, x)
        across = np.einsum("i,nik->nk", b * (1 + a * xi) / 4, x)
        volume = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
        if axisymmetric:
            # fault: mean over a cylinder as over a plate -> volume = volume * 1.0 | coupler/test_scenario_probes
            volume = volume * (x[:, :, 0] @ N)
        share += volume[:, None] * N
    return share


def _of_triangles(x: Floats, axisymmetric: bool) -> Floats:
    """Integrals of N_i dV, (n, 3), of triangles with corners x : (n, 3, 2)."""
    one, two = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    area = (one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]) / 2
    r = x[:, :, 0] if axisymmetric else np.ones(x.shape[:2])
    return np.asarray(area[:, None] * (r + r.sum(axis=1, keepdims=True)) / 12)
