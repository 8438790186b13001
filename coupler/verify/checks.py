"""How a half behaves when it runs: each check drives new instances and compares their numbers to the bit."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np

from coupler.errors import HalfError, ScenarioError
from coupler.fmu.builders import build_half, known_halves
from coupler.fmu.description import Description
from coupler.fmu.half import Advance, Array, Block, Half, Status
from coupler.init.templates import templates
from coupler.running.demo import shipped_scenarios
from coupler.scenario import Scenario, load_scenario
from coupler.scenario.document import did_you_mean
from coupler.verify.border import BLOCKS, MECHANICAL, NEEDED, OUT, SAME_LENGTH, THERMAL, face_of

# What one check found.

class Verdict(Enum):
    """Of one check."""

    PASS = "pass"
    FAIL = "FAIL"
    NOT_APPLICABLE = "n/a"


@dataclass(frozen=True)
class Finding:
    """check : its name.  reason : what was seen.  remedy : what to change, of a failure; of n/a what it costs."""

    check: str
    verdict: Verdict
    reason: str = ""
    remedy: str = ""


def passed(check: str, reason: str = "") -> Finding:
    return Finding(check, Verdict.PASS, reason)


def failed(check: str, reason: str, remedy: str) -> Finding:
    return Finding(check, Verdict.FAIL, reason, remedy)


def not_applicable(check: str, reason: str, cost: str = "") -> Finding:
    return Finding(check, Verdict.NOT_APPLICABLE, reason, cost)


# A half on the bench: made afresh as often as wanted, driven by inputs that move a little from substep to substep.

HALVINGS = 20
END = 1e9  # s, stop time the half is told
NUMBERS = ("Real", "Integer", "Boolean")


@dataclass(frozen=True)
class Bench:
    """make : a new instance, loaded and not initialised.  h : size of a substep [s].

    starts : the Real inputs as a new instance has them.  blocks : all of the half's.
    """

    make: Callable[[], Half]
    h: float
    starts: Mapping[str, Array]
    blocks: Mapping[str, Block]

    @contextmanager
    def half(self) -> Iterator[Half]:
        """A new instance, initialised with its own start values; closed on the way out."""
        half = self.make()
        try:
            half.initialise(0.0, END, {}, self.starts, ())
            yield half
        finally:
            half.close()

    @property
    def outputs(self) -> list[str]:
        """All numbers it gives out."""
        return [name for name, b in self.blocks.items() if b.causality == "output" and b.kind in NUMBERS]

    def inputs(self, k: int) -> dict[str, Array]:
        """The inputs of substep k (from 1): start values, moved where a name or unit says what is harmless.

        Temperatures by 1 to 3 K a substep in a pattern, coordinates by 1e-7 of their span as a whole, pressures by
        1e5 Pa, heats by 1 mJ; loads, controls and what has no meaning at the border stay.
        """
        return {name: _moved(name, self.blocks[name].unit, start, k) for name, start in self.starts.items()}

    def step(self, half: Half, k: int) -> dict[str, Array]:
        """Substep k, from (k - 1) h by h; all outputs.  Raises HalfError where it is refused."""
        return took(half.advance((k - 1) * self.h, self.h, self.inputs(k), self.outputs))


def took(done: Advance) -> dict[str, Array]:
    """The outputs of a substep.  Raises HalfError where it was refused."""
    if done.status is not Status.OK:
        raise HalfError(f"it refused an ordinary substep: {done.message}")
    return done.outputs


def settled(make: Callable[[], Half], h: float) -> Bench:
    """A bench with a substep the half takes three times: h, or a half, a quarter, ... of it.  Raises HalfError."""
    half = make()
    try:
        blocks = dict(half.blocks)
        starts = half.read([name for name, b in blocks.items() if b.causality == "input" and b.kind == "Real"])
    finally:
        half.close()
    for _ in range(HALVINGS):
        bench = Bench(make, h, starts, blocks)
        with bench.half() as half:
            done = [half.advance((k - 1) * h, h, bench.inputs(k), ()) for k in (1, 2, 3)]
        if all(d.status is Status.OK for d in done):
            return bench
        h *= 0.5
    raise HalfError(f"it takes no substep, not even of {2 * h:.3g} s: {done[0].message}")


def differing(a: Mapping[str, Array], b: Mapping[str, Array]) -> list[str]:
    """Names whose values are not the same to the bit."""
    # fault: verify-half: outputs nearly the same pass for the same -> return [name for name in a if name not in b or
    #   not np.allclose(a[name], b[name])] | coupler/test_verify
    return [name for name in a if name not in b or np.asarray(a[name]).tobytes() != np.asarray(b[name]).tobytes()]


def _moved(name: str, unit: str, start: Array, k: int) -> Array:
    value = np.asarray(start, dtype=float)
    if name.startswith(("load.", "bc.", "control.")) or value.size == 0:
        return value
    if unit == "K":
        return value + k * (2.0 + np.cos(np.arange(value.size))).reshape(value.shape)
    if name == "x":
        return value + k * 1e-7 * float(np.ptp(value))
    if name == "contact.t_N":
        return value - k * 1e5
    return value + k * 1e-3 if unit == "J" else value


Check = Callable[[Bench, str], Finding]  # its name is the second, as CHECKS has it
BALANCE = 1e-10  # of the sum of |terms|, the ledger's own bound
SHOWN = 5


def behaviour_findings(bench: Bench) -> Iterator[Finding]:
    """Every check in turn.  A half that raises in one fails it; the next begins with a new instance."""
    for name, check in CHECKS.items():
        try:
            yield check(bench, name)
        except HalfError as exc:
            first = str(exc).splitlines()[0]
            yield failed(name, f"it failed: {first}", "A step that cannot be made is a Discard; nothing else may fail")


def same_twice(bench: Bench, check: str) -> Finding:
    """Two instances, the same inputs: the same bits."""
    with bench.half() as a, bench.half() as b:
        for k in (1, 2, 3):
            if wrong := differing(bench.step(a, k), bench.step(b, k)):
                return failed(check, f"two new instances differ after substep {k} in {_some(wrong)}",
                              "No random numbers, clocks, or memory that instances share; sums in a fixed order")
    return passed(check)


def reading(bench: Bench, check: str) -> Finding:
    """A half read over and over ends where one ends that is not read at all."""
    with bench.half() as read, bench.half() as unread:
        for k in (1, 2):
            read.advance((k - 1) * bench.h, bench.h, bench.inputs(k), bench.outputs)
            first, again = read.read(bench.outputs), read.read(bench.outputs)
            if wrong := differing(first, again):
                return failed(check, f"read twice, {_some(wrong)} changed", "Outputs are computed in the step")
            took(unread.advance((k - 1) * bench.h, bench.h, bench.inputs(k), ()))
        if wrong := differing(bench.step(read, 3), bench.step(unread, 3)):
            return failed(check, f"a half that was read goes on differently in {_some(wrong)}",
                          "Outputs are computed in the step, and getters change nothing")
    return passed(check)


def restoring(bench: Bench, check: str) -> Finding:
    """Back to a state as often as wanted: outputs as they were, and the same substeps give the same bits."""
    with bench.half() as half:
        if not half.can_save:
            return _no_state(check)
        bench.step(half, 1)
        token, there = half.save(), half.read(bench.outputs)
        first = [bench.step(half, k) for k in (2, 3)]
        for turn in ("first", "second"):
            half.restore(token)
            if wrong := differing(there, half.read(bench.outputs)):
                return failed(check, f"after the {turn} restore {_some(wrong)} is not as it was saved",
                              "Outputs are part of the state")
            again = [bench.step(half, k) for k in (2, 3)]
            # fault: verify-half: nobody looks what a restore gives again -> for k, (a, b) in enumerate(zip(first,
            #   first, strict=True), start=2): | coupler/test_verify
            for k, (a, b) in enumerate(zip(first, again, strict=True), start=2):
                if wrong := differing(a, b):
                    return failed(check, f"after the {turn} restore substep {k} gives another {_some(wrong)}",
                                  "All that evolves belongs to the state, copied on save and on restore: histories, "
                                  "counters, last increments; what is kept beside it must change no bits")
    return passed(check)


def remembers_inputs(bench: Bench, check: str) -> Finding:
    """Inputs that were set before a save count again after the restore, for only what changed is sent."""
    with bench.half() as half:
        if not half.can_save:
            return _no_state(check)
        bench.step(half, 1)
        token = half.save()
        given = took(half.advance(bench.h, bench.h, bench.inputs(1), bench.outputs))
        half.restore(token)
        bench.step(half, 2)
        half.restore(token)
        kept = took(half.advance(bench.h, bench.h, {}, bench.outputs))
    if wrong := differing(given, kept):
        return failed(check, f"restored and stepped without setting inputs, {_some(wrong)} comes from later inputs",
                      "Save the inputs with the state, and put them back with it")
    return passed(check)


def caches(bench: Bench, check: str) -> Finding:
    """A new instance that takes over a state goes on like the one that made it: hot and cold caches, same bits."""
    with bench.half() as hot:
        if not (hot.can_save and hot.can_serialise):
            return not_applicable(check, "it cannot write its state down", "no resume of a run that stopped")
        bench.step(hot, 1)
        data = hot.serialise(hot.save())
        with bench.half() as cold:
            cold.restore(cold.deserialise(data))
            for k in (2, 3):
                if wrong := differing(bench.step(hot, k), bench.step(cold, k)):
                    return failed(check, f"taken over by a new instance, substep {k} gives another {_some(wrong)}",
                                  "What changes bits (first guesses, old factors, counters) is state, or is made anew "
                                  "at every step")
    return passed(check)


def discards(bench: Bench, check: str) -> Finding:
    """A substep that cannot be made is discarded, with a reason, and the half lives."""
    with bench.half() as half:
        bench.step(half, 1)
        found = _refused(bench, half)
        if not found:
            return not_applicable(check, "it takes every step it was offered (inputs that are no numbers, no length)",
                                  "its numbers are then checked by the coupler alone")
        if not found.strip():
            return failed(check, "it gives no reason", "Set status.message, or log why")
    return passed(check, found)


def no_trace(bench: Bench, check: str) -> Finding:
    """After a discard outputs stand as they stood; restored, the half goes on as if nothing had been asked."""
    with bench.half() as half, bench.half() as undisturbed:
        if not half.can_save:
            return _no_state(check)
        bench.step(half, 1)
        token, before = half.save(), half.read(bench.outputs)
        if not _refused(bench, half):
            return not_applicable(check, "it takes every step it was offered")
        values = [name for name in bench.outputs if not name.startswith("status.")]
        if wrong := [n for n in differing(before, half.read(bench.outputs)) if n in values]:
            return failed(check, f"the rejected substep changed {_some(wrong)}",
                          "Take new state and outputs over only when the step has succeeded")
        half.restore(token)
        bench.step(undisturbed, 1)
        if wrong := differing(bench.step(undisturbed, 2), bench.step(half, 2)):
            return failed(check, f"put back after a rejected substep it gives another {_some(wrong)}",
                          "A step works on copies; whatever it kept on its way out must not change the next one")
    return passed(check)


def substeps(bench: Bench, check: str) -> Finding:
    """A window whole, in two substeps, and whole again."""
    t, h = bench.h, bench.h
    with bench.half() as half:
        if not half.can_save:
            return _no_state(check)
        bench.step(half, 1)
        token = half.save()
        whole = took(half.advance(t, h, bench.inputs(2), bench.outputs))
        half.restore(token)
        for part in (0.0, 0.5):
            took(half.advance(t + part * h, 0.5 * h, bench.inputs(2), bench.outputs))
        half.restore(token)
        if wrong := differing(whole, took(half.advance(t, h, bench.inputs(2), bench.outputs))):
            return failed(check, f"a window gives another {_some(wrong)} once it was tried in two substeps",
                          "What depends on the size of a substep (rates, factors) belongs to the substep")
    return passed(check)


def heat_balance(bench: Bench, check: str) -> Finding:
    """What goes in is what is stored, by the half's own terms: sum of heat.* but stored = sum of heat.stored.*"""
    terms = [name for name in bench.outputs if name.startswith("heat.")]
    if not any(name.startswith("heat.stored") for name in terms):
        return not_applicable(check, "it gives no heat terms", "the run's heat ledger cannot hold it to account")
    with bench.half() as half:
        for k in (1, 2, 3):
            gap = _imbalance(bench.step(half, k), terms)
            if gap > BALANCE:
                return failed(check, f"substep {k}: {gap:.1e} of the sum of |terms| is missing (at most {BALANCE:g})",
                              "Every heat.* is an energy of the substep into the bodies [J], at temperatures it used")
    return passed(check)


CHECKS: Mapping[str, Check] = {
    "same inputs, same bits": same_twice, "reading has no side effect": reading,
    "save and restore to the bit": restoring, "inputs are part of the state": remembers_inputs,
    "hot and cold caches, same bits": caches, "a bad substep is discarded": discards,
    "a rejected substep leaves no trace": no_trace, "substeps of one window": substeps,
    "heat terms close": heat_balance}


def _refused(bench: Bench, half: Half) -> str:
    """Offer substeps nobody can make; the reason of the first that is refused, a blank without one, "" if none is."""
    name = next((n for n in ("T", "x", *bench.starts) if n in bench.starts and bench.starts[n].size), "")
    bad = {name: np.full(bench.starts[name].shape, np.nan)} if name else {}
    for inputs, h in ((bad, bench.h), ({}, 0.0)):
        if h and not inputs:
            continue
        done = half.advance(bench.h, h, {**bench.inputs(2), **inputs}, ())
        # fault: verify-half: a rejected substep is not offered -> if False: | coupler/test_verify
        if done.status is Status.DISCARD:
            return done.message or " "
    return ""


def _imbalance(values: Mapping[str, Array], terms: list[str]) -> float:
    """|terms - stored| over the sum of |terms|; 0 where there are none."""
    heats = {name: float(np.sum(values[name])) for name in terms}
    total = sum(-v if name.startswith("heat.stored") else v for name, v in heats.items())
    size = sum(abs(v) for v in heats.values())
    return abs(total) / size if size else 0.0


def _no_state(check: str) -> Finding:
    return not_applicable(check, "it cannot keep its state", "no iteration, no second try of a window")


def _some(names: list[str]) -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more


# The face of a half as its description states it: role, names, units, causality, kinds, shapes, references.

DOC = "docs/design.md lists the names"


def role_of(blocks: Mapping[str, Block]) -> str:
    """thermal, mechanical, or "" where its outputs do not tell: T is what the one makes, x what the other does."""
    made = {name for name in ("T", "x") if name in blocks and blocks[name].causality == OUT}
    return {frozenset({"T"}): THERMAL, frozenset({"x"}): MECHANICAL}.get(frozenset(made), "")


def face_findings(blocks: Mapping[str, Block]) -> list[Finding]:
    """Checks of the blocks alone; needs no running half."""
    role = role_of(blocks)
    if not role:
        return [failed("role", "of T and x it has to give out exactly one",
                       "A thermal half has the output T and the input x, a mechanical one the output x")]
    return [passed("role", role), _needed(blocks, role), _names(blocks), _causality(blocks, role), _units(blocks),
            _kinds(blocks), _shapes(blocks), _whole(blocks), _identity(blocks)]


def reference_finding(description: Description) -> Finding:
    """Whether a block's value references follow each other, so that it travels in one call."""
    scattered = [name for name, field in description.fields.items()
                 if (np.diff(np.asarray(field.references, dtype=np.int64)) != 1).any()]
    return _of("value references", scattered, "are not consecutive: they travel element by element",
               "Number the scalars of a block one after the other, last index fastest")


def state_findings(can_save: bool, can_serialise: bool) -> list[Finding]:
    """What the description promises of its state."""
    name = "keeps its state"
    save = passed(name) if can_save else not_applicable(
        name, "canGetAndSetFMUstate is false", "without it: no iteration, no second try of a window, no events")
    name = "writes its state down"
    return [save, passed(name) if can_serialise else not_applicable(
        name, "canSerializeFMUstate is false", "without it: no resume of a run that stopped")]


def _of(check: str, wrong: Iterable[str], what: str, remedy: str, right: str = "") -> Finding:
    """A failure that names what is wrong, where anything is."""
    names = list(wrong)
    return failed(check, f"{', '.join(names)} {what}".strip(), remedy) if names else passed(check, right)


def _needed(blocks: Mapping[str, Block], role: str) -> Finding:
    missing = [name for name in NEEDED[role] if name not in blocks]
    return _of("what a run needs", missing, "missing", f"A {role} half has {', '.join(NEEDED[role])}")


def _names(blocks: Mapping[str, Block]) -> Finding:
    """A name of ours in other letters, or with a slip, would be passed over in silence."""
    slips = []
    lower = {name.lower(): name for name in BLOCKS}
    for name in blocks:
        if face_of(name) is None and (meant := lower.get(name.lower().replace("_", ".")) or lower.get(name.lower())):
            slips.append(f"{name} (meant {meant}?)")
    inputs = [name for name, b in blocks.items() if b.causality == "input" and face_of(name) is None
              and not name.startswith("bc.")]
    if slips:
        return failed("names", f"{', '.join(slips)}: nobody will read or set them", DOC)
    if inputs:
        return passed("names", f"inputs that a run leaves as they start: {', '.join(inputs)}")
    return passed("names")


def _causality(blocks: Mapping[str, Block], role: str) -> Finding:
    wrong = []
    for name, block in blocks.items():
        face = face_of(name)
        if face is not None and (want := face.causality(role)) and block.causality != want:
            wrong.append(f"{name} is {block.causality}, not {want}")
    return _of("causality", wrong, "", f"As docs/design.md says for a {role} half")


def _units(blocks: Mapping[str, Block]) -> Finding:
    wrong = [f"{name} is in {block.unit or 'no unit'}, not {face.unit}" for name, block in blocks.items()
             # fault: verify-half: units are not looked at -> if (face := face_of(name)) is not None and face.kind ==
             #   "Real" == block.kind and False] | coupler/test_verify
             if (face := face_of(name)) is not None and face.kind == "Real" == block.kind and block.unit != face.unit]
    return _of("units", wrong, "", "SI at the border: convert inside the half, and declare the unit in its description")


def _kinds(blocks: Mapping[str, Block]) -> Finding:
    wrong = [f"{name} is {block.kind}, not {face.kind}" for name, block in blocks.items()
             if (face := face_of(name)) is not None and block.kind != face.kind]
    return _of("types", wrong, "", DOC)


def _shapes(blocks: Mapping[str, Block]) -> Finding:
    wrong = [f"{name} has {len(block.shape)} indices, not {face.rank}" for name, block in blocks.items()
             if (face := face_of(name)) is not None and len(block.shape) != face.rank]
    # Arrays of the half's own that its description puts on the same places are as many too.
    own = [[name for name, block in blocks.items() if block.on == on] for on in sorted({b.on for b in blocks.values()})
           if on not in ("", "none")]
    for group in (*SAME_LENGTH, *own):
        lengths = {name: blocks[name].shape[0] for name in group if name in blocks and blocks[name].shape}
        if len(set(lengths.values())) > 1:
            wrong.append("of different length: " + ", ".join(f"{name} {n}" for name, n in lengths.items()))
    return _of("shapes", wrong, "", "T[i], x[i,j] by node; contact.NAME[s] by surface node; E_M[e] by cell; from 1")


def _whole(blocks: Mapping[str, Block]) -> Finding:
    # What did not gather to a block kept its index in its name.
    loose = [name for name in blocks if name.endswith("]")]
    return _of("whole blocks", loose[:5], "belong to no whole block (an index is missing, or causality, type or unit "
               "differ)", "Indices 1 to n without a hole, last index fastest, all of one unit and causality")


def _identity(blocks: Mapping[str, Block]) -> Finding:
    missing = [name for name in ("mesh.hash", "surfaces.hash", "geometry") if name not in blocks]
    if missing:
        return not_applicable("says what it was built of", f"no {', '.join(missing)}",
                              "a half of another mesh is then not noticed at load")
    return passed("says what it was built of")


# What is verified: an FMU by its path, or a kind of half by its entry point, built for a scene that uses it.

def fmu_of(half: str, scenario: Path | None, scratch: Path) -> Path:
    """The FMU of a path or of the name of an entry point; built, if need be, for a scenario that uses it.

    scratch : a folder for what is built.  Raises ScenarioError where there is none, HalfError where it cannot be built.
    """
    if half.endswith(".fmu"):
        path = Path(half)
        if not path.is_file():
            raise ScenarioError("there is no such FMU", key="HALF", value=half, remedy="Check the path")
        return path
    known = known_halves()
    if half not in known:
        raise ScenarioError("this is neither an FMU (a path that ends in .fmu) nor the name of an installed half",
                            key="HALF", value=half, remedy=did_you_mean(half, known))
    scene, role = _scene_with(half, scenario)
    return build_half(scene.write_half(role, scratch), scratch)


def _scene_with(kind: str, scenario: Path | None) -> tuple[Scenario, str]:
    """A scene that uses a kind, and the role it has there; of our own kinds a template does."""
    for path in [scenario] if scenario is not None else _own():
        scene = load_scenario(path)
        for role, used in (("thermal", scene.thermal_half), ("mechanical", scene.mechanical_half)):
            if used == kind:
                return scene, role
    where = f"{scenario} uses other halves" if scenario is not None else "no template uses this half"
    raise ScenarioError(where, key="--scenario", value=kind, remedy="Give a scenario that uses it, with --scenario")


def _own() -> Iterable[Path]:
    yield from (template.path for template in templates().values())
    yield shipped_scenarios() / "heated_bars.yaml"  # the rigid half
