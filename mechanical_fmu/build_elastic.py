"""`python -m mechanical_fmu.build_elastic DIRECTORY OUT.fmu`: the elastic half as an FMU."""

from contact.half.build import main as build_main


def main() -> None:
    """Build the FMU named on the command line."""
    build_main("mechanical_fmu", "mechanical_fmu.elastic_model:load")


if __name__ == "__main__":
    main()
