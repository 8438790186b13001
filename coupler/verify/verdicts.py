"""Verdicts on halves of other packages: each is checked once before it runs, and what was found is kept.

A verdict lies in the cache, in CACHE/verdicts, under a name made of all that it depends on: the FMU's content, what is
known of the scene, the first substep, what the half declares, and the sources of the checks.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import os
import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Any

from contact.half.build import content_hash
from contact.half.entry import sources_hash
from coupler.errors import HalfError
from coupler.fmu.bounds import BorderScene
from coupler.fmu.description import read_description
from coupler.fmu.launch import VERDICTS, cache_directory
from coupler.fmu.scratch import scratch_folder
from coupler.scenario import Scenario
from coupler.scenario.kinds import OWN, SHIPPED, fmu_path, understood_by
from coupler.trust.checks import Check, TrustVerdict
from coupler.verify.border import CheckVerdict, Finding, conclusion
from coupler.verify.child import ALIVE, LIMIT, findings_of
from coupler.verify.matter import known_scene
from coupler.verify.reference import Reference, built, reference_of

MOST = 300.0  # s that the checks of a half may take before a run; what is not made by then is told
ROW = "halves of other packages"  # of the trust table
LEFT_OUT = "left out (--no-verify)"


class Verify(StrEnum):
    """Whether halves of other packages are checked before a run."""

    ONCE = "once"  # where no verdict is known
    ANEW = "anew"  # whatever is known; programs as halves too, and without a limit of time
    NEVER = "never"
    KNOWN = "known"  # not checked; a verdict that is there is told


@dataclass(frozen=True)
class HalfVerdict:
    """What is known of a half of another package.

    half : its name in the scenario.  kind : an entry point, or the path of its FMU.  findings : of all checks.
    why_not : why it was not checked; "" where it was.  known : whether an earlier run had found it.
    """

    half: str
    kind: str
    findings: tuple[Finding, ...] = ()
    why_not: str = ""
    known: bool = False

    @property
    def failed(self) -> tuple[Finding, ...]:
        """The rows that the half fails."""
        return tuple(f for f in self.findings if f.verdict is CheckVerdict.FAIL)

    @property
    def text(self) -> str:
        """A sentence, with every check that was not made and why."""
        name = f"{self.half} half {Path(self.kind).name}"
        if self.why_not:
            return f"{name}: not checked: {self.why_not}"
        made = sum(f.verdict is CheckVerdict.PASS for f in self.findings)
        left = "; ".join(f"{f.check} ({f.reason})" for f in self.findings if f.verdict is CheckVerdict.NOT_APPLICABLE)
        return f"{name}: {made} checks passed" + (f", not checked: {left}" if left else "")


def verdicts_of(scenario: Scenario, fmus: Mapping[str, Path], how: Verify, *, elsewhere: bool = False,
                tell: Callable[[str], None] = lambda text: None) -> tuple[HalfVerdict, ...]:
    """Return the verdict on each half of another package in a scene, checked if need be.

    fmus : name of a half -> its FMU in the cache.  elsewhere : halves run on other machines, so one that cannot be
    loaded on this one is not checked.  tell : called with what is being done, where that takes time.
    Raises HalfError with all rows that fail, of all halves.
    """
    found = []
    for name, kind in scenario.kinds.items():
        role = name.partition(".")[0]
        if kind in OWN[role].values() or (kind in SHIPPED and how is not Verify.ANEW):
            continue
        found.append(_verdict(_Subject(scenario, name, kind, fmus[name]), how, elsewhere, tell))
    # fault: a half that breaks the specification is run -> wrong = [] | coupler/test_run_verified
    wrong = [(v, row) for v in found for row in v.failed]
    if wrong and how is not Verify.KNOWN:
        names = ", ".join(dict.fromkeys(row.check for _, row in wrong))
        rows = "\n".join(f"{v.half} half {v.kind}: {row.check}: {row.reason}. {row.remedy}" for v, row in wrong)
        raise HalfError(f"nothing was run, for the interface specification is violated ({names}):\n{rows}")
    return tuple(found)


def trust_rows(verdicts: Iterable[HalfVerdict]) -> tuple[Check, ...]:
    """Return the row of the trust table on the halves of other packages; none where there are none."""
    verdicts = tuple(verdicts)
    if not verdicts:
        return ()
    text = "; ".join(v.text for v in verdicts)
    if any(v.why_not for v in verdicts):
        return (Check(ROW, TrustVerdict.UNCHECKED, unit="rows", what=text),)
    broken = [f"{v.half} half: {row.check}: {row.reason}" for v in verdicts for row in v.failed]
    if broken:
        return (Check(ROW, TrustVerdict.BROKEN, len(broken), 0.0, "rows", 0.0, "; ".join(broken),
                      "Mend the half: slideline verify-half shows every check"),)
    return (Check(ROW, TrustVerdict.HOLDS, unit="rows", what=text),)


def border_of(scene: Scenario, role: str) -> BorderScene:
    """Return what is known of a scene that a half in a role is held against."""
    return known_scene(scene.interface_of(role), scene.models["thermal"], scene.models["mechanical"],
                       () if scene.stated is None else scene.stated.thermal.boundary)


@dataclass(frozen=True)
class _Subject:
    """A half that is checked.  name : in the scenario.  fmu : in the cache, unpacked beside."""

    scenario: Scenario
    name: str
    kind: str
    fmu: Path

    @property
    def scene(self) -> BorderScene | None:
        """What is known of the scene; of one of several halves in a role nothing is."""
        return border_of(self.scenario, self.name) if self.name in OWN else None

    @property
    def reads(self) -> frozenset[str] | None:
        """What its builder declares; an FMU says it itself."""
        folder = self.scenario.file.parent
        return None if fmu_path(self.kind, folder) is not None else understood_by(self.kind, folder)

    @property
    def step(self) -> float:
        """The substep to begin with [s].

        The power of ten below the first window, so that a study of windows checks a half once; the first window itself
        of a half whose steps have one length.
        """
        c = self.scenario.coupling
        first = c.adaptive.first if c.adaptive is not None else min(c.windows[0].first, c.end)
        any_step = read_description(self.fmu.with_suffix("")).any_step
        return float(10.0 ** math.floor(math.log10(first))) if any_step else float(first)


def _verdict(half: _Subject, how: Verify, elsewhere: bool, tell: Callable[[str], None]) -> HalfVerdict:
    if how is Verify.NEVER:
        return HalfVerdict(half.name, half.kind, why_not=LEFT_OUT)
    scene, step, reads = half.scene, half.step, half.reads
    reference = reference_of(half.scenario, half.name, reads)
    file = cache_directory() / VERDICTS / f"{_key(half.fmu, scene, step, reads, reference)}.json"
    kept = None if how is Verify.ANEW else read_verdict(file)
    if kept is not None:
        return HalfVerdict(half.name, half.kind, kept, known=True)
    if how is Verify.KNOWN:
        return HalfVerdict(half.name, half.kind, why_not="no verdict on it is known")
    tell(f"checking the {half.name} half {Path(half.kind).name} against the interface specification, "
         "once (--no-verify leaves it out)")
    limit = half.scenario.coupling.deadlines.get(half.name.partition(".")[0], LIMIT)
    most = math.inf if how is Verify.ANEW else MOST
    try:
        with scratch_folder() as scratch:
            folder = scratch / "verify"
            folder.mkdir()
            own, why_none = built(reference, scratch / "own")
            findings = tuple(findings_of(half.fmu, folder, step, scene, limit, reads=reads, most=most, reference=own,
                                         why_none=why_none))
    except HalfError as exc:
        if not elsewhere:
            raise
        return HalfVerdict(half.name, half.kind, why_not=f"it runs on another machine, and not on this one "
                                                         f"({str(exc).splitlines()[0]})")
    # A half that hung or died may have done so for want of time or memory: that is not kept.
    if all(f.check != ALIVE for f in findings):
        write_verdict(file, findings)
    tell(f"{half.name} half: {conclusion(half.kind, findings)}")
    return HalfVerdict(half.name, half.kind, findings)


def _key(fmu: Path, scene: BorderScene | None, step: float, reads: frozenset[str] | None, reference: Reference) -> str:
    """All that a verdict depends on, in 32 hex digits."""
    told: dict[str, Any] = {"fmu": hashlib.sha256(fmu.read_bytes()).hexdigest(), "step": step,
                            "reads": None if reads is None else sorted(reads)}
    # fault: a verdict is taken over to a scene whose laws are others -> told["own"] = {} |
    #   coupler/test_reference
    told["own"] = reference.key
    checks = checks_hash()
    if scene is None:
        return hashlib.sha256(json.dumps([told, checks], sort_keys=True).encode()).hexdigest()[:32]
    for f in fields(scene):
        if f.name != "interface":
            value = getattr(scene, f.name)
            # fault: a verdict is taken over to another scene -> continue | coupler/test_verdicts_kept
            told[f.name] = value if isinstance(value, float) else hashlib.sha256(value.tobytes()).hexdigest()
    return content_hash(scene.interface, told, checks)


@cache
def checks_hash() -> dict[str, str]:
    """Return the sources of the checks and of what they call, as hashes by folder."""
    coupler = Path(__file__).resolve().parents[1]
    return {name: sources_hash(coupler / name) for name in ("verify", "fmu")}


# The files.  What is damaged, or of another form, is no verdict: one more check, not an error.

def read_verdict(file: Path) -> tuple[Finding, ...] | None:
    """Return the findings of a verdict; None where there is none, or it is damaged."""
    try:
        kept = json.loads(file.read_text(encoding="utf-8"))
        rows = kept["findings"]
        # fault: a damaged verdict is believed -> if False: | coupler/test_verdicts_kept
        if kept["sum"] != _sum(rows) or not rows:
            return None
        found = tuple(Finding(row["check"], CheckVerdict(row["verdict"]), row["reason"], row["remedy"])
                      for row in rows)
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    # One that is used stays; a cache of another user may be read all the same.
    with contextlib.suppress(OSError):
        os.utime(file)
    return found


def write_verdict(file: Path, findings: Iterable[Finding]) -> None:
    """Write a verdict, whole or not at all; a cache that cannot be written costs one more check, and nothing else."""
    rows = [asdict(f) | {"verdict": f.verdict.value} for f in findings]
    with contextlib.suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        handle, new = tempfile.mkstemp(dir=file.parent, prefix=".new-")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as out:
                json.dump({"findings": rows, "sum": _sum(rows)}, out, indent=1)
            os.replace(new, file)
        except BaseException:
            Path(new).unlink(missing_ok=True)
            raise


def _sum(rows: Any) -> str:
    return hashlib.sha256(json.dumps(rows, sort_keys=True).encode()).hexdigest()
