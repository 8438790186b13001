"""Scenes that were found, as files: the smallest that still break a law, with their seed and the cause."""

from __future__ import annotations

import contextlib
import json
from dataclasses import dataclass
from pathlib import Path

import hypothesis
from ruamel.yaml import YAML

from random_scenes.draw import generator, scenes
from random_scenes.invariant import Invariant
from random_scenes.judge import SILENT, Row, row_of
from random_scenes.scene import Scene
from random_scenes.story import COMPLETED, told

FAULTS = Path(__file__).parent / "faults"


@dataclass(frozen=True)
class Kept:
    """A scene that broke a law in silence.

    seed : that drew it, and the random numbers of the check; None: made by hand.  cause : one line.
    now : "silent" as it was, "told" where the run says so now, "mended" where the law holds.
    """

    scene: Scene
    invariant: str
    cause: str
    seed: int | None = None
    now: str = SILENT

    def write(self, path: Path) -> None:
        yaml = _yaml()
        with path.open("w", encoding="utf-8") as f:
            yaml.dump({"invariant": self.invariant, "cause": self.cause, "now": self.now, "seed": self.seed,
                       "recipes": dict(self.scene.recipes), "scenario": dict(self.scene.doc)}, f)

    @staticmethod
    def read(path: Path) -> Kept:
        found = _yaml().load(path.read_text(encoding="utf-8"))
        return Kept(Scene(found["scenario"], found["recipes"]), found["invariant"], found["cause"], found["seed"],
                    found.get("now", SILENT))

    def judged(self, invariant: Invariant) -> Row:
        """What the law says of it today; "holds" too where the scene is refused or its run fails with a message."""
        story = told(self.scene)
        if story.outcome != COMPLETED:
            return Row(invariant.name, story.outcome, story.message)
        return row_of(invariant, self.scene, story, generator(self.seed or 0))


def _yaml() -> YAML:
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = None
    yaml.width = 120
    yaml.sort_base_mapping_type_on_output = False
    return yaml


class _FoundError(Exception):
    """This scene is silent too."""


def smallest(seed: int, invariant: Invariant, most: int = 60) -> Scene | None:
    """The plainest scene near that of a seed which still breaks a law in silence; None where the seed's own does not.

    most : scenes that are run in the search.
    """
    seen: dict[str, bool] = {}
    best: list[Scene] = []

    @hypothesis.seed(seed)
    @hypothesis.settings(max_examples=2, phases=(hypothesis.Phase.generate, hypothesis.Phase.shrink), database=None,
                         deadline=None, report_multiple_bugs=False,
                         suppress_health_check=list(hypothesis.HealthCheck))
    @hypothesis.given(scenes())
    def holds(scene: Scene) -> None:
        key = json.dumps([scene.doc, scene.recipes])
        if key not in seen:
            if len(seen) >= most:
                return
            seen[key] = _silent(scene, invariant, seed)
            if seen[key]:
                best.append(scene)
        if seen[key]:
            raise _FoundError(key)

    with contextlib.suppress(_FoundError):
        holds()
    return best[-1] if best else None


def _silent(scene: Scene, invariant: Invariant, seed: int) -> bool:
    if not invariant.applies(scene):
        return False
    story = told(scene)
    return story.outcome == COMPLETED and row_of(invariant, scene, story, generator(seed)).verdict == SILENT
