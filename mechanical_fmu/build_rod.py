"""`python -m mechanical_fmu.build_rod DIRECTORY OUT.fmu`: the mechanical rod as an FMU."""

from contact.half.build import main as build_main


def main() -> None:
    """Build the FMU named on the command line."""
    build_main("mechanical_fmu", "mechanical_fmu.rod_model:load")


if __name__ == "__main__":
    main()
