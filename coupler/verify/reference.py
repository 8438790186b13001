"""Slideline's own half of a scene in which a half of another package stands, to compare that with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from contact.half.build import content_hash
from contact.half.entry import sources_hash
from coupler.errors import HalfError, ScenarioError
from coupler.fmu.launch import build_half
from coupler.scenario import Scenario
from coupler.scenario.kinds import OWN
from coupler.scenario.load import scenario_from

WHOLE = {"thermal": "thermal", "mechanical": "elastic"}  # role -> the kind of our own that leaves nothing out
ROOMS = {"thermal": "thermal_fmu", "mechanical": "mechanical_fmu"}  # where these are


@dataclass(frozen=True)
class Reference:
    """Slideline's own half of a scene.  why_none : why there is none, "" where there is.  kind, scenario, role : of it.
    """

    why_none: str = ""
    scenario: Scenario | None = None
    role: str = ""

    @property
    def key(self) -> Mapping[str, Any]:
        """What its answers depend on."""
        if self.scenario is None:
            return {"why": self.why_none}
        root = Path(__file__).resolve().parents[2]
        sources = {name: sources_hash(root / name) for name in ("contact", ROOMS[self.role])}
        return {"half": content_hash(self.scenario.interface_of(self.role), dict(self.scenario.models[self.role]),
                                     sources)}

    def build(self, scratch: Path) -> Path | None:
        """Return its FMU, built into the cache; None where there is none.  Raises HalfError."""
        if self.scenario is None:
            return None
        return build_half(self.scenario.write_half(self.role, scratch), scratch)


def reference_of(scenario: Scenario, name: str, reads: frozenset[str] | None) -> Reference:
    """Return our own half of a scene that another one is compared with, or why there is none.

    name : of the other half in the scenario.  reads : what it declares to read of a scene; None: it does not say.
    """
    if name not in OWN:
        return Reference("it is one of several halves in a role")
    stated = scenario.stated
    if stated is None:
        return Reference("the scenario is not known")
    role = name
    settings = getattr(stated, role)
    if settings.half in OWN[role]:
        return Reference("it is one of Slideline's own")
    if reads is None:
        return Reference("it does not declare what it reads of a scene (UNDERSTANDS), so it may be of another one")
    # fault: a half of physics of its own is compared with ours -> if False: | coupler/test_reference
    if settings.options:
        return Reference(f"{role}.options give it physics that Slideline's own half does not have")
    if settings.ignore:
        return Reference(f"the scenario lets it leave out {', '.join(settings.ignore)}")
    if role == "mechanical" and stated.mechanical.elastic is None:
        return Reference("the scenario has no mechanical.elastic, by which Slideline's own half could be held")
    try:
        own = scenario_from(scenario.text, scenario.file, {**scenario.overrides, f"{role}.half": WHOLE[role]})
    except ScenarioError as exc:
        return Reference(f"Slideline's own half does not take this scene: {str(exc).splitlines()[0]}")
    return Reference("", own, role)


def built(reference: Reference, scratch: Path) -> tuple[Path | None, str]:
    """Return the FMU of a reference, or None and why there is none."""
    try:
        return reference.build(scratch), reference.why_none
    except HalfError as exc:
        return None, f"Slideline's own half cannot be built: {str(exc).splitlines()[0]}"
