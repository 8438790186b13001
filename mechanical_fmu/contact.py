"""Contact as the mechanical halves see it: forces and stiffness of the surface nodes, put on the mesh."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix, csr_matrix

from contact.half.contact_client import ContactSurfaces, History
from contact.half.model import Link, Value, Variable
from contact.half.passing import Side, sides_of
from contact.messages import Couplings, Ints, Tractions

Floats = NDArray[np.float64]


class MeshContact(ContactSurfaces):
    """The contact surfaces of a scene, and their forces and stiffness on the mesh."""

    def on_slaves(self, pairs: Collection[str]) -> NDArray[np.bool_]:
        """Say, (n_q,), whether a pair node is of one of these pairs, on a side that is searched from."""
        of = np.array([pair.name in pairs for pair in self.interface.pairs], dtype=np.bool_)
        return (self.pair_nodes.searched == 1) & of[self.pair_nodes.pair]

    def multiplied(self, pairs: Collection[str]) -> NDArray[np.bool_]:
        """Say, (n_m,), which multipliers are those of these pairs: of slave nodes, or of their ties."""
        of, tied = self.on_slaves(pairs), self.pair_nodes.tied
        held = np.repeat(of[tied], 2)
        of[tied] = False
        return np.concatenate([of, held])

    @cached_property
    def tied(self) -> NDArray[np.bool_] | None:
        """Say, (n_q,), which pair nodes are of tied pairs; None where no pair is tied."""
        tied = np.array([pair.tied for pair in self.interface.pairs], dtype=np.bool_)
        return tied[self.pair_nodes.pair] if tied.any() else None

    @cached_property
    def slips(self) -> bool:
        """Say whether a pair has friction."""
        return any(pair.mu > 0.0 for pair in self.interface.pairs)

    @cached_property
    def sides(self) -> tuple[Side, ...]:
        """Return both sides of every pair of two bodies."""
        return sides_of(self.interface)

    @cached_property
    def dofs(self) -> NDArray[np.intp]:
        """Return (2 n_s,) degrees of freedom of the surface nodes, 2 node + component."""
        return (2 * self.interface.contact_nodes[:, None] + np.arange(2)).ravel().astype(np.intp)

    def force(self, tractions: Tractions) -> Floats:
        """Put the contact forces on the nodes of the mesh: (n_nodes, 2) [N]."""
        f = np.zeros((len(self.interface.nodes), 2))
        f[self.interface.contact_nodes] = tractions.force
        return f

    def dense(self, tractions: Tractions) -> Floats:
        """Assemble the stiffness (2 n_s, 2 n_s) [N/m] of the touching points on the surface nodes."""
        n = len(tractions.starts) - 1
        K = np.zeros((n, 2, n, 2))
        K[np.repeat(np.arange(n), np.diff(tractions.starts)), :, tractions.columns] = tractions.blocks
        return K.reshape(2 * n, 2 * n)

    def against(self, tractions: Tractions, motions: Floats) -> Floats:
        """Compute what that stiffness holds against motions : (2 n_s, m) [1], M' K M : (m, m) [N/m]."""
        return np.asarray(motions.T @ (_rows(tractions, self.dofs.size) @ motions))

    def matrix(self, tractions: Tractions) -> csr_matrix:
        """Assemble the same on all degrees of freedom of the mesh, (2 n_nodes, 2 n_nodes) [N/m]."""
        starts, columns = self.places(tractions)
        size = 2 * len(self.interface.nodes)
        return bsr_matrix((tractions.blocks, columns, starts), shape=(size, size)).tocsr()

    def places(self, tractions: Tractions) -> tuple[Ints, Ints]:
        """Return where it has its blocks: starts (n_nodes + 1,) and columns (n_b,), by nodes of the mesh."""
        # Surface nodes ascend: blocks in the order of the surface are in that of the mesh.
        nodes = self.interface.contact_nodes
        starts = np.zeros(len(self.interface.nodes) + 1, dtype=np.int32)
        starts[nodes + 1] = np.diff(tractions.starts)
        return np.cumsum(starts, out=starts), nodes[tractions.columns].astype(np.int32)


@dataclass(frozen=True)
class ContactQuery:
    """What one step asks the contact service: tractions at x : (n_nodes, 2) [m], and how they answer to multipliers.

    history : what contact remembers.  Raises ContactRefusedError.
    multipliers : (n_m,) [Pa] of the moment; those of the history are of the start of the step.
    sticking : share of eps_T [1] by which points stick.
    away : (n_nodes, 2) [m] how far from x nodes are put, (0,) none.
    """

    contact: MeshContact
    link: Link
    history: History
    multipliers: Floats
    sticking: float = 1.0
    away: Floats = field(default_factory=lambda: np.empty(0))

    def __call__(self, x: Floats) -> Tractions:
        """Ask for the contact tractions at x : (n_nodes, 2) [m].  Raises ContactRefusedError."""
        x = x + self.away if self.away.size else x
        return self.contact.tractions(self.link, x, self.history, self.multipliers, self.sticking)

    def couplings(self, x: Floats) -> Couplings:
        """Ask how contact at x : (n_nodes, 2) [m] answers to its multipliers.  Raises ContactRefusedError."""
        return self.contact.couplings(self.link, x, self.history, self.multipliers, self.sticking)

    def softened(self, sticking: float, memory: float = 0.0) -> ContactQuery:
        """Let points stick by a share of eps_T [1] only, with a share of the shear of before [1] to begin with."""
        at = self.history.mobilised_at * [1.0, 1.0, memory]
        history = replace(self.history, mobilised=memory * self.history.mobilised, mobilised_at=at)
        return replace(self, history=history, sticking=sticking)

    def with_multipliers(self, multipliers: Floats) -> ContactQuery:
        """Replace the multipliers of contact; multipliers : (n_m,) [Pa]."""
        return replace(self, multipliers=multipliers)


def _rows(tractions: Tractions, size: int) -> bsr_matrix:
    return bsr_matrix((tractions.blocks, tractions.columns, tractions.starts), shape=(size, size))


# What a pair node does (contact.status).
ALONE, OPEN, TOUCHES, SLIPS, TIED = range(5)


def contact_variables(n_q: int, slips: bool = False, with_status: bool = False,
                      tied: bool = False, by_end: bool = True) -> tuple[Variable, ...]:
    """List the contact outputs of both mechanical halves; n_q : pair nodes, slips : whether a pair has friction.

    with_status : whether the half tells what each of them does.  tied : whether a pair is, and the half has forces.
    by_end : whether friction heat is by the pressure at the end of a step, not by those of all of it.
    """
    sign = "normal traction, <= 0; of tied pairs > 0 where they are pulled" if tied else "normal traction, <= 0"
    variables = [Variable("contact.t_N", (n_q,), unit="Pa", description=sign, on="pair_nodes"),
                 Variable("contact.gap", (n_q,), unit="m", description="normal gap", on="pair_nodes"),
                 Variable("contact.covered", (n_q,), unit="1", description="share of a node's side that is faced",
                          on="pair_nodes"),
                 Variable("contact.touching", description="contact quadrature points that touch")]
    if with_status:
        variables.append(Variable("contact.status", (n_q,), unit="1", on="pair_nodes", description="0 faces nothing, "
                                  "1 open, 2 touches (with friction: sticks), 3 slips: most of what it touches"
                                  + ", 4 tied" * tied))
    if slips or tied:
        variables.append(Variable("contact.t_T", (n_q,), unit="Pa", description="shear traction of slave nodes",
                                  on="pair_nodes"))
    if slips:
        variables += [Variable("contact.E_friction", (n_q,), unit="J", description="friction heat of the substep",
                               on="pair_nodes"),
                      *((Variable("contact.E_friction.at", (), "output", start="end", kind="String",
                                  variability="constant",
                                  description="at which time of a step the pressure is that makes its friction heat"),)
                        if by_end else ()),
                      Variable("contact.slipping", description="contact quadrature points that slip"),
                      *(() if by_end else
                        (Variable("contact.slip_speed", unit="m/s", description="mean speed at the end of the substep "
                                  "of what slipped in it, the way its friction goes; negative: it turned"),)),
                      Variable("contact.slip_share", (n_q,), unit="1",
                               description="of what a slave node touches, the share at Coulomb's bound",
                               on="pair_nodes"),
                      Variable("contact.slip", (n_q,), unit="m", on="pair_nodes",
                               description="slip of slave nodes in the substep, along the surface"),
                      Variable("contact.slip_path", (n_q,), unit="m", on="pair_nodes",
                               description="slip of slave nodes since the start, to and fro added up")]
    return tuple(variables)


def status(tractions: Tractions, tied: NDArray[np.bool_] | None = None) -> Floats:
    """Tell what each pair node does: (n_q,) ALONE, OPEN, TOUCHES or SLIPS; nodes of a master never slip.

    tied : (n_q,) which are of tied pairs, None: none.  Those that face something are TIED.
    """
    faces = np.where(tractions.node_covered > 0.0, OPEN, ALONE)
    slides = np.where(tractions.slipping > 0.5, SLIPS, TOUCHES)
    # fault: what slips is told to stick -> slides = np.full(faces.shape, TOUCHES) | mechanical_fmu/test_fields
    does = np.where(tractions.t_N < 0.0, slides, faces)
    if tied is not None:
        does = np.where(tied & (tractions.node_covered > 0.0), TIED, np.where(tied, ALONE, does))
    return does.astype(np.float64)


def slid(way: Floats, before: Floats) -> Floats:
    """Return how far slave nodes have slipped since the start, to and fro; before : (n_q,) [m], (0,) without friction.

    way : (n_q,) [m] of it in a step, (0,) of none.
    """
    return before + way if way.size and before.size else before


def contact_outputs(tractions: Tractions, path: Floats | None = None,
                    tied: NDArray[np.bool_] | None = None) -> dict[str, Value]:
    """Return the values of contact_variables; path : (n_q,) [m] slipped since the start, None: nothing can.

    tied : (n_q,) which pair nodes are of tied pairs, None: none.
    """
    outputs: dict[str, Value] = {"contact.t_N": tractions.t_N, "contact.gap": tractions.node_gap,
                                 "contact.covered": tractions.node_covered,
                                 "contact.touching": float(tractions.n_touching),
                                 "contact.status": status(tractions, tied)}
    if path is not None or tied is not None:
        outputs["contact.t_T"] = tractions.shear
    if path is not None:
        outputs |= {"contact.E_friction": tractions.E_friction, "contact.slip": tractions.slip,
                    "contact.slip_path": path,
                    "contact.slipping": float(tractions.n_slipping), "contact.slip_share": tractions.slipping}
    return outputs
