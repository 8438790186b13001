"""Runs killed (SIGKILL) at random times and resumed until they are done, held against the run nobody disturbed.

Every file must be the same to the bit, but for seconds of wall-clock time.  A run is killed again and again until it is
done; then it is compared, and the next begins.  Every tenth process is a fresh `slideline resume`; the others are forks
of this one, which have the imports behind them.  A process killed before its run has a checkpoint is started anew.

What a process was doing when it was killed is told from the files it left: `counted` says how many died where.
"""

from __future__ import annotations

import json
import multiprocessing
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from coupler import Results, load_scenario, run
from coupler.record.paths import can_resume, checkpoint_of, making_of, part_of
from coupler.running.resume import resume

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
WALL_CLOCK = {"thermal_seconds", "mechanical_seconds", "fmi_seconds", "seconds", "recording_seconds"}
TIMES = {"timings", "calls"}  # tables of wall-clock time
OF_THE_PROCESS = {"seconds", "setup_seconds", "resumed_at", "started", "processes", "contact", "restarts"}
FRESH = 10  # every so many processes is not forked
SHARE = 0.1  # of the undisturbed run's time: the longest a process is let go on before it is killed
ANYWHERE = 0.2  # share of kills that may fall into the set-up
AT_THE_END = 0.15  # share of kills that wait until the results file is being made
MAKING = 0.1  # s, about what making it takes
PHASES = ("set-up", "windows", "checkpoint", "end")


@dataclass(frozen=True)
class Case:
    """A scenario, what is changed in it, and how many kills."""

    file: str
    overrides: Mapping[str, Any] = field(default_factory=dict)
    kills: int = 200


CASES = {
    "casting_1d": Case("casting_1d.yaml", {"coupling.end": 2, "output.fields.every": 5, "output.checkpoint": 0}),
    "sliding_blocks_elastic": Case("sliding_blocks.yaml", {
        "bodies.lower.mesh.rectangle.cells": [4, 3], "bodies.upper.mesh.rectangle.cells": [4, 3],
        "coupling.end": 15000, "output.checkpoint": 0, "coupling.windows": [
            {"until": 2500, "size": 500}, {"until": 10000, "first": 1000, "last": 50},
            {"until": 12500, "first": 50, "last": 500}, {"until": 15000, "size": 150}]}, 10),
    "sliding_blocks": Case("sliding_blocks.yaml", {
        "mechanical.half": "rigid", "bodies.lower.mesh.rectangle.cells": [8, 6],
        "bodies.upper.mesh.rectangle.cells": [8, 6], "output.checkpoint": 0.2}, 10),
}


@dataclass
class Count:
    """kills : in all.  phases : how many died in which.  runs : killed and done."""

    kills: int = 0
    phases: dict[str, int] = field(default_factory=lambda: dict.fromkeys(PHASES, 0))
    runs: int = 0
    different: list[str] = field(default_factory=list)


def counted(count: Count) -> str:
    """In words."""
    return f"{count.kills} kills (" + ", ".join(f"{n} {phase}" for phase, n in count.phases.items()) + ")"


def told(line: str) -> None:
    print(line, flush=True)


def kill_and_resume(case: Case, folder: Path, seed: int, say: Callable[[str], None] = told) -> Count:
    """Kill runs of a case until the kills are used up, and compare each with the undisturbed one."""
    whole, random, count = folder / "whole.h5", np.random.default_rng(seed), Count()
    started = time.perf_counter()
    _fork(_run, case, whole).join()
    seconds = time.perf_counter() - started
    say(f"{case.file}: {len(Results(whole).windows)} windows in {seconds:.1f} s undisturbed")
    while count.kills < case.kills:
        out = folder / f"killed{count.runs}.h5"
        _until_done(case, out, random, count, seconds)
        count.runs += 1
        found = differences(whole, out)
        count.different += [f"{out.name}: {where}" for where in found]
        left = sorted(p.name for p in folder.glob(f".{out.name}*"))
        count.different += [f"{out.name}: left {name}" for name in left]
        say(f"{counted(count)}, {count.runs} runs, {len(count.different)} differences")
        for file in folder.glob(f"{out.stem}.*"):
            file.unlink()
    return count


def _until_done(case: Case, out: Path, random: np.random.Generator, count: Count, seconds: float) -> None:
    """One run, killed about ten times, or as often as there are kills left."""
    for process in _processes(case, out, count):
        before = _marks(out)
        if count.kills >= case.kills:
            process.join()
        else:
            # Some fall anywhere, set-up included, some where the results file is made; the others where windows are
            # being solved: without that a busy machine would be killed in its set-up for ever.
            where, longest = random.random(), SHARE * seconds
            if where < AT_THE_END:
                _wait(process, lambda was=before: _marks(out)[2] != was[2])
                longest = MAKING
            elif where > AT_THE_END + ANYWHERE:
                _wait(process, lambda was=before: _marks(out)[0] != was[0])
            process.join(timeout=float(random.uniform(0.0, longest)))
        if process.exitcode is None:
            process.kill()
            process.join()
            count.kills += 1
            count.phases[_phase(out, before)] += 1
            if out.exists() and not can_resume(out):
                return  # it died behind its end
        elif process.exitcode == 0:
            return
        else:
            raise RuntimeError(f"{out}: ended with exit code {process.exitcode}")


def _marks(out: Path) -> tuple[int, int, int]:
    """When the checkpoint was written, when the one that is not whole, when the results file; 0: there is none."""
    return (_written(checkpoint_of(out)), _written(part_of(checkpoint_of(out))),
            max(_written(out), _written(making_of(out))))


def _phase(out: Path, before: tuple[int, int, int]) -> str:
    """What a process was doing when it died, from what stood there before it began and what stands there now."""
    checkpoint, part, results = _marks(out)
    if results != before[2]:
        return "end"
    if part not in (0, before[1]):
        return "checkpoint"
    return "windows" if checkpoint != before[0] else "set-up"


def _wait(process: Any, come: Callable[[], bool]) -> None:
    while process.exitcode is None and not come():
        time.sleep(0.002)


def _processes(case: Case, out: Path, count: Count) -> Iterator[Any]:
    number = 0
    while True:
        number += 1
        if not can_resume(out):
            yield _fork(_run, case, out)
        elif number % FRESH:
            yield _fork(_resume, out)
        else:
            yield _Fresh(subprocess.Popen([sys.executable, "-m", "coupler.cli", "resume", str(out)],
                                          stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))


class _Fresh:
    """A child like those of multiprocessing."""

    def __init__(self, child: subprocess.Popen[bytes]) -> None:
        self._child = child

    @property
    def exitcode(self) -> int | None:
        return self._child.poll()

    def join(self, timeout: float | None = None) -> None:
        try:
            self._child.wait(timeout)
        except subprocess.TimeoutExpired:
            return

    def kill(self) -> None:
        self._child.kill()


def _fork(work: Callable[..., None], *arguments: Any) -> Any:
    process = multiprocessing.get_context("fork").Process(target=work, args=arguments)
    process.start()
    return process


def _run(case: Case, out: Path) -> None:
    run(load_scenario(SCENARIOS / case.file, overrides=case.overrides), out)


def _resume(out: Path) -> None:
    resume(out)


def _written(file: Path) -> int:
    try:
        return file.stat().st_mtime_ns
    except FileNotFoundError:
        return 0


def differences(one: Path, other: Path) -> list[str]:
    """Where the results files of two runs, and their field files, differ in a bit; seconds and places apart."""
    a, b = Results(one), Results(other)
    found = [f"{n}: {x} and {y}" for n, x, y in (
        ("outcome", a.outcome, b.outcome), ("messages", a.messages, b.messages),
        ("totals", _lasting(a.totals), _lasting(b.totals)), ("header", _lasting(a.header), _lasting(b.header)))
        if json.dumps(x) != json.dumps(y)]
    files = [(one, other), *((a.field_files[half], b.field_files[half]) for half in a.field_files)]
    for file, twin in files:
        with h5py.File(file) as f, h5py.File(twin) as g:
            mine, theirs = dict(_datasets(f)), dict(_datasets(g))
        found += [f"{file.suffix} {n}" for n in sorted({*mine, *theirs}) if mine.get(n) != theirs.get(n)]
    return found


def _lasting(facts: Mapping[str, Any]) -> dict[str, Any]:
    return {n: v for n, v in facts.items() if n not in OF_THE_PROCESS | {"field_files"}}


def _datasets(group: h5py.Group) -> Iterator[tuple[str, bytes]]:
    """Name and bytes of every dataset, column by column; tables and columns of wall-clock time left out."""
    for name, item in group.items():
        if name in TIMES:
            continue
        if isinstance(item, h5py.Group):
            yield from ((f"{name}/{inner}", data) for inner, data in _datasets(item))
        elif item.dtype.names:
            yield from ((f"{name}.{column}", item[column].tobytes()) for column in item.dtype.names
                        if column not in WALL_CLOCK)
        else:
            yield name, np.asarray(item[()]).tobytes()
