"""python -m toy_half.build DIRECTORY OUT.fmu"""

from contact.half.build import main

if __name__ == "__main__":
    main("toy_half", "toy_half.model:load")
