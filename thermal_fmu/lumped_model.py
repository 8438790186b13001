"""The lumped thermal half: one temperature a body, C dT/dt = sum of conductances times differences."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from contact.half.interface import Interface
from thermal_fmu.station_model import StationHalf
from thermal_fmu.stations import lumped_stations


def load(interface: Interface, spec: Mapping[str, Any]) -> StationHalf:
    """The half `lumped` of an interface file and the content of its model.json.  Raises ValueError."""
    return StationHalf(interface, spec, "lumped", lumped_stations)
