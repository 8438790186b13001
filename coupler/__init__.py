"""The coupler: scenarios, FMI import, schemes, recording and the command line.  It never imports a half.

>>> from coupler import load_scenario, run, Results
>>> results = run(load_scenario("scenarios/sliding_blocks.yaml"), out="run.h5")
>>> t, T = results.probe("lower.top.left", unit="degC")
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from coupler.errors import CouplingError, HalfError, ResultsError, ScenarioError, SlidelineError
    from coupler.record.results import Results
    from coupler.running.run import Run, run
    from coupler.scenario import Scenario, load_scenario

    __version__: str

__all__ = ["CouplingError", "HalfError", "Results", "ResultsError", "Run", "Scenario", "ScenarioError",
           "SlidelineError", "load_scenario", "run"]

_HOME = {"Results": "coupler.record.results", "Run": "coupler.running.run", "run": "coupler.running.run",
         "Scenario": "coupler.scenario", "load_scenario": "coupler.scenario"}


def __getattr__(name: str) -> object:
    # Names are fetched when first asked for: a process that only hosts a half need not load the scenario schema.
    if name == "__version__":
        return import_module("importlib.metadata").version("slideline")
    if name not in __all__:
        raise AttributeError(f"module 'coupler' has no attribute {name!r}")
    return getattr(import_module(_HOME.get(name, "coupler.errors")), name)
