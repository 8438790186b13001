"""Pairs of surfaces for the tests of contact: flat, curved, and whatever is done to them."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np

from contact.messages import Facing, Floats, Ints, Passes, Project, Register, Registered, Traction, Tractions
from contact.pair_nodes import pair_layout_of
from contact.service import ContactService
from contact.surfaces import RegisteredSurfaces, surfaces_of

EXPECTED = tomllib.loads((Path(__file__).parent.parent / "expected.toml").read_text(encoding="utf-8"))
GAP_MAX, EPS = 0.5, 1e9


def chain(n: int, first: int) -> Ints:
    """n edges from node `first` on."""
    return np.column_stack([np.arange(n), np.arange(1, n + 1)]) + first


def passes(*sides: tuple[int, int], weight: float = 1.0, by_node: bool = False, mu: float = 0.0,
           gap_max: float = GAP_MAX) -> Passes:
    """Passes of one pair, each (slave, master)."""
    def ints(*values: int) -> Ints:
        return np.array(values, dtype=np.int32)

    n = len(sides)
    return Passes(ints(*[0] * n), ints(*(s for s, _ in sides)), ints(*(m for _, m in sides)), np.full(n, weight),
                  ints(*[int(by_node)] * n), np.full(n, gap_max), np.full(n, EPS), np.full(n, EPS), np.full(n, mu))


def scene(slave: Floats, master: Floats, *, axisymmetric: bool = False) -> tuple[Register, Floats]:
    """One pair from the nodes along each surface, body on the left."""
    n_s, n_m = len(slave) - 1, len(master) - 1
    edges = np.concatenate([chain(n_s, 0), chain(n_m, n_s + 1)]).astype(np.int32)
    register = Register(n_s + n_m + 2, edges, np.repeat([0, 1], [n_s, n_m]).astype(np.int32), axisymmetric,
                        passes((0, 1)))
    return register, np.concatenate([slave, master])


def flat(n_s: int, n_m: int, *, slide: float = 0.0, gap: float = 0.01,
         axisymmetric: bool = False) -> tuple[Register, Floats]:
    """Unit-wide blocks, slave above; spacing uneven so that nothing is exact by luck."""
    def grid(n: int, power: float) -> Floats:
        return np.linspace(0.0, 1.0, n + 1) ** power

    slave = np.column_stack([grid(n_s, 1.1) + slide, np.full(n_s + 1, gap)])
    master = np.column_stack([grid(n_m, 0.9)[::-1], np.zeros(n_m + 1)])
    return scene(slave, master, axisymmetric=axisymmetric)


def curved(n_s: int, n_m: int, *, gap: float = 0.02, slave_end: float = 1.9) -> tuple[Register, Floats]:
    """A disc of radius 1 (slave, lower arc) in a bowl of radius 1 + gap that reaches less far round."""
    a = np.linspace(np.pi + 0.9, np.pi + slave_end, n_s + 1)
    b = np.linspace(np.pi + 2.2, np.pi + 0.7, n_m + 1)
    slave = np.column_stack([np.cos(a), np.sin(a)])
    return scene(slave, (1.0 + gap) * np.column_stack([np.cos(b), np.sin(b)]))


def ask(register: Register, x: Floats) -> Facing:
    """Facing of a scene through the service."""
    service = ContactService()
    registered = service.handle(register)
    assert isinstance(registered, Registered), registered
    facing = service.handle(Project(registered.surfaces, x))
    assert isinstance(facing, Facing), facing
    return facing


def push(register: Register, x: Floats, multipliers: Floats | None = None, x_before: Floats | None = None,
         mobilised: Floats | None = None, multipliers_before: Floats | None = None,
         mobilised_at: Floats | None = None, sticking: float = 1.0) -> Tractions:
    """Tractions of a scene through the service."""
    service = ContactService()
    registered = service.handle(register)
    assert isinstance(registered, Registered), registered
    layout = pair_layout_of(register)
    zeros = np.zeros(layout.size)
    given = np.zeros(layout.n_multipliers) if multipliers is None else multipliers
    reply = service.handle(Traction(registered.surfaces, x, given, x if x_before is None else x_before,
                                    given if multipliers_before is None else multipliers_before,
                                    zeros if mobilised is None else mobilised, mobilised_at, sticking))
    assert isinstance(reply, Tractions), reply
    return reply


def kept(register: Register) -> RegisteredSurfaces:
    """The surfaces as the service keeps them."""
    return surfaces_of(register)


def renumbered(register: Register, x: Floats, seed: int = 3) -> tuple[Register, Floats, Ints, Ints]:
    """The same scene with nodes and edges (within their surfaces) in another order: new register, new x, and the
    place of every old node and old edge in the new numbering."""
    random = np.random.default_rng(seed)
    node = random.permutation(register.n_nodes)
    x_new = np.empty_like(x)
    x_new[node] = x
    order = np.concatenate([random.permutation(np.flatnonzero(register.edge_surface == k)) for k in (0, 1)])
    edge = np.empty_like(order)
    edge[order] = np.arange(order.size)
    edges = node[register.edges[order]].astype(np.int32)
    return replace(register, edges=edges), x_new, node, edge


def mirrored(register: Register, x: Floats) -> tuple[Register, Floats]:
    """The scene in a mirror at x = 0: edges change their direction so that the body stays on the left."""
    edges = np.ascontiguousarray(register.edges[:, ::-1])
    return replace(register, edges=edges), x * np.array([-1.0, 1.0])
