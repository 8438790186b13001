"""Checks of physics, by role; and whether substeps converge."""

from __future__ import annotations

from collections.abc import Mapping

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


def converges(bench: Bench, check: str) -> Finding:
    """Check that one substep and two halves of it come to agree as they become shorter.

    What a half adds to each substep, whatever its length, stays.
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
    return failed(check, f"one substep of {h / SHORTER:.3g} s and two halves of it still differ by {difference:.3g} "
                  f"{bench.blocks[main].unit} in {main}", "What happens in a substep goes to 0 with its length")


def _after(bench: Bench, name: str, h: float, n: int) -> Array | None:
    """An output after n substeps that make up h; None where one is refused."""
    # Energies are those of a substep: one that has the same in each would not come to agree.
    energies = {key: start for key, start in bench.starts.items() if bench.blocks[key].unit == "J"}
    with bench.half() as half:
        for k in range(n):
            done = half.advance(k * h / n, h / n, {**bench.inputs(1), **energies}, (name,))
            if done.status is not Status.OK:
                return None
    return done.outputs[name]


AGREES = "agrees with our half"
PHYSICS: Mapping[str, Mapping[str, Check]] = {
    THERMAL: {"time passes": takes_time, "substeps converge": converges, "heat warms a body": warms,
              "cells in order": cells_in_order, "answers to a gap": answers_gap,
              "answers to pressure": answers_pressure, AGREES: agrees},
    MECHANICAL: {"substeps converge": converges, "expands freely": expands, "moves rigidly": rigid,
                 "nodes in order": nodes_in_order, AGREES: agrees}}
