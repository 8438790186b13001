"""python -m flux_half.build DIRECTORY OUT.fmu"""

from contact.half.build import main

if __name__ == "__main__":
    main("flux_half", "flux_half.model:load")
