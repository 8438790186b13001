"""Whether an equilibrium is stable: in how many directions the bodies would leave it by themselves.

An equilibrium is stable where the work of second order dx K dx of every small motion dx is positive (Hill's criterion),
K : the derivative of all forces, contact and pressures that follow the surface included.  Its sign hangs on the
symmetric part of K alone, and Sylvester's law of inertia counts the negative eigenvalues: they are as many as negative
pivots in L D L' of it.  A column under more than Euler's load, a shell that snaps, a tube at its limit load have some,
and Newton's method finds their equilibria all the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.sparse import csr_matrix, diags_array

from contact.half.linalg import negative_pivots
from contact.half.model import Value, Variable
from mechanical_fmu.advance import StepResult
from mechanical_fmu.newton import with_tangent
from mechanical_fmu.stress_outputs import Moved
from mechanical_fmu.system import ForceBalance, Loading, System
from mechanical_fmu.tangent import constrained, stiffness

NAME = "unstable_directions"
# A motion that nothing resists is not unstable: each unknown is held by this share of its own stiffness besides.
HELD = 1e-9
# Where no stress is above this share of the least shear modulus mu, that share holds them against all of it.  Of a
# motion v with gradients grad N of its nodes, stress takes back at most 2 sigma int |grad v|^2, which is at most
# 2 nn sigma sum v_i^2 int |grad N_i|^2 with nn <= 4 nodes a cell; the own stiffness is at least mu int |grad N_i|^2.
UNSTRESSED = HELD / 8.0
UNKNOWN = -1.0


def unstable_variables(system: System) -> tuple[Variable, ...]:
    """List the output; none with inertia, where motion itself tells, nor where a program has the bodies' stiffness."""
    if system.spec.stated.inert or system.program is not None:
        return ()
    return (Variable(NAME, description="directions in which the equilibrium is unstable, negative eigenvalues of the "
                                       "stiffness; -1: not known"),)


def unstable_outputs(system: System, found: StepResult, moved: Moved) -> Mapping[str, Callable[[], Value]]:
    """Give the output at the end of a step, worked out when it is asked for: that costs as much as a factorisation."""
    if not unstable_variables(system):
        return {}
    loading = moved.loading if system.volume.elastic else replace(moved.loading, step=found.last)
    # What is kept until then is to be small.
    return {NAME: partial(unstable_directions, system, replace(found.balance, entries=None), loading)}


def unstable_directions(system: System, balance: ForceBalance, loading: Loading) -> float:
    """Count the directions in which the bodies would leave an equilibrium by themselves [1].

    UNKNOWN where surfaces slip with friction (its force follows from the pressure and from no energy, so the symmetric
    part does not tell), and where the stiffness cannot be had.
    """
    # fault: slip is judged by the symmetric part of its stiffness -> if False: | mechanical_fmu/test_friction
    if balance.tractions is not None and balance.tractions.n_slipping:
        return UNKNOWN
    if _unstressed(system, balance, loading):
        return 0.0
    try:
        K = constrained(system, stiffness(system, with_tangent(system, balance, loading), loading))
        even = csr_matrix(0.5 * (K + K.T))
        # fault: what nothing resists counts as unstable -> held = -HELD * abs(even.diagonal()) |
        #   mechanical_fmu/test_unstable
        held = HELD * abs(even.diagonal())
        return float(negative_pivots(csr_matrix(even + diags_array(held, format="csr"))))
    except ArithmeticError:
        return UNKNOWN


def _unstressed(system: System, balance: ForceBalance, loading: Loading) -> bool:
    """Say whether elastic bodies have no stress that could make them leave, and touch nothing: no need to count."""
    touches = balance.tractions is not None and len(balance.tractions.blocks) > 0
    if not system.volume.elastic or not system.volume.tells_stress or touches or system.rigid is not None:
        return False
    told = zip(system.volume.stress(balance.u, loading.moduli), loading.moduli, strict=True)
    largest = [(np.abs(stress).max(initial=0.0), UNSTRESSED * m.mu.min(initial=np.inf)) for (stress, _), m in told]
    # fault: what is pressed is taken for free of stress -> return True | mechanical_fmu/test_unstable
    return all(bool(most <= allowed) for most, allowed in largest)
