"""The same bits by whatever way a run is made: FMUs embedded or in processes, bytes in between, stopped and resumed."""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from coupler import CouplingError, HalfError, Results, Run
from coupler.running.resume import resumed
from coupler.schemes.levels import Level
from random_scenes.invariant import Finding, Invariant
from random_scenes.scene import Scene
from random_scenes.story import COMPLETED, Story

ONE_IN = 25  # scenes: FMUs are built, and processes started, for seconds
MOST_WINDOWS = 60
FIELDS = ("t", "T", "x", "t_N", "gap", "covered", "f_s")


@dataclass(frozen=True, eq=False)
class Made:
    """A run by FMUs.

    levels : at the start and the end of accepted windows.  probes, ledger : as its results have them.
    error : what ended it early.
    """

    levels: Sequence[Level]
    probes: Mapping[str, NDArray[np.float64]]
    ledger: Mapping[str, NDArray[np.float64]]
    error: str = ""


def made(scene: Scene, folder: Path, *, in_processes: bool = False, until: float | None = None) -> Made:
    """Run a scene by FMUs, up to the first window end at or after a time [s]."""
    return _followed(Run(scene.checked(folder), folder / "run.h5", processes=in_processes), until)


def processes(scene: Scene, folder: Path) -> Made:
    """The same, each half and the contact service in a process of its own."""
    return made(scene, folder, in_processes=True)


def stopped_and_resumed(scene: Scene, folder: Path, until: float) -> Made:
    """The same to its end, but stopped at a time [s] and resumed from what it left."""
    first = made(scene, folder, until=until)
    if first.error:
        return first
    rest = _followed(resumed(folder / "run.h5"), None)
    return Made([*first.levels, *rest.levels[1:]], rest.probes, rest.ledger, rest.error)


def _followed(run: Run, until: float | None) -> Made:
    levels: list[Level] = []
    try:
        with run:
            levels.append(run.state.now)
            for _ in run.windows(until):
                if run.state.now.t > levels[-1].t:
                    levels.append(run.state.now)
    except (CouplingError, HalfError) as error:
        return Made(levels, {}, {}, str(error))
    results = Results(run.out)
    return Made(levels, {n: results.probe(n)[1] for n in results.probe_names}, results.ledger_history()[1])


def differences(a: Made, b: Made) -> str:
    """Where a run first differs from another, in words; empty where all bits are the same."""
    if a.error != b.error:
        return f"it ends with {a.error or 'no error'!r} in place of {b.error or 'none'!r}"
    if len(a.levels) != len(b.levels):
        return f"it takes {len(a.levels) - 1} windows in place of {len(b.levels) - 1}"
    for one, other in zip(a.levels, b.levels, strict=True):
        for name in FIELDS:
            if told := _apart(getattr(one, name), getattr(other, name)):
                return f"{name} at t = {other.t:.6g} s {told}"
    for what, own, others in (("probe", a.probes, b.probes), ("heat of", a.ledger, b.ledger)):
        for name, values in others.items():
            if told := _apart(own.get(name), values):
                return f"{what} {name} {told}"
    return ""


def _apart(a: object, b: object) -> str:
    if a is None or b is None:
        return "" if a is b else "is known in one only"
    x, y = np.asarray(a), np.asarray(b)
    if x.shape != y.shape:
        return f"has the shape {x.shape} in place of {y.shape}"
    same = np.array_equal(x, y, equal_nan=True)
    return "" if same else f"differs by up to {np.nanmax(np.abs(x - y)):.3g}"


def check_same_bits(scene: Scene, story: Story, rng: np.random.Generator) -> Sequence[Finding]:
    """A scene by FMUs in four ways, and as it was run without them."""
    ends = story.t[1:-1]
    until = float(rng.choice(ends)) if len(ends) else float(story.t[-1])
    plain = scene.edited(output__checkpoint=None)
    ways: dict[str, Callable[[Path], Made]] = {
        "through bytes (link: codec)": lambda f: made(plain.edited(coupling__link="codec"), f),
        "in processes of their own": lambda f: processes(plain, f),
        f"stopped at {until:.6g} s and resumed": lambda f: stopped_and_resumed(plain, f, until)}
    findings = []
    with TemporaryDirectory(prefix="slideline-random-") as scratch, patch.dict(
            os.environ, SLIDELINE_CACHE=str(Path(scratch) / "cache")):
        embedded = made(plain, Path(scratch) / "embedded")
        direct = Made(story.levels, story.probes, story.ledger)
        if told := differences(direct, embedded):
            findings.append(Finding(f"run without FMUs {told}", np.inf, ()))
        for number, (way, make) in enumerate(ways.items()):
            if told := differences(make(Path(scratch) / f"way{number}"), embedded):
                findings.append(Finding(f"{way} {told}", np.inf, ()))
    return findings


def is_drawn(scene: Scene) -> bool:
    """Whether this scene is one of the few that are run by FMUs: a matter of its text alone."""
    text = json.dumps([scene.doc, scene.recipes], sort_keys=True, default=str)
    return zlib.crc32(text.encode()) % ONE_IN == 0


SAME_BITS = Invariant("same bits", is_drawn, lambda scene, story, rng: check_same_bits(scene, story, rng)
                      if story.outcome == COMPLETED and len(story.levels) <= MOST_WINDOWS else [], runs=6)
"""The same scenario gives the same bits by every way of running it that is offered (README.md, table of commands).

Each does the same operations in the same order on one thread: a state that was written down restores all of it, and
what crosses as bytes are the eight of a double.  So there is no tolerance.  With the thread settings of its caller.
"""

INVARIANTS = (SAME_BITS,)
