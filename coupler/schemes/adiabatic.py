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
from coupler.scenario.options import Scheme

MODE = "control.mode"
ISOTHERMAL, FROZEN = 0.0, 1.0
Inputs = Mapping[str, Mapping[str, float]]


def can_freeze(thermal: Half, mechanical: Half, substeps: Mapping[str, int]) -> bool:
    """Whether the halves can be run so.

    In a second mechanical substep the T it is given would not know what the first one moved.
    """
    return MODE in mechanical.blocks and "E_S" in mechanical.blocks and "E_S" in thermal.blocks \
        and substeps["mechanical"] == 1


def check_adiabatic(thermal: Half, mechanical: Half, substeps: Mapping[str, int]) -> None:
    """Raises HalfError where they cannot, with the reason."""
    if MODE not in mechanical.blocks or "E_S" not in mechanical.blocks:
        raise HalfError("cannot step at frozen entropy (it has no control.mode or tells no E_S), which the scheme "
                        "adiabatic needs; the half elastic can, with mechanical.elastic.adiabatic: true, or give "
                        "another coupling.scheme", half=mechanical.name)
    if "E_S" not in thermal.blocks:
        raise HalfError("takes no E_S, so what the scheme adiabatic moves as heat would be lost; give another "
                        "coupling.scheme", half=thermal.name)
    if substeps["mechanical"] != 1:
        raise HalfError(f"has {substeps['mechanical']} substeps a window, and the scheme adiabatic freezes the entropy "
                        "of its start once; leave coupling.substeps.mechanical at 1", half=mechanical.name)


def with_mode(inputs: Inputs, mechanical: Half, scheme: Scheme) -> Inputs:
    """The inputs of a window with the mode of its scheme.  A half that has no mode is told none.

    It is told at every window, for a half keeps what it was last given.
    """
    if MODE not in mechanical.blocks:
        return inputs
    given = inputs.get("mechanical", {})
    # fault: adiabatic windows at isothermal moduli -> mode = ISOTHERMAL if scheme is Scheme.ADIABATIC else
    #   given.get(MODE, ISOTHERMAL) | coupler/test_adiabatic
    mode = FROZEN if scheme is Scheme.ADIABATIC else given.get(MODE, ISOTHERMAL)
    return {**inputs, "mechanical": {**given, MODE: mode}}
