"""Which halves there are: our own, and those of other packages (entry points `slideline.halves`)."""

from __future__ import annotations

from importlib.metadata import entry_points

from coupler.scenario.document import Document
from coupler.scenario.quantity import did_you_mean

GROUP = "slideline.halves"
OWN = {"thermal": ("thermal",), "mechanical": ("elastic", "rigid")}


def known_kinds(role: str) -> tuple[str, ...]:
    """Kinds that can stand in a role: ours for it, and those of other packages, whose role we cannot know."""
    ours = {kind for kinds in OWN.values() for kind in kinds}
    return OWN[role] + tuple(sorted({e.name for e in entry_points(group=GROUP)} - ours))


def check_kind(document: Document, role: str, kind: str) -> None:
    """Raises ScenarioError where no such half is installed, or it is one of the other role."""
    known = known_kinds(role)
    if kind not in known:
        raise document.error(
            (role, "half"), f"there is no {role} half of kind {kind!r}", did_you_mean(kind, known)
        )
