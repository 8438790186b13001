"""Checks a half in a process of its own, so that one that hangs, crashes or ends the process is a row of the table.

    python -m coupler.verify.child FMU SCRATCH STEP READS OWN WHY_NONE [SCENE]

The child tells findings as lines of JSON, one as each comes, and before each call into the half what it is about to
ask.  READS : paths of a scene that the half declares to read, as JSON; null: it declares nothing.  OWN : the FMU
of Slideline's own half of the scene; "" where there is none, and then WHY_NONE says why.  SCENE : a folder with
interface.h5 and scene.npz.
"""

from __future__ import annotations

import json
import math
import os
import selectors
import sys
import tempfile
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from coupler.errors import HalfError
from coupler.fmu.bounds import BorderScene
from coupler.fmu.children import Child, python, reap, start
from coupler.fmu.fmi import load_half
from coupler.fmu.half import Advance, Array, Half
from coupler.verify.behaviour import checks_of
from coupler.verify.bench import NO_REFERENCE
from coupler.verify.border import ROLE, CheckVerdict, Finding, failed, not_applicable
from coupler.verify.conformance import RUNS, verify_fmu
from coupler.verify.matter import read_scene, write_scene

LIMIT = 60.0  # s a call into the half may take
LOAD_LIMIT = 300.0  # s until the first word: loading, and compiling what it compiles
ALIVE = "its process lives"
OURS = "while Slideline's own half was asked to"
FINDING, ASKING, ERROR, DONE = "finding", "asking", "error", "done"


def findings_of(fmu: Path, scratch: Path, h: float, scene: BorderScene | None = None,
                limit: float = LIMIT, *, reads: frozenset[str] | None = None,
                most: float = math.inf, reference: Path | None = None,
                why_none: str = NO_REFERENCE) -> Iterator[Finding]:
    """Check an FMU in a child, and yield its findings one by one.  h : substep to begin with [s].

    scratch : an empty folder.  limit : s a call into the half may take.  reads : what its builder declares that it
    reads of a scene; None: what the FMU itself declares.  most : s that all checks may take; those that were not made
    by then are rows, too, which say so.  reference : the FMU of Slideline's own half of the scene, unpacked
    beside; None, and then why_none says why, where there is none.  Raises HalfError where the file is no FMU.
    """
    # Here and not above: the child reads no scenario, whose import takes 0.6 s.
    from coupler.scenario.understood import declared_in

    reads = declared_in(fmu) if reads is None else reads
    told = json.dumps(None if reads is None else sorted(reads))
    command = [*python(), "-m", "coupler.verify.child", str(fmu.absolute()), str(scratch), repr(h), told,
               "" if reference is None else str(reference.absolute()), why_none]
    if scene is not None:
        command.append(str(write_scene(scene, scratch / "scene")))
    child = start("half", command, scratch)
    try:
        yield from _told(child, limit, most)
    finally:
        reap([child])


def _told(child: Child, limit: float, most: float) -> Iterator[Finding]:
    asking, patience, lines = "being loaded", LOAD_LIMIT, _Lines(child)
    end, role, made = time.monotonic() + most, "", set[str]()
    while (line := lines.next(min(patience, end - time.monotonic()))) != "":
        # fault: checks that take for ever hold up a run -> if False: | coupler/test_verify_child
        if time.monotonic() >= end:
            yield from _not_made(role, made, most)
            return
        if line is None:
            late = f"it gave no answer for {patience:g} s, {asking}"
            # fault: a half that hangs passes -> return | coupler/test_verify_child
            yield failed(ALIVE, late, "A step that does not work out is a Discard, not a longer wait")
            return
        word = json.loads(line)
        kind = word.pop("kind")
        if kind == DONE:
            return
        if kind == ASKING:
            asking, patience = word["what"], word.get("patience", limit)
        elif kind == ERROR:
            raise HalfError(word["message"])
        else:
            found = Finding(word["check"], CheckVerdict(word["verdict"]), word["reason"], word["remedy"])
            role, made = found.reason if found.check == ROLE else role, made | {found.check}
            yield found
    child.process.wait(LIMIT)
    log = child.log_tail()
    died = f"{child.death()}, {asking}" + (f"; it said: {log.splitlines()[-1]}" if log else "")
    # fault: a half that ends its process passes -> return | coupler/test_verify_child
    yield failed(ALIVE, died, "A half never ends its process; what fails is a Discard, or fmi2Fatal")


def _not_made(role: str, made: Collection[str], most: float) -> Iterator[Finding]:
    """A row for each check for which there was no time.  role : of the half; "" where it did not come so far."""
    names = [RUNS, *(checks_of(role) if role else ())]
    yield from (not_applicable(name, f"there was no time for it: checks may take {most:g} s before a run",
                               "slideline verify-half takes the time it needs") for name in names if name not in made)


class _Lines:
    """The lines a child says, one at a time."""

    def __init__(self, child: Child) -> None:
        assert child.process.stdout is not None
        self._out, self._rest = child.process.stdout.fileno(), b""

    def next(self, patience: float) -> str | None:
        """Return the next one; "" where it says no more, None where it says nothing for `patience` seconds."""
        end = time.monotonic() + patience
        with selectors.DefaultSelector() as selector:
            selector.register(self._out, selectors.EVENT_READ)
            while b"\n" not in self._rest:
                if not selector.select(max(0.0, end - time.monotonic())):
                    return None
                chunk = os.read(self._out, 65536)
                if not chunk:
                    return ""
                self._rest += chunk
        line, _, self._rest = self._rest.partition(b"\n")
        return line.decode("utf-8", "replace")


# In the child

class ToldHalf:
    """A half (coupler.fmu.half.Half) that is another one, and says what it is asked for before it is asked.

    whose : how that begins.  patience : s that a call may take, where it is not that of the half that is checked.
    """

    def __init__(self, half: Half, out: IO[str], whose: str = "asked to", patience: float | None = None) -> None:
        self._half, self._out = half, out
        self._whose, self._more = whose, {} if patience is None else {"patience": patience}
        self.name, self.blocks, self.strings = half.name, half.blocks, half.strings
        self.can_save, self.can_serialise = half.can_save, half.can_serialise

    def _asks(self, what: str) -> None:
        _say(self._out, {"kind": ASKING, "what": f"{self._whose} {what}", **self._more})

    def initialise(self, t_start: float, t_end: float, parameters: Mapping[str, str], inputs: Mapping[str, Array],
                   outputs: Sequence[str]) -> dict[str, Array]:
        """As of the half."""
        self._asks("start")
        return self._half.initialise(t_start, t_end, parameters, inputs, outputs)

    def advance(self, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Advance:
        """As of the half."""
        self._asks(f"step from {t:.6g} s by {h:.3g} s")
        return self._half.advance(t, h, inputs, outputs)

    def read(self, names: Sequence[str], finite: bool = True) -> dict[str, Array]:
        """As of the half."""
        return self._half.read(names, finite)

    def save(self) -> int:
        """As of the half."""
        self._asks("keep its state")
        return self._half.save()

    def restore(self, token: int) -> None:
        """As of the half."""
        self._asks("go back to a state")
        self._half.restore(token)

    def release(self, token: int) -> None:
        """As of the half."""
        self._half.release(token)

    def serialise(self, token: int) -> bytes:
        """As of the half."""
        self._asks("write its state down")
        return self._half.serialise(token)

    def deserialise(self, data: bytes) -> int:
        """As of the half."""
        self._asks("read a state")
        return self._half.deserialise(data)

    def log_tail(self) -> str:
        """As of the half."""
        return self._half.log_tail()

    def close(self) -> None:
        """As of the half."""
        self._asks("end")
        self._half.close()


def _say(out: IO[str], word: Mapping[str, Any]) -> None:
    out.write(json.dumps(word) + "\n")
    out.flush()


def main() -> None:
    """Check the FMU named on the command line, and tell what is found."""
    fmu, scratch, h = Path(sys.argv[1]), Path(sys.argv[2]), float(sys.argv[3])
    # What a half prints goes to the log: its words are not ours.
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    told = json.loads(sys.argv[4])
    reads = None if told is None else frozenset(told)
    ours, why_none = sys.argv[5:7]
    scene = read_scene(Path(sys.argv[7])) if len(sys.argv) > 7 else None

    def reference() -> Half:
        _say(out, {"kind": ASKING, "what": f"{OURS} be loaded", "patience": LOAD_LIMIT})
        return ToldHalf(load_half(Path(ours), None, "own"), out, OURS, LOAD_LIMIT)

    try:
        with tempfile.TemporaryDirectory(dir=scratch) as own:
            for f in verify_fmu(fmu, Path(own), h, scene, lambda half: ToldHalf(half, out), reads,
                                reference if ours else None, why_none):
                _say(out, {"kind": FINDING, "check": f.check, "verdict": f.verdict.value, "reason": f.reason,
                           "remedy": f.remedy})
    except HalfError as exc:
        _say(out, {"kind": ERROR, "message": str(exc)})
    _say(out, {"kind": DONE})
    # An orderly end of an interpreter that loaded an FMU may corrupt the heap.
    os._exit(0)


if __name__ == "__main__":
    main()
