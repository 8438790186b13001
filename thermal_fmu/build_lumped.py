"""`python -m thermal_fmu.build_lumped DIRECTORY OUT.fmu`: the lumped thermal half as an FMU."""

from contact.half.build import main as build_main


def main() -> None:
    """Build the FMU named on the command line."""
    build_main("thermal_fmu", "thermal_fmu.lumped_model:load")


if __name__ == "__main__":
    main()
