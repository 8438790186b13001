"""`python -m mechanical_fmu.build DIRECTORY OUT.fmu`: the mechanical half of a directory as an FMU."""

from __future__ import annotations

from contact.half.build import main as build_main

LOADS = {"elastic": "mechanical_fmu.elastic_half:load", "rigid": "mechanical_fmu.rigid_half:load",
         "mechanical_rod": "mechanical_fmu.rod_half:load"}
"""`half` of model.json -> the function that loads it."""


def main() -> None:
    """Build the FMU named on the command line."""
    build_main("mechanical_fmu", LOADS)


if __name__ == "__main__":
    main()
