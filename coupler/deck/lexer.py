"""Splits a deck into blocks, and says which of its keywords and options are understood."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from coupler.errors import ScenarioError

# Keyword lines with their data lines, included files in place.

MAX_BYTES = 200_000_000  # of the deck with all it includes, files counted as often as they are included
MAX_FILES = 1_000  # included, counted as often
MAX_DEPTH = 20  # of includes within includes
MAX_NAME = 200  # no file name and no set name is longer
MAX_EXCERPT = 90  # of a line, in messages
NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eEdD][-+]?[0-9]+)?")
_WHOLE = re.compile(r"[-+]?[0-9]{1,10}")
_QUOTED = re.compile(r'"[^"]*"|[^,"]+|,|"')


@dataclass(frozen=True)
class DeckLine:
    """A line of a deck.  fields : the texts between its commas, stripped."""

    file: str
    line: int
    text: str
    fields: tuple[str, ...]

    @property
    def excerpt(self) -> str:
        """Return the line as a message may hold it, cut to MAX_EXCERPT characters."""
        return self.text if len(self.text) <= MAX_EXCERPT else self.text[:MAX_EXCERPT] + "..."

    def field(self, i: int) -> str:
        """Return a field, empty where the line is shorter."""
        return self.fields[i] if i < len(self.fields) else ""


@dataclass(frozen=True)
class KeywordBlock:
    """A keyword line and its data lines.

    word : the keyword in capitals, without its star.  options : name in capitals -> value, without quotes.
    """

    word: str
    options: Mapping[str, str]
    row: DeckLine
    data: tuple[DeckLine, ...] = field(default=())

    def option(self, name: str) -> str:
        """Return an option's value in capitals, empty where it is not given."""
        return self.options.get(name, "").upper()


def wrong(row: DeckLine, message: str, remedy: str = "") -> ScenarioError:
    """Return the error for a line; the caller raises it."""
    return ScenarioError(message, file=row.file, line=row.line, value=row.excerpt, remedy=remedy)


def number(row: DeckLine, i: int, what: str, default: float | None = None) -> float:
    """Return field i of a line, a finite number; 1.D3 is 1000.  Raises ScenarioError."""
    text = row.field(i)
    if not text and default is not None:
        return default
    if not NUMBER.fullmatch(text):
        raise wrong(row, f"{what} (field {i + 1}) must be a number",
                    "Write it out, as 1.5 or 1.5E3; parameters and expressions are not evaluated.")
    value = float(text.upper().replace("D", "E"))
    if abs(value) == float("inf"):
        raise wrong(row, f"{what} (field {i + 1}) is too large for a number")
    return value


def numbers(row: DeckLine, what: str) -> list[float]:
    """Return all fields of a line as numbers, without empty ones at its end.  Raises ScenarioError."""
    count = max((i + 1 for i, text in enumerate(row.fields) if text), default=0)
    return [number(row, i, what, 0.0) for i in range(count)]


def whole(row: DeckLine, i: int, what: str, default: int | None = None) -> int:
    """Return field i of a line, a whole number.  Raises ScenarioError."""
    text = row.field(i)
    if not text and default is not None:
        return default
    if not _WHOLE.fullmatch(text):
        raise wrong(row, f"{what} (field {i + 1}) must be a whole number of at most 10 digits")
    return int(text)


def is_whole(text: str) -> bool:
    """Return whether a field is the number of a node or an element."""
    return _WHOLE.fullmatch(text) is not None


@dataclass
class _Files:
    """What may be read: files in the folder the deck was named in, so many bytes and files.  display : it, as given."""

    folder: Path
    display: Path
    remaining: int = MAX_BYTES
    files: int = MAX_FILES


def blocks_of(path: Path) -> list[KeywordBlock]:
    """Read the blocks of a deck in order, included files in place.

    Raises ScenarioError, naming file and line, where a file is missing, too large, not text, not beside the deck, or
    includes itself, and where data stand before the first keyword.
    """
    # fault: decks: includes lie beside what a link leads to -> files = _Files(path.resolve().parent, path.parent) |
    #   coupler/test_deck_hostile
    files = _Files(path.parent.resolve(), path.parent)
    blocks: list[KeywordBlock] = []
    data: list[DeckLine] = []
    for row in _rows(path, files, (), DeckLine(printable(str(path)), 0, "", ())):
        if not row.text.startswith("*"):
            if not blocks:
                raise wrong(row, "data before the first keyword", "A deck begins with a keyword, such as *HEADING.")
            data.append(row)
            continue
        if blocks:
            blocks[-1] = _closed(blocks[-1], data)
        blocks.append(_keyword(row))
        data = []
    if not blocks:
        raise ScenarioError("the deck is empty", file=str(path), remedy="It needs at least *NODE and *ELEMENT.")
    blocks[-1] = _closed(blocks[-1], data)
    return blocks


def _closed(block: KeywordBlock, data: list[DeckLine]) -> KeywordBlock:
    return KeywordBlock(block.word, block.options, block.row, tuple(data))


def _rows(path: Path, files: _Files, within: tuple[Path, ...], asked: DeckLine) -> Iterator[DeckLine]:
    """Yield the lines of a file without comments, keyword lines joined, includes in place.  asked : names the file."""
    lines = _text(path, files, asked).split("\n")
    resolved, file = path.resolve(), printable(str(path))
    i = 0
    while i < len(lines):
        # fault: decks: a line keeps what no comment may hold -> text, start = lines[i].strip(), i + 1 |
        #   coupler/test_deck_hostile
        text, start = printable(lines[i]).strip(), i + 1
        i += 1
        if not text or text.startswith("**"):
            continue
        if text.startswith("*"):
            while text.endswith(",") and i < len(lines) and not lines[i].lstrip().startswith("*"):
                text, i = f"{text} {printable(lines[i]).strip()}", i + 1
        row = DeckLine(file, start, text, _fields(text))
        if not text.startswith("*"):
            yield row
            continue
        block = _keyword(row)
        if block.word != "INCLUDE":
            yield row
        if "INPUT" in block.options:
            inner = _beside(block, files, (*within, resolved))
            yield from _rows(inner, files, (*within, resolved), row)
        elif block.word == "INCLUDE":
            raise wrong(row, "*INCLUDE does not say which file", "Write *INCLUDE, INPUT=file.inp.")


def _beside(block: KeywordBlock, files: _Files, within: tuple[Path, ...]) -> Path:
    """Return the file an INPUT names.  Raises ScenarioError where it is elsewhere or being read already."""
    name = block.options["INPUT"]
    if not name or len(name) > MAX_NAME:
        raise wrong(block.row, "INPUT must name a file")
    path = Path(os.path.realpath(files.folder / name))  # links that lead in a circle stay as they are
    # fault: decks: an included file may lie anywhere -> if False: | coupler/test_deck_hostile
    if not path.is_relative_to(files.folder):
        raise wrong(block.row, "only files beside the deck are read", f"Move it into {files.folder}.")
    if path in within:
        raise wrong(block.row, "this file includes itself", "Take the circle of *INCLUDE apart.")
    if len(within) > MAX_DEPTH:
        raise wrong(block.row, f"more than {MAX_DEPTH} files within files")
    return files.display / path.relative_to(files.folder)


def _text(path: Path, files: _Files, asked: DeckLine) -> str:
    """Read a file's text.  Raises ScenarioError that quotes the line which names the file."""
    def refuse(message: str, remedy: str = "") -> ScenarioError:
        if asked.line:
            return wrong(asked, f"{path.name}: {message}", remedy)
        return ScenarioError(message, file=str(path), remedy=remedy)

    if not path.is_file():
        raise refuse("there is no such file")
    try:
        size = path.stat().st_size
        raw = path.read_bytes() if size <= files.remaining else b""
    except OSError as exc:
        raise refuse(f"cannot be read ({exc.strerror})") from exc
    if size > files.remaining:
        raise refuse(f"decks may have {MAX_BYTES} bytes with all they include", "Thin the mesh out.")
    files.remaining, files.files = files.remaining - size, files.files - 1
    if files.files < 0:  # small files that include each other twice are a great many
        raise refuse(f"more than {MAX_FILES} files are included")
    if b"\0" in raw:
        raise refuse("is not a text file, or in UTF-16", "Save it as UTF-8 or ASCII text.")
    try:
        return raw.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError:
        return raw.decode("latin-1").replace("\r\n", "\n").replace("\r", "\n")  # which has a letter for every byte


def printable(text: str) -> str:
    """Replace what no message and no comment may hold by blanks: control characters, line ends, half letters."""
    return text if text.isprintable() else "".join(c if c.isprintable() else " " for c in text)


def _fields(text: str) -> tuple[str, ...]:
    """Split a line at its commas, but for those in quotes; each text stripped."""
    if '"' not in text:
        return tuple(part.strip() for part in text.split(","))
    parts = [""]
    for token in _QUOTED.findall(text):
        if token == ",":
            parts.append("")
        else:
            parts[-1] += token
    return tuple(part.strip() for part in parts)


def _keyword(row: DeckLine) -> KeywordBlock:
    """Return the block that a keyword line opens."""
    word, *rest = row.fields
    options = {}
    for part in rest:
        if part:
            name, _, value = part.partition("=")
            options[" ".join(name.upper().split())] = value.strip().strip('"').strip()
    return KeywordBlock(" ".join(word[1:].upper().split()), options, row)


# Which keywords and options of a deck are understood, and a log of every line that is not.

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
    "CONTACT PAIR": "INTERACTION,TYPE", "TIE": "NAME,POSITION TOLERANCE,ADJUST,TYPE",
    "AMPLITUDE": "NAME,TIME,VALUE,DEFINITION",
    "INITIAL CONDITIONS": "TYPE", "PHYSICAL CONSTANTS": "ABSOLUTE ZERO,STEFAN BOLTZMANN",
    "STEP": "NAME,NLGEOM,INC,AMPLITUDE", "END STEP": "", "STATIC": "DIRECT",
    "COUPLED TEMPERATURE-DISPLACEMENT": "DIRECT,STEADY STATE,DELTMX",
    "UNCOUPLED TEMPERATURE-DISPLACEMENT": "DIRECT,STEADY STATE,DELTMX", "HEAT TRANSFER": "DIRECT,STEADY STATE,DELTMX",
    "BOUNDARY": "AMPLITUDE,OP", "CLOAD": "AMPLITUDE,OP", "DFLUX": "AMPLITUDE,OP", "DSFLUX": "AMPLITUDE,OP",
    "FILM": "AMPLITUDE,FILM AMPLITUDE,OP", "SFILM": "AMPLITUDE,FILM AMPLITUDE,OP", "RADIATE": "AMPLITUDE,OP",
    "SRADIATE": "AMPLITUDE,OP", "DLOAD": "AMPLITUDE,OP", "DSLOAD": "AMPLITUDE,OP",
}
_OUTPUT = "what is kept is said under `output` and `probes`"
_JOINT = "degrees of freedom cannot be tied together; join the meshes, or tie surfaces by *TIE"
WHY: dict[str, str] = {
    **dict.fromkeys(("NODE FILE", "EL FILE", "NODE PRINT", "EL PRINT", "CONTACT FILE", "CONTACT PRINT", "OUTPUT",
                     "NODE OUTPUT", "ELEMENT OUTPUT", "CONTACT OUTPUT", "ENERGY OUTPUT", "ELEMENT FILE", "RESTART",
                     "ENERGY PRINT", "MONITOR", "FILE FORMAT", "SECTION PRINT", "FACE PRINT"), _OUTPUT),
    **dict.fromkeys(("PREPRINT", "CONTROLS", "TIME POINTS", "SOLVER CONTROLS", "DIAGNOSTICS"),
                    "the way of solving is said under `coupling`, `thermal` and `mechanical`"),
    **dict.fromkeys(("EQUATION", "MPC", "COUPLING", "KINEMATIC", "DISTRIBUTING"), _JOINT),
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
