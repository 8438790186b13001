"""Where the scenarios are that come with an installation.  It reads none: a command that takes no scenario is quick."""

from __future__ import annotations

from pathlib import Path

from coupler.errors import ScenarioError

SCENARIO = "sliding_blocks.yaml"


def shipped_scenarios() -> Path:
    """Return the folder of scenarios: beside the packages in a checkout, inside this one when installed.

    Raises ScenarioError where there is none.
    """
    here = Path(__file__).resolve().parent.parent
    for folder in (here / "scenarios", here.parent / "scenarios"):
        if (folder / SCENARIO).is_file():
            return folder
    raise ScenarioError("the scenarios that belong to this installation are missing", file=str(here / "scenarios"),
                        remedy="Install slideline again, or give `slideline run` a scenario of your own")
