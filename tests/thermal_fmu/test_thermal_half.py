"""The thermal half as a half: purity, caches, discards, model.json, its FMU."""

from __future__ import annotations

import copy
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fmpy.validation import validate_fmu

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import Box, FlatContact, inputs_of, scene, spec

from contact.half.interface import Pair, write_interface
from contact.half.model import Discard, Done
from contact.half.state import from_bytes, to_bytes
from contact.messages import Refused, Register
from thermal_fmu.half import load


def blocks():
    mesh = scene(Box(0, 1, 0, 1, 4, 4, triangles=True), Box(0.3, 1.3, 1, 2, 5, 3),
                 pairs=(Pair("p", "b.bottom", "a.top", 0.5, 1e9),))
    model = spec([{"on": "a.bottom", "temperature": 300.0, "name": "floor"},
                  {"on": "b.top", "convection": {"h": 3.0, "T": 500.0, "exponent": 0.3}}],
                 k={"polynomial": [1.0, 1e-3]}, c={"polynomial": [1.0, 0.0, 1e-6]}, T0=300.0,
                 pairs={"p": {"conduction": {"closed": {"law": "constant", "h": 20.0}, "open": None}}})
    model["bodies"]["b"] = {"material": "m", "T0": 600.0}
    return mesh, model


def trail(half, mesh, state, link, first, last):
    """The bits of every output of steps first..last; method and sizes change on the way."""
    bits = []
    for i in range(first, last):
        x = mesh.nodes + np.where(mesh.node_body == 1, 0.01 * i, 0.0)[:, None] * np.array([1.0, 0.0])
        given = inputs_of(mesh, half, x=x, t_N=np.full(len(mesh.pair_nodes), -1e5), load_floor=1.0 + 0.01 * i)
        given |= {"control.method": i % 4, "control.event": i // 5}
        done = half.step(state, given, 0.02 * i, 0.02, link)
        assert isinstance(done, Done), done
        state = done.state
        bits.append({k: np.asarray(v).tobytes() for k, v in done.outputs.items()})
    return state, bits


def test_a_step_is_pure_and_hot_and_cold_caches_give_the_same_bits():
    mesh, model = blocks()
    half, link = load(mesh, model), FlatContact()
    state, _ = half.start(inputs_of(mesh, half), 0.0, link)
    middle, _ = trail(half, mesh, state, link, 0, 6)
    before = copy.deepcopy(middle)
    _, once = trail(half, mesh, middle, link, 6, 12)
    trail(half, mesh, state, link, 0, 3)  # other matrices in the cache
    _, again = trail(half, mesh, middle, link, 6, 12)
    _, cold = trail(load(mesh, model), mesh, middle, link, 6, 12)
    assert once == again == cold
    assert to_bytes(before) == to_bytes(middle)


def test_the_state_survives_as_bytes():
    mesh, model = blocks()
    half, link = load(mesh, model), FlatContact()
    state, _ = half.start(inputs_of(mesh, half), 0.0, link)
    state, _ = trail(half, mesh, state, link, 0, 2)
    restored = from_bytes(to_bytes(state), {"thermal_fmu"})
    assert trail(half, mesh, state, link, 2, 5)[1] == trail(load(mesh, model), mesh, restored, link, 2, 5)[1]


def test_an_inverted_cell_is_a_discard_that_names_it():
    mesh, model = blocks()
    half, link = load(mesh, model), FlatContact()
    state, _ = half.start(inputs_of(mesh, half), 0.0, link)
    x = mesh.nodes.copy()
    corner = int(np.argmin(np.hypot(*(mesh.nodes - [1.3, 2.0]).T)))
    x[corner] -= 0.5
    answer = half.step(state, inputs_of(mesh, half, x=x), 0.0, 0.1, link)
    assert isinstance(answer, Discard)
    assert "cell 15 of body b" in answer.message


def test_the_second_triangle_is_named_after_the_quads():
    mesh, model = blocks()
    half, link = load(mesh, model), FlatContact()
    state, _ = half.start(inputs_of(mesh, half), 0.0, link)
    x = mesh.nodes.copy()
    x[1, 1] = 2.0  # second node of a's bottom row: cells 2, ... of a turn over
    answer = half.step(state, inputs_of(mesh, half, x=x), 0.0, 0.1, link)
    assert isinstance(answer, Discard)
    assert "of body a" in answer.message
    assert int(answer.message.split("cell ")[1].split()[0]) > len(mesh.quads)


def test_what_does_not_converge_is_a_discard_with_a_smaller_step():
    """A conductivity that falls below zero on the way (a polynomial cannot be checked at load)."""
    bar = scene(Box(0, 1, 0, 1, 4))
    half = load(bar, spec([{"on": "a.left", "flux": 500.0}], k={"polynomial": [1.0, -0.01]}))
    state, _ = half.start(inputs_of(bar, half), 0.0, FlatContact())
    answer = half.step(state, inputs_of(bar, half), 0.0, 2.0, FlatContact())
    assert isinstance(answer, Discard)
    assert answer.dt_suggest == 1.0
    assert "conductivity of body a" in answer.message


def test_a_steady_body_without_any_hold_is_a_discard():
    bar = scene(Box(0, 1, 0, 1, 4))
    half = load(bar, spec([{"on": "a.left", "flux": 5.0}], method="steady", T0=300.0))
    state, _ = half.start(inputs_of(bar, half), 0.0, FlatContact())
    assert isinstance(half.step(state, inputs_of(bar, half), 0.0, 2.0, FlatContact()), Discard)


def test_a_contact_service_that_refuses_or_forgets():
    """A refusal is a discard with its reason; a service that knows no surfaces is told of them again."""
    mesh, model = blocks()

    class Forgetful(FlatContact):
        refuse = ""

        def ask(self, request):
            if isinstance(request, Register):
                self.knows = True
            elif self.refuse or not self.knows:
                return Refused(self.refuse or "unknown_surfaces", "no")
            return super().ask(request)

    half, link = load(mesh, model), Forgetful()
    state, _ = half.start(inputs_of(mesh, half), 0.0, link)
    link.knows = False
    assert isinstance(half.step(state, inputs_of(mesh, half), 0.0, 0.1, link), Done)
    link.refuse = "busy"
    answer = half.step(state, inputs_of(mesh, half), 0.0, 0.1, link)
    assert isinstance(answer, Discard)
    assert "busy" in answer.message


def test_first_outputs_are_the_initial_state():
    mesh, model = blocks()
    half = load(mesh, model)
    _, first = half.start(inputs_of(mesh, half), 0.0, FlatContact())
    T = np.where(mesh.node_body == 1, 600.0, 300.0)
    assert np.array_equal(first["T"], T)
    assert np.array_equal(first["surface.T"], T[mesh.contact_nodes])
    told = {k: v for k, v in first.items() if k not in ("T", "surface.T", "heat_rounding") and "_off." not in k}
    assert not any(np.any(v) for v in told.values())
    assert {v.name for v in half.variables if v.causality == "output"} == set(first)


def _without(model, *path):
    changed = copy.deepcopy(model)
    place = changed
    for key in path[:-1]:
        place = place[key]
    del place[path[-1]]
    return changed


def _with(model, value, *path):
    changed = copy.deepcopy(model)
    place = changed
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return changed


@pytest.mark.parametrize(("path", "value", "words"), [
    (("boundary", 0, "radiator"), {}, ("boundary.0.radiator", "radiation", "temperature")),
    (("boundary", 0, "on"), "a.botom", ("boundary.0.on", "a.botom", "a.bottom")),
    (("boundary", 1, "on"), "nowhere", ("boundary.1.on", "nowhere")),
    (("boundary", 1, "convection", "h"), -3.0, ("boundary.1.convection.h", "negative", "-3.0")),
    (("boundary", 1, "convection", "gap"), {"d_cut": 1e-3}, ("boundary.1.convection.gap.d_full",)),
    (("boundary", 1, "convection", "exponant"), 1.0, ("exponant", "exponent")),
    (("materials", "m", "rho"), -1.0, ("materials.m.rho", "-1.0")),
    (("materials", "m", "k"), 0.0, ("materials.m.k", "greater than zero")),
    (("materials", "m", "c"), {"T": [1, 2], "value": [3, -4]}, ("materials.m.c", "-4")),
    (("materials", "m", "c"), {"T": [2, 1], "value": [3, 4]}, ("materials.m.c", "increase")),
    (("bodies", "a", "T0"), "hot", ("bodies.a.T0", "hot")),
    (("bodies", "a", "T0"), float("nan"), ("bodies.a.T0",)),
    (("bodies", "a", "material"), "brass", ("bodies.a.material", "brass", "m")),
    (("bodies", "c"), {"material": "m", "T0": 1.0}, ("bodies", "c", "a, b")),
    (("pairs", "q"), {}, ("pairs", "q", "p")),
    (("pairs", "p", "conduction", "closed"), {"law": "magic"}, ("pairs.p.conduction.closed.law", "magic")),
    (("method",), "euler", ("method", "euler", "midpoint")),
    (("half",), "elastic", ("elastic",)),
    (("tolerance",), 0, ("tolerance",)),
])
def test_a_wrong_model_is_refused_by_key_and_value(path, value, words):
    mesh, model = blocks()
    with pytest.raises(ValueError, match=r"model\.json") as caught:
        load(mesh, _with(model, value, *path))
    assert all(word in str(caught.value) for word in words), str(caught.value)


@pytest.mark.parametrize("path", [("materials",), ("bodies", "b"), ("materials", "m", "c"), ("half",)])
def test_a_missing_key_is_named(path):
    mesh, model = blocks()
    with pytest.raises(ValueError, match=str(path[-1])):
        load(mesh, _without(model, *path))


HOST = """
import sys, json
import numpy as np
from pathlib import Path
from coupler.fmu.fmi import load_half
half = load_half(Path(sys.argv[1]), None, "thermal")
try:
    n = half.blocks["T"].shape[0]
    first = half.initialise(0.0, 1.0, {}, {}, ["T"])
    token = half.save()
    runs = []
    for _ in range(2):
        T = [half.advance(0.1 * i, 0.1, {}, ["T", "heat.stored.a"]) for i in range(3)]
        assert all(a.status.value == "ok" for a in T), [a.message for a in T]
        runs.append([a.outputs["T"].tobytes() for a in T])
        half.restore(token)
    half.release(token)
    assert runs[0] == runs[1]
    print(json.dumps({"n": n, "same": True, "T": float(T[-1].outputs["T"].max())}))
finally:
    half.close()
"""


@pytest.mark.slow
def test_its_fmu_is_valid_and_runs(tmp_path):
    """Built by its own command, loaded by the coupler's importer in a fresh process, stepped, put back, stepped."""
    mesh, model = blocks()
    write_interface(mesh, tmp_path / "interface.h5")
    (tmp_path / "model.json").write_text(json.dumps(model), encoding="utf-8")
    out = tmp_path / "thermal.fmu"
    root = str(Path(__file__).resolve().parents[2])
    built = subprocess.run([sys.executable, "-m", "thermal_fmu.build", str(tmp_path), str(out)], check=False,
                           capture_output=True, text=True, cwd=root, timeout=240)
    assert built.returncode == 0, built.stderr
    assert validate_fmu(str(out)) == []
    ran = subprocess.run([sys.executable, "-c", HOST, str(out)], check=False, capture_output=True, text=True, cwd=root,
                         timeout=240)
    assert ran.returncode == 0, ran.stderr[-3000:]
    answer = json.loads(ran.stdout.strip().splitlines()[-1])
    assert answer["n"] == len(mesh.nodes)
    assert 300.0 < answer["T"] < 600.0
