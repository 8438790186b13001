"""What a half on a mesh of its own makes, temperatures or shapes: how much of it the scene's mesh holds.

The other half, probes and pictures see what the scene's mesh holds.  What it does not hold is no error of the half, and
whether it matters depends on the scene: it is told, never more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from coupler.trust.checks import Check, amount, measured

NOTE_AT = 0.01  # of the span of temperatures: what a reader sees in a curve
NAME, SHAPES = "temperatures carried to the scene's mesh", "displacements carried to the scene's mesh"


@dataclass(frozen=True)
class CarriedLog:
    """off [K], or [m]: the most that was lost there and back, in a window to t [s].

    span [m]: how far a body was deformed at most; 0 of temperatures, whose span is known elsewhere.
    """

    off: float = 0.0
    t: float = 0.0
    span: float = 0.0


def watched(log: CarriedLog, off: float | None, t: float, span: float = 0.0) -> CarriedLog:
    """Return the log after a window to t [s].  off : None of a half on the scene's mesh.  span [m]: as in the log."""
    if off is None:
        return log
    worst = log if off <= log.off else CarriedLog(off, t)
    return CarriedLog(worst.off, worst.t, max(log.span, span))


def shape_checks(log: CarriedLog, own_mesh: bool) -> tuple[Check, ...]:
    """Return the check of displacements at the end, none where there is one mesh."""
    if not own_mesh:
        return ()
    # fault: what the scene's mesh does not hold of x is not told -> share = 0.0 |
    #   coupler/test_own_mechanical_meshes::test_what_the_scene_s_mesh_does_not_hold_of_shapes_is_told
    share = log.off / log.span if log.span > 0.0 else 0.0
    what = (f"the scene's mesh does not hold the mechanical half's displacements: there and back they differ by up to "
            f"{log.off:.3g} m, {100 * share:.2g} % of the largest inside a body, at t = {log.t:.6g} s")
    return (measured(SHAPES, share, (NOTE_AT, math.inf), what=what, t=log.t,
                     remedy="Where gaps are as small as that, or probes stand there, refine the mesh of the bodies"),)


def checks(log: CarriedLog, span: float, own_mesh: bool) -> tuple[Check, ...]:
    """Return the check of temperatures at the end, none where there is one mesh.  span [K]: of all temperatures."""
    if not own_mesh:
        return ()
    # fault: what the scene's mesh does not hold of T is not told -> share = 0.0 |
    #   coupler/test_own_meshes::test_what_the_scene_s_mesh_does_not_hold_is_told_and_breaks_nothing
    share = log.off / span if span > 0.0 else 0.0
    what = (f"the scene's mesh does not hold the thermal half's temperatures: there and back they differ by up to "
            f"{amount(log.off, 'K')}, {100 * share:.2g} % of their span, at t = {log.t:.6g} s")
    return (measured(NAME, share, (NOTE_AT, math.inf), what=what, t=log.t,
                     remedy="Where bodies expand much, or probes stand there, refine the mesh of the bodies"),)
