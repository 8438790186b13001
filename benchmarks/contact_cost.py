"""What contact costs: search and forces from 1e3 to 1e5 surface nodes, and what zenoh adds.

    python benchmarks/contact_cost.py [--quick] [--links] [--chart FILE.svg] [--json FILE]

Two strips, 13 cells of the one against 10 of the other, touching everywhere.  A Newton iteration to compare with:
assembly, factorisation and one solve of the elastic half on strips of 20 layers of cells with as many surface nodes,
the least a body can have behind its surface and still be one; larger bodies make contact's share smaller.

The three links are asked in turns, with the memory settings of a half in a process of its own.  What a link adds is the
median of its time over that of the direct call beside it, in the rounds in which the machine was quiet: those whose
direct call took at most a tenth more than the least of all did.
"""

from __future__ import annotations

import argparse
import json
import os
import secrets
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scene import pin, table

from contact.half.interface import Interface, Pair
from contact.half.linalg import factorise, pattern_of
from contact.half.register import register_message
from contact.messages import Project, Registered, Traction
from contact.rpc.link import Link, open_link
from contact.rpc.seal import SECRET_BYTES, keep_secret
from contact.rpc.server import keep_freed_memory

LAYERS, DEPTH = 20, 1e-5
QUIET, PATIENCE = 300, 20.0  # quiet rounds wanted, and the seconds after which fewer must do
SMALLEST = 30  # repeats are made until this many ms have gone


@dataclass(frozen=True)
class Cost:
    """Milliseconds, CPU, medians.  newton: nan where it was not measured."""

    surface_nodes: int
    project: float
    traction: float
    newton: float


@dataclass(frozen=True)
class Ways:
    """Elapsed ms of a traction request: direct, and what codec and zenoh add.  rounds : quiet ones."""

    surface_nodes: int
    direct: float
    codec: float
    zenoh: float
    rounds: int


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="up to 1e4 surface nodes")
    parser.add_argument("--links", action="store_true", help="the links alone")
    parser.add_argument("--chart", type=Path)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    sizes = () if options.links else (450, 1400, 4500) if options.quick else (450, 1400, 4500, 14000, 45000)
    costs = [measured(n) for n in sizes]
    if costs:
        say_costs(costs)
    ways = links((45, 140, 450, 1400, 4500))
    print(table([{"surface nodes": f"{w.surface_nodes}", "direct ms": f"{w.direct:.3f}", "codec adds": f"{w.codec:.3f}",
                  "zenoh adds": f"{w.zenoh:.3f}", "quiet rounds": f"{w.rounds}"} for w in ways]))
    if options.chart:
        draw(costs, ways, options.chart)
    if options.json:
        options.json.write_text(json.dumps({"costs": [asdict(c) for c in costs], "links": [asdict(w) for w in ways]}))


def say_costs(costs: list[Cost]) -> None:
    """A row a size."""
    print(table([{"surface nodes": f"{c.surface_nodes}", "project ms": f"{c.project:.2f}",
                  "traction ms": f"{c.traction:.2f}", "Newton ms": f"{c.newton:.0f}",
                  "search share %": f"{100 * c.project / c.newton:.2f}",
                  "share %": f"{100 * (c.project + c.traction) / c.newton:.1f}"} for c in costs]))
    grows = np.polyfit(np.log([c.surface_nodes for c in costs]), np.log([c.traction for c in costs]), 1)[0]
    print(f"traction grows as n^{grows:.2f}")


def strips(n: int) -> Interface:
    """The surfaces of two strips as a contact pair, n and 1.3 n edges; the cells behind them are not asked for."""
    m = int(1.3 * n)
    slave = np.column_stack([np.linspace(0.0, 1.0, n + 1), np.full(n + 1, -DEPTH / n)])
    master = np.column_stack([np.linspace(1.0, 0.0, m + 1), np.zeros(m + 1)])

    def chain(count: int, first: int) -> np.ndarray:
        return (np.column_stack([np.arange(count), np.arange(1, count + 1)]) + first).astype(np.int32)

    none = np.empty(0, np.int32)
    return Interface("plane", np.concatenate([slave, master]), none.reshape(0, 4), none.reshape(0, 3), none, none,
                     ("a", "b"), ("m", "m"), {"s": chain(n, 0), "m": chain(m, n + 1)}, {},
                     (Pair("p", "s", "m", 0.1, 1e12),))


def measured(n: int) -> Cost:
    """Search and forces of two strips with n and 1.3 n edges."""
    interface = strips(n)
    link = open_link("direct")
    known = link.ask(register_message(interface))
    assert isinstance(known, Registered), known
    x, zeros = interface.nodes, np.zeros(len(interface.nodes))
    return Cost(len(x), median_ms(lambda: link.ask(Project(known.surfaces, x)), time.process_time),
                median_ms(lambda: link.ask(Traction(known.surfaces, x, zeros, x, zeros, zeros)), time.process_time),
                newton(int(1.15 * n)))


def median_ms(work: Callable[[], object], clock: Callable[[], float]) -> float:
    """Median of five batches, after one that warms up."""
    work()
    started = clock()
    work()
    repeats = max(1, int(SMALLEST / max(1e3 * (clock() - started), 0.05)))
    batches = []
    for _ in range(5):
        started = clock()
        for _ in range(repeats):
            work()
        batches.append(1e3 * (clock() - started) / repeats)
    return statistics.median(batches)


def newton(n: int) -> float:
    """CPU ms of factorising and solving two strips of n by LAYERS cells, from a stiffness of that pattern.

    Without assembly: so contact's share is rather over- than understated.
    """
    grid = np.arange((n + 1) * (LAYERS + 1)).reshape(LAYERS + 1, n + 1)
    cells = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4)
    dofs = (2 * cells[:, :, None] + np.arange(2)).reshape(-1, 8)
    pattern = pattern_of(2 * grid.size, dofs)
    block = np.full((8, 8), -1.0) + 9.0 * np.eye(8)
    A = pattern.matrix(np.tile(block.ravel(), len(dofs)))
    b = np.ones(A.shape[0])
    return 2.0 * median_ms(lambda: factorise(A)(b), time.process_time) if n < 20000 else 2.0 * once_ms(
        lambda: factorise(A)(b))


def once_ms(work: Callable[[], object]) -> float:
    """CPU ms of one call."""
    started = time.process_time()
    work()
    return 1e3 * (time.process_time() - started)


def links(sizes: tuple[int, ...]) -> list[Ways]:
    """What the links add, at each size."""
    keep_freed_memory()
    service = subprocess.Popen([sys.executable, "-m", "contact.rpc.serve", "--run", "cost", "--child"],
                               stdin=subprocess.PIPE, stdout=subprocess.PIPE, env={**os.environ})
    assert service.stdin is not None
    assert service.stdout is not None
    secret = secrets.token_bytes(SECRET_BYTES)
    service.stdin.write(f"{secret.hex()}\n".encode())
    service.stdin.flush()
    keep_secret("cost", secret)
    endpoint = service.stdout.readline().decode().split()[1]
    ways = [open_link("direct"), open_link("codec"), open_link(f"zenoh:{endpoint}/cost")]
    try:
        return [in_turns(ways, strips(n)) for n in sizes]
    finally:
        for link in ways:
            link.close()
        service.communicate(timeout=10)


def in_turns(ways: list[Link], interface: Interface) -> Ways:
    """Elapsed ms of a traction request by each link, until QUIET rounds were quiet, or for PATIENCE seconds."""
    for link in ways:
        known = link.ask(register_message(interface))
    assert isinstance(known, Registered), known
    x, zeros = interface.nodes, np.zeros(len(interface.nodes))
    request = Traction(known.surfaces, x, zeros, x, zeros, zeros)
    rounds: list[list[float]] = []
    quiet, until = np.zeros((0, 3)), time.perf_counter() + PATIENCE
    while len(quiet) < QUIET and (not rounds or time.perf_counter() < until):
        for _ in range(50):
            rounds.append([once(link, request) for link in ways])
        took = np.array(rounds[10:])
        quiet = took[took[:, 0] <= 1.1 * took[:, 0].min()]
    direct, codec, zenoh = np.median(quiet - np.outer(quiet[:, 0], [0.0, 1.0, 1.0]), axis=0)
    return Ways(len(x), float(direct), float(codec), float(zenoh), len(quiet))


def once(link: Link, request: Traction) -> float:
    """Elapsed ms of one request."""
    started = time.perf_counter()
    link.ask(request)
    return 1e3 * (time.perf_counter() - started)


def draw(costs: list[Cost], ways: list[Ways], path: Path) -> None:
    """Contact's share of a Newton iteration, and the links, against surface nodes."""
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
    n = [c.surface_nodes for c in costs]
    left.loglog(n, [100 * c.project / c.newton for c in costs], "o-", ms=3, lw=1, label="search and projection")
    left.loglog(n, [100 * (c.project + c.traction) / c.newton for c in costs], "s-", ms=3, lw=1,
                label="and forces, stiffness")
    left.axhline(5.0, color="#888888", ls=":", lw=1, label="5 %")
    left.set_ylabel("% of a Newton iteration")
    left.set_ylim(0.05, 10)
    n = [w.surface_nodes for w in ways]
    for label, times, style in (("direct", [w.direct for w in ways], "o-"),
                                ("codec", [w.direct + w.codec for w in ways], "s-"),
                                ("zenoh", [w.direct + w.zenoh for w in ways], "^-")):
        right.loglog(n, times, style, ms=3, lw=1, label=label)
    right.loglog(n, [w.zenoh for w in ways], "^:", ms=3, lw=1, c="C2", label="what zenoh adds")
    right.axhline(0.3, color="#888888", ls=":", lw=1, label=".3 ms")
    right.set_ylabel("a traction request [ms]")
    for axes in (left, right):
        axes.set_xlabel("surface nodes")
        axes.legend(frameon=False, fontsize=8)
    figure.savefig(path)


if __name__ == "__main__":
    main()
