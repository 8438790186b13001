"""The same scene with shorter windows, finer meshes, or another scheme or method: what answers are compared with."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupler.scenario.options import ErrorTolerances, Tolerances
from random_scenes.scene import Scene

SIZES = ("size", "first", "last")


def finer_windows(scene: Scene, times: float = 2.0) -> Scene:
    """The scene with windows so many times as short (below 1: as long).

    Fixed windows: size, first and last divided by it.  Adaptive ones: the tolerances of all quantities, those that are
    left out too, and `first`.
    """
    doc = scene.copied_doc()
    coupling = doc["coupling"]
    if "adaptive" in coupling:
        given = coupling["adaptive"].get("tolerance", {})
        # An atol that is left out goes with rtol.
        tolerance = {name: {key: value / times for key, value in {"rtol": usual.rtol, **given.get(name, {})}.items()}
                     for name, usual in ErrorTolerances()}
        coupling["adaptive"] = {**coupling["adaptive"], "first": coupling["adaptive"]["first"] / times,
                                "tolerance": tolerance}
        return replace(scene, doc=doc)
    start = 0.0
    for row in coupling["windows"]:
        longest, start = row["until"] - start, row["until"]
        row.update({key: min(row[key] / times, longest) for key in SIZES if key in row})
    return replace(scene, doc=doc)


def windows_along(scene: Scene, t: NDArray[np.float64], pieces: int) -> Scene:
    """The scene with fixed windows: each of those that end at t (n,) [s], from t[0] = 0 on, in equal pieces."""
    doc = scene.copied_doc()
    coupling = doc["coupling"]
    coupling.pop("adaptive", None)
    coupling.pop("events", None)  # where contact changed, a window ends already
    # A hair longer than they are: a piece more would be a crumb.
    coupling["windows"] = [{"until": float(b), "size": float((b - a) / pieces * (1 + 1e-9) if pieces > 1 else b - a)}
                           for a, b in pairwise(t)]
    return replace(scene, doc=doc)


def finer_mesh(scene: Scene, times: int = 2) -> Scene:
    """The scene with so many times the cells along either side of each body.

    Raises ValueError where its meshes are not those of its recipes any more.
    """
    if scene.moved is not None:
        raise ValueError("meshes that were moved have no recipe to refine")
    return replace(scene, recipes={body: {**recipe, "cells": [times * n for n in recipe["cells"]]}
                                   for body, recipe in scene.recipes.items()})


def with_scheme(scene: Scene, scheme: str, method: str | None = None, **iteration: Any) -> Scene:
    """The scene with another scheme and, where given, another method of the thermal half and options of iteration.

    Options that only other methods have go; so do rules, which may change what is asked for here.
    """
    doc = scene.copied_doc()
    doc["coupling"] = {**doc["coupling"], "scheme": scheme}
    if iteration:
        doc["coupling"]["iteration"] = {**doc["coupling"].get("iteration", {}), **iteration}
    doc.pop("rules", None)
    if method is not None:
        doc["thermal"] = {key: value for key, value in doc["thermal"].items() if key not in ("theta", "increments")}
        doc["thermal"]["method"] = method
    return replace(scene, doc=doc)


def tightly_iterated(scene: Scene, share: float, **iteration: Any) -> Scene:
    """The scene with every window iterated until it agrees to a share of the default tolerances.

    The tolerance of a quantity is a floor and a part of its change; both are multiplied.
    """
    tolerance = {name: {key: share * value for key, value in default.items()}
                 for name, default in Tolerances().model_dump().items()}
    return with_scheme(scene, "iterated", max_iterations=60, tolerance=tolerance, **iteration)
