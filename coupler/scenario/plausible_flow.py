"""Creep at a rate that nothing has: its A in a unit of stress that was not meant.

Of `A: 5e-6` with `n: 5`, meant in 1/(MPa^5 s), a bar that is held loses its stress at once.  A run is not wrong by its
numbers then, and nothing in it looks so.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, log

from contact.problem.curves import Polynomial, PropertyTable
from contact.problem.flow import Creep
from coupler.scenario.scene import parts_of
from coupler.scenario.schema import ScenarioFile

R = 8.31446  # J/mol K
# By so much a second nothing flows under 1 MPa that is computed as a solid: melts of polymers reach 1e3, glasses in
# work 1e4.
STRESS, FASTEST = 1e6, 1e6


def unlikely_creep(stated: ScenarioFile) -> list[str]:
    """Return a sentence for each material that would creep at a rate that nothing has.

    stated : what the file says, in SI.
    """
    notes = {}
    for name, part in parts_of(stated):
        material = stated.materials.get(part.material)
        creep = None if material is None else material.creep
        if creep is None or creep.n is None or not isinstance(part.T0, int | float) or not part.T0 > 0.0:
            continue
        rate = min(_rates(creep, float(part.T0)), default=-inf)
        # fault: creep by A in MPa is taken for what it says -> if True: | coupler/test_scenario_plausible_flow
        if rate <= log(FASTEST):
            continue
        meant = f": is 1/(MPa^{creep.n:g} s) meant?" if rate - creep.n * log(STRESS) <= log(FASTEST) else ""
        notes[part.material] = (f"material {part.material}: creep.A in 1/(Pa^{creep.n:g} s) makes {name} flow by "
                                f"1e{rate / log(10.0):.0f} a second under 1 MPa at its start{meant}")
    return list(notes.values())


def _rates(creep: Creep, T: float) -> Iterator[float]:
    """Yield the logarithms of the rates [1/s] under STRESS at T [K], one for each value that A has."""
    A = creep.A
    if A is None or creep.n is None:
        return
    values = A.value if isinstance(A, PropertyTable) else [A.polynomial[0] if isinstance(A, Polynomial) else float(A)]
    for value in values:
        if value > 0.0:
            yield log(value) + creep.n * log(STRESS) - (creep.Q or 0.0) / (R * T)
