"""Fits: pairs whose gap as drawn is not what the drawing says, but a stated clearance or interference.

What is stated is the gap at the start, without load: c.  The drawing has the gap g_0 there, so c - g_0 is added to the
gap wherever the pair is looked at: by both halves, and by the coupler.  It belongs to the slave's nodes and goes with
them as they slide.  Nodes that face nothing as drawn take what the nearest that does has.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from contact.facing import cut_surfaces
from contact.half.functions import field_from
from contact.half.interface import Interface, Pair
from contact.half.register import register_message
from contact.problem.pairs import ContactPair
from contact.surfaces import surfaces_of
from coupler.scenario.document import Document, DocumentErrors
from coupler.scenario.schema import ScenarioFile

Floats = NDArray[np.float64]


def offsets_of(document: Document, file: ScenarioFile, interface: Interface,
               found: DocumentErrors) -> dict[str, Floats]:
    """Return pair -> (n,) [m] what is added to the gap at its pair nodes, of pairs that state their fit."""
    stated = {name: pair for name, pair in file.contact.items() if _keys(pair)}
    if not stated or {p.name for p in interface.pairs} != set(file.contact):
        return {}
    # By the rays along which forces act: there the pressure of an interference is made.
    gap = cut_surfaces(surfaces_of(register_message(interface)), interface.nodes[interface.contact_nodes]).node_gap
    offsets: dict[str, Floats] = {}
    for pair in interface.pairs:
        if pair.name in stated:
            with found.each():
                offsets[pair.name] = _offset(document, stated[pair.name], pair, interface, gap)
    return offsets


def _keys(pair: ContactPair) -> list[str]:
    return [key for key in ("clearance", "interference") if getattr(pair, key) is not None]


def _offset(document: Document, stated: ContactPair, pair: Pair, interface: Interface, gap: Floats) -> Floats:
    (key,) = _keys(stated)
    field = field_from(getattr(stated, key))
    if any(np.ptp(signal.value) > 0.0 for signal in field.signals):
        raise document.error(("contact", pair.name, key), "a fit is that of the drawing: it does not change in time",
                             "Give a number, or terms of x and y; what grows in time is a motion or an expansion.")
    sign, parts = (1.0 if key == "clearance" else -1.0), []
    for side in (s for s in interface.pair_sides if s.pair == pair.name):
        x, drawn = interface.nodes[side.nodes], gap[side.at]
        faced = drawn < pair.gap_max
        if not faced.any():
            raise document.error(("contact", pair.name, key), f"{pair.slave} and {pair.master} do not face each other "
                                 f"as drawn within gap_max, {pair.gap_max:g} m, so that there is no fit of them",
                                 "Draw them facing each other, or raise gap_max.")
        _, nearest = cKDTree(x[faced]).query(x)
        # fault: a fit is added to the gap as drawn -> drawn = np.zeros(len(x)) | coupler/test_fits
        drawn = drawn[faced][nearest]
        parts.append(sign * field.at(x, 0.0) - drawn)
    return np.concatenate(parts)
