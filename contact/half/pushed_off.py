"""Bodies that their loads push off what they lie on: friction cannot hold them, whatever contact comes to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contact.half.held import HOLDS_ALL, held_by, name_of_pairs
from contact.half.interface import Interface, Pair
from contact.problem.boundary import FORCES, HELD, WEIGHTS
from contact.problem.errors import Wrong

if TYPE_CHECKING:
    from contact.problem.mechanical import ElasticBoundary, ElasticProblem

Floats = NDArray[np.float64]

# Statics: a body at rest has contact forces that add up to the opposite of its load.  Each force lies in the cone of
# Coulomb around a normal of its place, mu to either side, so their sum lies in the cone of all of them.  Where that
# does not contain the opposite of the load, wherever the body goes along these faces, it is never at rest.

# Bodies deform and turn a little as they come to lie [rad]: a load nearer to the cone may yet be held.
MARGIN = 0.05


def pushed_off(problem: ElasticProblem, interface: Interface) -> Iterator[Wrong]:
    """Bodies in the plane that contact alone would have to hold, against a load of one direction, and cannot.

    Only where all that they may lie on stands still: no condition on the body, all on the others, and those constant.
    """
    if problem.inert or interface.axisymmetric:
        return
    for name in interface.bodies:
        pairs = [pair for pair in interface.pairs if name in _bodies(pair)]
        others = {body for pair in pairs for body in _bodies(pair)} - {name}
        own = [b for b in problem.boundary if _of(b) == name]
        alone = not any(getattr(b, key) is not None for b in own for key in HELD)
        if (not pairs or not alone or any(pair.tied or len(set(_bodies(pair))) == 1 for pair in pairs)
                or not all(_stands(body, problem, interface) for body in others)):
            continue
        load = _direction(name, own, problem, interface)
        if load is None:
            continue
        off = _off(-load, _cone(name, pairs, interface))
        # fault: what slides down is let pass -> if off > 10.0: | coupler/test_held
        if off > MARGIN:
            mu = max(pair.mu for pair in pairs)
            yield Wrong(("bodies", name), f"nothing will ever hold body {name!r} against its load: no condition does, "
                        f"and the load lies {np.degrees(off):.1f} degrees outside of what contact in "
                        f"{name_of_pairs(pairs)} carries (mu {mu:g}: {np.degrees(np.arctan(mu)):.1f} degrees to either "
                        "side of the normal)", f"Prescribe a displacement of {name}, give the pair more friction, or "
                        "add mechanical.elastic.dynamics.")


def _bodies(pair: Pair) -> tuple[str, str]:
    return pair.slave.partition(".")[0], pair.master.partition(".")[0]


def _of(b: ElasticBoundary) -> str:
    return b.body if b.body is not None else b.where.partition(".")[0]


def _stands(body: str, problem: ElasticProblem, interface: Interface) -> bool:
    """Whether constant displacements hold a body in all its motions, to the end."""
    own = [b for b in problem.boundary if _of(b) == body and any(getattr(b, key) is not None for key in HELD)]
    if any(b.rotation is not None or b.until is not None
           or not all(isinstance(getattr(b, key), (int, float, type(None))) for key in ("u_x", "u_y", "angle"))
           for b in own):
        return False
    return held_by(own, problem, interface, body) == HOLDS_ALL


def _direction(body: str, own: Sequence[ElasticBoundary], problem: ElasticProblem,
               interface: Interface) -> Floats | None:
    """(2,) [1] along which a body is loaded whenever it is; None where that changes, is nothing, or is not told here.

    Weight alone, or forces alone: to weigh one against the other takes masses.
    """
    if any(b.pressure is not None or b.t_x is not None or b.t_y is not None or b.name is not None for b in own):
        return None
    if problem.gravity is not None and problem.gravity.name is not None:
        return None
    parts: list[tuple[Any, Any]] = []
    if problem.gravity is not None:
        parts.append((problem.gravity.x, problem.gravity.y))
    for kind in (FORCES, WEIGHTS):
        parts += [(getattr(b, kind[0]), getattr(b, kind[1])) for b in own
                  if getattr(b, kind[0]) is not None or getattr(b, kind[1]) is not None]
    if len(parts) != 1:
        return None
    signs = [_constant(part) for part in parts[0]]
    if None in signs:
        # One component may change in time, if not its sign.
        sides = [_side(part) for part in parts[0]]
        if None in sides or sides.count(0.0) != 1:
            return None
        signs = sides
    found = np.array(signs, dtype=float)
    size = float(np.linalg.norm(found))
    return found / size if size > 0.0 else None


def _constant(signal: Any) -> float | None:
    return 0.0 if signal is None else float(signal) if isinstance(signal, (int, float)) else None


def _side(signal: Any) -> float | None:
    """1 or -1 for a signal that is never on the other side of 0, 0 for none, None for another one."""
    values = np.atleast_1d(np.asarray(getattr(signal, "value", 0.0 if signal is None else signal), dtype=object))
    if not all(isinstance(v, (int, float)) for v in values):
        return None
    least, most = min(values), max(values)
    return None if least < 0.0 < most else float(np.sign(most if most > 0.0 else least))


def _cone(body: str, pairs: Sequence[Pair], interface: Interface) -> Floats:
    """(n, 2) the edges of the cones in which contact may push a body: those of all edges of both sides, as drawn."""
    found = []
    for pair in pairs:
        for surface in (pair.slave, pair.master):
            ends = interface.nodes[interface.surfaces[surface]]
            t = (ends[:, 1] - ends[:, 0]) / np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None]
            n = np.stack([t[:, 1], -t[:, 0]], axis=1) * (-1.0 if surface.partition(".")[0] == body else 1.0)
            found += [n + pair.mu * t, n - pair.mu * t]
    return np.concatenate(found)


def _off(v: Floats, cone: Floats) -> float:
    """How far [rad] v : (2,) lies outside of what (n, 2) span with no negative factor; 0 inside."""
    angle = np.arctan2(v[0] * cone[:, 1] - v[1] * cone[:, 0], cone @ v)
    left, right = angle[angle >= 0.0], angle[angle <= 0.0]
    if len(left) and len(right) and left.min() - right.max() < np.pi:
        return 0.0
    return float(np.abs(angle).min())
