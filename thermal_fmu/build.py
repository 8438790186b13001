"""`python -m thermal_fmu.build DIRECTORY OUT.fmu`: the thermal half of a directory as an FMU."""

from __future__ import annotations

from contact.half.build import main as build_main

LOADS = {"thermal": "thermal_fmu.half:load", "lumped": "thermal_fmu.stations.half:load_lumped",
         "thermal_rod": "thermal_fmu.stations.half:load_rod", "thermal_ccx": "thermal_fmu.calculix:load"}
"""`half` of model.json -> the function that loads it."""
UNDERSTANDS = "boundary bodies pairs materials.rho materials.k materials.c"  # what the half around a program reads


def main() -> None:
    """Build the FMU named on the command line."""
    build_main("thermal_fmu", LOADS)


if __name__ == "__main__":
    main()
