"""What distance costs: sliding blocks in one process, in processes, and on machines so far away, against a model.

    python benchmarks/network_cost.py [--cells 24 100] [--chart FILE.svg]      Linux, with `unshare` and `ip`

Machines are network namespaces around a router; `tests/coupler/bad_line.py` delays and narrows the line to each.  The
model takes three numbers that no distance changes from the run in processes, and two of the line:

    window = window in processes + (messages + requests) x round trip + bytes / rate

messages : of the coupler to a half and back (steps and reads).  requests : of a half to the contact service.  bytes :
8 for each real that crosses the border of a half.  round trip : of one byte.  rate : bytes of a message of the mean
size over what its way takes beyond one byte's.  Both are measured in the same namespaces, over TCP as the run's own.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np

from coupler import Results, load_scenario, run
from coupler.fmu.metered import CALLS

matplotlib.use("Agg")
import matplotlib.pyplot as plt

ROOT = Path(__file__).resolve().parents[1]
TESTS = ROOT / "tests/coupler"
sys.path.insert(0, str(TESTS))
from host_scene import ROLES, SLIDELINE, host, router, wait_for, waiting, write_hosts  # noqa: E402

SCENARIO = ROOT / "scenarios/sliding_blocks.yaml"
LINES = ((0.0, 0.0), (0.001, 0.0), (0.020, 0.0), (0.020, 1e8))  # round trip between two machines [s], rate [bit/s]
WINDOWS, SKIPPED = 64, 4
ECHO = """
import socket
with socket.create_server(("0.0.0.0", 9000)) as server:
    line, _ = server.accept()
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    while head := line.recv(8, socket.MSG_WAITALL):
        line.recv(int.from_bytes(head, "little"), socket.MSG_WAITALL)
        line.sendall(b"x")
"""
ASK = """
import socket, statistics, sys, time
line = socket.create_connection((sys.argv[1], 9000), timeout=20)
line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
for size in (1, int(sys.argv[2])):
    took = []
    for _ in range(50):
        begun = time.perf_counter()
        line.sendall(size.to_bytes(8, "little") + bytes(size))
        line.recv(1)
        took.append(time.perf_counter() - begun)
    print(statistics.median(took))
"""


Row = tuple[float, float, float, float]  # round trip, window, window by the model [s], rate of the line [bit/s]


@dataclass(frozen=True)
class Cost:
    """Of a window, means: seconds [s]; messages, requests, bytes [1]."""

    seconds: float
    messages: float
    requests: float
    bytes: float


def settings(cells: int) -> dict[str, object]:
    """Windows of one size while the gap is open: each is worth the same."""
    return {"coupling.windows": [{"until": 10.0 * WINDOWS, "size": 10.0}], "coupling.end": 10.0 * WINDOWS,
            **{f"bodies.{body}.mesh.rectangle.cells": [cells, cells] for body in ("lower", "upper")}}


def cost_of(path: Path) -> Cost:
    """What the windows of a run cost, without the first."""
    results = Results(path)
    times, windows, calls = results.timings[SKIPPED:], results.windows[SKIPPED:], results.calls
    asked = np.isin(calls.call, [CALLS.index("advance"), CALLS.index("read")]) & (calls.window >= SKIPPED)
    n = len(times)
    return Cost(statistics.median(times.seconds + times.record), asked.sum() / n, times.requests.sum() / n,
                8.0 * windows["values"].sum() / n)


def at_distance(folder: Path, cells: int, trip: float, rate: float, size: int) -> None:
    """Run on three machines; called inside of `unshare`.

    Leaves run.h5, and trip.txt with the round trips [s] of one byte and of a message of so many bytes.
    """
    # Every message crosses two lines each way.
    addresses = router(ROLES, {"delay": trip / 4.0, "rate": rate})
    inside = {role: ["ip", "netns", "exec", role] for role in (*ROLES, "coupler")}
    echo = subprocess.Popen([*inside["thermal"], sys.executable, "-c", ECHO])
    time.sleep(1.0)
    asked = subprocess.run([*inside["coupler"], sys.executable, "-c", ASK, addresses["thermal"], str(size)],
                           check=True, capture_output=True, text=True)
    echo.wait()
    (folder / "trip.txt").write_text(asked.stdout)
    write_hosts(folder, addresses)
    hosts = [host(folder, role, inside[role]) for role in ROLES]
    try:
        wait_for(lambda: waiting(folder, ROLES), "no host came up")
        sets = [word for key, value in settings(cells).items() for word in ("--set", f"{key}={json.dumps(value)}")]
        with (folder / "run.log").open("wb") as log:
            subprocess.run([*inside["coupler"], *SLIDELINE, "run", SCENARIO, "-o", folder / "run.h5", "--hosts",
                            folder / "hosts.yaml", *sets], check=False, stdout=log, stderr=log)
    finally:
        for process in hosts:
            process.terminate()
            process.wait(20)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, nargs="+", default=[24, 100])
    parser.add_argument("--chart", type=Path)
    parser.add_argument("--inside", nargs=5, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.inside:
        folder, cells, trip, rate, size = options.inside
        return at_distance(Path(folder), int(cells), float(trip), float(rate), int(size))
    os.environ.setdefault("PYTHONPATH", str(ROOT))
    print("| cells | where | round trip [ms] | rate [Mbit/s] | messages | requests | kB | window [ms] | model [ms] "
          "| off |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    found: dict[int, list[Row]] = {}
    with tempfile.TemporaryDirectory() as name:
        for cells in options.cells:
            one, many = Path(name) / f"one{cells}.h5", Path(name) / f"many{cells}.h5"
            run(load_scenario(SCENARIO, settings(cells)), one)
            run(load_scenario(SCENARIO, settings(cells)), many, processes=True)
            near = cost_of(many)
            for where, cost in (("one process", cost_of(one)), ("processes", near)):
                print(f"| 2 x ({cells} x {cells}) | {where} | | | {cost.messages:.1f} | {cost.requests:.1f} | "
                      f"{cost.bytes / 1e3:.0f} | {1e3 * cost.seconds:.1f} | | |", flush=True)
            for k, (trip, rate) in enumerate(LINES):
                folder = Path(name) / f"far{cells}_{k}"
                folder.mkdir()
                size = near.bytes / near.messages
                subprocess.run(["unshare", "-rnm", sys.executable, __file__, "--inside", folder, str(cells), str(trip),
                                str(rate), str(int(size))], check=True)
                cost = cost_of(folder / "run.h5")
                trip, sent = map(float, (folder / "trip.txt").read_text().split())
                model = near.seconds + (near.messages + near.requests) * trip + near.messages * max(sent - trip, 0.0)
                found.setdefault(cells, []).append((trip, cost.seconds, model, rate))
                mbit = 8e-6 * size / max(sent - trip, 1e-9)
                print(f"| | machines | {1e3 * trip:.2f} | {mbit:.0f} | {cost.messages:.1f} | "
                      f"{cost.requests:.1f} | {cost.bytes / 1e3:.0f} | {1e3 * cost.seconds:.1f} | {1e3 * model:.1f} | "
                      f"{100 * (model / cost.seconds - 1):+.0f} % |", flush=True)
    if options.chart:
        draw(found, options.chart)


def draw(found: dict[int, list[Row]], chart: Path) -> None:
    figure, ax = plt.subplots(figsize=(6.4, 3.6))
    for cells, rows in found.items():
        trips, seconds, model = 1e3 * np.array([row[:3] for row in rows if not row[3]]).T
        line, = ax.plot(trips, seconds, "o", label=f"2 x ({cells} x {cells}) cells, measured")
        ax.plot(trips[np.argsort(trips)], model[np.argsort(trips)], "-", color=line.get_color(), label="model")
        for trip, took, told, rate in (row for row in rows if row[3]):
            at = 1e3 * trip
            ax.plot(at, 1e3 * took, "s", mfc="none", color=line.get_color(), label=f"at {rate / 1e6:.0f} Mbit/s")
            ax.plot(at, 1e3 * told, "_", ms=12, color=line.get_color())
    ax.set_xlabel("round trip between two machines [ms]")
    ax.set_ylabel("a window [ms]")
    ax.legend()
    figure.savefig(chart, bbox_inches="tight")


if __name__ == "__main__":
    main()
