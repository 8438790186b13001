"""The area of a gas layer between two sides that are curved: neither side's, and the same whichever is the slave."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.messages import Facing, Floats, Ints


def gap_areas(interface: Interface, edges: Ints, facing: Facing, x: Floats) -> tuple[Floats, Floats, Floats]:
    """Return (n_p,) the area a gas layer conducts through, and (n_p,) those at its slave's and its master's end [m2].

    edges : (n_edges, 2) nodes of the mesh, as registered.  x : (n_nodes, 2) [m], where facing was found.
    All are those of round surfaces, as the gap is.  From s = 0 on the slave to 1 on the master the area of a piece is A
    (1 + s (r_1 - 1)) (1 + s (r_2 - 1)) with the stretches r_1 in the plane and r_2 around the axis.  Layers in a row:
    the mean is A / int_0^1 ds/((1 + s (r_1 - 1)) (1 + s (r_2 - 1))) = A (r_1 - r_2)/ln(r_1/r_2), the logarithmic mean
    of both areas for cylinders (r_2 = 1), the geometric one for spheres (r_1 = r_2), the same from either side
    (Incropera & DeWitt, Fundamentals of Heat and Mass Transfer, 3.3).  The stretches are those of whole pieces, whose
    lengths and radii both sides measured: so they have a limit at the axis.
    """
    # fault: gas between chords -> area, area_m = facing.area, facing.area_m | thermal_fmu/test_thermal_gap_roles
    area, area_m = facing.area * facing.wide_s, facing.area_m * facing.wide_m
    A, M = _of_pieces(area), _of_pieces(area_m)
    r_1 = np.divide(M, A, out=np.ones(A.size), where=A > 0.0)
    r_2 = np.ones(A.size)
    by_node = [pair.by_node for pair in interface.pairs]
    if interface.axisymmetric or any(by_node):
        on_s = _on_edges(x[edges[facing.slave_edge]], facing.xi_s)
        on_m = _on_edges(x[edges[facing.master_edge]], facing.xi_m)
        nodal = np.flatnonzero(np.array(by_node)[facing.pair[::2]])
        on_s[2 * nodal + 1] = on_s[2 * nodal]  # where the part of a node ends nothing is faced
        if interface.axisymmetric:
            R_s, R_m = _of_pieces(on_s[:, 0]), _of_pieces(on_m[:, 0])
            # fault: gaps do not widen around the axis -> r_2 = 1.0 * r_2 | thermal_fmu/test_thermal_gap_area
            r_2 = np.divide(R_m, R_s, out=r_2, where=(R_s > 0.0) & (R_m > 0.0))
            r_1 /= r_2
        r_1[nodal] = _stretch_at_nodes(facing, 2 * nodal, on_s[2 * nodal], on_m[2 * nodal])
    # fault: heat across a gap by the area of the slave alone -> mean = np.ones(r_1.size) |
    #   thermal_fmu/test_thermal_gap_area
    mean = logarithmic_mean(r_1, r_2)
    return area * np.repeat(mean, 2), area, area * np.repeat(r_1 * r_2, 2)


def _of_pieces(values: Floats) -> Floats:
    """Return (n_p/2,) the sums over the two points of each piece, which are neighbours in values : (n_p,)."""
    return np.asarray(values[::2] + values[1::2])


def _on_edges(ends: Floats, xi: Floats) -> Floats:
    """Return (n, 2) places [m] at xi : (n,) of edges with ends : (n, 2, 2) [m]."""
    return np.asarray((1.0 - xi)[:, None] * ends[:, 0] + xi[:, None] * ends[:, 1])


def _stretch_at_nodes(facing: Facing, rows: NDArray[np.intp], on_s: Floats, on_m: Floats) -> Floats:
    """Return (n_rows,) the stretch in the plane [1] at rows, points of `form: nodes`: that of their slave edge.

    on_s, on_m : (n_rows, 2) the points on either side [m].  The edge's two points face what lies so far apart; where
    only one of them faces something it is 1.
    """
    edge, pair = facing.slave_edge[rows], facing.pair[rows]
    first = np.flatnonzero((edge[:-1] == edge[1:]) & (pair[:-1] == pair[1:]))
    length_s, length_m = (np.linalg.norm(on[first + 1] - on[first], axis=1) for on in (on_s, on_m))
    out = np.ones(len(rows))
    out[first] = out[first + 1] = length_m / length_s
    return out


def logarithmic_mean(a: Floats, b: Floats) -> Floats:
    """Return (a - b)/ln(a/b), (n,), of a, b : (n,) >= 0 in one unit; a where they are equal, 0 where one is 0."""
    total = a + b
    z = np.divide(a - b, total, out=np.zeros(a.size), where=total > 0.0)
    with np.errstate(divide="ignore"):  # one is 0
        return 0.5 * total * np.divide(z, np.arctanh(z), out=np.ones(a.size), where=z != 0.0)
