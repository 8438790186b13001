"""Studies made up of numbers: outcomes without a run, and what stands where a process would."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import numpy as np

from coupler.experiments.trial import TrialResult
from coupler.experiments.work_precision import Point
from coupler.scenario.document import Document, document_from

ROOT = Path(__file__).resolve().parents[2]
LUMPED = ROOT / "scenarios/lumped_gap.yaml"
E8 = tomllib.loads((ROOT / "tests/expected.toml").read_text(encoding="utf-8"))["E8"]
T_END = 2.0


def document() -> Document:
    """The lumped scenario without the study it comes with."""
    text = LUMPED.read_text(encoding="utf-8")
    return document_from(LUMPED, text[:text.index("\nstudy:")])


def decay(H: float, order: int, factor: float = 0.1) -> TrialResult:
    """A run of exp(-t) in windows of H [s], off by factor H^order sin(t)."""
    t = np.linspace(0.0, T_END, round(T_END / H) + 1)
    value = np.exp(-t) + factor * H**order * np.sin(t)
    return TrialResult("", 2 * (len(t) - 1), 0.01 / H, windows=len(t) - 1, t=t.tolist(),
                 probes={"T": value.tolist(), "still": (0.0 * t + 3.0).tolist()}, units={"T": "K", "still": "m"})


FELL = TrialResult("window 3 at t = 1 s: did not converge", 12, 0.1, windows=2)


def point(label: str, solver_calls: int, error: float, floor: float = 1e-6) -> Point:
    """A point of the curve `label`, its wall time going with its solver calls."""
    return Point(label, label, solver_calls, 0.01 * solver_calls, error, floor)


# Stands for a worker: answers at once, dies on the scenario "die", sleeps on "sleep".
FAKE = [sys.executable, "-c", """
import json, sys, time
for line in sys.stdin:
    job = json.loads(line)
    if job["text"] == "die":
        sys.exit("no such thing")
    if job["text"] == "sleep":
        time.sleep(60)
    print(json.dumps({"solver_calls": len(job["text"])}), flush=True)
"""]
