"""Newton directions: with a fresh tangent, or with the factor of an earlier one and today's contact.

Bodies that slide change their contact in every step but hardly their own stiffness.  So the stiffness K_v of the
bodies is factored once, at an anchor (u_a, T_a) held in the state, and contact C enters by its few surface nodes:
    (K_v + C)^-1 r = K_v^-1 r - W E w,   (1 + S E) w = P' K_v^-1 r,   W = K_v^-1 P,   S = P' W,   E = C - D.
P picks the surface degrees of freedom; D are springs that hold bodies which only contact holds, inside the factor.
W is kept where it is small, which saves a solve in every direction.  All of it can be rebuilt bit for bit from the
anchor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array

from contact.compiled import kernel
from contact.half.held import name_of
from contact.half.linalg import SingularMatrixError, Solve, factorise
from contact.messages import Ints, Tractions
from mechanical_fmu.material import Moduli
from mechanical_fmu.system import ForceBalance, Loading, System

Floats = NDArray[np.float64]

# More surface unknowns than this and their dense inverse costs more than factoring anew.
MAX_SURFACE_DOFS = 2000
# Right-hand sides solved at a time: keeps the memory of the surface compliance small.
RIGHT_SIDES = 64
# Entries of W, 8 MB: beyond, a product with it costs as much as a solve (0.1 of one at 1.5e5).
MOST_ENTRIES = 1_000_000
# Below this share of surface components with contact it pays to pick them out.
FEW_ACTIVE = 0.8
# A rigid motion whose contact stiffness is less than this share of the stiffest one is not held by contact.
LOOSE_RATIO = 1e-7
# Of the largest part of a motion of several bodies: one with less of it stays where it is.
PART_OF_A_GROUP = 1e-6


def fresh_direction(system: System, balance: ForceBalance, loading: Loading, gap: Floats) -> Floats:
    """Solve for d : (2 n_nodes,) [m] with the whole tangent at balance.u; d = gap on prescribed components.

    gap : (n_fixed,) [m] still to go to the prescribed displacements.
    balance must hold entries.  Raises SingularMatrixError, naming body and motion where one is loose.
    """
    assert balance.entries is not None
    if loading.inertia is None:
        refuse_loose(system, balance, loading.sticking)
    K = stiffness(system, balance, loading)
    d = factorise(constrained(system, K), symmetric(system, balance, loading))(right_side(system, balance, K, gap))
    return finish(system, balance, d, gap)


def stiffness(system: System, balance: ForceBalance, loading: Loading) -> csr_matrix:
    """Assemble dr/du : (2 n_nodes, 2 n_nodes) [N/m] of everything at balance.u, with entries.

    Rigid bodies are condensed to their reference rows.
    """
    assert balance.entries is not None
    K = system.tangent_matrix(balance.entries, balance.tractions)
    if any(loading.pressure):
        K = K + system.load_matrix(balance.u, loading)
    if balance.turning is not None:
        assert system.rigid is not None
        K = system.rigid.condensed(K, balance.u, balance.turning)
    return K if loading.inertia is None else K + loading.inertia.matrix


def symmetric(system: System, balance: ForceBalance, loading: Loading) -> bool | None:
    """Return True where the stiffness is symmetric by its making; None where that must be looked at."""
    touches = balance.tractions is not None and len(balance.tractions.blocks) > 0
    if touches or any(loading.pressure) or balance.turning is not None or system.volume.skew:
        return None
    return True


@dataclass(frozen=True)
class StiffnessAnchor:
    """The stiffness of the bodies at u : (n_nodes, 2) [m] and the moduli of that time, and what follows from it."""

    system: System
    u: Floats
    moduli: tuple[Moduli, ...]

    @cached_property
    def entries(self) -> Floats:
        """Compute (n_entries,) [N/m], the flat entries of the bodies' stiffness at the anchor."""
        return self.system.volume.tangent(self.u, self.moduli)[1]

    @cached_property
    def matrix(self) -> csr_matrix:
        """Assemble the bodies' stiffness (2 n_nodes, 2 n_nodes) [N/m] at the anchor."""
        return self.system.pattern.matrix(self.entries)

    @cached_property
    def springs(self) -> Floats:
        """Find D [N/m]: the own stiffness of surface nodes of bodies that prescribed displacements do not hold.

        D : (2 n_s,), 0 on other bodies.
        """
        dofs = self.system.contact.dofs
        loose = [body for body, _ in self.system.constraints.loose_motions(self.system.interface.nodes)]
        held_by_contact = np.isin(self.system.constraints.node_body[dofs // 2], loose)
        return np.where(held_by_contact, self.matrix.diagonal()[dofs], 0.0) * self.system.constraints.free[dofs]

    @cached_property
    def solve(self) -> Solve:
        """Factor the anchor's stiffness with its springs; returns the solver of K d = b, b : (2 n_nodes,) [N]."""
        diagonal = np.zeros(self.matrix.shape[0])
        diagonal[self.system.contact.dofs] = self.springs
        K = self.matrix + diags_array(diagonal, format="csr") if diagonal.any() else self.matrix
        return factorise(constrained(self.system, K), None if self.system.volume.skew else True)

    @cached_property
    def moved(self) -> Floats | None:
        """Compute W : (2 n_nodes, 2 n_s) [m/N], what a force on each surface component moves; None where it is large.
        """
        dofs = self.system.contact.dofs
        if self.matrix.shape[0] * dofs.size > MOST_ENTRIES:
            return None
        return self._responses(np.arange(self.matrix.shape[0]))

    @cached_property
    def compliance(self) -> Floats:
        """Compute S : (2 n_s, 2 n_s) [m/N]."""
        dofs = self.system.contact.dofs
        return self._responses(dofs) if self.moved is None else self.moved[dofs]

    def _responses(self, rows: NDArray[np.intp]) -> Floats:
        """Solve for these rows, (m,), of what a force on each surface component moves: (m, 2 n_s) [m/N]."""
        dofs = self.system.contact.dofs
        found = np.empty((rows.size, dofs.size))
        for start in range(0, dofs.size, RIGHT_SIDES):
            unit = np.zeros((self.matrix.shape[0], min(RIGHT_SIDES, dofs.size - start)), order="F")
            unit[dofs[start : start + RIGHT_SIDES], np.arange(unit.shape[1])] = 1.0
            found[:, start : start + RIGHT_SIDES] = self.solve(unit)[rows]
        return found

    def pushed(self, d: Floats, b: Floats, active: NDArray[np.intp], f: Floats) -> Floats:
        """Return K_v^-1 (b - P f) : (2 n_nodes,) [m] of d = K_v^-1 b; b : (2 n_nodes,) [N].

        f : (m,) [N] on surface components `active`, numbers among the 2 n_s.
        """
        if self.moved is None:
            less = b.copy()
            less[self.system.contact.dofs[active]] -= f
            return self.solve(less)
        on_surface = np.zeros(self.system.contact.dofs.size)
        on_surface[active] = f
        # fault: contact pushes for nine tenths -> return np.asarray(d - 0.9 * self.moved @ on_surface) |
        #   mechanical_fmu/test_elastic_contact
        return np.asarray(d - self.moved @ on_surface)

    def drift(self, entries: Floats) -> float:
        """Compute the largest change of a cell's stiffness since the anchor, relative to that cell's largest entry [1].

        entries : (n_entries,) [N/m] of today's tangent, flat, as a ForceBalance has them.
        """
        worst, start = 0.0, 0
        for cells in self.system.volume.kinds:
            size = (2 * cells.nodes.shape[1]) ** 2
            part = slice(start, start + size * len(cells.nodes))
            then, now = self.entries[part].reshape(-1, size), entries[part].reshape(-1, size)
            worst = max(worst, float((np.abs(now - then).max(axis=1) / np.abs(then).max(axis=1)).max()))
            start = part.stop
        return worst

    def direction(self, balance: ForceBalance, gap: Floats) -> Floats:
        """Solve for d : (2 n_nodes,) [m] with the bodies' stiffness of the anchor and the contact of today.

        gap : (n_fixed,) [m] still to go to the prescribed displacements, which d is there.
        Raises SingularMatrixError, naming body and motion where one is loose.
        """
        refuse_loose(self.system, balance)
        b = right_side(self.system, balance, self.matrix, gap, balance.tractions)
        d = self.solve(b)
        E = self.surface_change(balance.tractions)
        active, S = np.flatnonzero(E.any(axis=1)), self.compliance
        if active.size:
            if active.size < FEW_ACTIVE * len(E):
                E, S = E[np.ix_(active, active)], S[np.ix_(active, active)]
            else:
                active = np.arange(len(E))
            small = S @ E
            small.flat[:: active.size + 1] += 1.0
            d = self.pushed(d, b, active, E @ np.linalg.solve(small, d[self.system.contact.dofs[active]]))
        return finish(self.system, balance, d, gap)

    def surface_change(self, tractions: Tractions | None) -> Floats:
        """Assemble E : (2 n_s, 2 n_s) [N/m], what contact and springs change in the anchor's stiffness."""
        free = self.system.constraints.free[self.system.contact.dofs]
        # fault: springs never taken out again -> E = np.diag(0.0 * self.springs) | mechanical_fmu/test_elastic_contact
        E = np.diag(-self.springs)
        if tractions is not None and len(tractions.blocks):
            E = E + self.system.contact.dense(tractions) * np.outer(free, free)
        return E


class LooseBodyError(SingularMatrixError):
    """Nothing holds a body against a rigid motion; `together`: or several that hold each other.

    motion : (2 n_nodes,) [1] of all of them, (0,) where it is not known.
    """

    def __init__(self, message: str, together: bool = False, motion: Floats | None = None) -> None:
        super().__init__(message)
        self.together, self.motion = together, np.empty(0) if motion is None else motion


def refuse_loose(system: System, balance: ForceBalance, sticking: float = 1.0) -> None:
    """Raise LooseBodyError where nothing holds a body against a rigid motion, with the body and the motion.

    sticking : share of eps_T [1] by which points stick.
    """
    if not system.can_be_loose:
        return
    x = system.interface.nodes + balance.u
    found = system.constraints.loose_motions(x)
    motions = np.concatenate([system.constraints.rigid_motions(x, body, system.contact.dofs) @ Z for body, Z in found],
                             axis=1) if found else np.zeros((0, 0))
    held = np.zeros((motions.shape[1], motions.shape[1]))
    if balance.tractions is not None and len(balance.tractions.blocks):
        held = system.contact.against(balance.tractions, motions)
    ends = np.cumsum([0, *(Z.shape[1] for _, Z in found)])
    for (body, Z), own in zip(found, (slice(*pair) for pair in pairwise(ends)), strict=True):
        # Slip is not symmetric: what is pressed aside may be held though the symmetric part has a negative eigenvalue.
        # fault: what slips at most points is taken for loose -> vectors, values = np.linalg.eigh(held[own, own] +
        #   held[own, own].T)[::-1]; values, vectors = values[::-1], vectors.T[::-1] | mechanical_fmu/test_slipping
        _, values, vectors = np.linalg.svd(held[own, own])
        # fault: loose bodies not looked for -> if values[-1] > 1e300: |
        #   mechanical_fmu/test_first_contact::test_a_body_that_meets_nothing_is_told_with_its_way
        if values[-1] <= LOOSE_RATIO * sticking * values[0]:
            raise _loose_error(system, x, {body: Z @ vectors[-1]})
    if len(found) > 1:
        _refuse_loose_together(system, x, found, held, LOOSE_RATIO * sticking)


def _refuse_loose_together(system: System, x: Floats, found: Sequence[tuple[int, Floats]], held: Floats,
                           least: float) -> None:
    """Raise LooseBodyError where bodies that hold each other go together, held by nothing else.

    found : bodies and the motions left to each.  held : (m, m) [N/m] of contact against all of them.
    least : of the stiffest motion [1], what is loose has less.
    """
    by_size = 1.0 / np.sqrt(np.abs(held).max(axis=1))  # pairs may differ in stiffness by orders
    # fault: bodies that slip on each other are taken for loose -> vectors, values = np.linalg.eigh(
    #   (held + held.T) * np.outer(by_size, by_size))[::-1]; values, vectors = values[::-1], vectors.T[::-1] |
    #   mechanical_fmu/test_carrying
    _, values, vectors = np.linalg.svd(held * np.outer(by_size, by_size))
    # fault: bodies that only hold each other are taken for held -> if True: |
    #   mechanical_fmu/test_first_contact::test_two_bodies_that_only_hold_each_other_are_named
    if values[-1] > least:
        return
    together, start, parts = by_size * vectors[-1], 0, {}
    for body, Z in found:
        parts[body] = Z @ together[start : start + Z.shape[1]]
        start += Z.shape[1]
    largest = max(float(np.abs(part).max()) for part in parts.values())
    raise _loose_error(system, x, {body: part for body, part in parts.items()
                                   if np.abs(part).max() > PART_OF_A_GROUP * largest}, together=True)


def _loose_error(system: System, x: Floats, parts: Mapping[int, Floats], together: bool = False) -> LooseBodyError:
    """Make the error that names bodies and their motion; x : (n_nodes, 2) [m], parts : (3,) of each body."""
    motion = np.sum([system.constraints.rigid_motions(x, body) @ part for body, part in parts.items()], axis=0)
    return LooseBodyError(_loose_text(system, list(parts), next(iter(parts.values()))), together, motion)


def _loose_text(system: System, bodies: Sequence[int], motion: Floats) -> str:
    names = [system.interface.bodies[body] for body in bodies]
    who = f"body {names[0]}" if len(names) == 1 else f"bodies {' and '.join(names)}, which hold each other,"
    return (f"nothing holds {who} against {name_of(motion)}: "
            "prescribe a displacement or let it press on something")


def refuse_unheld(system: System) -> None:
    """Raise SingularMatrixError where a body is loose and in no contact pair that could hold it."""
    interface = system.interface
    touching = {int(interface.node_body[node]) for node in interface.contact_nodes}
    for body, Z in system.constraints.loose_motions(interface.nodes):
        if body not in touching:
            raise SingularMatrixError(_loose_text(system, [body], Z[:, 0]))


def right_side(system: System, balance: ForceBalance, K: csr_matrix, gap: Floats,
                tractions: Tractions | None = None) -> Floats:
    """Compute -r - K gap : (2 n_nodes,) [N] on free components, 0 on the others.

    K : (2 n_nodes, 2 n_nodes) [N/m].  gap : (n_fixed,) [m].
    tractions : contact not in K, whose share of K gap is added.
    """
    b = -balance.r.ravel()
    if gap.any():
        moved = np.zeros_like(b)
        moved[system.constraints.fixed] = gap
        b -= K @ moved
        if tractions is not None and len(tractions.blocks):
            b -= system.contact.matrix(tractions) @ moved
    return b * system.constraints.free


def constrained(system: System, K: csr_matrix) -> csr_matrix:
    """Replace the rows and columns of prescribed components by those of a diagonal.

    K : (2 n_nodes, 2 n_nodes) [N/m], or a mass matrix [kg].
    """
    return csr_matrix((_held(K.data, K.indices, K.indptr, system.constraints.free), K.indices, K.indptr), shape=K.shape)


@kernel
def _held(data: Floats, indices: Ints, indptr: Ints, free: Floats) -> Floats:
    """Return the entries of a matrix whose prescribed components, free : (n,) 0.0, have its largest diagonal alone.

    data, indices : (nnz,) and indptr : (n + 1,), the diagonal among them: it is in the pattern, and sums of matrices
    keep it.
    """
    kept, largest = data.copy(), 0.0
    for i in range(free.size):
        for k in range(indptr[i], indptr[i + 1]):
            if indices[k] == i:
                largest = max(largest, abs(data[k]))
    for i in range(free.size):
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            if free[i] == 0.0 or free[j] == 0.0:
                kept[k] = largest if i == j else 0.0
    return kept


def finish(system: System, balance: ForceBalance, d: Floats, gap: Floats) -> Floats:
    """Set d : (2 n_nodes,) [m] to gap : (n_fixed,) [m] on prescribed components, let rigid nodes follow and return it.

    Raises SingularMatrixError where d is not finite.
    """
    if not np.isfinite(d).all():
        raise SingularMatrixError("the stiffness matrix is singular")
    d[system.constraints.fixed] = gap
    return d if system.rigid is None else system.rigid.spread(d, balance.u)
