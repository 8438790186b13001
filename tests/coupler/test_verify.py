"""`slideline verify-half`: halves that keep to the border pass, and every way to break it is caught by its check."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
import pytest
from typer.testing import CliRunner

from coupler.cli.cli import app
from coupler.errors import HalfError, ScenarioError
from coupler.fmu.half import Advance, Block, Status
from coupler.verify.border import CheckVerdict, Finding, conclusion, description_findings, role_of, table_of
from coupler.verify.conformance import verify_half

N = 3


def block(name: str, shape: tuple[int, ...], unit: str, causality: str, kind: str = "Real") -> Block:
    return Block(name, shape, unit, causality, kind)


GOOD = {b.name: b for b in (
    block("T", (N,), "K", "output"), block("x", (N, 2), "m", "input"), block("E_M", (2,), "J", "input"),
    block("contact.t_N", (2,), "Pa", "input"), block("surface.T", (2,), "K", "output"),
    block("load.oven", (), "1", "input"), block("heat.stored.body", (), "J", "output"),
    block("heat.mechanical", (), "J", "output"), block("heat.flux", (), "J", "output"),
    block("iterations", (), "1", "output"), block("status.code", (), "1", "output", "Integer"),
    block("mesh.hash", (), "1", "output", "String"), block("surfaces.hash", (), "1", "output", "String"),
    block("geometry", (), "1", "output", "String"))}


@dataclass
class Honest:
    """T falls towards 300 K and takes heat; steps above h_max are refused.  Each class below breaks one promise."""

    can_save: bool = True
    can_serialise: bool = True
    h_max: float = 0.6
    blocks: Mapping[str, Block] = field(default_factory=lambda: dict(GOOD))
    strings: Mapping[str, str] = field(default_factory=dict)
    name: str = "honest"
    now: dict[str, Any] = field(default_factory=dict)
    saved: dict[int, dict[str, Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        shapes = {name: b.shape for name, b in self.blocks.items() if b.kind != "String"}
        self.now = {name: np.zeros(shape) for name, shape in shapes.items()}
        self.now |= {"x": np.arange(2.0 * N).reshape(N, 2), "T": np.full(N, 500.0)}

    def initialise(self, t_start: float, t_end: float, parameters: Any, inputs: Any, outputs: Any) -> dict[str, Any]:
        self.now |= {name: np.array(v) for name, v in inputs.items()}
        return self.read(outputs)

    def advance(self, t: float, h: float, inputs: Mapping[str, Any], outputs: Sequence[str]) -> Advance:
        self.now |= {name: np.array(v) for name, v in inputs.items()}
        if not (0 < h <= self.h_max and all(np.isfinite(v).all() for v in self.now.values())):
            return Advance(Status.DISCARD, self.refusal(), {}, 0.0)
        T = self.now["T"]
        new = T + h * (300.0 - T) * 0.1 + self.now["E_M"].sum() + h * 1e-3 * self.now["x"][:, 0]
        self.now = {**self.now, "T": new, "heat.mechanical": np.array(self.now["E_M"].sum()),
                    "heat.stored.body": np.array((new - T).sum()), "surface.T": new[:2],
                    "heat.flux": np.array((new - T).sum() - self.now["E_M"].sum())}
        return Advance(Status.OK, "", self.read(outputs), 0.0)

    def refusal(self) -> str:
        return "too long, or no numbers"

    def read(self, names: Sequence[str]) -> dict[str, Any]:
        return {name: np.array(self.now[name]) for name in names}

    def save(self) -> int:
        self.saved[len(self.saved)] = dict(self.now)
        return len(self.saved) - 1

    def restore(self, token: int) -> None:
        self.now = dict(self.saved[token])

    def release(self, token: int) -> None: ...

    def serialise(self, token: int) -> bytes:
        return json.dumps({name: np.asarray(v).tolist() for name, v in self.saved[token].items()}).encode()

    def deserialise(self, data: bytes) -> int:
        self.saved[len(self.saved)] = {name: np.array(v) for name, v in json.loads(data).items()}
        return len(self.saved) - 1

    def log_tail(self) -> str:
        return ""

    def close(self) -> None: ...


@dataclass
class Leaking(Honest):
    """Counts its steps beside the state: what every restore must bring back, this one does not."""

    made: int = 0

    def advance(self, t: float, h: float, inputs: Any, outputs: Any) -> Advance:
        done = super().advance(t, h, inputs, outputs)
        if done.status is Status.OK:
            self.made += 1
            self.now = {**self.now, "T": self.now["T"] + 1e-9 * self.made}
        return Advance(done.status, done.message, self.read(outputs) if done.outputs else {}, 0.0)


class Shared(Honest):
    """Instances share a memory."""

    made: ClassVar[int] = 0

    def advance(self, t: float, h: float, inputs: Any, outputs: Any) -> Advance:
        Shared.made += 1
        self.now = {**self.now, "T": self.now["T"] + 1e-9 * Shared.made}
        return super().advance(t, h, inputs, outputs)


class Shy(Honest):
    """Changes when it is looked at."""

    def read(self, names: Sequence[str]) -> dict[str, Any]:
        got = super().read(names)
        if "T" in names:
            self.now = {**self.now, "T": np.nextafter(self.now["T"], np.inf)}
        return got


class OldOutputs(Honest):
    """Restores all but what it shows."""

    def restore(self, token: int) -> None:
        self.now = {**self.saved[token], "surface.T": self.now["surface.T"]}


class NewInputs(Honest):
    """Restores all but its inputs."""

    def restore(self, token: int) -> None:
        inputs = {name: self.now[name] for name, b in self.blocks.items() if b.causality == "input"}
        self.now = {**self.saved[token], **inputs}


class Rounding(Honest):
    """Writes its state down in single precision: warm it goes on in other bits than cold."""

    def deserialise(self, data: bytes) -> int:
        token = super().deserialise(data)
        self.saved[token]["T"] = self.saved[token]["T"].astype(np.float32).astype(float)
        return token


class Mute(Honest):
    """Refuses without a word."""

    def refusal(self) -> str:
        return ""


class Hasty(Honest):
    """Takes the new state over before it knows whether the step succeeds."""

    def advance(self, t: float, h: float, inputs: Any, outputs: Any) -> Advance:
        done = super().advance(t, h, inputs, outputs)
        if done.status is Status.DISCARD:
            self.now = {**self.now, "T": self.now["T"] + 1.0}
        return done


@dataclass
class Scarred(Honest):
    """A refused step leaves a first guess behind that changes the next one, restored or not."""

    hurt: float = 0.0

    def advance(self, t: float, h: float, inputs: Any, outputs: Any) -> Advance:
        self.now = {**self.now, "T": self.now["T"] + self.hurt}
        done = super().advance(t, h, inputs, outputs)
        self.hurt = 1e-9 if done.status is Status.DISCARD else 0.0
        return done


@dataclass
class Rated(Honest):
    """Remembers the size of its last step where that changes: a rate kept beside the state."""

    last: float = 0.0

    def advance(self, t: float, h: float, inputs: Any, outputs: Any) -> Advance:
        if self.last and h != self.last and 0 < h < self.last:
            self.h_max = 0.6 + 1e-9
        self.last = h or self.last
        self.now = {**self.now, "T": self.now["T"] + (self.h_max - 0.6)}
        return super().advance(t, h, inputs, outputs)


class Losing(Honest):
    """Tells a third of its heat as stored too little."""

    def advance(self, t: float, h: float, inputs: Any, outputs: Any) -> Advance:
        done = super().advance(t, h, inputs, outputs)
        self.now = {**self.now, "heat.stored.body": self.now["heat.stored.body"] * (1 + 1e-6)}
        return Advance(done.status, done.message, self.read(outputs) if done.outputs else {}, 0.0)


class Throwing(Honest):
    """Fails where it should discard."""

    def advance(self, t: float, h: float, inputs: Any, outputs: Any) -> Advance:
        done = super().advance(t, h, inputs, outputs)
        if done.status is Status.DISCARD and h != 1.0:
            raise HalfError("fmi2DoStep answered error")
        return done


def found(kind: type[Honest], **made: Any) -> dict[str, Finding]:
    return {f.check: f for f in verify_half(lambda: kind(**made), 1.0)}


def verdicts(findings: Mapping[str, Finding], verdict: CheckVerdict) -> set[str]:
    return {f.check for f in findings.values() if f.verdict is verdict}


def test_an_honest_half_passes_everything():
    findings = found(Honest)
    # No scene is known here.
    assert verdicts(findings, CheckVerdict.PASS) == set(findings) - {
        "starts as the scene", "answers to pressure", "answers to a gap", "heat warms a body", "cells in order",
        "agrees with our half"}
    assert len(findings) == 31
    assert findings["takes substeps"].reason == "of 0.5 s"  # 1 s is refused, and halved


RESTORE, TRACE = "save and restore to the bit", "a rejected substep leaves no trace"


@pytest.mark.parametrize(("kind", "check"), [
    (Leaking, RESTORE), (Shared, "same inputs, same bits"), (Shy, "reading has no side effect"), (OldOutputs, RESTORE),
    (NewInputs, "inputs are part of the state"), (Rounding, "hot and cold caches, same bits"),
    (Mute, "a bad substep is discarded"), (Hasty, TRACE), (Scarred, TRACE), (Rated, "substeps of one window"),
    (Losing, "heat terms close"), (Throwing, "a bad substep is discarded")])
def test_a_broken_promise_is_caught_by_its_check(kind: type[Honest], check: str) -> None:
    findings = found(kind)
    assert findings[check].verdict is CheckVerdict.FAIL
    assert findings[check].reason
    assert findings[check].remedy


def test_what_leaks_names_the_output():
    finding = found(Leaking)[RESTORE]
    assert "after the first restore substep 2 gives another T" in finding.reason
    assert "counters" in finding.remedy


def test_a_half_without_state_is_told_what_that_costs():
    findings = found(Honest, can_save=False, can_serialise=False)
    assert not verdicts(findings, CheckVerdict.FAIL)
    missing = verdicts(findings, CheckVerdict.NOT_APPLICABLE)
    assert {RESTORE, TRACE, "keeps its state", "writes its state down", "hot and cold caches, same bits"} <= missing
    assert "no iteration" in findings["keeps its state"].remedy


def test_a_half_that_takes_no_step_says_so():
    findings = found(Honest, h_max=0.0)
    assert findings["takes substeps"].verdict is CheckVerdict.FAIL
    assert "--step" in findings["takes substeps"].remedy
    assert RESTORE not in findings


@pytest.mark.parametrize(("change", "check", "text"), [
    ({"T": {"unit": "degC"}}, "units", "T is in degC, not K"),
    ({"x": {"causality": "output"}}, "role", "exactly one"),
    ({"E_M": {"causality": "output"}}, "causality", "E_M is output, not input"),
    ({"status.code": {"kind": "Real"}}, "types", "status.code is Real, not Integer"),
    ({"x": {"shape": (2 * N,)}}, "shapes", "x has 1 indices, not 2"),
    ({"T": {"shape": (N + 1,)}}, "shapes", "of different length: T 4, x 3"),
    ({"E_M": {"on": "contact_nodes", "shape": (5,)}, "surface.T": {"on": "contact_nodes"}}, "shapes",
     "of different length: E_M 5, surface.T 2"),
    ({"surface.T": {"name": "surface_T"}}, "names", "surface_T (meant surface.T?)"),
    ({"E_M": {"name": "E_M[2]"}}, "whole blocks", "E_M[2]"),
    ({"x": {"name": "coordinates"}}, "what a run needs", "x missing"),
])
def test_a_wrong_face_is_named(change: dict[str, dict[str, Any]], check: str, text: str) -> None:
    changed = [replace(b, **change.get(b.name, {})) for b in GOOD.values()]
    findings = {f.check: f for f in description_findings({b.name: b for b in changed})}
    assert findings[check].verdict is CheckVerdict.FAIL
    assert text in findings[check].reason


def test_the_role_follows_from_what_is_made():
    assert role_of(GOOD) == "thermal"
    assert role_of({"x": block("x", (3, 2), "m", "output")}) == "mechanical"
    assert role_of({}) == ""


def test_the_table_holds_reason_and_remedy():
    findings = list(found(Leaking).values())
    assert table_of("leaking.fmu", findings).row_count == len(findings)
    assert "leaking.fmu violates the interface specification" in conclusion("leaking.fmu", findings)
    assert "meets the interface specification: 25 passed" in conclusion("x", found(Honest).values())


@pytest.mark.parametrize(("arguments", "text"), [
    (("nowhere.fmu",), "no such FMU"),
    (("lumpd",), "Did you mean 'lumped'"),
    (("lumped", "--step", "0"), "longer than 0"),
])
def test_the_verb_refuses(arguments: tuple[str, ...], text: str) -> None:
    done = CliRunner().invoke(app, ["verify-half", *arguments])
    assert isinstance(done.exception, ScenarioError)
    assert text in str(done.exception)
