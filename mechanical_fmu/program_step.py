"""An equilibrium whose inside of bodies is a program's: it takes force or displacement and gives the other.

As in the thermal half (docs/program_half.md) the cells of this half search around the program.  They carry a force
`defect` at the nodes: what the program resists with at its displacements less what the cells resist with there.

    equilibrium of the cells with the defect, in contact  ->  forces on the nodes, displacements there
    run the program with the one                          ->  the other
    defect = force on the nodes - what the cells resist with at the program's displacements

Where both have the same displacements the answer is the program's.  The stiff part, contact that opens and closes, is
Newton's own in every iteration, so the program is asked about the inside of bodies alone, which is smooth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contact.half.program import ProgramError
from contact.half.quasi_newton import Trail, quasi_newton_guess
from mechanical_fmu.newton import Equilibrium, NoEquilibriumError
from mechanical_fmu.program import ForceTask, MechanicalProgram
from mechanical_fmu.system import ForceBalance, Loading, System

Floats = NDArray[np.float64]

MOST_RUNS = 30  # of the program, for one equilibrium
AGREED = 3e-6  # of the largest displacement, and of the largest force: a few units of what seven printed digits tell
LEAST = 1e-12  # of the largest body, where nothing moves

Solve = Callable[[Loading, ForceBalance], Equilibrium]


def solve_by_program(system: System, program: MechanicalProgram, loading: Loading, first: ForceBalance,
                     solve: Solve) -> Equilibrium:
    """Find the equilibrium nearest to `first` in which the cells of this half and the program agree.

    solve : by the cells.  Raises ProgramError, NoEquilibriumError, and what solve raises.
    """
    defect: Floats = np.zeros(first.u.shape)
    trail, balance, off = Trail(), first, np.inf
    for runs in range(1, MOST_RUNS + 1):
        loaded = replace(loading, dead=-defect if loading.dead is None else loading.dead - defect)
        found = solve(loaded, system.balance(balance.u, loaded, tangent=True))
        balance = found.balance
        told = _asked(system, program, loading, balance, defect)
        # fault: a program is asked once, and believed -> if runs > 0: | mechanical_fmu/test_mechanical_program
        if told.off <= 1.0:
            return replace(found, runs=runs)
        off = min(off, told.off)
        # fault: the defect is not heeded -> trail = trail.plus(defect.ravel(), defect.ravel()) |
        #   mechanical_fmu/test_mechanical_program
        trail = trail.plus(defect.ravel(), told.defect.ravel())
        guess = quasi_newton_guess(trail)
        defect = (trail.outcomes[-1] if guess is None else guess).reshape(-1, 2)
    raise NoEquilibriumError(f"{type(program).__name__} and the surface do not agree after {MOST_RUNS} runs: they are "
                             f"off by {off * AGREED:.2g} of the largest displacement or force (bound {AGREED:g})")


@dataclass(frozen=True)
class _Told:
    """defect : (n, 2) [N] by what a program said.  off : how far both are apart, as a part of what they may be."""

    defect: Floats
    off: float


def _asked(system: System, program: MechanicalProgram, loading: Loading, balance: ForceBalance,
           defect: Floats) -> _Told:
    u, T = balance.u, loading.moduli[0].T
    assert T is not None, "System.moduli says of which temperatures"
    external = balance.external + defect
    # What has to hold a component is force too: the cells' and the defect's.
    resisted = balance.r + external
    fixed = np.asarray(system.constraints.fixed, dtype=np.intp)
    if program.takes == "displacement":
        fixed = np.union1d(fixed, system.contact.dofs)
    force = external.ravel().copy()
    force[fixed] = 0.0
    answer = program.solve(ForceTask(T, force.reshape(-1, 2), fixed, u.ravel()[fixed]))
    for what, values, needed in (("u", answer.u, u.size), ("reaction", answer.reaction, fixed.size)):
        if values.size != needed or not np.isfinite(values).all():
            raise ProgramError(f"{type(program).__name__}.solve: {what} must be {needed} finite numbers")
    v = answer.u.reshape(u.shape)
    force[fixed] = answer.reaction
    X = system.interface.nodes
    largest = max(float(np.abs(v).max()), float(np.abs(u).max()), LEAST * float(np.ptp(X, axis=0).max()))
    # fault: program and surface agree at any distance -> off = 0.0 | mechanical_fmu/test_mechanical_program
    off = float(np.abs(v - u).max()) / (AGREED * largest)
    if program.takes == "displacement":
        size = float(np.abs(force).max())
        apart = float(np.abs(force - resisted.ravel())[fixed].max())
        off = max(off, apart / (AGREED * size) if size > 0.0 else 0.0)
    own = system.volume.evaluate(v, loading.moduli, loading.step).f
    return _Told(force.reshape(u.shape) - own, off)
