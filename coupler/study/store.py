"""Outcomes kept by content: a run of the same values by the same sources is never repeated."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import asdict
from pathlib import Path

from contact.half.build import package_directory
from contact.half.entry import sources_hash
from coupler.errors import ResultsError
from coupler.fmu.halves import known_halves
from coupler.record.beside import part_of
from coupler.record.keeper import versions
from coupler.scenario import Scenario
from coupler.study.cell import Outcome, outcome_from

# Parts of the coupler that change no number of a run.
APART = ("study", "report")


def sources() -> str:
    """Hash of everything installed that an outcome depends on."""
    packages = {"contact", *(point.module.split(".")[0] for point in known_halves().values())}
    digest = hashlib.sha256(json.dumps(versions(), sort_keys=True).encode())
    for name in sorted(packages):
        digest.update(sources_hash(package_directory(name)).encode())
    coupler = Path(__file__).resolve().parent.parent
    for path in sorted(coupler.rglob("*.py")):
        if path.relative_to(coupler).parts[0] not in APART:
            digest.update(path.relative_to(coupler).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()


def key_of(scenario: Scenario, packages: str) -> str:
    """Name of a run: of its resolved values, its meshes and the sources."""
    return hashlib.sha256(f"{scenario.hash} {packages}".encode()).hexdigest()[:32]


class Store:
    """Outcomes in a folder, a file each, whole or not there."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def get(self, key: str) -> Outcome | None:
        """The outcome kept under a key.  Raises ResultsError for a file that is not one."""
        path = self._folder / f"{key}.json"
        if not path.exists():
            return None
        try:
            return outcome_from(json.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError) as exc:
            raise ResultsError(f"{path}: not an outcome of a study ({exc}); remove it, and it is run again") from exc

    def put(self, key: str, outcome: Outcome) -> None:
        """Keep an outcome.  Raises ResultsError where it cannot be written."""
        path = self._folder / f"{key}.json"
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            part_of(path).write_text(json.dumps(asdict(outcome), allow_nan=False), encoding="utf-8")
            os.replace(part_of(path), path)
        except OSError as exc:
            raise ResultsError(f"{path}: the outcome cannot be written ({exc.strerror})") from exc
