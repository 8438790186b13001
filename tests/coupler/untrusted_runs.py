"""Runs by the command line that cannot be trusted: embedded and with processes, each of which ends with code 4."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from coupler import Results
from coupler.trust.checks import Check


def trust_both_ways(scenario: Path, folder: Path) -> list[tuple[Check, ...]]:
    """The trust tables of both."""
    told = []
    for name, more in (("embedded", []), ("processes", ["--processes"])):
        out = folder / f"{name}.h5"
        command = [sys.executable, "-m", "coupler.cli", "run", str(scenario), "--out", str(out), *more]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == 4, done.stdout + done.stderr
        told.append(tuple(Results(out).trust))
    return told
