"""Regions of bodies: cells of one conforming mesh with a material, a start or a source of their own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def regions_in(bodies: Mapping[str, Any]) -> dict[str, Any]:
    """Return the regions of bodies by "body.region", in the order of Interface.regions."""
    return {f"{body}.{name}": region for body, stated in bodies.items()
            for name, region in (stated.regions or {}).items()}
