"""The scenario file: read, checked, meshed, and written out for each half (docs/scenario.md)."""

from coupler.scenario.edits import parse_override
from coupler.scenario.load import Scenario, load_scenario
from coupler.scenario.probes import Probe

__all__ = ["Probe", "Scenario", "load_scenario", "parse_override"]
