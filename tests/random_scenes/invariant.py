"""What an invariant is: a law that holds in every scene, and what is said where it does not."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from random_scenes.scene import Scene
from random_scenes.story import Story


@dataclass(frozen=True)
class Finding:
    """A law that does not hold.

    what : a sentence with the numbers.  size : the violation over its tolerance, above 1.
    named_by : words (lower case) of which one must stand in a warning of the run for the user to have been told.
    told_by : the story that should have told it, if not the scene's own.
    """

    what: str
    size: float
    named_by: tuple[str, ...]
    told_by: Story | None = None


@dataclass(frozen=True)
class Invariant:
    """A law.

    name : its word.  applies : whether it says anything about a scene, from the scene alone.
    check : the scene, its story (completed) and a generator of random numbers -> what does not hold.  It may run
    changed scenes (story.told); the same numbers give the same answer.
    runs : about how many scenes a check runs; those that run none are checked in every scene.
    weight : how often it is drawn where it applies; a law that few scenes can break is drawn more often.
    """

    name: str
    applies: Callable[[Scene], bool]
    check: Callable[[Scene, Story, np.random.Generator], Sequence[Finding]]
    runs: int = 1
    weight: float = 1.0

    def __str__(self) -> str:
        return self.name
