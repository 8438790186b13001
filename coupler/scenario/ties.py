"""Tied pairs: whether there is something to tie, and what heat crosses a bond without a resistance of its own.

A bond that states no resistance conducts as a layer of LAYER of the cells that meet there: k/h of the two cells in a
row, over LAYER.  More would not be better: where the meshes do not match, temperatures that are linear along either
side's edges agree everywhere only if they are linear along the whole joint, and a conductance beyond all measure asks
for that.  What this one leaves is LAYER of a cell's own difference of temperature.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from contact.half.diagnostics import facing_at, nothing_faced
from contact.half.interface import Interface
from contact.half.outlines import cell_sizes
from contact.penalty import in_a_row
from coupler.scenario.document import Document, DocumentErrors

LAYER = 0.01


def refuse_loose_ties(document: Document, interface: Interface, found: DocumentErrors) -> None:
    """Note tied pairs of which nothing faces anything as drawn."""
    if not any(pair.tied for pair in interface.pairs):
        return
    met = np.bincount(facing_at(interface, interface.nodes).pair, minlength=len(interface.pairs))
    for pair, points in zip(interface.pairs, met, strict=True):
        with found.each():
            # fault: a tie of what faces nothing is silent -> if False: |
            #   coupler/test_ties::test_other_contradictions_are_told_too
            if pair.tied and not points:
                raise document.error(("contact", pair.name, "tied"), f"there is nothing to tie: "
                                     f"{nothing_faced(interface, pair, interface.nodes)}",
                                     "Draw the surfaces facing each other, or raise gap_max.")


def bond_conductance(interface: Interface, name: str, k: Mapping[str, float]) -> float:
    """Return the conductance [W/m2K] of a tied pair that states no resistance.  k : part -> conductivity [W/mK]."""
    pair = next(p for p in interface.pairs if p.name == name)
    sides = [_of_cells(interface, surface, k) for surface in (pair.slave, pair.master)]
    # fault: a bond conducts like one cell -> return in_a_row(*sides) |
    #   coupler/test_ties::test_one_without_a_resistance_conducts_like_a_hundredth_of_the_cells_beside_it
    return in_a_row(*sides) / LAYER


def _of_cells(interface: Interface, surface: str, k: Mapping[str, float]) -> float:
    """Return the mean over a surface's edges of k/h [W/m2K] of the cells behind them."""
    edges = interface.surfaces[surface]
    of = np.array([k.get(interface.parts[part], 0.0) for part in interface.edge_parts(edges)])
    length = np.linalg.norm(interface.nodes[edges[:, 1]] - interface.nodes[edges[:, 0]], axis=1)
    return float(np.average(of / cell_sizes(interface, edges), weights=length))
