"""Whether an equilibrium is stable: in how many directions the bodies would leave it by themselves.

An equilibrium is stable where the work of second order dx K dx of every small motion dx is positive (Hill's criterion),
K : the derivative of all forces, contact and pressures that follow the surface included.  Its sign hangs on the
symmetric part of K alone, and Sylvester's law of inertia counts the negative eigenvalues: they are as many as negative
pivots in L D L' of it.  A column under more than Euler's load, a shell that snaps, a tube at its limit load have some,
and Newton's method finds their equilibria all the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array

from contact.half.linalg import negative_pivots
from contact.half.model import Value, Variable
from mechanical_fmu.advance import StepResult
from mechanical_fmu.displaced import displaced
from mechanical_fmu.newton import with_tangent
from mechanical_fmu.softest import UNKNOWN, stiffness_off
from mechanical_fmu.stress_outputs import Moved
from mechanical_fmu.system import ForceBalance, Loading, System, mesh_nodes
from mechanical_fmu.tangent import constrained, stiffness

Floats = NDArray[np.float64]

NAME = "unstable_directions"
SOFT = "mesh.stiffness_off"
PLACES = "mesh.u_off"
# A motion that nothing resists is not unstable: each unknown is held by this share of its own stiffness besides.
HELD = 1e-9
# Where no stress is above this share of the least shear modulus mu, that share holds them against all of it.  Of a
# motion v with gradients grad N of its nodes, stress takes back at most 2 sigma int |grad v|^2, which is at most
# 2 nn sigma sum v_i^2 int |grad N_i|^2 with nn <= 4 nodes a cell; the own stiffness is at least mu int |grad N_i|^2.
UNSTRESSED = HELD / 8.0


def unstable_variables(system: System) -> tuple[Variable, ...]:
    """List the output; none with inertia, where motion itself tells, nor where a program has the bodies' stiffness."""
    if system.spec.stated.inert or system.program is not None:
        return ()
    return (Variable(NAME, description="directions in which the equilibrium is unstable, negative eigenvalues of the "
                                       "stiffness; -1: not known"),
            *((Variable(SOFT, description="share of the stiffness left against the softest motion, beside that "
                                          "without loads, which the mesh makes of nothing; -1: not known"),)
              if _smooth(system) else ()),
            *((Variable(PLACES, (mesh_nodes(system), 2), unit="m", on="nodes",
                        description="how much farther nodes would be on a finer mesh, estimated; not a number: not "
                                    "known"),) if _smooth(system) else ()))


def _smooth(system: System) -> bool:
    """Whether bodies have a stress, and it follows from their shape alone."""
    return system.volume.tells_stress and not system.volume.makes_heat


def unstable_outputs(system: System, found: StepResult, moved: Moved) -> Mapping[str, Callable[[], Value]]:
    """Give the output at the end of a step, worked out when it is asked for: that costs as much as a factorisation."""
    if not unstable_variables(system):
        return {}
    loading = moved.loading if system.volume.elastic else replace(moved.loading, step=found.last)
    # What is kept until then is to be small.
    now = _Stability(system, replace(found.balance, entries=None), loading)
    told = [v.name for v in unstable_variables(system)]
    made = {NAME: "directions", SOFT: "softened", PLACES: "displaced"}
    return {name: partial(getattr, now, what) for name, what in made.items() if name in told}


def unasked(system: System, names: Iterable[str]) -> dict[str, Value]:
    """Return what stands for outputs that nobody asked for: not known."""
    places = np.full((mesh_nodes(system), 2), np.nan)
    return {name: places if name == PLACES else UNKNOWN for name in names}


def unstable_directions(system: System, balance: ForceBalance, loading: Loading) -> float:
    """Count the directions in which the bodies would leave an equilibrium by themselves [1].

    UNKNOWN where surfaces slip with friction (its force follows from the pressure and from no energy, so the symmetric
    part does not tell), and where the stiffness cannot be had.
    """
    return _Stability(system, balance, loading).directions


@dataclass(frozen=True)
class _Stability:
    """What is told of an equilibrium, of one count."""

    system: System
    balance: ForceBalance
    loading: Loading

    @cached_property
    def _K(self) -> csr_matrix | None:
        """The stiffness that decides; None where it is not to be had, or there is no need for it."""
        system, balance, loading = self.system, self.balance, self.loading
        # fault: slip is judged by the symmetric part of its stiffness -> if False: | mechanical_fmu/test_friction
        if balance.tractions is not None and balance.tractions.n_slipping:
            return None
        try:
            K = constrained(system, stiffness(system, with_tangent(system, balance, loading), loading))
        except ArithmeticError:
            return None
        even = csr_matrix(0.5 * (K + K.T))
        # fault: what nothing resists counts as unstable -> held = -HELD * abs(even.diagonal()) |
        #   mechanical_fmu/test_unstable
        held = HELD * abs(even.diagonal())
        return csr_matrix(even + diags_array(held, format="csr"))

    @cached_property
    def _unstressed(self) -> bool:
        return _unstressed(self.system, self.balance, self.loading)

    @cached_property
    def directions(self) -> float:
        """As unstable_directions."""
        slips = self.balance.tractions is not None and self.balance.tractions.n_slipping
        if not slips and self._unstressed:
            return 0.0
        try:
            return UNKNOWN if self._K is None else float(negative_pivots(self._K))
        except ArithmeticError:
            return UNKNOWN

    @cached_property
    def softened(self) -> float:
        """As softest.stiffness_off; 0 where the bodies leave their equilibrium anyway."""
        if self.directions or self._unstressed:
            return min(self.directions, 0.0)
        try:
            assert self._K is not None
            return stiffness_off(self.system, self._K, self.balance.u, self.loading)
        except ArithmeticError:
            return UNKNOWN

    @cached_property
    def displaced(self) -> Floats:
        """As displaced.displaced; not a number where the bodies leave their equilibrium, or surfaces slip."""
        unknown = np.full((mesh_nodes(self.system), 2), np.nan)
        try:
            if self._K is None or self.directions != 0.0:
                return unknown
            return displaced(self.system, self._K, self.balance.u, self.loading)
        except (ArithmeticError, ValueError):
            return unknown


def _unstressed(system: System, balance: ForceBalance, loading: Loading) -> bool:
    """Say whether elastic bodies have no stress that could make them leave, and touch nothing: no need to count."""
    touches = balance.tractions is not None and len(balance.tractions.blocks) > 0
    if not system.volume.elastic or not system.volume.tells_stress or touches or system.rigid is not None:
        return False
    told = zip(system.volume.stress(balance.u, loading.moduli), loading.moduli, strict=True)
    largest = [(np.abs(stress).max(initial=0.0), UNSTRESSED * m.mu.min(initial=np.inf)) for (stress, _), m in told]
    # fault: what is pressed is taken for free of stress -> return True | mechanical_fmu/test_unstable
    return all(bool(most <= allowed) for most, allowed in largest)
