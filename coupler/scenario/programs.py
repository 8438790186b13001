"""What a half around a program cannot do of a scene (docs/program_half.md), told before anything is built."""

from __future__ import annotations

from collections.abc import Iterator

from contact.problem.errors import Wrong
from contact.problem.material import Axes
from coupler.scenario.schema import ScenarioFile

OTHER = "Choose the half {}, or one of another package."


def program_wrongs(role: str, kind: str, file: ScenarioFile) -> Iterator[Wrong]:
    """Yield what of a scene a half around a program refuses.  kind : the scenario's word for it."""
    other = OTHER.format("thermal" if role == "thermal" else "elastic")
    # fault: a program is given a scene around an axis -> if False: | coupler/test_program_scenes
    if file.geometry == "axisymmetric":
        yield Wrong(("geometry",), f"the half {kind} is for the plane, this scene is around an axis", other)
    if role != "thermal":
        return
    stated = file.thermal
    if stated.adaptive is not None:
        yield Wrong(("thermal", "adaptive"), "inner steps are judged by matrices, which a program does not tell",
                    "Leave it out, or choose the half thermal.")
    if stated.method == "steady":
        yield Wrong(("thermal", "method"), f"the half {kind} takes steps in time", "Choose another method, or "
                    "the half thermal.")
    for name in {part.material for body in file.bodies.values() for part in body.parts.values()}:
        material = file.materials.get(name)
        if material is not None and isinstance(material.k, Axes):
            yield Wrong(("materials", name, "k"), f"the half {kind} has one conductivity for all directions", other)
