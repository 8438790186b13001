"""Says which keywords and options of a deck are understood, and logs every line that is not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from coupler.deck.lexer import DeckLine, KeywordBlock, wrong


@dataclass(frozen=True)
class Missed:
    """A line of the deck that has no counterpart in the scenario, and why."""

    file: str
    line: int
    text: str
    why: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.text}: {self.why}"


@dataclass(frozen=True)
class Converted:
    """A converted deck.

    files : written, the scenario first.  missed : lines that are not understood, in the deck's order.
    notes : choices made where the deck leaves one.
    """

    files: tuple[Path, ...]
    missed: tuple[Missed, ...]
    notes: tuple[str, ...]

    @property
    def lines(self) -> tuple[str, ...]:
        """Return the lines that the command line prints."""
        head = (f"{len(self.missed)} line{'s' * (len(self.missed) != 1)} of the deck not understood:",)
        return (*(f"wrote {path}" for path in self.files), *(f"note: {note}" for note in self.notes),
                *(head if self.missed else ()), *(f"  {missed}" for missed in self.missed))


@dataclass
class Log:
    """Collects, while a deck is read, the lines that are not understood (missed) and the choices made (notes)."""

    missed: list[Missed] = field(default_factory=list)
    notes: dict[str, None] = field(default_factory=dict)

    def miss(self, what: DeckLine | KeywordBlock, why: str) -> None:
        """Log a line without a counterpart; for a block, its keyword line."""
        row = what if isinstance(what, DeckLine) else what.row
        if isinstance(what, KeywordBlock) and len(what.data) > 1:
            why = f"{why} (with its {len(what.data)} lines of data)"
        line = Missed(row.file, row.line, row.excerpt, why)
        if line not in self.missed[-50:]:  # one line may be looked at once for each body it touches
            self.missed.append(line)

    def note(self, text: str) -> None:
        """Log a choice, once."""
        self.notes[text] = None


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


def understood(blocks: Sequence[KeywordBlock], log: Log) -> list[KeywordBlock]:
    """Return the blocks that are understood, and log the others and unknown options.

    Raises ScenarioError for a step that is neither heat transfer nor equilibrium.
    """
    taken = []
    for block in blocks:
        if block.word in REFUSED:
            raise wrong(block.row, f"a step of *{block.word} is no heat and no equilibrium",
                        "Understood are *HEAT TRANSFER, *COUPLED and *UNCOUPLED TEMPERATURE-DISPLACEMENT, *STATIC.")
        if block.word not in UNDERSTOOD:
            log.miss(block, WHY.get(block.word, "this keyword is not understood"))
            continue
        taken.append(block)
        for name in block.options:
            # fault: decks: options that are not understood go unsaid -> if False: | coupler/test_deck
            if name not in UNDERSTOOD[block.word].split(","):
                log.miss(block.row, f"the option {name[:40]} is not understood, the rest of the line is")
    return taken
