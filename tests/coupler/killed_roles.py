"""Runs in processes whose halves and contact service are killed at random moments and started anew.

    python tests/coupler/killed_roles.py [RUNS] [SEED]     each run kills each role once; compared with one undisturbed
"""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import threading
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from coupler import Results, load_scenario, run

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from killed_runs import differences  # noqa: E402

SCENARIO = HERE.parents[1] / "scenarios/casting_1d.yaml"
CHANGED = {"coupling.end": 0.5}
ROLES = ["thermal", "mechanical", "contact"]
PAUSE = (0.05, 0.4)  # s between two kills; a run takes two seconds, and one more for each that is started anew
RESTARTED = 30.0  # s to wait for the next process


@dataclass(frozen=True)
class KilledRun:
    """roles : in the order in which they were killed.  restarts : that the run tells.  differences : of its files."""

    roles: tuple[str, ...]
    restarts: int
    differences: list[str]


def children() -> dict[str, int]:
    """The processes of a run of this process, by role."""
    found = {}
    for child in psutil.Process().children():
        try:
            words = child.cmdline()
        except (psutil.ZombieProcess, psutil.NoSuchProcess):
            continue
        found |= {role: child.pid for role in ("thermal", "mechanical") if role in words}
        if "contact.rpc.serve" in words:
            found["contact"] = child.pid
    return found


def killed_run(whole: Path, out: Path, seed: int) -> KilledRun:
    """Run the scenario, each role killed once at a random moment, and compare it with the one nobody disturbed."""
    random, killed, stop = np.random.default_rng(seed), [], threading.Event()

    def kill() -> None:
        for role in random.permutation(ROLES):
            stop.wait(float(random.uniform(*PAUSE)))
            if stop.is_set() or role not in (now := children()):
                return
            os.kill(now[role], signal.SIGKILL)
            killed.append(str(role))
            until = time.monotonic() + RESTARTED
            while children().get(role) in (None, now[role]) and time.monotonic() < until and not stop.is_set():
                time.sleep(0.02)

    killer = threading.Thread(target=kill)
    try:
        run(load_scenario(SCENARIO, CHANGED | {"coupling.restart": 3}), out, processes=True,
            on_window=lambda w: killer.start() if w.number == 1 else None)
    finally:
        stop.set()
        killer.join()
    # coupling.restart stands in the header.
    found = [d for d in differences(whole, out) if not d.startswith("header:")]
    return KilledRun(tuple(killed), len(Results(out).totals["restarts"]), found)


def main(runs: int, seed: int) -> int:
    """Tell how many kills there were of each role, and what they changed."""
    killed: Counter[str] = Counter()
    different = 0
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole.h5"
        run(load_scenario(SCENARIO, CHANGED), whole)
        for k in range(runs):
            one = killed_run(whole, Path(folder) / f"run{k}.h5", seed + k)
            killed.update(one.roles)
            different += bool(one.differences)
            print(f"run {k + 1}: killed {', '.join(one.roles) or 'nobody'}; {one.restarts} started anew; "
                  f"{one.differences or 'the same bits'}", flush=True)
    print(f"{sum(killed.values())} kills ({', '.join(f'{n} {role}' for role, n in sorted(killed.items()))}) in {runs} "
          f"runs, {different} runs differ")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main(*(int(word) for word in (sys.argv[1:] + ["10", "100"][len(sys.argv) - 1:]))))
