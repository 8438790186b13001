"""python -m toy_half.build DIRECTORY OUT.fmu"""

from contact.half import build_main


def main() -> None:
    """Build the FMU named on the command line."""
    build_main("toy_half", "toy_half.model:load")


if __name__ == "__main__":
    main()
