"""`python -m thermal_fmu.build DIRECTORY OUT.fmu`: the thermal half of a directory as an FMU."""

from __future__ import annotations

from contact.half.build import main as build_main

LOADS = {"thermal": "thermal_fmu.half:load", "lumped": "thermal_fmu.stations.half:load_lumped",
         "thermal_rod": "thermal_fmu.stations.half:load_rod"}
"""`half` of model.json -> the function that loads it."""


def main() -> None:
    """Build the FMU named on the command line."""
    build_main("thermal_fmu", LOADS)


if __name__ == "__main__":
    main()
