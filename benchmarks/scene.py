"""The sliding blocks as the benchmarks run them: any number of cells, one thread, windows of one's own choice."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from coupler import load_scenario
from coupler.scenario import Scenario

SCENARIO = Path(__file__).resolve().parents[1] / "scenarios" / "sliding_blocks.yaml"
L, E, NU, P0 = 0.0762, 2.0e11, 0.3, 1.0e7
SLIDE_START, SLIP_OFF, SLIDE_END = 12500.0, 12500.0 + 2500.0 / 1.1, 15000.0
THREADS = {name: "1" for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")}

# Up to the slide the solution is smooth and only has to be about right: every benchmark starts from here.
APPROACH: tuple[dict[str, float], ...] = (
    {"until": 2500, "first": 20, "last": 400},
    {"until": 9900, "first": 400, "last": 20},
    {"until": 10000, "first": 20, "last": 1},
    {"until": SLIDE_START, "first": 1, "last": 250},
)


def pin() -> None:
    """Run this process on one thread: libraries read these names when they load, so it starts anew with them set.

    Idle threads of MKL spin, which doubles a reading of CPU seconds.
    """
    if any(os.environ.get(name) != one for name, one in THREADS.items()):
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, **THREADS})


def blocks(n: int, mechanical: str = "elastic", **more: Any) -> Scenario:
    """The sliding blocks with n x n cells a block; `more`: overrides with __ for dots.

    The penalty is E/h as in the scenario; the stroke goes with it, so that the pressure stays 10 MPa.
    """
    eps_N = E * n / L
    squeeze = P0 * (2 * L * (1 - NU**2) / E + 1 / eps_N)
    overrides: dict[str, Any] = {
        "mechanical.half": mechanical, "contact.interface.penalty": eps_N, "contact.interface.augmented": None,
        "signals.stroke.value": [0, 0, -0.0508, -0.0508 - squeeze],
        **{f"bodies.{b}.mesh.rectangle.cells": [n, n] for b in ("lower", "upper")},
        **{name.replace("__", "."): value for name, value in more.items()}}
    return load_scenario(SCENARIO, overrides=overrides)


@dataclass
class Stopwatch:
    """CPU seconds and calls so far, by name.  The only mutable thing here: it is filled from inside the halves."""

    seconds: dict[str, float]
    calls: dict[str, int]


@contextmanager
def cpu_clock() -> Iterator[None]:
    """Make the coupler's own columns of seconds CPU seconds: on a busy machine elapsed time measures the others."""
    import coupler.fmu.fmi

    plain, coupler.fmu.fmi.perf_counter = time.perf_counter, time.process_time
    time.perf_counter = time.process_time
    try:
        yield
    finally:
        time.perf_counter = coupler.fmu.fmi.perf_counter = plain


@contextmanager
def contact_stopwatch() -> Iterator[Stopwatch]:
    """Count what this process asks of contact, by verb, inside whichever half asks."""
    from contact.service import ContactService

    watch, plain = Stopwatch({}, {}), ContactService.handle

    def timed(self: ContactService, request: Any) -> Any:
        started = time.process_time()
        reply = plain(self, request)
        verb = type(request).__name__
        watch.seconds[verb] = watch.seconds.get(verb, 0.0) + time.process_time() - started
        watch.calls[verb] = watch.calls.get(verb, 0) + 1
        return reply

    ContactService.handle = timed
    try:
        yield watch
    finally:
        ContactService.handle = plain


def table(rows: Sequence[Mapping[str, str]]) -> str:
    """Rows of equal keys as lines of text, keys first, columns as wide as they need to be."""
    names = list(rows[0])
    widths = [max(len(name), *(len(row[name]) for row in rows)) for name in names]
    lines = ["  ".join(name.rjust(w) for name, w in zip(names, widths, strict=True))]
    lines += ["  ".join(row[name].rjust(w) for name, w in zip(names, widths, strict=True)) for row in rows]
    return "\n".join(lines)
