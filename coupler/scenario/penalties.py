"""How stiff bodies are behind their surfaces: what the penalty of a pair follows that states none.

The stiffness of an edge is that of the cell behind it, squeezed straight in and held at its sides: M/h with the
constrained modulus M = lambda + 2 mu at T0 and the size h of the cell.  The size is its depth, or the edge where that
is longer: a pressure that changes from node to node is felt as deep as the edge is long, however thin the cells.  The
penalty at a place is that of both sides' cells in a row, eps_N = 1/(h_s/M_s + h_m/M_m): pressed surfaces sink in by
as much as these two cells yield, and the matrix is none the worse; on a graded mesh it has no one value.  Where nu goes
to 1/2, and in melts, M goes to the bulk modulus, beside which E is nothing: there it is MOST times E.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import property_from
from contact.half.interface import Interface
from contact.half.outlines import cell_sizes
from contact.half.start import mean_start
from coupler.scenario.bodies import MeshedBody
from coupler.scenario.schema import ScenarioFile
from coupler.scenario.stated import stated_start

MOST = 10.0  # of E: M at nu = 0.483

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


def stiffness_of(file: ScenarioFile, interface: Interface, parts: Mapping[str, MeshedBody]) -> dict[str, Floats]:
    """Return surface -> (n_edges,) M/h [Pa/m] of all surfaces of pairs whose bodies have an E.

    parts : by name, in the order of Interface.parts.
    """
    found: dict[str, Floats] = {}
    for surface in dict.fromkeys(name for pair in file.contact.values() for name in (pair.slave, pair.master)):
        if (edges := interface.surfaces.get(surface)) is None:
            continue
        of_edge, size = interface.edge_parts(edges), cell_sizes(interface, edges)
        M = np.full(len(edges), np.nan)
        for k in np.unique(of_edge):
            own = of_edge == k
            M[own] = _modulus(file, parts[interface.parts[k]], interface, np.unique(edges[own]))
        if np.isfinite(M).all():
            found[surface] = np.maximum(M, 0.0) / size
    return found


def _modulus(file: ScenarioFile, part: MeshedBody, interface: Interface, nodes: Ints) -> float:
    """Return M [Pa] of a part at its mean start at nodes (n,), no more than MOST E; nan without E."""
    material = file.materials.get(part.material)
    if material is None or material.E is None:
        return np.nan
    T = np.array([mean_start(stated_start(part.T0), interface, nodes)])
    E = float(property_from(material.E)(T)[0])
    nu = 0.0 if material.nu is None else float(property_from(material.nu)(T)[0])
    if not -1.0 < nu < 0.5:
        return MOST * E
    # fault: penalty without its cap -> return E * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu)) |
    #   coupler/test_penalties
    return E * min((1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu)), MOST)


def largest_penalty(interface: Interface, slave: str, master: str) -> float:
    """Return a bound of eps_N [Pa/m] of a pair that states none, 0 where a body has no stiffness."""
    sides = [interface.stiffness.get(side) for side in (slave, master)]
    first, second = (0.0 if side is None else float(side.max(initial=0.0)) for side in sides)
    return first * second / (first + second) if first > 0.0 and second > 0.0 else 0.0
