"""python -m toy_half.build DIRECTORY OUT.fmu"""

from contact.half import build_main

if __name__ == "__main__":
    build_main("toy_half", "toy_half.model:load")
