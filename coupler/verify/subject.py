"""What is verified: an FMU by its path, or a kind of half by its entry point, built for a scene that uses it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from coupler.demo import shipped_scenarios
from coupler.errors import ScenarioError
from coupler.fmu.halves import build_half, known_halves
from coupler.init.templates import templates
from coupler.scenario import Scenario, load_scenario
from coupler.scenario.quantity import did_you_mean


def fmu_of(half: str, scenario: Path | None, scratch: Path) -> Path:
    """The FMU of a path or of the name of an entry point; built, if need be, for a scenario that uses it.

    scratch : a folder for what is built.  Raises ScenarioError where there is none, HalfError where it cannot be built.
    """
    if half.endswith(".fmu"):
        path = Path(half)
        if not path.is_file():
            raise ScenarioError("there is no such FMU", key="HALF", value=half, remedy="Check the path")
        return path
    known = known_halves()
    if half not in known:
        raise ScenarioError("this is neither an FMU (a path that ends in .fmu) nor the name of an installed half",
                            key="HALF", value=half, remedy=did_you_mean(half, known))
    scene, role = _scene_with(half, scenario)
    return build_half(scene.write_half(role, scratch), scratch)


def _scene_with(kind: str, scenario: Path | None) -> tuple[Scenario, str]:
    """A scene that uses a kind, and the role it has there; of our own kinds a template does."""
    for path in [scenario] if scenario is not None else _own():
        scene = load_scenario(path)
        for role, used in (("thermal", scene.thermal_half), ("mechanical", scene.mechanical_half)):
            if used == kind:
                return scene, role
    where = f"{scenario} uses other halves" if scenario is not None else "no template uses this half"
    raise ScenarioError(where, key="--scenario", value=kind, remedy="Give a scenario that uses it, with --scenario")


def _own() -> Iterable[Path]:
    yield from (template.path for template in templates().values())
    yield shipped_scenarios() / "heated_bars.yaml"  # the rigid half
