"""Which keywords and options are understood, and why others are not."""

from __future__ import annotations

from collections.abc import Sequence

from coupler.deck.lexer import Block, wrong
from coupler.deck.log import Log

# Keyword -> options that are used, or that change nothing here.
UNDERSTOOD: dict[str, str] = {
    "HEADING": "", "NODE": "NSET,INPUT", "ELEMENT": "TYPE,ELSET,INPUT",
    "NSET": "NSET,GENERATE,ELSET,UNSORTED,INTERNAL,INSTANCE", "ELSET": "ELSET,GENERATE,UNSORTED,INTERNAL,INSTANCE",
    "SURFACE": "NAME,TYPE,INTERNAL", "PART": "NAME", "END PART": "", "ASSEMBLY": "NAME", "END ASSEMBLY": "",
    "INSTANCE": "NAME,PART", "END INSTANCE": "",
    "MATERIAL": "NAME", "ELASTIC": "TYPE", "EXPANSION": "TYPE,ZERO", "CONDUCTIVITY": "TYPE", "SPECIFIC HEAT": "",
    "DENSITY": "", "PLASTIC": "HARDENING", "LATENT HEAT": "", "INELASTIC HEAT FRACTION": "",
    "SOLID SECTION": "ELSET,MATERIAL", "SURFACE INTERACTION": "NAME", "SURFACE BEHAVIOR": "PRESSURE-OVERCLOSURE",
    "GAP CONDUCTANCE": "PRESSURE", "GAP RADIATION": "", "GAP HEAT GENERATION": "", "FRICTION": "",
    "CONTACT PAIR": "INTERACTION,TYPE", "AMPLITUDE": "NAME,TIME,VALUE,DEFINITION",
    "INITIAL CONDITIONS": "TYPE", "PHYSICAL CONSTANTS": "ABSOLUTE ZERO,STEFAN BOLTZMANN",
    "STEP": "NAME,NLGEOM,INC,AMPLITUDE", "END STEP": "", "STATIC": "DIRECT",
    "COUPLED TEMPERATURE-DISPLACEMENT": "DIRECT,STEADY STATE,DELTMX",
    "UNCOUPLED TEMPERATURE-DISPLACEMENT": "DIRECT,STEADY STATE,DELTMX", "HEAT TRANSFER": "DIRECT,STEADY STATE,DELTMX",
    "BOUNDARY": "AMPLITUDE,OP", "CLOAD": "AMPLITUDE,OP", "DFLUX": "AMPLITUDE,OP", "DSFLUX": "AMPLITUDE,OP",
    "FILM": "AMPLITUDE,FILM AMPLITUDE,OP", "SFILM": "AMPLITUDE,FILM AMPLITUDE,OP", "RADIATE": "AMPLITUDE,OP",
    "SRADIATE": "AMPLITUDE,OP", "DLOAD": "AMPLITUDE,OP", "DSLOAD": "AMPLITUDE,OP",
}
_OUTPUT = "what is kept is said under `output` and `probes`"
_JOINT = "degrees of freedom cannot be tied together; join the meshes, or use a contact pair"
WHY: dict[str, str] = {
    **dict.fromkeys(("NODE FILE", "EL FILE", "NODE PRINT", "EL PRINT", "CONTACT FILE", "CONTACT PRINT", "OUTPUT",
                     "NODE OUTPUT", "ELEMENT OUTPUT", "CONTACT OUTPUT", "ENERGY OUTPUT", "ELEMENT FILE", "RESTART",
                     "ENERGY PRINT", "MONITOR", "FILE FORMAT", "SECTION PRINT", "FACE PRINT"), _OUTPUT),
    **dict.fromkeys(("PREPRINT", "CONTROLS", "TIME POINTS", "SOLVER CONTROLS", "DIAGNOSTICS"),
                    "the way of solving is said under `coupling`, `thermal` and `mechanical`"),
    **dict.fromkeys(("TIE", "EQUATION", "MPC", "COUPLING", "KINEMATIC", "DISTRIBUTING"), _JOINT),
    "CFLUX": "heat enters through surfaces; spread it over one, with *DSFLUX",
    "TEMPERATURE": "temperatures are solved for; prescribe them by *BOUNDARY, 11",
    "RIGID BODY": "write mechanical.elastic.bodies.BODY.rigid: true by hand",
    "CONTACT": "general contact; name its surfaces by *CONTACT PAIR",
    "CREEP": "write materials.NAME.creep by hand", "HYPERELASTIC": "bodies are neo-Hookean, by *ELASTIC",
    "ORIENTATION": "axes are global; write the angle into materials.NAME.k by hand",
    "PARAMETER": "nothing is evaluated; write the numbers out",
    "MODEL CHANGE": "what is there stays", "CLEARANCE": "gaps are those of the mesh",
    "CONTACT INTERFERENCE": "overlaps are those of the mesh",
}
REFUSED = {"DYNAMIC", "FREQUENCY", "BUCKLE", "VISCO", "MODAL DYNAMIC", "STEADY STATE DYNAMICS", "COMPLEX FREQUENCY",
           "GREEN", "ELECTROMAGNETICS", "CFD", "HCF", "SENSITIVITY", "DIRECT CYCLIC", "GEOSTATIC", "SOILS", "ANNEAL"}


def understood(blocks: Sequence[Block], log: Log) -> list[Block]:
    """The blocks that are understood; what is not, options too, goes to the log.  Raises ScenarioError."""
    known = []
    for block in blocks:
        if block.word in REFUSED:
            raise wrong(block.row, f"a step of *{block.word} is no heat and no equilibrium",
                        "Understood are *HEAT TRANSFER, *COUPLED and *UNCOUPLED TEMPERATURE-DISPLACEMENT, *STATIC.")
        if block.word not in UNDERSTOOD:
            log.miss(block, WHY.get(block.word, "this keyword is not understood"))
            continue
        known.append(block)
        for name in block.options:
            # fault: decks: options that are not understood go unsaid -> if False: | coupler/test_deck
            if name not in UNDERSTOOD[block.word].split(","):
                log.miss(block.row, f"the option {name[:40]} is not understood, the rest of the line is")
    return known
