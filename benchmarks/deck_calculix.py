"""One deck, two programs: CalculiX reads it, and `slideline init --from` makes a scenario of it.

    python benchmarks/deck_calculix.py [--quick] [--json FILE]      needs `ccx` on the path (Debian: calculix-ccx)

The deck is that of calculix.py: two pressed blocks, conductance from the pressure, 2500 s from a jump of 1000 K between
them.  Compared at every increment: the temperature of the middle of the lower block's top.  Both step by backward Euler
and iterate heat and deformation to agreement.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from calculix import L, deck
from numpy.typing import NDArray

from coupler.deck import convert
from coupler.running.run import run
from coupler.scenario import load_scenario

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Difference:
    """n cells a side, increment [s]; largest and last difference of the two programs' temperature [K]; the last one
    of either [degC]."""

    n: int
    dt: float
    largest: float
    last: float
    ccx: float
    ours: float


def told(n: int, dt: float) -> str:
    """The deck with the probe printed at every increment."""
    return re.sub(r"FREQUENCY=\d+", "FREQUENCY=1", deck(n, dt))


def by_calculix(folder: Path) -> tuple[Floats, Floats]:
    """Times and temperatures of the probe.  Raises RuntimeError if ccx fails."""
    ccx = shutil.which("ccx")
    if ccx is None:
        raise RuntimeError("ccx is not on the path (Debian: apt-get install calculix-ccx)")
    done = subprocess.run([ccx, "blocks"], cwd=folder, env=dict(os.environ, OMP_NUM_THREADS="1"), capture_output=True,
                          text=True, check=False)
    if done.returncode or "Job finished" not in done.stdout:
        raise RuntimeError("ccx failed:\n" + (done.stdout + done.stderr)[-2000:])
    found = re.findall(r"time\s+([-\d.E+]+)\s+\d+\s+([-\d.E+]+)\s*$", (folder / "blocks.dat").read_text(), re.M)
    t, T = np.array(found, dtype=float).T
    return t, T


def by_us(folder: Path) -> tuple[Floats, Floats]:
    """Times and temperatures of the probe, of the scenario the deck becomes."""
    converted = convert(folder / "blocks.inp", folder / "blocks.yaml")
    probe = {"T": {"at": [L / 2, L], "body": "EALL_1"}}
    results = run(load_scenario(converted.files[0], overrides={"probes.top": probe}), folder / "run.h5")
    return results.probe("top", "degC")


def difference(n: int, dt: float) -> Difference:
    """Both programs on one deck."""
    with tempfile.TemporaryDirectory(prefix="deck.") as name:
        folder = Path(name)
        (folder / "blocks.inp").write_text(told(n, dt))
        t_ccx, T_ccx = by_calculix(folder)
        t, T = by_us(folder)
    ours = np.interp(t_ccx, t, T)
    apart = np.abs(ours - T_ccx)
    return Difference(n, dt, float(apart.max()), float(apart[-1]), float(T_ccx[-1]), float(ours[-1]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the coarsest alone")
    parser.add_argument("--json", type=Path, help="write the numbers here too")
    args = parser.parse_args()
    print("   n  increment s   largest difference K (of 1000)   at the end K   CalculiX, ours at the end degC")
    found = []
    for n, dt in ((4, 250.0),) if args.quick else ((4, 250.0), (8, 100.0), (8, 50.0)):
        d = difference(n, dt)
        found.append(asdict(d))
        print(f"{n:4d} {dt:12g} {d.largest:32.3f} {d.last:14.4f}   {d.ccx:.3f}, {d.ours:.3f}", flush=True)
    if args.json:
        args.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
