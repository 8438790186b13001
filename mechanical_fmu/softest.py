"""How much of the stiffness that loads leave to the bodies is made by cells that are too large.

A column under nine tenths of Euler's load has a tenth of its stiffness left against bending, and bends ten times as
far as it would without the load.  Cells that bend by a twentieth too stiffly leave it a half more than that; cells that
bend by a tenth too stiffly hide that it buckles.  Its stress tells nothing of that while it is straight.  So motions
are looked for against which the bodies are softest: those of least dx K dx, K with all forces, as unstable.py has it.
Of such a motion the cells' strain has a stress by linear elasticity, with the energy W, and a smoother stress is
recovered at nodes from it, which says how much W the mesh misses, that is, makes too much: m (recovery.py).  The
stiffness that is left, w = dx K dx/2, is too large by the same m.  Of what a body resists with, loads leave w/W on the
mesh, and (w - m)/(W - m) of the body; what the mesh makes of it is

    1 - (w - m)/(W - m) W/w = (m/w - m/W)/(1 - m/W),

0 without stress (what a mesh misses then is told by its stress), 1 where the bodies would leave their equilibrium by
themselves on a mesh that bends as they do, and below 0 where cells are too soft.  Motions from cell to cell, which a
mesh has and a body has not, are left out: their stress is all missed, and the next finer mesh has others.  Of
motions of a single row of cells of one dilatation nothing is known: no pressure across the row is (recovery.py).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from contact.half.linalg import SingularMatrixError, factorise
from mechanical_fmu.cells import ELASTIC, QUAD, Cells
from mechanical_fmu.material import Moduli
from mechanical_fmu.recovery import Stressed, energies, missed_energy
from mechanical_fmu.system import Loading, System

Floats = NDArray[np.float64]

MOTIONS = 4  # so many are looked at: a scene may have several bodies that are soft
TURNS = 5  # of inverse iteration, from motions at random, the same each time
STRAIN = 1e-6  # largest that a motion is given
ROUGH = 0.1  # of the square of a motion: what a field fitted to cells leaves of one that goes from cell to cell
LEFT = 0.95  # of the energy of a motion: loads that leave more of it hardly soften it
UNKNOWN = -1.0
IN_A_ROW = 0.1  # of the energy of a motion: what is in cells of which the mesh does not tell what they miss
LEAST = -0.9  # is told of cells that are softer still: -1 is what is not known


def stiffness_off(system: System, K: csr_matrix, u: Floats, loading: Loading) -> float:
    """Return the largest such share of the softest motions [1], but no less than LEAST, at u : (n_nodes, 2) [m].

    UNKNOWN where one is of a single row of quads of one dilatation.

    K : (2 n_nodes, 2 n_nodes) [N/m], symmetric, positive, what is prescribed held.  loading : its moduli and history.
    Raises ArithmeticError.
    """
    volume, plane = system.volume, not system.interface.axisymmetric
    worst, n_bodies = 0.0, len(system.interface.bodies)
    for motion in _softest(K, system.constraints.free).T:
        dx = motion.reshape(-1, 2)
        # fault: what goes from cell to cell counts as a motion of bodies -> rough = 0.0 | mechanical_fmu/test_softest
        rough = _rough(system, dx)
        if rough > ROUGH:
            continue
        stress, dilatation = motion_stress(system, u, dx, loading)
        W = sum(0.5 * float(energies(of, m, c.weight).sum())
                for c, of, m in zip(volume.kinds, stress, loading.moduli, strict=True))
        w = 0.5 * float(motion @ (K @ motion))
        # fault: loads that stiffen are taken to soften -> if w <= 0.0: | mechanical_fmu/test_softest
        if not 0.0 < w < LEFT * W:
            continue
        if _in_a_row(system, stress, loading) > IN_A_ROW:
            return UNKNOWN
        of = Stressed(stress, dilatation, system.nodal_stress, [np.zeros(c.weight.shape) for c in volume.kinds])
        m = float(missed_energy(volume.kinds, of, loading.moduli, len(u), n_bodies, plane, signed=True)[0].sum())
        if m < W:
            worst = max(worst, (m / w - m / W) / (1.0 - m / W), key=abs)
    return max(worst, LEAST)


def _softest(K: csr_matrix, free: Floats) -> Floats:
    """(n, MOTIONS) of least x K x/(x D x), D its diagonal, each with x D x = 1; fewer in a scene of fewer unknowns."""
    some = min(MOTIONS, int(free.sum()))
    if not some:
        return np.empty((len(free), 0))
    solve, D = factorise(K, True), np.abs(K.diagonal())
    root = np.sqrt(np.maximum(D, np.finfo(float).tiny))[:, None]
    x = np.random.default_rng(0).standard_normal((len(D), some)) * free[:, None]
    for _ in range(TURNS):
        y = np.stack([solve(column) for column in (D[:, None] * x).T], axis=1) * free[:, None]
        if not np.isfinite(y).all():
            raise SingularMatrixError("the stiffness matrix is singular")
        # Motions that nothing resists are all that is left of each, and roots of D make them lengths.
        y = np.linalg.qr(root * y)[0] / root
        x = y @ np.linalg.eigh(y.T @ (K @ y))[1]
    return np.asarray(x)


def _rough(system: System, dx: Floats) -> float:
    """Return the share of the square of a motion that a field fitted to the means of cells does not have."""
    fit, interface = system.nodal_stress, system.interface
    means = np.concatenate([dx[cells].mean(axis=1) for cells in (interface.quads, interface.triangles)])
    at = dx[fit.node]
    return float(((fit.fit @ means - at) ** 2).sum() / max(float((at**2).sum()), np.finfo(float).tiny))


def _in_a_row(system: System, stress: list[Floats], loading: Loading) -> float:
    """Return the share of the energy of stress : (n_e, nq, 4) [Pa] in single rows of quads of one dilatation."""
    fit, there = system.nodal_stress, np.zeros(len(system.interface.nodes), dtype=bool)
    there[fit.node[fit.known]] = True
    alone, every = 0.0, 0.0
    for cells, of, m in zip(system.volume.kinds, stress, loading.moduli, strict=True):
        energy = energies(of, m, cells.weight)
        # fault: a single row of quads is judged by what nothing tells -> in_row = np.zeros(len(energy), dtype=bool) |
        #   mechanical_fmu/test_softest
        in_row = ~there[cells.nodes].any(axis=1) & (cells.treatment == ELASTIC) & (cells.nodes.shape[1] == QUAD)
        alone, every = alone + float(energy[in_row].sum()), every + float(energy.sum())
    return alone / max(every, np.finfo(float).tiny)


def motion_stress(system: System, u: Floats, dx: Floats, loading: Loading) -> tuple[list[Floats], list[Floats]]:
    """Return the stress [Pa], (n_e, nq, 4), and dilatation of a small motion dx : (n_nodes, 2) [m], of each kind.

    By linear elasticity, of the change of strain from what is deformed now: a motion that only turns bodies has none.
    """
    kinds, moduli = system.volume.kinds, loading.moduli
    largest = max([float(np.abs(np.einsum("eqaj,eai->eqij", c.B, dx[c.nodes])).max()) for c in kinds if c.nodes.size],
                  default=0.0)
    if largest == 0.0:
        return [np.zeros((*c.weight.shape, 4)) for c in kinds], [np.zeros(c.weight.shape) for c in kinds]
    step = STRAIN / largest
    ahead, behind = (system.volume.stress(u + side * step * dx, moduli, loading.step) for side in (1.0, -1.0))
    strain = [_of_lengths_now((a - b) / (2.0 * step), 0.5 * (a + b))
              for (_, a), (_, b) in zip(ahead, behind, strict=True)]
    return ([_linear(c, of, m) for c, of, m in zip(kinds, strain, moduli, strict=True)],
            [of[..., [0, 1, 3]].sum(axis=-1) for of in strain])


def _of_lengths_now(change: Floats, strain: Floats) -> Floats:
    """Return (n_e, nq, 4) the change of the strain of Green and Lagrange, dE, of the lengths that bodies have now.

    U^-1 dE U^-1, U U = 1 + 2 E : its trace is the share by which a volume changes.  That of dE is not, where strain is
    large: cells of rubber that keep their volume would resist with their bulk modulus.
    """
    # fault: a motion that keeps volume at large strain is resisted by the bulk modulus -> C = 1.0 + 0.0 * strain |
    #   mechanical_fmu/test_softest
    C = 1.0 + 2.0 * strain
    a, b, c, shear = C[..., 0], C[..., 1], C[..., 3], C[..., 2] - 1.0
    # U = (C + det U)/tr U in the plane.
    det = np.sqrt(np.maximum(a * b - shear**2, np.finfo(float).tiny))
    trace = np.sqrt(a + b + 2.0 * det)
    inverse = np.empty((*a.shape, 2, 2))
    inverse[..., 0, 0], inverse[..., 1, 1] = b + det, a + det
    inverse[..., 0, 1] = inverse[..., 1, 0] = -shear
    inverse /= (trace * det)[..., None, None]
    plane = inverse @ change[..., [0, 2, 2, 1]].reshape(*a.shape, 2, 2) @ inverse
    return np.stack([plane[..., 0, 0], plane[..., 1, 1], plane[..., 0, 1], change[..., 3] / c], axis=-1)


def _linear(cells: Cells, strain: Floats, m: Moduli) -> Floats:
    """(n_e, nq, 4) [Pa] of strain : (n_e, nq, 4), by Hooke's law; of cells of one dilatation with its mean."""
    dilatation = strain[..., [0, 1, 3]].sum(axis=-1)
    p = dilatation
    # fault: cells of one dilatation have one a point -> if False: | mechanical_fmu/test_softest
    if not (cells.treatment.plane_stress or cells.treatment.enhanced):
        p = np.broadcast_to(((dilatation * cells.weight).sum(axis=1) / cells.volume)[:, None], dilatation.shape)
    stress = 2.0 * m.mu[:, None, None] * strain
    stress[..., [0, 1, 3]] += (m.kappa[:, None] * p - 2.0 / 3.0 * m.mu[:, None] * dilatation)[..., None]
    return np.asarray(stress)
