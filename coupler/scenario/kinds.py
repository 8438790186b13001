"""Which halves there are: our own, those of other packages (entry points `slideline.halves`), prebuilt FMUs."""

from __future__ import annotations

from importlib.metadata import entry_points
from pathlib import Path

from contact.problem.values import did_you_mean
from coupler.scenario.document import Document

GROUP = "slideline.halves"
# role -> word of the scenario -> entry point, which is also the `half` of model.json.  A rod is one in either role.
OWN: dict[str, dict[str, str]] = {
    "thermal": {"thermal": "thermal", "lumped": "lumped", "rod": "thermal_rod"},
    "mechanical": {"elastic": "elastic", "rigid": "rigid", "rod": "mechanical_rod"},
}


def known_kinds(role: str) -> tuple[str, ...]:
    """Kinds that can stand in a role: ours for it, and those of other packages, whose role we cannot know."""
    ours = {kind for kinds in OWN.values() for kind in kinds.values()}
    return tuple(OWN[role]) + tuple(sorted({e.name for e in entry_points(group=GROUP)} - ours))


def fmu_path(kind: str, folder: Path) -> Path | None:
    """The FMU a half's name is the path of, relative to the scenario's folder; None where it names a kind."""
    return (folder / kind).resolve() if kind.endswith(".fmu") else None


def check_kind(document: Document, role: str, kind: str) -> None:
    """Raises ScenarioError where no such half is installed, it is one of the other role, or its FMU is not there."""
    fmu = fmu_path(kind, document.path.parent)
    if fmu is not None:
        if not fmu.is_file():
            raise document.error((role, "half"), f"there is no FMU {fmu}", "Paths are relative to the scenario file.")
        return
    known = known_kinds(role)
    if kind not in known:
        raise document.error(
            (role, "half"), f"there is no {role} half of kind {kind!r}", did_you_mean(kind, known)
        )
