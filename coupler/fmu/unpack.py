"""Unpack FMUs where their wrapper can find them again."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
import zipfile
from pathlib import Path

from coupler.errors import HalfError

# The native wrapper of Python FMUs is given a file URI and decodes nothing but blanks: anything else quoted crashes it.
_SAFE = re.compile(r"[A-Za-z0-9_.~/\\: -]*")
SAFE_WORDS = "the path may hold letters a-z, digits, blanks and _ . ~ - only"
LIMIT = 4 << 30  # bytes unpacked; no half is near it, a damaged or hostile archive may be


def is_safe(path: Path) -> bool:
    """Whether an FMU may be unpacked at this absolute path."""
    return _SAFE.fullmatch(str(path.absolute())) is not None


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
            if sum(info.file_size for info in archive.infolist()) > LIMIT:
                raise HalfError(f"{fmu} unpacks to more than {LIMIT >> 30} GiB")
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
