"""A random scene: a scenario as plain data, with the meshes of its bodies beside it."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from coupler import load_scenario
from coupler.scenario import Scenario
from random_scenes.shapes import Shape, shape_of


@dataclass(frozen=True, eq=False)
class Scene:
    """doc : a scenario as docs/scenario.md has it, but for `mesh` of its bodies.  recipes : body -> recipe of its mesh.

    moved : body -> mesh that is not its recipe's any more (a turned scene's).  Nothing writes into them.
    """

    doc: Mapping[str, Any]
    recipes: Mapping[str, Mapping[str, Any]]
    moved: Mapping[str, Shape] | None = None

    @cached_property
    def shapes(self) -> Mapping[str, Shape]:
        """Body -> its mesh."""
        return self.moved if self.moved is not None else {b: shape_of(r) for b, r in self.recipes.items()}

    def edited(self, **values: Any) -> Scene:
        """A copy with other values: dotted keys with __ for the dot; None removes the key.

        >>> scene.edited(coupling__scheme="iterated", thermal__adaptive=None)
        """
        doc = self.copied_doc()
        for key, value in values.items():
            *way, last = key.split("__")
            at = doc
            for step in way:
                at = at[int(step)] if isinstance(at, list) else at.setdefault(step, {})
            if value is None:
                at.pop(last, None)
            else:
                at[last] = value
        return replace(self, doc=doc)

    def copied_doc(self) -> dict[str, Any]:
        """The scenario as a copy that may be written to."""
        return copy.deepcopy(dict(self.doc))

    def written(self, folder: Path, name: str = "scene") -> Path:
        """Write scenario and meshes to a folder; returns the scenario's path."""
        folder.mkdir(parents=True, exist_ok=True)
        doc = self.copied_doc()
        for body, shape in self.shapes.items():
            if self.wants_rectangles and (rectangle := rectangle_of(self.recipes[body])):
                doc["bodies"][body] = {"mesh": {"rectangle": rectangle}, **doc["bodies"][body]}
                continue
            file = f"{name}.{body}.msh"
            shape.write(folder / file)
            doc["bodies"][body] = {"mesh": {"file": {"path": file, "region": "cells"}}, **doc["bodies"][body]}
        path = folder / f"{name}.yaml"
        yaml = YAML(typ="safe", pure=True)
        yaml.default_flow_style = None
        yaml.width = 130
        yaml.sort_base_mapping_type_on_output = False
        with path.open("w", encoding="utf-8") as f:
            yaml.dump(doc, f)
        return path

    def checked(self, folder: Path) -> Scenario:
        """The scenario as the coupler reads it.  Raises ScenarioError where it is refused."""
        return load_scenario(self.written(folder))

    @property
    def wants_rectangles(self) -> bool:
        """Whether a half takes rectangles alone; such a scene can be neither turned nor renumbered, and its nodes have
        the coupler's order, not that of `shapes`."""
        return "rod" in (self.doc["thermal"].get("half"), self.doc["mechanical"]["half"])

    @property
    def pairs(self) -> Mapping[str, Mapping[str, Any]]:
        return self.doc.get("contact", {})

    @property
    def axisymmetric(self) -> bool:
        return self.doc["geometry"] == "axisymmetric"


def rectangle_of(recipe: Mapping[str, Any]) -> dict[str, Any]:
    """The rectangle of a scenario that a recipe stands for, or nothing where it is none."""
    if "patch" not in recipe or recipe.get("jitter") or recipe.get("triangles") == "mixed":
        return {}
    a, b, c, d = recipe["patch"]
    if a[1] != b[1] or b[0] != c[0] or c[1] != d[1] or d[0] != a[0]:
        return {}
    found = {"origin": list(a), "size": [float(f"{u - v:.12g}") for u, v in zip(c, a, strict=True)],
             "cells": list(recipe["cells"])}
    return found | {k: recipe[k] for k in ("grading", "triangles") if k in recipe}
