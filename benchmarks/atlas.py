"""Where each scheme is right: cases, schemes, windows and disturbances, a verdict each.

    python benchmarks/atlas.py [--quick] [--cases E4,E3c] [--json FILE] [--charts FOLDER] [--from FILE]

Cases and verdicts are those of tests/stability: small halves in Python under the real coupler.  Windows are .1 to 100
times the unit of a case: the closed form of the largest window that is stable with the other half held (E1, E3c, E4,
E5), or the time heat takes along the rod (E3b, D9, D13).  Disturbances are 1e-3 and .3 of the range of the case.
`--from` draws numbers that were written before.  Then the limits are measured by bisection and held against theory.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, replace
from pathlib import Path

from scene import pin, table

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(Path(__file__).parent), str(ROOT / "tests" / "stability")]

TITLES = {
    "E1": "E1  thermoelastic bar, T held", "E3b": "E3b  rod, three steady states", "E3c": "E3c  rod, chatter",
    "E4": "E4  lumped gap, backward Euler", "E4 midpoint": "E4  lumped gap, midpoint rule",
    "E5": "E5  aluminium given T, steel given heat", "D9": "D9  rod, clearance closes",
    "D13": "D13  rod grows into contact"}

# Their thermal halves tell the heat they store, which the scheme along_heat follows.
HEATED = ("E4", "E4 midpoint")


def cells(names: list[str], quick: bool) -> list[dict[str, object]]:
    """Every cell of the cases, in order, as plain values."""
    from cases import CASES, DISTURBANCES, WINDOWS
    from verdict import ADIABATIC, ALONG_HEAT, AUTO, FIXED, trial

    found = []
    for name in names:
        heated = (ALONG_HEAT,) if name in HEATED else ()
        for way in (*FIXED, *heated, AUTO, *((ADIABATIC,) if name == "E1" else ())):
            for disturbance in DISTURBANCES:
                for factor in WINDOWS[::3] if quick else WINDOWS:
                    cell = asdict(trial(CASES[name], way, factor, disturbance))
                    cell["outcome"] = cell["outcome"].value
                    found.append(cell)
            print(f"{name}: {way.name}", file=sys.stderr, flush=True)
    return found


def limits() -> list[dict[str, object]]:
    """Measured against predicted largest windows, where a closed form is known."""
    from boundary import bisected, contraction, limit
    from cases import CASES, chatter, e3c_limit, e5_limit, lagged_gap
    from fake_halves import A_LAG, B_LAG

    from coupler.scenario.options import Scheme, Seen

    E1, E4, E3c, a, b = CASES["E1"], CASES["E4"], CASES["E3c"], A_LAG, B_LAG
    middle, soft = CASES["E4 midpoint"], replace(E3c, make=lambda d: chatter(d, "midpoint"))
    euler = replace(E4, make=lambda d: lagged_gap(d, "backward_euler"))
    asked = [
        ("E1", "staggered", "midpoint", E1, Scheme.STAGGERED, E1.unit),
        ("E1", "mechanical first", "midpoint", E1, Scheme.MECHANICAL_FIRST, E1.unit),
        ("E3c", "staggered", "backward Euler", E3c, Scheme.STAGGERED, e3c_limit("backward_euler")),
        ("E3c", "staggered", "midpoint", soft, Scheme.STAGGERED, e3c_limit("midpoint")),
        ("E4", "staggered", "backward Euler", euler, Scheme.STAGGERED, 2 / (b - a)),
        ("E4", "parallel", "backward Euler", euler, Scheme.PARALLEL, 1 / (b - a)),
        ("E4", "mechanical first", "backward Euler", euler, Scheme.MECHANICAL_FIRST, 1 / (b / 2 - a)),
        ("E4", "staggered", "midpoint", middle, Scheme.STAGGERED, 2 / b),
        ("E4", "extrapolated", "midpoint", middle, Scheme.EXTRAPOLATED, 1 / b),
    ]
    found = [{"case": case, "scheme": scheme, "method": method, "predicted": about, "measured": limit(
        of, way, about)} for case, scheme, method, of, way, about in asked]
    plain = bisected(lambda dt: contraction(CASES["E5"], dt, Seen.END) > 1.0, 1e-3, 1e-1)
    found.append({"case": "E5", "scheme": "iterated, none", "method": "backward Euler", "predicted": e5_limit(),
                  "measured": plain})
    return found


def told(numbers: dict[str, list[dict[str, object]]]) -> str:
    """Counts of verdicts by scheme, cells where auto is not right but a fixed scheme is, and the limits."""
    rows, names = [], ("right", "iterates", "cycles", "wrong", "failed")
    ways = list(dict.fromkeys(c["way"] for c in numbers["cells"]))
    for way in ways:
        own = [c for c in numbers["cells"] if c["way"] == way]
        rows.append({"scheme": way, **{n: str(sum(c["outcome"] == n for c in own)) for n in names}})
    text = table(rows)
    behind = auto_behind(numbers["cells"])
    text += f"\n\nauto not right where a fixed scheme is: {len(behind)}\n" + "\n".join(map(str, behind))
    cycles = [c for c in numbers["cells"] if c["outcome"] == "cycles"]
    lasting = [(c["case"], c["way"], c["factor"], c["disturbance"]) for c in cycles if not ends(c, numbers["cells"])]
    text += f"\n\n{len(cycles)} cells cycle; smaller windows end all but {len(lasting)}\n"
    text += "\n".join(map(str, lasting))
    if numbers["limits"]:
        text += "\n\n" + table([{
            "case": x["case"], "scheme": x["scheme"], "method": x["method"], "predicted": f"{x['predicted']:.6g}",
            "measured": f"{x['measured']:.6g}", "off %": f"{100 * (x['measured'] / x['predicted'] - 1):.2f}"}
            for x in numbers["limits"]])
    return text


def ends(cycle: dict[str, object], found: list[dict[str, object]]) -> bool:
    """Whether a cycle is numerical: the same scheme is right in smaller windows from the same start."""
    return any(c["outcome"] in ("right", "iterates") and c["factor"] < cycle["factor"]
               and all(c[k] == cycle[k] for k in ("case", "way", "disturbance")) for c in found)


def auto_behind(found: list[dict[str, object]]) -> list[tuple[object, ...]]:
    """Cells (case, factor, disturbance, verdict of auto) where auto is not right and some fixed scheme is."""
    right, behind = {"right", "iterates"}, []
    for c in found:
        if c["way"] == "auto" and c["outcome"] not in right and any(
                o["outcome"] in right and o["way"] not in ("auto", "adiabatic", "along heat")
                and all(o[k] == c[k] for k in ("case", "factor", "disturbance")) for o in found):
            behind.append((c["case"], c["factor"], c["disturbance"], c["outcome"]))
    return behind


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="three windows a case, no limits")
    parser.add_argument("--cases", default=",".join(TITLES), help="names, with commas between")
    parser.add_argument("--json", type=Path, help="write the numbers here too")
    parser.add_argument("--charts", type=Path, help="draw atlas_*.svg into this folder")
    parser.add_argument("--from", dest="source", type=Path, help="take the numbers from here")
    args = parser.parse_args()
    if args.source:
        numbers = json.loads(args.source.read_text())
    else:
        numbers = {"cells": cells(args.cases.split(","), args.quick), "limits": []}
        if args.json:
            args.json.write_text(json.dumps(numbers, indent=1))  # kept if what follows fails
        numbers["limits"] = [] if args.quick else limits()
    if args.json:
        args.json.write_text(json.dumps(numbers, indent=1))
    print(told(numbers))
    if args.charts:
        from atlas_charts import draw

        draw(numbers, TITLES, args.charts)


if __name__ == "__main__":
    main()
