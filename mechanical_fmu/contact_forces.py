"""Contact as the mechanical halves see it: surfaces registered, then asked for forces or for gaps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from contact.half.interface import Interface
from contact.half.model import Link, Variable
from contact.half.register import register_message
from contact.wire import Facing, Project, Refused, Register, Registered, Reply, Request, Traction, Tractions

Floats = NDArray[np.float64]


class ContactRefusedError(ArithmeticError):
    """The contact service does not answer for these coordinates."""


@dataclass(frozen=True)
class Contact:
    """The contact surfaces of a scene, and the way to ask about them.

    known : the name the service gave the surfaces, once it has; the same from every service (a content hash).
    """

    interface: Interface
    known: list[str] = field(default_factory=list)

    @cached_property
    def message(self) -> Register:
        return register_message(self.interface)

    @cached_property
    def dofs(self) -> NDArray[np.intp]:
        """(2 n_s,) degrees of freedom of the surface nodes, 2 node + component."""
        return (2 * self.interface.contact_nodes[:, None] + np.arange(2)).ravel().astype(np.intp)

    def tractions(self, link: Link, x: Floats, multipliers: Floats) -> Tractions:
        """Contact forces at x : (n_nodes, 2) [m].  Raises ContactRefusedError."""
        reply = self._ask(link, lambda surfaces: Traction(surfaces, x[self.interface.contact_nodes], multipliers))
        if not isinstance(reply, Tractions):
            raise ContactRefusedError(f"contact does not answer: {_reason(reply)}")
        return reply

    def facing(self, link: Link, x: Floats) -> Facing:
        """What faces what at x : (n_nodes, 2) [m].  Raises ContactRefusedError."""
        reply = self._ask(link, lambda surfaces: Project(surfaces, x[self.interface.contact_nodes]))
        if not isinstance(reply, Facing):
            raise ContactRefusedError(f"contact does not answer: {_reason(reply)}")
        return reply

    def _ask(self, link: Link, request: Callable[[str], Request]) -> Reply:
        """The reply; a service that does not know the surfaces (yet, or any more) is told them first."""
        if self.known:
            reply = link.ask(request(self.known[0]))
            if not (isinstance(reply, Refused) and reply.code == "unknown_surfaces"):
                return reply
        told = link.ask(self.message)
        if not isinstance(told, Registered):
            raise ContactRefusedError(f"contact does not take the surfaces: {_reason(told)}")
        self.known[:] = [told.surfaces]
        return link.ask(request(told.surfaces))

    def force(self, tractions: Tractions) -> Floats:
        """(n_nodes, 2) [N] on the nodes of the mesh."""
        f = np.zeros((len(self.interface.nodes), 2))
        f[self.interface.contact_nodes] = tractions.force
        return f

    def dense(self, tractions: Tractions) -> Floats:
        """(2 n_s, 2 n_s) stiffness [N/m] of the touching points on the surface nodes."""
        size = self.dofs.size
        rows, columns = _places(tractions)
        K = np.zeros(size * size)
        K += np.bincount((rows * size + columns).ravel(), weights=tractions.blocks.ravel(), minlength=K.size)
        return K.reshape(size, size)

    def matrix(self, tractions: Tractions) -> csr_matrix:
        """The same on all degrees of freedom of the mesh."""
        rows, columns = _places(tractions)
        n = 2 * len(self.interface.nodes)
        where = (self.dofs[rows.ravel()], self.dofs[columns.ravel()])
        return csr_matrix((tractions.blocks.ravel(), where), shape=(n, n))


def _places(tractions: Tractions) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    dofs = (2 * tractions.block_nodes[:, :, None].astype(np.int64) + np.arange(2)).reshape(-1, 8)
    return np.repeat(dofs, 8, axis=1), np.tile(dofs, (1, 8))


def _reason(reply: Reply) -> str:
    return f"{reply.code}: {reply.message}" if isinstance(reply, Refused) else f"it sent {type(reply).__name__}"


def contact_variables(n_s: int) -> tuple[Variable, ...]:
    """What both mechanical halves say of contact; n_s : surface nodes."""
    return (Variable("contact.t_N", (n_s,), unit="Pa", description="normal traction, <= 0"),
            Variable("contact.gap", (n_s,), unit="m", description="normal gap"),
            Variable("contact.covered", (n_s,), unit="1", description="share of a node's surface that is faced"),
            Variable("contact.touching", description="facing points that touch"))
