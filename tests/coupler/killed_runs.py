"""Runs killed (SIGKILL) at random times and resumed until they are done, held against the run nobody disturbed.

Every file must be the same to the bit, but for seconds of wall-clock time.  A run is killed again and again until it is
done; then it is compared, and the next begins.  Every tenth process is a fresh `slideline resume`; the others are forks
of this one, which have the imports behind them.  A process killed before its run has a checkpoint is started anew.
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
from coupler.record.beside import can_resume, checkpoint_of
from coupler.resume import resume

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
WALL_CLOCK = {"thermal_seconds", "mechanical_seconds", "fmi_seconds", "seconds", "recording_seconds"}
OF_THE_PROCESS = {"seconds", "setup_seconds", "resumed_at", "started", "processes", "contact"}
FRESH = 10  # every so many processes is not forked
SHARE = 0.1  # of the undisturbed run's time: the longest a process is let go on before it is killed
ANYWHERE = 0.2  # share of kills that may fall into the set-up


@dataclass(frozen=True)
class Case:
    """A scenario, what is changed in it, and how many kills."""

    file: str
    overrides: Mapping[str, Any] = field(default_factory=dict)
    kills: int = 200


CASES = {
    "casting_1d": Case("casting_1d.yaml", {"coupling.end": 60, "output.fields.every": 5, "output.checkpoint": 0}),
    "sliding_blocks": Case("sliding_blocks.yaml", {
        "mechanical.half": "rigid", "bodies.lower.mesh.rectangle.cells": [8, 6],
        "bodies.upper.mesh.rectangle.cells": [8, 6], "output.checkpoint": 0.2}, 10),
}


@dataclass
class Count:
    """kills : in all.  early : of them before the process had written its first checkpoint.  runs : killed and done."""

    kills: int = 0
    early: int = 0
    runs: int = 0
    different: list[str] = field(default_factory=list)


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
        say(f"{count.kills} kills ({count.early} before a first checkpoint), {count.runs} runs, "
            f"{len(count.different)} differences")
        for file in folder.glob(f"{out.stem}.*"):
            file.unlink()
    return count


def _until_done(case: Case, out: Path, random: np.random.Generator, count: Count, seconds: float) -> None:
    """One run, killed about ten times, or as often as there are kills left."""
    for process in _processes(case, out, count):
        if count.kills >= case.kills:
            process.join()
        else:
            # One kill in five falls anywhere, set-up included; the others where windows are being solved, or the files
            # made of them: without that a busy machine would be killed in its set-up for ever.
            before = _written(out)
            if random.random() > ANYWHERE:
                _wait(process, lambda was=before: _written(out) != was)
            process.join(timeout=float(random.uniform(0.0, SHARE * seconds)))
        if process.exitcode is None:
            process.kill()
            process.join()
            count.kills += 1
            count.early += _written(out) == before
        elif process.exitcode == 0:
            return
        else:
            raise RuntimeError(f"{out}: ended with exit code {process.exitcode}")


def _wait(process: Any, come: Callable[[], bool]) -> None:
    while process.exitcode is None and not come():
        time.sleep(0.005)


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


def _written(out: Path) -> int:
    file = checkpoint_of(out)
    return file.stat().st_mtime_ns if file.exists() else 0


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
    """Name and bytes of every dataset, column by column; the columns of wall-clock time left out."""
    for name, item in group.items():
        if isinstance(item, h5py.Group):
            yield from ((f"{name}/{inner}", data) for inner, data in _datasets(item))
        elif item.dtype.names:
            yield from ((f"{name}.{column}", item[column].tobytes()) for column in item.dtype.names
                        if column not in WALL_CLOCK)
        else:
            yield name, np.asarray(item[()]).tobytes()
