"""What contact costs: search and forces from 1e3 to 1e5 surface nodes, and what zenoh adds.

    python benchmarks/contact_cost.py [--quick] [--chart FILE.svg] [--json FILE]

Two strips, 13 cells of the one against 10 of the other, touching everywhere.  A Newton iteration to compare with:
assembly, factorisation and one solve of the elastic half on strips of 20 layers of cells with as many surface nodes,
the least a body can have behind its surface and still be one; larger bodies make contact's share smaller.
"""

from __future__ import annotations

import argparse
import json
import os
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
from contact.half.register import register_message
from contact.half.sparse import factorise, pattern_of
from contact.link import Link, open_link
from contact.wire import Project, Registered, Traction

LAYERS, DEPTH = 20, 1e-5
SMALLEST = 30  # repeats are made until this many ms have gone


@dataclass(frozen=True)
class Cost:
    """Milliseconds, CPU, medians.  newton: nan where it was not measured."""

    surface_nodes: int
    project: float
    traction: float
    newton: float


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="up to 1e4 surface nodes")
    parser.add_argument("--chart", type=Path)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    sizes = (450, 1400, 4500) if options.quick else (450, 1400, 4500, 14000, 45000)
    costs = [measured(n) for n in sizes]
    print(table([{"surface nodes": f"{c.surface_nodes}", "project ms": f"{c.project:.2f}",
                  "traction ms": f"{c.traction:.2f}", "Newton ms": f"{c.newton:.0f}",
                  "share %": f"{100 * (c.project + c.traction) / c.newton:.1f}"} for c in costs]))
    grows = np.polyfit(np.log([c.surface_nodes for c in costs]), np.log([c.traction for c in costs]), 1)[0]
    print(f"traction grows as n^{grows:.2f}")
    direct, codec, zenoh = transports(450)
    print(f"traction at {costs[0].surface_nodes} surface nodes, elapsed: direct {direct:.2f} ms, "
          f"codec +{codec - direct:.2f} ms, zenoh +{zenoh - direct:.2f} ms")
    if options.chart:
        draw(costs, options.chart)
    if options.json:
        options.json.write_text(json.dumps({"costs": [asdict(c) for c in costs], "direct": direct, "codec": codec,
                                            "zenoh": zenoh}))


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
                median_ms(lambda: link.ask(Traction(known.surfaces, x, zeros, x, zeros)), time.process_time),
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


def transports(n: int) -> tuple[float, float, float]:
    """Elapsed ms of a traction request over the three links, in turns."""
    service = subprocess.Popen([sys.executable, "-m", "contact.serve", "--run", "cost", "--child"],
                               stdin=subprocess.PIPE, stdout=subprocess.PIPE, env={**os.environ})
    assert service.stdout is not None
    endpoint = service.stdout.readline().decode().split()[1]
    links = [open_link("direct"), open_link("codec"), open_link(f"zenoh:{endpoint}/cost")]
    try:
        return tuple(request_ms(link, strips(n)) for link in links)  # type: ignore[return-value]
    finally:
        for link in links:
            link.close()
        service.communicate(timeout=10)


def request_ms(link: Link, interface: Interface) -> float:
    """Median elapsed ms of a traction request."""
    known = link.ask(register_message(interface))
    assert isinstance(known, Registered), known
    x, zeros = interface.nodes, np.zeros(len(interface.nodes))
    return median_ms(lambda: link.ask(Traction(known.surfaces, x, zeros, x, zeros)), time.perf_counter)


def draw(costs: list[Cost], path: Path) -> None:
    """Milliseconds against surface nodes, log-log."""
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(5.5, 3.6), layout="constrained")
    n = [c.surface_nodes for c in costs]
    for name, label in (("project", "search and projection"), ("traction", "forces and stiffness"),
                        ("newton", f"factor and solve, {LAYERS} layers of cells")):
        axes.loglog(n, [getattr(c, name) for c in costs], "o-", ms=3, lw=1, label=label)
    axes.loglog(n, [0.05 * c.newton for c in costs], ":", c="C2", lw=1, label="5 % of it")
    axes.set_xlabel("surface nodes")
    axes.set_ylabel("CPU ms")
    axes.legend(frameon=False, fontsize=8)
    figure.savefig(path)


if __name__ == "__main__":
    main()
