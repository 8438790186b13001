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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from contact.half.layout import VENDOR, variables_hash
from contact.half.model import PLACES
from coupler.errors import HalfError
from coupler.fmu.half import Block
from coupler.fmu.names import face_of
from coupler.fmu.units import SI, Conversion, DeclaredUnit, conversion_of, declared_units, type_units, unit_of

_CACHE_VERSION = 4
_INDEXED = re.compile(r"^(.+)\[(\d+(?:,\d+)*)\]$")
_KINDS = ("Real", "Integer", "Boolean", "String", "Enumeration")


@dataclass(frozen=True)
class VariableBlock:
    """A block and where it lies.

    block : in the SI unit of its name, if it has one (coupler.fmu.names).  references : (size,) value references, last
    index fastest.  start : as written in the XML, of a scalar only.  variability : as in the XML, the standard's
    default where it is left out.  declared : the unit in the XML.  conversion : of numbers in it.
    """

    block: Block
    references: NDArray[np.uint32]
    start: str | None
    variability: str
    declared: str = "1"
    conversion: Conversion = SI


@dataclass(frozen=True)
class Description:
    """tool : the generator.  can_save, can_serialise : FMU state.  fields : by block name, in the XML's order."""

    guid: str
    identifier: str
    tool: str
    can_save: bool
    can_serialise: bool
    fields: dict[str, VariableBlock]


@dataclass(frozen=True)
class _Scalar:
    name: str
    reference: int
    causality: str
    variability: str
    kind: str
    unit: str
    start: str | None
    description: str = ""


@dataclass(frozen=True)
class _Element:
    """A scalar of a block.  index : from 1, () of a scalar alone."""

    index: tuple[int, ...]
    scalar: _Scalar


def read_description(extracted: Path) -> Description:
    """The description of an extracted FMU.  Raises HalfError where it is not one of FMI 2.0 co-simulation."""
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
            fields[name] = VariableBlock(block, references, start, variability, unit)
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
    if root.tag != "fmiModelDescription" or version != "2.0":
        raise HalfError(f"{path}: FMI {version or 'of no version'}; a half must be FMI 2.0 for co-simulation")
    simulation = root.find("CoSimulation")
    if simulation is None:
        raise HalfError(f"{path}: no CoSimulation; a half must be FMI 2.0 for co-simulation")
    types = type_units(root)
    return Description(
        guid=root.get("guid", ""), identifier=simulation.get("modelIdentifier", ""),
        tool=root.get("generationTool", ""),
        can_save=simulation.get("canGetAndSetFMUstate") in ("true", "1"),
        can_serialise=simulation.get("canSerializeFMUstate") in ("true", "1"),
        fields=_in_si(told if told is not None
                      else gather([_scalar(node, types) for node in root.iterfind("ModelVariables/ScalarVariable")],
                                  _places(root)), declared_units(root)))


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
    blocks = (block for tool in root.iterfind("VendorAnnotations/Tool") if tool.get("name") == VENDOR
              for block in tool.iter("Block"))
    return {block.get("name", ""): block.get("on", "") for block in blocks if block.get("on") in PLACES}


def _scalar(node: ElementTree.Element, types: Mapping[str, str]) -> _Scalar:
    value = next(child for child in node if child.tag in _KINDS)
    return _Scalar(node.attrib["name"], int(node.attrib["valueReference"]), node.get("causality", "local"),
                   node.get("variability", "continuous" if value.tag == "Real" else "discrete"),
                   value.tag, unit_of(value, types) or "1", value.get("start"), node.get("description", ""))


def gather(scalars: Sequence[_Scalar], places: Mapping[str, str] = MappingProxyType({})) -> dict[str, VariableBlock]:
    """Scalars a[1], a[2], ... to one block "a"; what does not fill a whole box of 1-based indices stays scalar.

    places : block -> what its rows belong to.
    """
    groups: dict[str, list[_Element]] = {}
    for scalar in scalars:
        match = _INDEXED.match(scalar.name)
        name, index = (match[1], tuple(map(int, match[2].split(",")))) if match else (scalar.name, ())
        groups.setdefault(name, []).append(_Element(index, scalar))
    fields: dict[str, VariableBlock] = {}
    for name, members in groups.items():
        field = _block(name, members, places.get(name, ""))
        if field is not None:
            fields[name] = field
        else:
            fields.update({m.scalar.name: _field(m.scalar.name, (), [m.scalar]) for m in members})
    return fields


def _block(name: str, members: list[_Element], on: str) -> VariableBlock | None:
    indices, scalars = [m.index for m in members], [m.scalar for m in members]
    if len({len(index) for index in indices}) > 1 or len({(s.kind, s.causality, s.unit) for s in scalars}) > 1:
        return None
    shape = tuple(max(column) for column in zip(*indices, strict=True))
    whole = len(set(indices)) == len(members) == math.prod(shape)
    if not whole or any(min(index, default=1) < 1 for index in indices):
        return None
    return _field(name, shape, [m.scalar for m in sorted(members, key=lambda m: m.index)], on)


def _field(name: str, shape: tuple[int, ...], scalars: list[_Scalar], on: str = "") -> VariableBlock:
    first = scalars[0]
    return VariableBlock(Block(name, shape, first.unit, first.causality, first.kind, first.description, on),
                         np.array([s.reference for s in scalars], dtype=np.uint32),
                         None if shape else first.start, first.variability, first.unit)


def _to_json(description: Description) -> dict[str, Any]:
    def references(refs: NDArray[np.uint32]) -> list[int] | int:
        consecutive = (np.diff(refs.astype(np.int64)) == 1).all()
        return int(refs[0]) if consecutive else [int(r) for r in refs]

    fields = [[{**vars(f.block), "shape": list(f.block.shape)}, references(f.references), f.start, f.variability,
               f.declared, f.conversion.factor, f.conversion.offset]
              for f in description.fields.values()]
    return {**vars(description), "fields": fields}


def _from_json(kept: dict[str, Any]) -> Description:
    fields = {}
    for about, refs, start, variability, declared, factor, offset in kept["fields"]:
        block = Block(**{**about, "shape": tuple(about["shape"])})
        if isinstance(refs, int):
            refs = np.arange(refs, refs + math.prod(block.shape))
        fields[block.name] = VariableBlock(block, np.asarray(refs, dtype=np.uint32), start, variability, declared,
                                           Conversion(factor, offset))
    return Description(kept["guid"], kept["identifier"], kept["tool"], kept["can_save"], kept["can_serialise"],
                       fields)


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
