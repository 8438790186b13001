"""Checks of physics, by role; and whether substeps converge."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from coupler.fmu.half import Array, Status
from coupler.fmu.names import MECHANICAL, THERMAL
from coupler.verify.agreement import agrees
from coupler.verify.bench import Bench, Check
from coupler.verify.border import Finding, failed, not_applicable, passed
from coupler.verify.heat import answers_gap, answers_pressure, cells_in_order, takes_time, warms
from coupler.verify.motion import expands, nodes_in_order, rigid

SHORTER = 0.25  # of a substep, the next that is tried
LEVELS = 12  # so often
LESS = 1e-5  # of the largest difference: converged
NOTHING = 1e-9  # of the largest number: no difference
SETTLING, SETTLED = 96, 0.5  # so many of the shortest substeps; the last change, of that halfway


def converges(bench: Bench, check: str) -> Finding:
    """Check that one substep and two halves of it come to agree as they become shorter.

    What a half adds to each substep, whatever its length, stays.  Friction may go on to slip for some substeps, however
    short they are, after a change of the inputs: that comes to an end.
    """
    main = "T" if bench.blocks.get("T") is not None and bench.blocks["T"].causality == "output" else "x"
    h, most, difference = bench.h, 0.0, 0.0
    for _ in range(LEVELS):
        found = [_after(bench, main, h, n) for n in (1, 2)]
        if any(value is None for value in found):
            return not_applicable(check, f"it takes no substep of {0.5 * h:.3g} s", "")
        one, two = (np.asarray(value) for value in found)
        difference = float(np.abs(one - two).max(initial=0.0))
        most = max(most, difference)
        # fault: verify-half: what is added to each substep passes -> if True: | coupler/test_plain_run
        if difference <= max(LESS * most, NOTHING * float(np.abs(one).max(initial=0.0))):
            return passed(check)
        h *= SHORTER
    if _settles(bench, main, h / SHORTER):
        return passed(check)
    return failed(check, f"one substep of {h / SHORTER:.3g} s and two halves of it still differ by {difference:.3g} "
                  f"{bench.blocks[main].unit} in {main}", "What happens in a substep goes to 0 with its length")


def _after(bench: Bench, name: str, h: float, n: int) -> Array | None:
    """An output after n substeps that make up h; None where one is refused."""
    found = _course(bench, name, h / n, n)
    return found[-1] if len(found) == n else None


def _course(bench: Bench, name: str, h: float, n: int) -> list[Array]:
    """An output after each of n substeps of h [s] with the same inputs, or of as many as the half takes."""
    # Energies are those of a substep: one that has the same in each would not come to agree.
    energies = {key: start for key, start in bench.starts.items() if bench.blocks[key].unit == "J"}
    found: list[Array] = []
    with bench.half() as half:
        for k in range(n):
            done = half.advance(k * h, h, {**bench.inputs(1), **energies}, (name,))
            if done.status is not Status.OK:
                break
            found.append(done.outputs[name])
    return found


def _settles(bench: Bench, name: str, h: float) -> bool:
    """Whether what changes from substep to substep of h [s], with the same inputs, comes to an end."""
    course = _course(bench, name, h, SETTLING)
    changes = [float(np.abs(b - a).max(initial=0.0)) for a, b in pairwise(course)]
    if len(course) < SETTLING:
        return False
    # fault: verify-half: friction that settles is taken for what is added to each substep -> ends = -1.0 |
    #   coupler/test_verify_friction
    ends = max(SETTLED * changes[SETTLING // 2], NOTHING * float(np.abs(course[-1]).max(initial=0.0)))
    return changes[-1] <= ends


AGREES = "agrees with our half"
PHYSICS: Mapping[str, Mapping[str, Check]] = {
    THERMAL: {"time passes": takes_time, "substeps converge": converges, "heat warms a body": warms,
              "cells in order": cells_in_order, "answers to a gap": answers_gap,
              "answers to pressure": answers_pressure, AGREES: agrees},
    MECHANICAL: {"substeps converge": converges, "expands freely": expands, "moves rigidly": rigid,
                 "nodes in order": nodes_in_order, AGREES: agrees}}
