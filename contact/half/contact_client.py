"""The contact surfaces of a half, and its requests to the contact service."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

import numpy as np

from contact.half.interface import Interface
from contact.half.model import Link
from contact.half.register import register_message, surface_names
from contact.messages import (
    Coupling,
    Couplings,
    Facing,
    Floats,
    Ints,
    Project,
    Refused,
    Register,
    Registered,
    Reply,
    Request,
    Traction,
    Tractions,
)
from contact.pair_nodes import PairLayout, pair_layout_of

R = TypeVar("R", Facing, Tractions, Couplings)


class ContactRefusedError(ArithmeticError):
    """The contact service will not answer for these coordinates."""


@dataclass(frozen=True)
class History:
    """The history of contact, which the mechanical state holds.

    multipliers : (n_m,) [Pa] of the pair nodes, then x and y of those of ties.  x : (n_s, 2) [m], where the surfaces
    were then.  mobilised : (n_q,) [1], shear over p_N of slave nodes, and mobilised_at : (n_h, 3), of the points that
    touched (ContactState).
    """

    multipliers: Floats
    x: Floats
    mobilised: Floats
    mobilised_at: Floats = field(default_factory=lambda: np.empty((0, 3)))


class ContactSurfaces:
    """The surfaces of the pairs of an interface file, as the contact service numbers them.

    Their name at the service is cached here and is in no state: it is a hash of their content, the same from every
    service, so it changes no bit of an answer.
    """

    def __init__(self, interface: Interface, parting: Collection[str] = (), rigid: Collection[str] = (),
                 augmented: Collection[str] = ()) -> None:
        """parting : names of pairs that have their penalty alone (contact.messages.Passes).

        rigid : names of surfaces that do not deform.  augmented : of pairs whose pressures are multipliers.
        """
        self.interface, self.parting, self.rigid, self.augmented = interface, parting, rigid, augmented
        self._registered_as = ""

    @cached_property
    def message(self) -> Register:
        """The message that registers them."""
        return register_message(self.interface, self.parting, self.rigid, self.augmented)

    @cached_property
    def edges(self) -> Ints:
        """Return the nodes of the mesh (n_edges, 2) of every edge as registered."""
        return self.interface.contact_nodes[self.message.edges].reshape(-1, 2)

    @cached_property
    def pair_nodes(self) -> PairLayout:
        """The pair nodes, as the service numbers them too."""
        return pair_layout_of(self.message)

    def searched_nodes(self, facing: Facing) -> Ints:
        """Return (n_p, 2) the pair nodes of the edge that each contact quadrature point was searched from."""
        of, p = self.pair_nodes, self.message.passes
        begin = np.zeros((len(self.interface.pairs), len(self.first)), dtype=np.int32)
        begin[p.pair, p.slave] = of.first[:, 0]
        surface = self.message.edge_surface[facing.slave_edge]
        return begin[facing.pair, surface][:, None] + of.place[facing.slave_edge]

    @cached_property
    def first(self) -> dict[str, int]:
        """Number of the first edge of each surface, by name."""
        return {name: int(np.searchsorted(self.message.edge_surface, i))
                for i, name in enumerate(surface_names(self.interface))}

    def facing(self, link: Link, x: Floats) -> Facing:
        """Ask for the contact quadrature points at coordinates x : (n_nodes, 2) [m].

        Raises ContactRefusedError, LinkError.
        """
        at = self._at_surfaces(x)
        return self._answer(link, lambda name: Project(name, at), Facing)

    def tractions(self, link: Link, x: Floats, history: History, multipliers: Floats | None = None,
                  sticking: float = 1.0) -> Tractions:
        """Ask for the contact forces at x : (n_nodes, 2) [m].

        multipliers : (n_m,) [Pa] of the moment, None for those of the history.  sticking : share of eps_T [1].
        Raises ContactRefusedError, LinkError.
        """
        return self._answer(link, self._asked(Traction, x, history, multipliers, sticking), Tractions)

    def couplings(self, link: Link, x: Floats, history: History, multipliers: Floats | None = None,
                  sticking: float = 1.0) -> Couplings:
        """Ask for residual and derivatives of the multipliers at x : (n_nodes, 2) [m].

        multipliers : (n_m,) [Pa] of the moment, None for those of the history.  sticking : share of eps_T [1].
        Raises ContactRefusedError, LinkError.
        """
        return self._answer(link, self._asked(Coupling, x, history, multipliers, sticking), Couplings)

    def no_history(self, x: Floats) -> History:
        """Return the history before anything pressed or slipped, with the surfaces at x : (n_nodes, 2) [m]."""
        zeros = np.zeros(self.pair_nodes.n_multipliers)
        return History(zeros, self._at_surfaces(x), zeros[:self.pair_nodes.size])

    def _at_surfaces(self, x: Floats) -> Floats:
        return np.ascontiguousarray(x[self.interface.contact_nodes])

    def _asked(self, request: type[Traction | Coupling], x: Floats, history: History, multipliers: Floats | None,
               sticking: float) -> Callable[[str], Request]:
        """Return a request by the name of the surfaces."""
        at, of_now = self._at_surfaces(x), history.multipliers if multipliers is None else multipliers
        return lambda name: request(name, at, of_now, history.x, history.multipliers, history.mobilised,
                                    history.mobilised_at, sticking)

    def _answer(self, link: Link, request: Callable[[str], Request], of: type[R]) -> R:
        reply = self._ask(link, request)
        if not isinstance(reply, of):
            raise ContactRefusedError(f"contact does not answer: {_reason(reply)}")
        return reply

    def _ask(self, link: Link, request: Callable[[str], Request]) -> Reply:
        """Ask the service; where it has not registered the surfaces (yet, or any more), register them first."""
        if self._registered_as:
            reply = link.ask(request(self._registered_as))
            # fault: surfaces forgotten -> if not (isinstance(reply, Refused) and reply.code == "never"): |
            #   thermal_fmu/test_thermal_half
            if not (isinstance(reply, Refused) and reply.code == "unknown_surfaces"):
                return reply
        registered = link.ask(self.message)
        if not isinstance(registered, Registered):
            raise ContactRefusedError(f"contact does not take the surfaces: {_reason(registered)}")
        self._registered_as = registered.surfaces
        return link.ask(request(registered.surfaces))


def _reason(reply: Reply) -> str:
    return f"{reply.code}: {reply.message}" if isinstance(reply, Refused) else f"it sent {type(reply).__name__}"
