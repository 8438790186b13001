"""`python -m mechanical_fmu.build_rigid DIRECTORY OUT.fmu`: the rigid half as an FMU."""

from contact.half.build import main as build_main


def main() -> None:
    """Build the FMU named on the command line."""
    build_main("mechanical_fmu", "mechanical_fmu.rigid_model:load")


if __name__ == "__main__":
    main()
