"""`auto` where its constants were not chosen: cases of the atlas with other numbers.

    python benchmarks/auto_unseen.py [--json FILE]

Cells as those of atlas.py (windows of .1 to 100 units, two disturbances), by `auto` and by `iterated` with iqn-ils: E1
with delta .6, E3c with eps .03 and g = 25 - 30 mean(T), E4 with C 50000 J/m2K and G 8000 W/m2K by both methods.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from scene import pin, table

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(Path(__file__).parent), str(ROOT / "tests" / "stability"), str(ROOT / "tests" / "coupler")]

NARROW = 0.5  # windows of at most so many units: what auto costs is told of them
E1_DELTA = 0.6
E3C_EPS, E3C_AT_0, E3C_GROWS = 0.03, 25.0, 30.0
E4_C, E4_G = 50000.0, 8000.0


def unseen() -> dict[str, object]:
    """name -> case (tests/stability/cases.py)."""
    from cases import CASES, bar

    soft = replace(CASES["E1"], name=f"E1 delta {E1_DELTA}", unit=2.0 / (1.0 + E1_DELTA),
                   make=lambda d: bar(d, delta=E1_DELTA))
    made = (chatter(), gap("backward_euler"), gap("midpoint"), soft)
    return {case.name: case for case in made}


def chatter() -> object:
    """E3c about another rest."""
    from cases import CASES, along, rod
    from rod_halves import Growth, Rod
    from scipy.optimize import brentq

    law = Rod(lambda x, p: (1.0 / (E3C_EPS + max(x, 0.0)), 0.0), T_left=1.0, T_w=0.0)

    def tip(g: float) -> float:
        return (E3C_EPS + g) / (1.0 + E3C_EPS + g)

    g = float(brentq(lambda g: E3C_AT_0 - 0.5 * E3C_GROWS * (1.0 + tip(g)) - g, 0.0, 5.0, xtol=1e-14))
    C, Bi = E3C_GROWS * tip(g) / (E3C_EPS + g) ** 2, 1.0 / (E3C_EPS + g)

    def left(dt: float) -> float:
        m = np.sqrt(2.0 / dt)
        return float(m * np.cosh(m) + Bi * np.sinh(m) - C * (np.cosh(m) - 1.0) / m)

    def make(d: float) -> object:
        T = 1.0 - (1.0 - tip(g)) * along(law.n) - d * np.sin(np.pi / 2.0 * along(law.n))
        return rod(law, Growth(E3C_AT_0, E3C_GROWS), T, "backward_euler")

    return replace(CASES["E3c"], name="E3c eps .03", make=make, unit=float(brentq(left, 0.01, 5.0)))


def gap(method: str) -> object:
    """E4 with other C and G, from d of the range below its rest."""
    from cases import CASES
    from coupled_run import start
    from fake_halves import G_M, K_G, T_S, T_W, gap_of, lumped, shrinking
    from scipy.optimize import brentq

    def h(T: float) -> float:
        return K_G / (gap_of(T) + G_M)

    rest = float(brentq(lambda T: E4_G * (T_S - T) - h(T) * (T - T_W), 500.0, 850.0, xtol=1e-12))
    a = (E4_G + h(rest)) / E4_C
    b = (rest - T_W) * h(rest) ** 2 / K_G * 3 * 2.5e-5 * 0.03 / E4_C

    def make(d: float) -> object:
        T = rest - d * 533.0
        return (lumped(T, method, body=(E4_C, E4_G)), shrinking(T)), start(T, gap_of(T))

    old, unit = ("E4", 2.0 / (b - a)) if method == "backward_euler" else ("E4 midpoint", 2.0 / b)
    return replace(CASES[old], name=f"{old} C 5e4", make=make, unit=unit)


def cells() -> list[dict[str, object]]:
    """Every cell, as plain values."""
    from cases import CASES, DISTURBANCES, WINDOWS
    from verdict import AUTO, FIXED, trial

    found = []
    CASES.update(unseen())
    for case in unseen().values():
        for way in (AUTO, FIXED[-1]):
            for disturbance in DISTURBANCES:
                for factor in WINDOWS:
                    cell = asdict(trial(case, way, factor, disturbance))
                    cell["outcome"] = cell["outcome"].value
                    found.append(cell)
        print(case.name, case.unit, file=sys.stderr, flush=True)
    return found


def told(found: list[dict[str, object]]) -> str:
    """A row a case: cells right by auto and by the scheme iterated, what auto costs, and where it is behind."""
    from atlas import auto_behind

    rows, good = [], ("right", "iterates")
    for name in dict.fromkeys(c["case"] for c in found):
        own = [c for c in found if c["case"] == name]
        mine = [c for c in own if c["way"] == "auto"]
        other = [c for c in own if c["way"] != "auto" and c["outcome"] in good]
        pairs = [c["pairs"] for c in mine if c["factor"] <= NARROW]
        rows.append({
            "case": name, "cells": str(len(mine)), "right iterated": str(len({
                (c["factor"], c["disturbance"]) for c in other})),
            "by auto": str(sum(c["outcome"] in good for c in mine)), "behind": str(len(auto_behind(own))),
            "largest error where right": f"{max(c['error'] for c in mine if c['outcome'] in good):.1g}",
            "pairs, narrow, mean": f"{np.mean(pairs):.2f}", "most": f"{max(pairs):.2f}"})
    return table(rows) + "\n" + "\n".join(map(str, auto_behind(found)))


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write the numbers here too")
    args = parser.parse_args()
    found = cells()
    if args.json:
        args.json.write_text(json.dumps(found, indent=1))
    print(told(found))


if __name__ == "__main__":
    main()
