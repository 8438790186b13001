"""What an FMU says of itself: its modelDescription.xml read in one pass, scalars gathered to blocks, kept beside it.

A full reader makes an object of every scalar: seconds at 1e5 variables.  Here only blocks are kept.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import os
import re
import shutil
import tempfile
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from contact.half.layout import VENDOR, variables_hash
from contact.half.model import PLACES
from coupler.errors import HalfError
from coupler.fmu.description3 import fields_of
from coupler.fmu.half import Block
from coupler.fmu.names import face_of
from coupler.fmu.units import Conversion, DeclaredUnit, conversion_of, declared_units, type_units, unit_of
from coupler.fmu.variables import Scalar, VariableBlock, gather, reference_of, stated

_CACHE_VERSION = 6
_VERSION_3 = re.compile(r"3\.\d+(\.\d+)?")
_KINDS = ("Real", "Integer", "Boolean", "String", "Enumeration")


@dataclass(frozen=True)
class Description:
    """fmi : 2 or 3.  guid : of FMI 3.0 its instantiation token.  tool : the generator.

    can_save, can_serialise : FMU state.  fields : by block name, in the XML's order.
    any_step : whether its steps may be of any length.  many : whether a process may hold several instances of it.
    """

    fmi: int
    guid: str
    identifier: str
    tool: str
    can_save: bool
    can_serialise: bool
    fields: dict[str, VariableBlock]
    any_step: bool = True
    many: bool = True


def read_description(extracted: Path) -> Description:
    """The description of an extracted FMU.  Raises HalfError where it is not one of FMI 2.0 or 3.0 co-simulation."""
    path = extracted / "modelDescription.xml"
    try:
        text = path.read_bytes()
    except OSError as exc:
        raise HalfError(f"{extracted} holds no FMU: {exc.strerror}") from exc
    key = f"{_CACHE_VERSION}:{hashlib.sha256(text).hexdigest()}"
    cache = extracted / "blocks.json"
    kept = _cached(cache, key)
    if kept is not None:
        return kept
    description = _parse(text, path, _told(extracted / "resources" / "blocks.json", text))
    # A cache that cannot be written (a folder of another user) costs time only.
    with contextlib.suppress(OSError):
        new = cache.with_suffix(f".{os.getpid()}")
        new.write_text(json.dumps({"key": key, **_to_json(description)}), encoding="utf-8")
        os.replace(new, cache)
    return description


def _cached(cache: Path, key: str) -> Description | None:
    """What the cache holds for a key; None where there is none, of another key, or damaged."""
    try:
        kept = json.loads(cache.read_text(encoding="utf-8"))
        return _from_json(kept) if kept["key"] == key else None
    except (OSError, ValueError, KeyError, TypeError):
        return None  # the description itself is at hand and is read instead


def _told(path: Path, text: bytes) -> dict[str, VariableBlock] | None:
    """The blocks of a description as its builder tells them (contact.half.layout.block_table); None where it does not,
    or not of this description."""
    try:
        table = json.loads(path.read_bytes())
        # fault: a table of blocks of another description is believed -> if False: | coupler/test_description
        if table["variables"] != variables_hash(text):
            return None
        fields = {}
        for name, shape, kind, causality, variability, unit, description, on, first, start in table["blocks"]:
            block = Block(name, tuple(shape), unit, causality, kind, description, on)
            references = np.arange(first, first + math.prod(block.shape), dtype=np.uint32)
            fields[name] = VariableBlock(block, references, start, variability, unit, type=kind)
    except (OSError, ValueError, KeyError, TypeError):
        return None  # the description itself is at hand and is read instead
    return fields if sum(f.references.size for f in fields.values()) == text.count(b"<ScalarVariable ") else None


def _parse(text: bytes, path: Path, told: dict[str, VariableBlock] | None) -> Description:
    try:
        # What stands after the variables is for others.
        root = ElementTree.fromstring(text if told is None else text.partition(b"<ModelVariables>")[0]
                                      + b"</fmiModelDescription>")
    except ElementTree.ParseError as exc:
        raise HalfError(f"{path} is not XML: {exc}") from exc
    version = root.get("fmiVersion", "")
    fmi = 3 if _VERSION_3.fullmatch(version) else 2
    must = "a half must be FMI 2.0 or 3.0 for co-simulation"
    if root.tag != "fmiModelDescription" or (fmi == 2 and version != "2.0"):
        raise HalfError(f"{path}: FMI {version or 'of no version'}; {must}")
    simulation = root.find("CoSimulation")
    if simulation is None:
        raise HalfError(f"{path}: no CoSimulation; {must}")
    state = "State" if fmi == 3 else "state"
    try:
        fields = told if told is not None else _fields(root, fmi)
        return Description(
            fmi=fmi, guid=root.get("instantiationToken" if fmi == 3 else "guid", ""),
            identifier=simulation.get("modelIdentifier", ""), tool=root.get("generationTool", ""),
            can_save=_is(simulation, f"canGetAndSetFMU{state}"),
            can_serialise=_is(simulation, f"canSerializeFMU{state}"),
            fields=_in_si(fields, declared_units(root)),
            any_step=_is(simulation, "canHandleVariableCommunicationStepSize"),
            many=not _is(simulation, "canBeInstantiatedOnlyOncePerProcess"))
    except ValueError as exc:
        raise HalfError(f"{path} is damaged: {exc}") from exc


def _is(node: ElementTree.Element, flag: str) -> bool:
    """A flag of a description; false where it is not stated, as FMI has it."""
    return node.get(flag) in ("true", "1")


def _fields(root: ElementTree.Element, fmi: int) -> dict[str, VariableBlock]:
    """Raises ValueError, for what is damaged."""
    types, places = type_units(root), _places(root)
    if fmi == 3:
        return fields_of(root, types, places)
    return gather([_scalar(node, types) for node in root.iterfind("ModelVariables/ScalarVariable")], places)


def _in_si(fields: Mapping[str, VariableBlock], declared: Mapping[str, DeclaredUnit]) -> dict[str, VariableBlock]:
    """Blocks whose names mean something in the SI units of these names; one in a unit that is not known as it was."""
    found = {}
    for name, f in fields.items():
        face = face_of(name)
        known = face is not None and face.kind == "Real" == f.block.kind
        # fault: millimetres are taken for metres -> how = conversion_of(face.unit, face.unit, {}) if known else None |
        #   coupler/test_border_units
        how = conversion_of(f.block.unit, face.unit, declared) if face is not None and known else None
        if face is not None and how is not None:
            f = replace(f, block=replace(f.block, unit=face.unit), conversion=how)
        found[name] = f
    return found


def _places(root: ElementTree.Element) -> dict[str, str]:
    """Block -> what its rows belong to, of those for which the annotation of this program says it."""
    mine = [tool for tool in root.iterfind("VendorAnnotations/Tool") if tool.get("name") == VENDOR]
    mine += [note for note in root.iterfind("Annotations/Annotation") if note.get("type") == VENDOR]
    blocks = (block for note in mine for block in note.iter("Block"))
    return {block.get("name", ""): block.get("on", "") for block in blocks if block.get("on") in PLACES}


def _scalar(node: ElementTree.Element, types: Mapping[str, str]) -> Scalar:
    """Raises ValueError where it is none."""
    name = stated(node, "name")
    value = next((child for child in node if child.tag in _KINDS), None)
    if value is None:
        raise ValueError(f"variable {name!r} has no type")
    return Scalar(name, reference_of(node), node.get("causality", "local"),
                  node.get("variability", "continuous" if value.tag == "Real" else "discrete"),
                  value.tag, unit_of(value, types) or "1", value.get("start"), node.get("description", ""))


def _to_json(description: Description) -> dict[str, Any]:
    def references(field: VariableBlock) -> list[int]:
        """First and number of those that follow each other, else all, after a number that none is."""
        refs = [int(r) for r in field.references]
        return [refs[0], len(refs)] if refs == list(range(refs[0], refs[0] + len(refs))) else [-1, *refs]

    fields = [[{**vars(f.block), "shape": list(f.block.shape)}, references(f), f.start, f.variability,
               f.declared, f.conversion.factor, f.conversion.offset, f.type]
              for f in description.fields.values()]
    return {**vars(description), "fields": fields}


def _from_json(kept: dict[str, Any]) -> Description:
    fields = {}
    for about, refs, start, variability, declared, factor, offset, kind in kept["fields"]:
        block = Block(**{**about, "shape": tuple(about["shape"])})
        first, *more = refs
        numbers = np.array(more if first < 0 else range(first, first + more[0]), dtype=np.uint32)
        fields[block.name] = VariableBlock(block, numbers, start, variability, declared, Conversion(factor, offset),
                                           kind)
    return Description(kept["fmi"], kept["guid"], kept["identifier"], kept["tool"], kept["can_save"],
                       kept["can_serialise"], fields, kept["any_step"], kept["many"])


# Unpack FMUs where their wrapper can find them again.

# The native wrapper of Python FMUs is given a file URI and decodes nothing but blanks: anything else quoted crashes it.
_SAFE = re.compile(r"[A-Za-z0-9_.~/\\: -]*")
SAFE_WORDS = "the path may hold letters a-z, digits, blanks and _ . ~ - only"
LIMIT = 4 << 30  # bytes unpacked; no half is near it, a damaged or hostile archive may be


def is_safe(path: Path) -> bool:
    """Whether an FMU may be unpacked at this absolute path."""
    return _SAFE.fullmatch(str(path.absolute())) is not None


def check_size(archive: zipfile.ZipFile, fmu: Path) -> None:
    """Raise HalfError where an archive would unpack to more than any half has; to ask before anything is read."""
    if sum(info.file_size for info in archive.infolist()) > LIMIT:
        raise HalfError(f"{fmu} unpacks to more than {LIMIT >> 30} GiB")


def unpack(fmu: Path, target: Path) -> Path:
    """Unpack an FMU into a new directory, whole or not at all; kept as it is if it is there already.

    Raises HalfError for a file that is no FMU, or a target no FMU can be loaded from.
    """
    if not is_safe(target):
        raise HalfError(f"an FMU cannot be loaded from {target.absolute()}: {SAFE_WORDS}; choose another folder for "
                        "FMUs (SLIDELINE_CACHE) or for temporary files (TMPDIR)")
    if target.is_dir():
        return target
    target.parent.mkdir(parents=True, exist_ok=True)
    scratch = Path(tempfile.mkdtemp(dir=target.parent, prefix=".unpack-"))
    try:
        with zipfile.ZipFile(fmu) as archive:
            check_size(archive, fmu)
            archive.extractall(scratch)
        try:
            os.replace(scratch, target)
        except OSError:
            # Another process was quicker; what it unpacked is the same.
            if not target.is_dir():
                raise
    except (OSError, zipfile.BadZipFile) as exc:
        raise HalfError(f"{fmu} cannot be unpacked: {exc}") from exc
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    return target


ZIP_TIME = (1980, 1, 1, 0, 0, 0)  # fixed, so that equal contents make equal files


def with_description(fmu: Path, change: Callable[[bytes], bytes], out: Path) -> Path:
    """Write a copy of an FMU whose modelDescription.xml is changed, all else as it was; returns `out`.

    Raises OSError, KeyError, zipfile.BadZipFile where it is none.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(fmu) as archive, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as new:
        for name in archive.namelist():
            info = zipfile.ZipInfo(name, ZIP_TIME)
            info.compress_type, info.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            content = archive.read(name)
            new.writestr(info, change(content) if name == "modelDescription.xml" else content)
    return out


def unpacked_beside(fmu: Path) -> Path | None:
    """The directory `half` beside `half.fmu`, if that is what the FMU unpacks to (its description says so)."""
    beside = fmu.with_suffix("")
    inside = beside / "modelDescription.xml"
    if not (inside.is_file() and is_safe(beside)):
        return None
    try:
        with zipfile.ZipFile(fmu) as archive:
            same = archive.read("modelDescription.xml") == inside.read_bytes()
    except (OSError, KeyError, zipfile.BadZipFile) as exc:
        raise HalfError(f"{fmu} cannot be read: {exc}") from exc
    return beside if same else None
