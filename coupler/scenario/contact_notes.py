"""What a user should know of a scenario's contact though it is no error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from contact.half.interface import Interface
from contact.half.property import property_from
from contact.notes import start_notes
from coupler.scenario.overlap import overlap_notes

Model = Mapping[str, Any]


def contact_notes(interface: Interface, thermal: Model, mechanical: Model) -> list[str]:
    """A sentence each: bodies that overlap, pairs that face nothing, folds, penalties that are too stiff.

    thermal, mechanical : model.json of the halves (of another package: what is not found in them is not told).
    """
    return overlap_notes(interface) + start_notes(interface, _stiffness(thermal, mechanical))


def _stiffness(thermal: Model, mechanical: Model) -> dict[str, float]:
    """Body -> E [Pa] at its T0, of the bodies that deform."""
    found = {}
    for name, body in mechanical.get("bodies", {}).items():
        E = mechanical.get("materials", {}).get(body.get("material"), {}).get("E")
        T0 = thermal.get("bodies", {}).get(name, {}).get("T0")
        if E is not None and T0 is not None and not body.get("rigid", False):
            found[name] = float(property_from(E)(np.array([T0]))[0])
    return found
