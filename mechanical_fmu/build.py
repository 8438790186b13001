"""`python -m mechanical_fmu.build DIRECTORY OUT.fmu`: the mechanical half of a directory as an FMU."""

from __future__ import annotations

from contact.half.build import main as build_main

LOADS = {"elastic": "mechanical_fmu.elastic_half:load", "rigid": "mechanical_fmu.small_halves:load_rigid",
         "mechanical_rod": "mechanical_fmu.small_halves:load_rod", "mechanical_ccx": "mechanical_fmu.calculix:load"}
"""`half` of model.json -> the function that loads it."""
# What the half around a program reads.
UNDERSTANDS = "boundary bodies pairs gravity materials.E materials.nu materials.alpha materials.T_ref materials.rho"


def main() -> None:
    """Build the FMU named on the command line."""
    build_main("mechanical_fmu", LOADS)


if __name__ == "__main__":
    main()
