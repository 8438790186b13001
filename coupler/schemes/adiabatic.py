"""The scheme `adiabatic`: mechanics at frozen entropy, then thermal from the temperatures that leaves.

Mechanics go first, on the T of the start, with control.mode 1: a body that is squeezed warms within the step and is
stiffer for it, by 1 + delta.  The heat so moved, E_S, is handed over once, as a jump of T at the start of the thermal
half's first substep, and conduction goes on from there.  Each of the two parts is stable at every size of window, and
so is their product; the isothermal split holds T while the body moves, and grows beyond c^2 dt/D = 2/(1 + delta).
"""

from __future__ import annotations

from collections.abc import Mapping

from coupler.errors import HalfError
from coupler.fmu.half import Half
from coupler.scenario.options import Scheme, Seen
from coupler.schemes.scheme import BOTH_ENDS, HELD, CouplingScheme, Exchange, Exchanged, Sees, WindowTask
from coupler.schemes.state import Solved, exchanged
from coupler.schemes.sweep import mechanical_first

MODE = "control.mode"
ISOTHERMAL, FROZEN = 0.0, 1.0
Inputs = Mapping[str, Mapping[str, float]]
# E_S comes within its own window, but all of it at the start.
JUMP = Exchanged(Sees.BOTH_ENDS, 1)


def solve_adiabatic(w: WindowTask) -> Solved:
    """Solve a window.  Raises DiscardError."""
    swept = mechanical_first(w.halves, w.state, w.span, exchanged(w.state.now))
    return swept.solved(w.state, Scheme.ADIABATIC)


def lacking(thermal: Half, mechanical: Half, substeps: Mapping[str, int]) -> HalfError | None:
    """What the halves lack to be run so.

    In a second mechanical substep the T it is given would not know what the first one moved.
    """
    if MODE not in mechanical.blocks or "E_S" not in mechanical.blocks:
        return HalfError("cannot step at frozen entropy (it has no control.mode or tells no E_S), which the scheme "
                         "adiabatic needs; the half elastic can, with mechanical.elastic.adiabatic: true, or give "
                         "another coupling.scheme", half=mechanical.name)
    if "E_S" not in thermal.blocks:
        return HalfError("takes no E_S, so what the scheme adiabatic moves as heat would be lost; give another "
                         "coupling.scheme", half=thermal.name)
    if substeps["mechanical"] != 1:
        return HalfError(f"has {substeps['mechanical']} substeps a window, and the scheme adiabatic freezes the "
                         "entropy of its start once; leave coupling.substeps.mechanical at 1", half=mechanical.name)
    return None


def with_mode(inputs: Inputs, mechanical: Half, frozen: bool) -> Inputs:
    """The inputs of a window with the mode of its scheme.  A half that has no mode is told none.

    It is told at every window, for a half keeps what it was last given.
    """
    if MODE not in mechanical.blocks:
        return inputs
    given = inputs.get("mechanical", {})
    # fault: adiabatic windows at isothermal moduli -> mode = ISOTHERMAL if frozen else given.get(MODE, ISOTHERMAL) |
    #   coupler/test_adiabatic
    mode = FROZEN if frozen else given.get(MODE, ISOTHERMAL)
    return {**inputs, "mechanical": {**given, MODE: mode}}


# fault: the adiabatic split is told to be of second order -> ADIABATIC = CouplingScheme(Scheme.ADIABATIC,
#   solve_adiabatic, {Seen.MIDDLE: Exchange(BOTH_ENDS, BOTH_ENDS, BOTH_ENDS)}, | coupler/test_scheme_table
ADIABATIC = CouplingScheme(Scheme.ADIABATIC, solve_adiabatic, {Seen.MIDDLE: Exchange(BOTH_ENDS, HELD, JUMP)},
                           frozen_entropy=True, lacking=lacking,
                           simpler=(Scheme.STAGGERED, Scheme.EXTRAPOLATED))
