"""`slideline verify-half`: finds the half that is named, and prints what the checks say of it."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from contact.problem.values import did_you_mean
from coupler.errors import ScenarioError
from coupler.fmu.bind import bind
from coupler.fmu.bounds import BorderScene
from coupler.fmu.launch import build_half, known_halves
from coupler.init.shipped import shipped_scenarios
from coupler.init.templates import templates
from coupler.scenario import Scenario, load_scenario
from coupler.scenario.kinds import OWN, entry_of, fmu_path, understood_by
from coupler.verify.bench import NO_REFERENCE
from coupler.verify.border import (
    CheckVerdict,
    conclusion,
    table_of,
)
from coupler.verify.child import findings_of
from coupler.verify.reference import Reference, built, reference_of
from coupler.verify.verdicts import border_of

NONE_KNOWN = Reference(NO_REFERENCE)
VIOLATED = 1  # exit code where a check failed


HalfArgument = Annotated[str, typer.Argument(
    help="An FMU, file.fmu, or the name of a half that is installed: thermal, elastic, ... ROLE=KIND puts a half into "
    "the scene of --scenario, as --swap does.", show_default=False)]
ScenarioOption = Annotated[Path | None, typer.Option(
    "--scenario", metavar="FILE", help="The scenario to check it in. For an installed half: one that uses this half; "
    "Slideline's own halves have one built in.",
    show_default=False)]
StepOption = Annotated[float, typer.Option("--step", metavar="SECONDS",
                                           help="Substep to begin with; halved while the half refuses it.")]


def verify_half_command(half: HalfArgument, scenario: ScenarioOption = None, step: StepOption = 1.0) -> None:
    """Check a half against the interface specification: names, units, state, discards, substeps.  Code 1: violated."""
    if not 0 < step < float("inf"):
        raise ScenarioError("a substep is longer than 0", key="--step", value=step, remedy="Give seconds")
    with tempfile.TemporaryDirectory(prefix="slideline-") as scratch:
        found = fmu_of(half, scenario, Path(scratch) / "half")
        own, why_none = built(found.reference, Path(scratch) / "own")
        findings = list(findings_of(found.fmu, Path(scratch), step, found.scene, reads=found.reads, reference=own,
                                    why_none=why_none))
    Console().print(table_of(half, findings))
    typer.echo(conclusion(half, findings))
    if any(f.verdict is CheckVerdict.FAIL for f in findings):
        raise typer.Exit(VIOLATED)


@dataclass(frozen=True)
class FoundHalf:
    """An FMU, and the scene it is for; None where nobody said.  reads : what its builder declares to read of it.

    reference : Slideline's own half of that scene.
    """

    fmu: Path
    scene: BorderScene | None
    reads: frozenset[str] | None = None
    reference: Reference = NONE_KNOWN


def fmu_of(half: str, scenario: Path | None, scratch: Path) -> FoundHalf:
    """Return the FMU of a path, or build that of an entry point for a scenario that uses it.

    half : a path, an entry point, or ROLE=KIND as of --swap.  scratch : a folder for what is built.
    Raises ScenarioError where there is none, HalfError where it cannot be built.
    """
    role, swapped, kind = half.partition("=")
    if swapped and role in OWN:
        return _swapped(role, kind, scenario, scratch)
    if half.endswith(".fmu"):
        path = Path(half)
        if not path.is_file():
            raise ScenarioError("there is no such FMU", key="HALF", value=half, remedy="Check the path")
        return FoundHalf(path, None) if scenario is None else _in_scene(path, load_scenario(scenario), scratch)
    installed = known_halves()
    if half not in installed:
        words = [f"{role}={half}" for role in OWN if entry_of(role, half) in installed]
        raise ScenarioError("this is neither an FMU (a path that ends in .fmu) nor the name of an installed half",
                            key="HALF", value=half, remedy=f"Say its role: {' or '.join(words)}, with --scenario"
                            if words else did_you_mean(half, installed))
    use = _scene_with(half, scenario)
    return _built(use.scene, use.role, scratch)


def _swapped(role: str, kind: str, scenario: Path | None, scratch: Path) -> FoundHalf:
    """The half of a kind in a role of a scene that may use another."""
    if scenario is None:
        raise ScenarioError("there is no scene to put this half into", key="HALF", value=f"{role}={kind}",
                            remedy="Give one, with --scenario")
    # fault: verify-half: a half in a scene is that of the scene -> scene = load_scenario(scenario) |
    #   coupler/test_verify_swapped
    scene = load_scenario(scenario, overrides={f"{role}.half": kind})
    if fmu_path(kind, scene.file.parent) is not None:
        return _in_scene(Path(str(scene.models[role]["half"])), scene, scratch)
    return _built(scene, role, scratch)


def _built(scene: Scenario, role: str, scratch: Path) -> FoundHalf:
    """The half of a role of a scene, built for it."""
    reads = understood_by(scene.kinds[role], scene.file.parent)
    return FoundHalf(build_half(scene.write_half(role, scratch), scratch), border_of(scene, role), reads,
                     reference_of(scene, role, reads))


def _in_scene(fmu: Path, scene: Scenario, scratch: Path) -> FoundHalf:
    """An FMU that lies ready, in a scene: with the names that the scene binds, where it is a half of it."""
    for role, kind in (("thermal", scene.thermal_half), ("mechanical", scene.mechanical_half)):
        if kind == str(fmu.resolve()):
            reads = understood_by(kind, scene.file.parent)
            return FoundHalf(bind(scene, role, fmu, scratch / "bound.fmu"), border_of(scene, role), reads,
                             reference_of(scene, role, reads))
    return FoundHalf(fmu, border_of(scene, ""))


@dataclass(frozen=True)
class _Use:
    """role : of the half in the scene."""

    scene: Scenario
    role: str


def _scene_with(kind: str, scenario: Path | None) -> _Use:
    """Find a scene that uses a kind of half; of our own kinds a template does."""
    for path in [scenario] if scenario is not None else _own():
        scene = load_scenario(path)
        for role, used in (("thermal", scene.thermal_half), ("mechanical", scene.mechanical_half)):
            if used == kind:
                return _Use(scene, role)
    where = f"{scenario} uses other halves" if scenario is not None else "no template uses this half"
    raise ScenarioError(where, key="--scenario", value=kind, remedy="Give a scenario that uses it, with --scenario")


def _own() -> Iterable[Path]:
    yield from (template.path for template in templates().values())
    yield shipped_scenarios() / "heated_bars.yaml"  # the rigid half
