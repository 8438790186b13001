"""How far each temperature is off because cells are too large for a front at which something melts or freezes.

A node stores heat by its own temperature, as if all that belongs to it had that.  Where temperatures go across a
melting range within a cell, what belongs to the node melts bit by bit while the cells around it range over dT: a front
goes from node to node, and what the cells behind conduct hangs on the node, not on the place, at which it is.  The
temperature T' that the node should have stores as much heat in the mean of a range dT about it,

    1/dT int h(T) dT over [T' - dT/2, T' + dT/2] = h of the node.

dT is that of the cells on the colder side or on the hotter one, each of which sees the front from there.  With T_s =
T_l and the share f frozen that is T_m + (1/2 - f) dT: where a node has just frozen the front is half a cell beyond it.
A mushy range of many cells makes T' = T.

The last node of a body to freeze does so late.  The front comes to it from half a cell away, but is fed over a whole
one all the time, not over three quarters in the mean; so that takes tau = rho L h h/(2 k dT), a third longer than it
should.  In truth it has cooled by then since t = tau/4, as what loses its heat to one side: by 2 dT/h sqrt(a t/pi).

What nodes beside the front are off by goes on into what is solid and what is liquid as heat does, in as much time as
the front needs for a cell: it is off to the other side then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Property
from contact.half.interface import Interface
from contact.half.linalg import SingularMatrixError, factorise
from contact.half.model import Variable
from thermal_fmu import phase_change
from thermal_fmu.boundary import boundary_flow
from thermal_fmu.cells import BadPropertyError, CellBlock, MatrixEntries
from thermal_fmu.extremes import StepEnded
from thermal_fmu.newton import matrix_of
from thermal_fmu.phase_change import Melting, NodalFields, PhaseChange

Floats = NDArray[np.float64]

FRONT_OFF = "mesh.T_front_off"  # of nodes: an output
HALVINGS = 40  # at most, of a range that holds T'
SETTLED = 1e-9  # of the range about T'
SOONER = 0.75  # of the time in which the last node changes phase: so long would all that belongs to it take
ALIKE = 0.5  # of what changes phase: where less than that is behind at a node around, the front goes nowhere on
SLIGHT = 1e-6  # of the largest: what is off by less is off by nothing


def front_variables(interface: Interface, melting: Sequence[Melting]) -> tuple[Variable, ...]:
    """List what is told of fronts: nothing where nothing melts."""
    if not melting:
        return ()
    return (Variable(FRONT_OFF, (len(interface.nodes),), unit="K", on="nodes",
                     description="how far the temperature is off by the mesh beside a front of melting, estimated: "
                     "what is added to it is nearer to the truth"),)


@dataclass(frozen=True)
class _Fronts:
    """at : what nodes are.  ranges : (2, n) [K] how much colder and hotter the cells around each are.

    off : (2, n) [K] of nodes beside fronts, as what is colder sees it, and what is hotter; 0 of others.
    """

    at: NodalFields
    ranges: Floats
    off: Floats


def front_off(end: StepEnded) -> Floats:
    """Estimate (n,) [K] what has to be added to the temperatures at the end of a substep; nan: not known."""
    now = _fronts(end, end.s)
    beside = np.abs(now.off).max(axis=0) > SLIGHT * np.abs(now.off).max(initial=0.0)
    if not beside.any():
        return np.zeros(end.s.size)
    try:
        return _spread(end, now, beside)
    except (SingularMatrixError, BadPropertyError):
        return np.full(end.s.size, np.nan)


def _fronts(end: StepEnded, s: Floats) -> _Fronts:
    scene = end.context.scene
    at = phase_change.fields(scene.melting, s)
    ranges, off = _ranges(scene.volume.blocks, at.T), np.zeros((2, s.size))
    for body in scene.melting:
        for side, dT in zip(off, ranges, strict=True):
            side[body.nodes] = shifted(body.change, s[body.nodes], dT[body.nodes]) - at.T[body.nodes]
    if at.f_s is not None:
        most_solid, most_liquid = _ranges(scene.volume.blocks, at.f_s)
        for body in scene.melting:
            k, f, sides = body.nodes, at.f_s[body.nodes], (body.change.solid, body.change.liquid)
            # fault: a node that begins to freeze is taken for the last to melt -> freezes = f > 0.5 |
            #   thermal_fmu/test_fronts
            freezes = end.s[k] < end.s_n[k]
            frozen = _late(body.change, sides[0], f, most_solid[k], ranges[0, k], freezes)
            melted = _late(body.change, sides[1], 1.0 - f, most_liquid[k], ranges[1, k], ~freezes)
            off[:, k] = np.where(frozen > 0.0, -frozen, np.where(melted > 0.0, melted, off[:, k]))
    off[:, scene.fixed] = 0.0
    return _Fronts(at, ranges, off)


def _ranges(blocks: Sequence[CellBlock], T: Floats) -> Floats:
    """(2, n) [K] how much colder and hotter than each node the cells around it are at most."""
    least, most = T.copy(), T.copy()
    for block in blocks:
        of = T[block.cells]
        # fault: a node is told nothing of the cells around it -> continue | thermal_fmu/test_fronts
        np.minimum.at(least, block.cells, np.broadcast_to(of.min(axis=1)[:, None], of.shape))
        np.maximum.at(most, block.cells, np.broadcast_to(of.max(axis=1)[:, None], of.shape))
    return np.stack([T - least, most - T])


def shifted(change: PhaseChange, s: Floats, dT: Floats) -> Floats:
    """Return T' : (m,) [K] about which a range dT : (m,) [K] stores what nodes at s : (m,) [K] do."""
    T = change.temperature(s)
    # Of all others nothing within reach melts: T' = T.
    near = (dT > 0.0) & (T - dT < change.T_l) & (T + dT > change.T_s)
    T[near] = _shifted(change, s[near], T[near], dT[near])
    return T


def _shifted(change: PhaseChange, s: Floats, T: Floats, dT: Floats) -> Floats:
    """As shifted, T : (m,) [K] at s, dT above 0."""
    phi, low, high = 1.0 - change.solid_fraction(s), change.T_s, change.T_l
    c_s, c_l = (float(c(np.array(at))) for c, at in ((change.solid, low), (change.liquid, high)))
    melt = change.L + 0.5 * (c_s + c_l) * (high - low)

    def stored(T: Floats) -> Floats:
        """Return h of a temperature; of the only one at which all melts, half of it."""
        mushy = melt * np.clip((T - low) / (high - low), 0.0, 1.0) if high > low else melt * np.heaviside(T - low, 0.5)
        return np.asarray(c_s * np.minimum(T - low, 0.0) + mushy + c_l * np.maximum(T - high, 0.0))

    def area(T: Floats) -> Floats:
        """Int h dT from T_s on."""
        beyond = np.maximum(T - high, 0.0)
        mushy = 0.5 * melt * np.clip(T - low, 0.0, high - low) ** 2 / (high - low) if high > low else 0.0
        return 0.5 * c_s * np.minimum(T - low, 0.0) ** 2 + mushy + melt * beyond + 0.5 * c_l * beyond**2

    h = c_s * np.minimum(T - low, 0.0) + melt * phi + c_l * np.maximum(T - high, 0.0)
    half = 0.5 * dT
    least, most, middle = T - half, T + half, T
    # Newton's method, and halves of what is left where it leads out of that: the mean goes up with T' in every way.
    for _ in range(HALVINGS):
        above, below = middle + half, middle - half
        mean, slope = (area(above) - area(below)) / dT, (stored(above) - stored(below)) / dT
        least, most = np.where(mean < h, middle, least), np.where(mean < h, most, middle)
        to = middle + np.divide(h - mean, slope, out=np.full(T.size, np.inf), where=slope > 0.0)
        to = np.where((to >= least) & (to <= most), to, 0.5 * (least + most))
        middle, before = to, middle
        if (np.abs(middle - before) <= SETTLED * dT).all():
            break
    return middle


def _late(change: PhaseChange, c: Property, f: Floats, beyond: Floats, dT: Floats, goes_on: NDArray[np.bool_]
          ) -> Floats:
    """(m,) [K] by how much nodes that are the last to freeze, or to melt, would have cooled, or warmed, already.

    f : (m,) share that has changed.  beyond : (m,) how much less has changed at a node around.  dT : (m,) [K] to those
    that have changed.  c : of what has.  goes_on : (m,) where it changes that way.
    """
    at_once = np.divide(dT, dT + (change.T_l - change.T_s), out=np.zeros(f.size), where=dT > 0.0)
    # fault: the last node to freeze is no later than others -> last = np.zeros(f.size, dtype=bool) |
    #   thermal_fmu/test_fronts
    last = goes_on & (f < 1.0) & (f > SOONER) & (beyond < ALIKE * at_once) & (dT > 0.0)
    t = 0.5 * (f[last] - SOONER) * change.L / (float(c(np.array(change.T_s))) * dT[last])  # of h h/a
    late = np.zeros(f.size)
    late[last] = dT[last] * at_once[last] * 2.0 * np.sqrt(t / np.pi)
    return late


def _spread(end: StepEnded, now: _Fronts, beside: NDArray[np.bool_]) -> Floats:
    """(n,) [K] what nodes beside : (n,) fronts are off by, and what follows from it elsewhere."""
    scene, substep, at, n = end.context.scene, end.context.substep, now.at, end.s.size
    assert at.f_s is not None
    frozen, melts = at.f_s > 0.5, np.zeros(n, dtype=bool)
    for body in scene.melting:
        melts[body.nodes] = True
    own = np.where(frozen, now.off[0], now.off[1])
    data = np.zeros(scene.volume.pattern.indices.size)
    plain = NodalFields(at.T, at.f_s, np.ones(n), np.zeros(n))
    scene.bulk.conduct(substep, plain, np.zeros(n), MatrixEntries(data, 1.0, secant=True))
    boundary = boundary_flow(substep, end.context.loads_at(end.t, -1), substep.E_M / end.h, at.T)
    K, _ = matrix_of(scene, boundary, 1.0, None, data, np.zeros(n))
    away, seen = ~(beside | scene.fixed), np.zeros(n)
    # What is solid sees the front from its side, what is liquid from the other, and another body the node itself.
    for which, value in ((melts & frozen, now.off[0]), (melts & ~frozen, now.off[1]), (~melts, own)):
        seen[which] = (K @ np.where(beside, value, 0.0))[which]
    found = own * beside
    if away.any():
        A = K[away][:, away].tocsr()
        C = scene.bulk.capacities(substep, end.s)[away]
        A.setdiag(A.diagonal() + C * _pace(end, now, beside) + np.finfo(float).tiny)
        found[away] = -factorise(A)(seen[away])
    return found


def _pace(end: StepEnded, now: _Fronts, beside: NDArray[np.bool_]) -> float:
    """One over the time [1/s] in which a front passes a cell; at least over that since all began."""
    if not end.stores:
        return 0.0
    change = np.abs(now.off - _fronts(end, end.s_n).off)[:, beside].sum()
    # fault: what a front leaves behind spreads as if it stood still -> passes = 0.0 | thermal_fmu/test_fronts
    passes = float(change / now.ranges[:, beside].sum()) / end.h
    return max(passes, 1.0 / end.since if end.since > 0.0 else 0.0)
