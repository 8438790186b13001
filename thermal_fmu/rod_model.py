"""The thermal rod: conduction along x through the columns of rectangles, one temperature a column."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from contact.half.interface import Interface
from thermal_fmu.station_model import StationHalf
from thermal_fmu.stations import rod_stations


def load(interface: Interface, spec: Mapping[str, Any]) -> StationHalf:
    """The half `thermal_rod` of an interface file and the content of its model.json.  Raises ValueError."""
    return StationHalf(interface, spec, "thermal_rod", rod_stations)
