"""Judges the seeds that come in, a line each, and writes what it finds as lines of JSON: a process of random_scenes.py.

    python benchmarks/random_scenes_worker.py MODULE:FUNCTION
"""

from __future__ import annotations

import importlib
import json
import os
import sys
from pathlib import Path


def main(judge: str) -> None:
    """Judge until there are no more.  judge : from a seed to what has `as_dict()`."""
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what a run prints is no row
    # Before this folder, where a file has the name of that package.
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
    module, _, name = judge.partition(":")
    judged = getattr(importlib.import_module(module), name)
    for line in sys.stdin:
        json.dump(judged(int(line)).as_dict(), out)
        out.write("\n")
        out.flush()


if __name__ == "__main__":
    main(sys.argv[1])
