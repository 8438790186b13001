"""`python -m thermal_fmu.build_rod DIRECTORY OUT.fmu`: the thermal rod as an FMU."""

from contact.half.build import main as build_main


def main() -> None:
    """Build the FMU named on the command line."""
    build_main("thermal_fmu", "thermal_fmu.rod_model:load")


if __name__ == "__main__":
    main()
