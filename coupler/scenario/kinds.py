"""Which halves there are: our own, those of other packages (entry points `slideline.halves`), prebuilt FMUs."""

from __future__ import annotations

import os
from importlib.metadata import entry_points
from pathlib import Path

from contact.problem.values import did_you_mean
from coupler.scenario.document import Document, Key
from coupler.scenario.understood import declared_by, declared_in

GROUP = "slideline.halves"
REPLAY = "replay"  # in either role: what another run recorded
# role -> word of the scenario -> entry point, which is also the `half` of model.json.  A rod is one in either role.
OWN: dict[str, dict[str, str]] = {
    "thermal": {"thermal": "thermal", "lumped": "lumped", "rod": "thermal_rod", REPLAY: "thermal_replay"},
    "mechanical": {"elastic": "elastic", "rigid": "rigid", "rod": "mechanical_rod", REPLAY: "mechanical_replay"},
}
# Halves of ours around a program of another maker: told the scene, and checked, as halves of other packages are.
PROGRAMS: dict[str, dict[str, str]] = {"thermal": {"ccx": "thermal_ccx"}, "mechanical": {"ccx": "mechanical_ccx"}}
SHIPPED = frozenset(entry for table in (OWN, PROGRAMS) for kinds in table.values() for entry in kinds.values())


def known_kinds(role: str) -> tuple[str, ...]:
    """Kinds that can stand in a role: ours for it, and those of other packages, whose role we cannot know."""
    return (*OWN[role], *PROGRAMS[role], *sorted({e.name for e in entry_points(group=GROUP)} - SHIPPED))


def stands_in(role: str, kind: str) -> bool:
    """Whether a half of this kind can stand in a role; what others have installed is looked up for theirs alone."""
    return kind in OWN[role] or kind in PROGRAMS[role] or kind in known_kinds(role)


def entry_of(role: str, kind: str) -> str:
    """Return the entry point of the scenario's word for a half."""
    return OWN[role].get(kind) or PROGRAMS[role].get(kind, kind)


def word_of(role: str, entry: str) -> str:
    """Return the scenario's word for an entry point, which `--swap` takes; another half is called as it is."""
    # fault: a half is told by a name that no scenario takes -> return entry | coupler/test_cli
    return next((word for table in (OWN, PROGRAMS) for word, own in table[role].items() if own == entry), entry)


def words_of(thermal: str, mechanical: str) -> dict[str, str]:
    """Return role -> the scenario's word for the entry points of both halves."""
    return {"thermal": word_of("thermal", thermal), "mechanical": word_of("mechanical", mechanical)}


def fmu_path(kind: str, folder: Path) -> Path | None:
    """The FMU a half's name is the path of, relative to the scenario's folder; None where it names a kind."""
    return (folder / kind).resolve() if kind.endswith(".fmu") else None


def check_kind(document: Document, role: str, kind: str, at: Key = ()) -> None:
    """Raises ScenarioError where no such half is installed, it is one of the other role, or its FMU is not there."""
    fmu = fmu_path(kind, document.path.parent)
    if fmu is not None:
        if not fmu.is_file():
            raise document.error(at or (role, "half"), f"there is no FMU {fmu}",
                                 "Paths are relative to the scenario file." + _from_here(kind, document.path.parent))
        return
    if not stands_in(role, kind):
        raise document.error(at or (role, "half"), f"there is no {role} half of kind {kind!r}",
                             did_you_mean(kind, known_kinds(role)))


def _from_here(kind: str, folder: Path) -> str:
    """A hint where the file is there as seen from the current folder."""
    # fault: an FMU in the current folder is told to be nowhere -> if True: | coupler/test_fmu_by_path
    if not Path(kind).is_file():
        return ""
    return f" That of the current folder: {os.path.relpath(kind, folder)}"


def understood_by(kind: str, folder: Path) -> frozenset[str] | None:
    """What a half of another package declares to read of a scene; None where it says nothing.  kind : its entry point.
    """
    if (fmu := fmu_path(kind, folder)) is not None:
        return declared_in(fmu)
    entry = next((e for e in entry_points(group=GROUP) if e.name == kind), None)
    return None if entry is None else declared_by(entry)
