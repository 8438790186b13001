"""Named breaks of the code, each of which must turn a test red: `python tests/mutations.py [NAME ...]`.

The packages are copied to a scratch folder, one line is broken there, and the tests named with it run on the copy.
A break that no test notices is a hole in the tests; the command then exits with 1.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("contact", "thermal_fmu", "mechanical_fmu", "coupler")


@dataclass(frozen=True)
class Mutation:
    """In `file`, `old` (which stands there once) becomes `new`; one of `tests` (pytest arguments) must fail."""

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]


MUTATIONS = tuple(
    Mutation(**{**row, "tests": tuple(row["tests"])})
    for row in tomllib.loads((ROOT / "tests/mutations.toml").read_text(encoding="utf-8"))["mutation"]
)


def broken_copy(mutation: Mutation, target: Path) -> None:
    """Copy the packages to target and break one line.  Raises ValueError where the line is not there once."""
    for name in (*PACKAGES, "tests", "scenarios", "docs", "benchmarks"):
        shutil.copytree(ROOT / name, target / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "CHANGELOG.md"):
        shutil.copy(ROOT / name, target)
    path = target / mutation.file
    text = path.read_text(encoding="utf-8")
    if text.count(mutation.old) != 1:
        raise ValueError(f"{mutation.name}: the line stands {text.count(mutation.old)} times in {mutation.file}")
    path.write_text(text.replace(mutation.old, mutation.new), encoding="utf-8")


def is_noticed(mutation: Mutation, scratch: Path) -> bool:
    """Whether a test fails on the broken copy, made in scratch/copy; scratch keeps compiled kernels between calls."""
    target = scratch / "copy"
    shutil.rmtree(target, ignore_errors=True)
    broken_copy(mutation, target)
    env = {**os.environ, "PYTHONPATH": str(target), "SLIDELINE_CACHE": str(target / "cache"),
           "NUMBA_CACHE_DIR": str(scratch / "numba")}
    done = subprocess.run([sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-m", "", "-p", "no:cacheprovider",
                           *mutation.tests], cwd=target, env=env, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise RuntimeError(f"{mutation.name}: pytest ended with {done.returncode}\n{done.stdout}{done.stderr}")
    return done.returncode == 1


def main(names: list[str]) -> int:
    """Run the breaks whose name or file contains one of `names` (all where none is given)."""
    unnoticed = 0
    with tempfile.TemporaryDirectory() as scratch:
        for mutation in MUTATIONS:
            if names and not any(n in mutation.name or n in mutation.file for n in names):
                continue
            noticed = is_noticed(mutation, Path(scratch))
            unnoticed += not noticed
            print(f"{'red' if noticed else 'NOT NOTICED':12} {mutation.file}: {mutation.name}", flush=True)
    return 1 if unnoticed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
