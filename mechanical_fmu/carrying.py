"""A first guess for bodies that only contact holds: they go along with what they lie on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.turns import rotated, turn_between
from mechanical_fmu.system import Loading, System

Floats = NDArray[np.float64]

# A rigid motion is fitted to what is prescribed of a body by Gauss-Newton: from a turn that is near it takes three.
FITTING = 8
# A turn [rad] or a way (share of the body) below this carries nothing.
STILL = 1e-14
# How much more a turn counts than a way, where conditions let a body follow in part only.
FACES = 1e4


@dataclass(frozen=True)
class RigidMotion:
    """A turn by an angle [rad] about : (2,) [m], and then a way : (2,) [m]."""

    angle: float
    about: Floats
    way: Floats

    def of(self, x: Floats) -> Floats:
        """Compute the displacement (n, 2) [m] of x : (n, 2) [m]."""
        return rotated(x - self.about, self.angle) + self.way


def carried(system: System, u: Floats, moved: Floats, loading: Loading) -> Floats:
    """Return moved : (n, 2) [m], where driven bodies have gone from u, with bodies that lie on them carried along.

    What touches a body that moves takes its rigid motion, as far as conditions leave it, and what touches that, too: of
    several neighbours the mean.  Raises ContactRefusedError.
    """
    if loading.query is None or not system.can_be_loose:
        return moved
    x = system.interface.nodes + u
    loose = dict(system.constraints.loose_motions(x))
    known = {body: _driven(system, body, u, loading.target) for body in range(len(system.interface.bodies))
             if body not in loose}
    # Contact is asked only where a body that moves could take another along.
    if not any(_moves(system, body, _mean(system, body, x, [motion], left))
               for motion in known.values() for body, left in loose.items()):
        return moved
    neighbours = _neighbours(system, x, loading)
    out = moved.copy()
    for body, motion in known.items():
        # One that conditions tilt: the mean of what is prescribed would leave it level while what lies on it turns.
        # fault: a floor that turns is left level -> if abs(motion.angle) > 1e300: | mechanical_fmu/test_carrying
        if abs(motion.angle) > STILL:
            here = system.interface.node_body == body
            out[here] = u[here] + motion.of(x[here])
    while ready := [b for b in loose if b not in known and any(n in known for n in neighbours[b])]:
        found = {}
        for body in ready:
            found[body] = _mean(system, body, x, [known[n] for n in neighbours[body] if n in known], loose[body])
            _move(system, body, x, out, found[body])
        known |= found
    return out if system.rigid is None else system.rigid.placed(out)


def _moves(system: System, body: int, motion: RigidMotion) -> bool:
    size = float(np.ptp(system.interface.nodes[system.interface.node_body == body], axis=0).max())
    return abs(motion.angle) > STILL or float(np.abs(motion.way).max()) > STILL * size


def _driven(system: System, body: int, u: Floats, target: Floats) -> RigidMotion:
    """The rigid motion that fits best what is prescribed of a body that conditions hold."""
    constraints, X = system.constraints, system.interface.nodes
    own = constraints.holder[constraints.fixed // 2] == body
    dofs, goal = constraints.fixed[own], target[own]
    if system.rigid is not None:
        for k in np.flatnonzero(system.rigid.body == body):
            by_dof = dict(zip(dofs.tolist(), goal - u.ravel()[dofs], strict=True))
            way_x, way_y, turn = (by_dof.get(int(dof), 0.0) for dof in system.rigid.dofs[k])
            point = system.rigid.point_rows[k]
            return RigidMotion(turn / float(system.rigid.size[k]), X[point] + u[point], np.array([way_x, way_y]))
    nodes, c = dofs // 2, dofs % 2
    x, to = (X + u)[nodes], X.ravel()[dofs] + goal
    about = x.mean(axis=0)
    q = np.array([0.0, 0.0, _turn(nodes, c, x, to)])
    for _ in range(FITTING):
        at = x + rotated(x - about, q[2]) + q[:2]
        arm = x - about + rotated(x - about, q[2])
        J = np.stack([c == 0, c == 1, np.where(c == 0, -arm[:, 1], arm[:, 0])], axis=1).astype(float)
        step = np.linalg.lstsq(J, to - at[np.arange(len(c)), c], rcond=None)[0]
        q = q + step
        if float(np.abs(step).max()) <= STILL:
            break
    return RigidMotion(float(q[2]), about, q[:2])


def _turn(nodes: NDArray[np.intp], c: NDArray[np.intp], x: Floats, to: Floats) -> float:
    """The turn of the nodes that are prescribed whole, to begin with; 0 of fewer than two."""
    whole = np.flatnonzero((nodes[:-1] == nodes[1:]) & (c[:-1] == 0))
    if whole.size < 2:
        return 0.0
    a, b = x[whole], np.stack([to[whole], to[whole + 1]], axis=1)
    return turn_between(a - a.mean(axis=0), b - b.mean(axis=0))


def _neighbours(system: System, x: Floats, loading: Loading) -> Mapping[int, list[int]]:
    """Body -> the bodies that it presses at x : (n, 2) [m], or is tied to."""
    assert loading.query is not None
    t_N = loading.query(x).t_N
    out: dict[int, list[int]] = {body: [] for body in range(len(system.interface.bodies))}
    for pair in system.interface.pairs:
        a, b = (system.interface.bodies.index(side.partition(".")[0]) for side in (pair.slave, pair.master))
        if a != b and (pair.tied or bool((t_N[system.contact.on_slaves([pair.name])] < 0.0).any())):
            out[a].append(b)
            out[b].append(a)
    return out


def _mean(system: System, body: int, x: Floats, motions: list[RigidMotion], left: Floats) -> RigidMotion:
    """The mean of motions as it is at a body, as far as left : (3, k) [1] lets it go so."""
    own = x[system.interface.node_body == body]
    middle = 0.5 * (own.max(axis=0) + own.min(axis=0))
    size = float(np.abs(own - middle).max())
    ways = np.array([[*motion.of(middle[None])[0], motion.angle * size] for motion in motions]).mean(axis=0)
    # What conditions do not let follow is the way rather than the turn: faces that lie on each other stay so.
    weights = np.array([1.0, 1.0, FACES])
    # fault: bodies are carried where conditions hold them -> q = ways | mechanical_fmu/test_carrying
    q = left @ np.linalg.lstsq(weights[:, None] * left, weights * ways, rcond=None)[0]
    return RigidMotion(float(q[2] / size), middle, q[:2])


def _move(system: System, body: int, x: Floats, out: Floats, motion: RigidMotion) -> None:
    here = system.interface.node_body == body
    # fault: bodies that lie on others are left behind -> pass | mechanical_fmu/test_carrying
    out[here] += motion.of(x[here])
    if system.rigid is not None:
        for k in np.flatnonzero(system.rigid.body == body):
            point, turn = system.rigid.point_rows[k], system.rigid.turn_rows[k]
            out[point] += motion.of(x[point][None])[0]
            out[turn, 0] += motion.angle * system.rigid.size[k]
