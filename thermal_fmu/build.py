"""python -m thermal_fmu.build DIRECTORY OUT.fmu: the thermal half of a directory as an FMU."""

from __future__ import annotations

from contact.half.build import main as build_main

PACKAGE, LOAD = "thermal_fmu", "thermal_fmu.model:load"


def main() -> None:
    """Build the FMU the command line names."""
    build_main(PACKAGE, LOAD)


if __name__ == "__main__":
    main()
