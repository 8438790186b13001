"""Runs killed (SIGKILL) at random times and resumed until they are done, held against the run nobody disturbed.

    python benchmarks/kills.py [--kills 200] [--seed 1] [--only casting_1d] [--folder DIR]

How it is done: tests/coupler/killed_runs.py, which the tests use too.  Ends with code 1 if any file differs in a bit.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "coupler"))
from killed_runs import CASES, Case, counted, kill_and_resume


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, help="instead of those of the case")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=CASES)
    parser.add_argument("--folder", type=Path)
    options = parser.parse_args()
    different = 0
    for name, case in CASES.items():
        if options.only not in (None, name):
            continue
        with tempfile.TemporaryDirectory(dir=options.folder) as folder:
            done = kill_and_resume(Case(case.file, case.overrides, options.kills or case.kills), Path(folder),
                                   options.seed)
        print(f"{name}: {counted(done)} in {done.runs} runs: " + (
            "every file the same to the bit" if not done.different else "\n  ".join(["DIFFERENT", *done.different])))
        different += len(done.different)
    sys.exit(different > 0)


if __name__ == "__main__":
    main()
