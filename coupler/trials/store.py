"""Trials kept by content: one of the same values by the same sources is never run twice."""

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
from coupler.trials.trial import Trial, trial_from

FORMAT, VERSION = "slideline.trial", 1
# Parts of the coupler that change nothing in a trial.
APART = ("study", "advise", "report", "deck", "init", "verify", "cli.py")


def sources() -> str:
    """Hash of everything installed that a trial depends on."""
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
    """Name of a trial: of its resolved values, its meshes and the sources."""
    return hashlib.sha256(f"{scenario.hash} {packages}".encode()).hexdigest()[:32]


class Store:
    """Trials in a folder, a file each, whole or not there; one of another version is as if it were not there."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def get(self, key: str) -> Trial | None:
        """The trial kept under a key.  Raises ResultsError for a file that is not one."""
        path = self._folder / f"{key}.json"
        if not path.exists():
            return None
        try:
            values = json.loads(path.read_text(encoding="utf-8"))
            if values.pop("format") != FORMAT:
                raise ValueError("of another format")
            # fault: trials of another version are taken -> return trial_from(values) if values.pop("version") or True
            #   else None | coupler/test_study
            return trial_from(values) if values.pop("version") == VERSION else None
        except (OSError, ValueError, TypeError, KeyError, AttributeError) as exc:
            raise ResultsError(f"{path}: not a trial ({exc}); remove it, and it is run again") from exc

    def put(self, key: str, trial: Trial) -> None:
        """Keep a trial.  Raises ResultsError where it cannot be written."""
        path = self._folder / f"{key}.json"
        whole = {"format": FORMAT, "version": VERSION, **asdict(trial)}
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            part_of(path).write_text(json.dumps(whole, allow_nan=False), encoding="utf-8")
            os.replace(part_of(path), path)
        except OSError as exc:
            raise ResultsError(f"{path}: the trial cannot be written ({exc.strerror})") from exc
