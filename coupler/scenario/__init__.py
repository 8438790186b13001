"""The scenario file: read, checked, meshed, and written out for each half (docs/scenario.md)."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from coupler.scenario.edits import parse_override
    from coupler.scenario.load import Scenario, load_scenario
    from coupler.scenario.probes import Probe

__all__ = ["Probe", "Scenario", "load_scenario", "parse_override"]

_HOME = {"Probe": "probes", "Scenario": "load", "load_scenario": "load", "parse_override": "edits"}


def __getattr__(name: str) -> object:
    # As of coupler: who reads results needs the names of conditions, and none of what reads a scenario.
    if name not in __all__:
        raise AttributeError(f"module 'coupler.scenario' has no attribute {name!r}")
    return getattr(import_module(f"coupler.scenario.{_HOME[name]}"), name)
