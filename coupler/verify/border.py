"""How the description of a half is held against the interface specification (coupler.fmu.names)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum

import numpy as np
from rich.markup import escape
from rich.table import Table

from coupler.fmu.description import Description
from coupler.fmu.half import Block
from coupler.fmu.names import BLOCKS, NEEDED, SAME_LENGTH, face_of, role_of

# The finding of one check of a half, and how findings are shown.

class CheckVerdict(Enum):
    """The verdict of one check."""

    PASS = "pass"
    FAIL = "FAIL"
    NOT_APPLICABLE = "n/a"


@dataclass(frozen=True)
class Finding:
    """The finding of a check.

    check : its name.  reason : what was measured.  remedy : of a failure what to change; of n/a what a run then lacks.
    """

    check: str
    verdict: CheckVerdict
    reason: str = ""
    remedy: str = ""


def passed(check: str, reason: str = "") -> Finding:
    return Finding(check, CheckVerdict.PASS, reason)


def failed(check: str, reason: str, remedy: str) -> Finding:
    return Finding(check, CheckVerdict.FAIL, reason, remedy)


def not_applicable(check: str, reason: str, cost: str = "") -> Finding:
    return Finding(check, CheckVerdict.NOT_APPLICABLE, reason, cost)


_COLOUR = {CheckVerdict.PASS: "green", CheckVerdict.FAIL: "bold red", CheckVerdict.NOT_APPLICABLE: "yellow"}


def table_of(half: str, findings: Iterable[Finding]) -> Table:
    """Return a table with one row a check."""
    table = Table(title=f"{half} against the interface specification", title_justify="left")
    for column in ("check", "", "result", "remedy"):
        table.add_column(column, overflow="fold")
    for f in findings:
        table.add_row(f.check, f"[{_COLOUR[f.verdict]}]{f.verdict.value}[/]", escape(f.reason), escape(f.remedy))
    return table


def conclusion(half: str, findings: Iterable[Finding]) -> str:
    """Return the result of all checks in a line."""
    verdicts = [f.verdict for f in findings]
    counts = ", ".join(f"{n} {text}" for verdict, text in (
        (CheckVerdict.PASS, "passed"), (CheckVerdict.FAIL, "failed"), (CheckVerdict.NOT_APPLICABLE, "not applicable"))
        if (n := verdicts.count(verdict)))
    result = "violates" if CheckVerdict.FAIL in verdicts else "meets"
    return f"{half} {result} the interface specification: {counts}"


# Checks the description of a half: role, names, units, causality, types, shapes, references.

DOC = "docs/design.md lists the names"
ROLE = "role"  # the check whose reason is the role of the half


def description_findings(blocks: Mapping[str, Block]) -> list[Finding]:
    """Check the blocks alone, without a running half."""
    role = role_of(blocks)
    if not role:
        return [failed(ROLE, "of T and x it has to give out exactly one",
                       "A thermal half has the output T and the input x, a mechanical one the output x")]
    return [passed(ROLE, role), _needed(blocks, role), _names(blocks), _causality(blocks, role), _units(blocks),
            _kinds(blocks), _shapes(blocks), _whole(blocks), _identity(blocks)]


def reference_finding(description: Description) -> Finding:
    """Check that the value references of a block are consecutive, so that it travels in one call."""
    scattered = [name for name, field in description.fields.items()
                 if (np.diff(np.asarray(field.references, dtype=np.int64)) != 1).any()]
    return _of("value references", scattered, "are not consecutive: they travel element by element",
               "Number the scalars of a block one after the other, last index fastest")


def conversion_findings(description: Description) -> list[Finding]:
    """Report blocks whose declared unit is not SI and which are converted at the border; none where all are SI."""
    turned = [f"{name} from {field.declared}" for name, field in description.fields.items()
              if not field.conversion.is_none]
    return [passed("units converted", ", ".join(turned))] if turned else []


def state_findings(can_save: bool, can_serialise: bool) -> list[Finding]:
    """Report what the description promises of the state."""
    name = "keeps its state"
    save = passed(name) if can_save else not_applicable(
        name, "canGetAndSetFMUstate is false", "without it: no iteration, no second try of a window, no events")
    name = "writes its state down"
    return [save, passed(name) if can_serialise else not_applicable(
        name, "canSerializeFMUstate is false", "without it: no resume of a run that stopped")]


def _of(check: str, wrong: Iterable[str], what: str, remedy: str, right: str = "") -> Finding:
    """Return a failure that names what is wrong, if anything is."""
    names = list(wrong)
    return failed(check, f"{', '.join(names)} {what}".strip(), remedy) if names else passed(check, right)


def _needed(blocks: Mapping[str, Block], role: str) -> Finding:
    missing = [name for name in NEEDED[role] if name not in blocks]
    return _of("what a run needs", missing, "missing", f"A {role} half has {', '.join(NEEDED[role])}")


def _names(blocks: Mapping[str, Block]) -> Finding:
    """Check for misspelled names, which a run would ignore in silence."""
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
    return _of("shapes", wrong, "", "T[i], x[i,j] by node; contact.NAME[q] by pair node; E_M[e] by cell; from 1")


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
