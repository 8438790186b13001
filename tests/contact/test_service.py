"""The service answers every request, refuses wrong ones in words, and remembers nothing but registered surfaces."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import flat, passes

import contact.service
from contact.messages import Facing, Project, Refused, Register, Registered, Traction, Tractions
from contact.service import MAX_SCENES, ContactService

REGISTER, X = flat(5, 7)


def registered(service: ContactService, register: Register = REGISTER) -> str:
    reply = service.handle(register)
    assert isinstance(reply, Registered), reply
    return reply.surfaces


def refusal(service: ContactService, request: Any) -> Refused:
    reply = service.handle(request)
    assert isinstance(reply, Refused), reply
    return reply


def spoiled(value: float) -> np.ndarray:
    x = X.copy()
    x[3, 1] = value
    return x


@pytest.mark.parametrize("x", [spoiled(np.nan), spoiled(np.inf), spoiled(-1e200), X[:-1], X.ravel(), X.astype(str),
                               X.astype(complex), np.empty((0, 2)), "x", None])
def test_wrong_coordinates_are_refused(x: Any) -> None:
    service = ContactService()
    key = registered(service)
    for request in (Project(key, x), replace(traction(key, X), x=x)):
        reply = refusal(service, request)
        assert reply.code == "bad_request"
        assert "x" in reply.message


@pytest.mark.parametrize("multipliers", [np.full(len(X), np.nan), np.zeros(3), np.ones(len(X)), None])
def test_wrong_multipliers_are_refused(multipliers: Any) -> None:
    service = ContactService()
    reply = refusal(service, traction(registered(service), X, multipliers=multipliers))
    assert reply.code == "bad_request"
    assert "multipliers" in reply.message


@pytest.mark.parametrize("sticking", [0.0, -1.0, np.nan, np.inf, "much", None, [1.0, 1.0]])
def test_a_wrong_share_of_sticking_is_refused(sticking: Any) -> None:
    service = ContactService()
    reply = refusal(service, traction(registered(service), X, sticking=sticking))
    assert reply.code == "bad_request"
    assert "sticking" in reply.message


def test_an_edge_without_length_is_refused_by_number() -> None:
    service = ContactService()
    x = X.copy()
    x[3] = x[2]
    reply = refusal(service, Project(registered(service), x))
    assert reply.code == "bad_request"
    assert "edge 2" in reply.message


def test_a_node_beyond_the_axis_is_refused() -> None:
    service = ContactService()
    register, x = flat(5, 7, axisymmetric=True)
    key = registered(service, register)
    assert isinstance(service.handle(Project(key, x - [1e-12, 0.0])), Facing), "round-off at the axis is none"
    reply = refusal(service, Project(key, x - [0.01, 0.0]))
    assert reply.code == "bad_request"
    assert "axis" in reply.message


def test_unknown_surfaces_are_named() -> None:
    service = ContactService()
    for request in (Project("nobody", X), traction("nobody", X)):
        reply = refusal(service, request)
        assert reply.code == "unknown_surfaces"
        assert "nobody" in reply.message
    for request in ("hello", None, Refused("a", "b")):
        assert refusal(service, request).code == "bad_request"


def changed(**fields: Any) -> Register:
    """The scene with other fields, of its passes where they have them."""
    own = {name: value for name, value in fields.items() if hasattr(REGISTER, name)}
    others = {name: value for name, value in fields.items() if name not in own}
    return replace(REGISTER, **own, passes=replace(REGISTER.passes, **others))


def traction(key: str, x: Any, **given: Any) -> Traction:
    """A Traction request without history but for what is given."""
    zeros = np.zeros(len(x))
    return Traction(**{"surfaces": key, "x": x, "multipliers": zeros, "x_before": x,
                       "multipliers_before": zeros, "mobilised": zeros, **given})


@pytest.mark.parametrize(("register", "word"), [
    (changed(n_nodes=3), "nodes"),
    (changed(n_nodes=-1), "n_nodes"),
    (changed(n_nodes=14.0), "n_nodes"),
    (changed(edges=REGISTER.edges.astype(float)), "edges"),
    (changed(edges=-REGISTER.edges), "edges"),
    (changed(edges=REGISTER.edges.ravel()), "edges"),
    (changed(edges=np.zeros_like(REGISTER.edges)), "both ends"),
    (changed(edges=np.concatenate([REGISTER.edges[:1, ::-1], REGISTER.edges[1:]])), "same way"),
    (changed(edge_surface=REGISTER.edge_surface[:-1]), "edge_surface"),
    (changed(edge_surface=REGISTER.edge_surface[::-1]), "consecutive"),
    (changed(master=np.array([2])), "surface 2"),
    (changed(weight=np.array([0.0])), "weight"),
    (changed(by_node=np.array([2])), "by_node"),
    (changed(mu=np.array([-0.1])), "mu"),
    (changed(master=np.array([1, 1])), "passes.master"),
    (changed(slave=np.array([[0]])), "passes.slave"),
    (changed(gap_max=np.array([0.0])), "gap_max"),
    (changed(gap_max=np.array([np.nan])), "gap_max"),
    (changed(eps_N=np.array([-1.0])), "eps_N"),
    (changed(eps_N=None), "eps_N"),
])
def test_wrong_surfaces_are_refused(register: Register, word: str) -> None:
    reply = refusal(ContactService(), register)
    assert reply.code == "bad_request"
    assert word in reply.message


def test_the_key_is_the_content() -> None:
    """Same surfaces, same key, in any service and integer type; any change gives another."""
    key = registered(ContactService())
    assert key == registered(ContactService(), changed(edges=REGISTER.edges.astype(np.int64)))
    others = [changed(axisymmetric=True), changed(gap_max=np.array([0.4])), changed(eps_N=np.array([1.0])),
              changed(n_nodes=20), changed(edges=REGISTER.edges[[1, 0, *range(2, 12)]])]
    keys = {registered(ContactService(), other) for other in others}
    assert len(keys) == len(others)
    assert key not in keys


def test_a_reply_does_not_depend_on_what_was_asked_before() -> None:
    service = ContactService()
    key = registered(service)
    before = service.handle(traction(key, X - [0, 0.011] * (X[:, 1:] > 0)))
    service.handle(Project(key, X + 0.1 * np.arange(2)))
    service.handle(Project(key, spoiled(np.nan)))
    registered(service, changed(axisymmetric=True))
    after = service.handle(traction(key, X - [0, 0.011] * (X[:, 1:] > 0)))
    assert isinstance(before, Tractions)
    assert before.n_touching > 0
    assert all(np.asarray(a).tobytes() == np.asarray(b).tobytes()
               for a, b in zip(vars(before).values(), vars(after).values(), strict=True))


def test_replies_have_the_types_of_the_wire() -> None:
    """int32 and float64, C-ordered: what the codec carries."""
    service = ContactService()
    key = registered(service)
    replies = (service.handle(Project(key, X)), service.handle(traction(key, X)),
               service.handle(traction(key, X[::1] - [0, 0.011] * (X[:, 1:] > 0))))
    for reply in replies:
        assert isinstance(reply, (Facing, Tractions))
        for name, value in vars(reply).items():
            if name.startswith("n_"):
                assert type(value) is int
                continue
            if name == "stored":
                assert type(value) is float
                continue
            whole = name in ("pair", "slave_edge", "master_edge", "starts", "columns")
            assert value.dtype == (np.int32 if whole else np.float64), name
            assert value.flags.c_contiguous, name
            assert np.isfinite(value).all(), name


def test_a_scene_without_pairs_or_nodes_is_answered() -> None:
    service = ContactService()
    none = np.empty(0, dtype=np.int32)
    key = registered(service, Register(0, np.empty((0, 2), dtype=np.int32), none, False, passes()))
    facing = service.handle(Project(key, np.empty((0, 2))))
    assert isinstance(facing, Facing)
    assert facing.area.size == 0
    assert isinstance(service.handle(traction(key, np.empty((0, 2)))), Tractions)


def test_scenes_unused_longest_are_forgotten() -> None:
    service = ContactService()
    key = registered(service)
    for i in range(MAX_SCENES - 1):
        registered(service, changed(gap_max=np.array([1.0 + i])))
    assert isinstance(service.handle(Project(key, X)), Facing)
    registered(service, changed(gap_max=np.array([1e3])))
    assert isinstance(service.handle(Project(key, X)), Facing), "it was used just now"
    first = ContactService().handle(changed(gap_max=np.array([1.0])))
    assert isinstance(first, Registered)
    assert refusal(service, Project(first.surfaces, X)).code == "unknown_surfaces"


def test_a_bug_is_a_reply_with_its_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: Any) -> Any:
        raise ZeroDivisionError("planted")

    service = ContactService()
    key = registered(service)
    monkeypatch.setattr(contact.service, "project", broken)
    reply = refusal(service, Project(key, X))
    assert reply.code == "bug"
    assert "planted" in reply.message


def test_passes_of_the_same_two_surfaces_are_few():
    """A pass is 60 bytes of a request and may be megabytes of its reply: 18 kB made one of 273 MB, in 9 s."""
    def often(n: int) -> Register:
        p = REGISTER.passes
        more = {k: np.tile(v, n) for k, v in vars(p).items() if v is not None}
        return replace(REGISTER, passes=replace(p, **{**more, "pair": np.arange(n, dtype=np.int32)}))

    service = ContactService()
    assert isinstance(service.handle(often(4)), Registered)
    refused = refusal(service, often(5))
    assert refused.code == "bad_request"
    assert "5 passes search surface" in refused.message
