"""Runs in processes whose halves and contact service are killed at random moments and started anew, or stopped.

    python tests/coupler/killed_roles.py [KILLS] [STOPS] [SEED]

Each of KILLS runs kills each role once, each of STOPS runs stops each role once for a while (SIGSTOP, SIGCONT); all
are compared with one that nobody disturbed, bit by bit.
"""

from __future__ import annotations

import contextlib
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
STOPPED = (0.2, 7.0)  # s that a role is stopped: a lease is three


@dataclass(frozen=True)
class KilledRun:
    """roles : in the order of what befell them.  restarts : that the run tells.  differences : of its files."""

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


def killed_run(whole: Path, out: Path, seed: int, stops: bool = False) -> KilledRun:
    """Run the scenario, each role killed once at a random moment, and compare it with the one nobody disturbed.

    stops : they are stopped for a while, and none is killed.
    """
    random, killed, stop = np.random.default_rng(seed), [], threading.Event()

    def kill() -> None:
        for role in random.permutation(ROLES):
            stop.wait(float(random.uniform(*PAUSE)))
            if stop.is_set() or role not in (now := children()):
                return
            os.kill(now[role], signal.SIGSTOP if stops else signal.SIGKILL)
            killed.append(str(role))
            if stops:
                time.sleep(float(random.uniform(*STOPPED)))
                # A run that stood still until its end may be over: its processes are gone.
                with contextlib.suppress(ProcessLookupError):
                    os.kill(now[role], signal.SIGCONT)
                continue
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


def main(kills: int = 10, stops: int = 3, seed: int = 100) -> int:
    """Tell how many roles were killed and stopped, and what that changed."""
    done: dict[str, Counter[str]] = {"killed": Counter(), "stopped": Counter()}
    different = 0
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole.h5"
        run(load_scenario(SCENARIO, CHANGED), whole)
        for k in range(kills + stops):
            what = "killed" if k < kills else "stopped"
            one = killed_run(whole, Path(folder) / f"run{k}.h5", seed + k, stops=k >= kills)
            done[what].update(one.roles)
            different += bool(one.differences)
            print(f"run {k + 1}: {what} {', '.join(one.roles) or 'nobody'}; {one.restarts} started anew; "
                  f"{one.differences or 'the same bits'}", flush=True)
    for what, roles in done.items():
        print(f"{what}: {', '.join(f'{n} {role}' for role, n in sorted(roles.items())) or 'nobody'}")
    print(f"{kills + stops} runs, {different} differ")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
