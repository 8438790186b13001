"""Force and moment of each named condition on the bodies: what holds, drives, presses or pulls them, at a step's end.

A prescribed component of a node belongs to one condition (constraints.py refuses a second of another name), and what
has to hold it is the residual there, inertia of the node included; loads on the same node are counted as theirs.  So
the forces of all conditions, contact and inertia add up to nothing on every body, to the tolerance of the solution.
When plane they are of a metre of depth; when axisymmetric of the whole turn, and the force along r is the sum of the
radial forces, which no resultant of a body is.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.model import Value, Variable
from mechanical_fmu.constraints import Constraints
from mechanical_fmu.loads import DeadForces, pressure_forces
from mechanical_fmu.problem import ElasticSpec

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

FORCE, MOMENT = "condition.reaction.", "condition.reaction_moment."
TURNS = 2
"""The component of an angle or a moment."""


@dataclass(frozen=True)
class NamedForce:
    """What one name stands for.

    held : (k,) its degrees of freedom.  pressures : numbers and edges of its follower pressures.
    dead : numbers of its dead loads and (2,) the force of each of size one.
    turned : the degree of freedom of its angle and the length that makes a moment of a force there.
    levers : of each rotation its point (2,) [m] and the degrees of freedom (k,) it holds.
    moments : numbers of its dead moments.
    """

    held: NDArray[np.intp]
    pressures: tuple[tuple[int, Ints], ...] = ()
    dead: tuple[tuple[int, Floats], ...] = ()
    turned: tuple[tuple[int, float], ...] = ()
    levers: tuple[tuple[Floats, NDArray[np.intp]], ...] = ()
    moments: tuple[int, ...] = ()


@dataclass(frozen=True)
class ForcesAt:
    """The end of a step.  held : (n, 2) [N] residual with inertia.  x : (n, 2) [m].  pressure : (n_pressures,) [Pa].

    dead : (n_dead,) size of each dead load.
    """

    held: Floats
    x: Floats
    pressure: Floats
    dead: Floats


@dataclass(frozen=True)
class NamedForces:
    """The named conditions of a scene.  forces, moments : by name, those with a force and those with a moment."""

    axisymmetric: bool
    forces: dict[str, NamedForce] = field(default_factory=dict)
    moments: dict[str, NamedForce] = field(default_factory=dict)

    @property
    def variables(self) -> list[Variable]:
        """List the outputs."""
        forces = [Variable(FORCE + name, (2,), unit="N", description="force of the condition on the body", on="none")
                  for name in self.forces]
        about = "about the point of its rotation or the body's reference point"
        return forces + [Variable(MOMENT + name, unit="N.m", description=f"anticlockwise moment on the body {about}")
                         for name in self.moments]

    def outputs(self, at: ForcesAt) -> dict[str, Value]:
        """Compute the outputs by name."""
        found: dict[str, Value] = {FORCE + name: self._force(of, at) for name, of in self.forces.items()}
        for name, of in self.moments.items():
            found[MOMENT + name] = (sum(float(at.held.ravel()[dof]) * length for dof, length in of.turned)
                                    + sum(_moment(about, dofs, at) for about, dofs in of.levers)
                                    + sum(float(at.dead[i]) for i in of.moments))
        return found

    def _force(self, of: NamedForce, at: ForcesAt) -> Floats:
        force = np.array([at.held.ravel()[of.held[of.held % 2 == i]].sum() for i in range(2)])
        for i, edges in of.pressures:
            p = np.full(len(edges), at.pressure[i])
            force += pressure_forces(at.x, edges, p, self.axisymmetric).sum(axis=(0, 1))
        for i, unit in of.dead:
            # fault: a dead load told without its size -> force += unit | mechanical_fmu/test_named_forces
            force += at.dead[i] * unit
        return force


def named_forces(interface: Interface, spec: ElasticSpec, constraints: Constraints,
                 dead: DeadForces | None) -> NamedForces:
    """Find what each name of a scene stands for.  dead : patterns of the dead loads, None without any."""
    forces, moments = {}, {}
    for name in spec.load_names:
        motions = [i for i, d in enumerate(spec.displacements) if name in (d.name, d.turn.name if d.turn else "")]
        turning = [i for i in motions if spec.displacements[i].component == TURNS]
        dofs = constraints.fixed[np.isin(constraints.source, [i for i in motions if i not in turning])]
        loads = [i for i, d in enumerate(spec.dead) if d.name == name]
        twists = tuple(i for i in loads if spec.dead[i].component == TURNS)
        levers = tuple((turn.about, constraints.fixed[np.isin(constraints.source, own)]) for i in motions
                       if (turn := spec.displacements[i].turn) is not None
                       if (own := [j for j in motions if spec.displacements[j].turn is turn])[0] == i)
        of = NamedForce(
            dofs, tuple((i, p.edges) for i, p in enumerate(spec.pressures) if p.name == name),
            tuple((i, _resultant(dead, i)) for i in loads if i not in twists),
            tuple((int(dof), constraints.motions.scale[i]) for i in turning
                  for dof in constraints.fixed[constraints.source == i]), levers, twists)
        # What is released holds nothing, and says so.
        if turning or levers or of.moments:
            moments[name] = of
        if len(motions) > len(turning) or of.pressures or of.dead:
            forces[name] = of
    return NamedForces(interface.axisymmetric, forces, moments)


def _moment(about: Floats, dofs: NDArray[np.intp], at: ForcesAt) -> float:
    """Moment [N m] about a point of what holds some degrees of freedom."""
    # fault: the moment of a rotation about another point -> arm = at.x[dofs // 2] | mechanical_fmu/test_named_forces
    arm = at.x[dofs // 2] - about
    lever = np.where(dofs % 2 == 0, -arm[:, 1], arm[:, 0])
    return float((lever * at.held.ravel()[dofs]).sum())


def _resultant(dead: DeadForces | None, i: int) -> Floats:
    """(2,) force of a dead load of size one."""
    assert dead is not None, "it has this load"
    return np.asarray(dead.unit[:, [i]].toarray()).reshape(-1, 2).sum(axis=0)

