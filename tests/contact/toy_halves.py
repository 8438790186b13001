"""Make toy halves (tests/contact/halves/toy_half) and use them in fresh processes: FMUs share one interpreter."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np

from contact.half.interface import Interface, write_interface

HALVES = Path(__file__).resolve().parent / "halves"
ROOT = HALVES.parent.parent.parent


def interface(n: int) -> Interface:
    """n nodes and no cells."""
    none = np.empty(0, dtype=np.int32)
    return Interface("plane", np.arange(2.0 * n).reshape(n, 2), np.empty((0, 4), dtype=np.int32),
                     np.empty((0, 3), dtype=np.int32), none, none, ("body",), ("steel",), {})


def directory(path: Path, n: int = 4, **model: object) -> Path:
    """The directory of a toy half of n nodes."""
    path.mkdir(parents=True, exist_ok=True)
    write_interface(interface(n), path / "interface.h5")
    (path / "model.json").write_text(json.dumps({"half": "toy", "rate": 0.1, **model}))
    return path


def environment(**more: str) -> dict[str, str]:
    """An environment in which our packages and the toy half are installed."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(HALVES)]), "OMP_NUM_THREADS": "1", **more}


def fresh(code: str, *args: object, env: dict[str, str] | None = None) -> str:
    """Run a program in a process of its own; its standard output.  Fails, with its words, unless it ends with 0."""
    done = subprocess.run([sys.executable, "-P", "-c", textwrap.dedent(code), *map(str, args)], capture_output=True,
                          text=True, timeout=240, env=env or environment(), check=False)
    assert done.returncode == 0, f"ended with {done.returncode}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}"
    return done.stdout


def build(path: Path, n: int = 4, fmi: int = 2, **model: object) -> Path:
    """The FMU of a toy half, built by its own builder in a process of its own.  fmi : 2 or 3."""
    out = directory(path, n, **model) / "toy.fmu"
    subprocess.run([sys.executable, "-P", "-m", "toy_half.build", str(path), str(out),
                    *(["--fmi", "3"] if fmi == 3 else [])], check=True, timeout=240, env=environment())
    return out
