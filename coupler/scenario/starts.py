"""What bodies start with where another run left it: temperatures at every node, and what taking them over did."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from contact.problem.start import FromFrames
from coupler.scenario.bodies import FromRun
from coupler.scenario.document import DocumentErrors, Key
from coupler.scenario.earlier_bodies import EarlierRuns, meshes_sentence
from coupler.scenario.mesh import BodyMesh, Floats
from coupler.scenario.schema import ScenarioFile
from coupler.scenario.transfer import moved


@dataclass(frozen=True)
class TakenStart:
    """A body's start from another run.

    T : (n,) [K] at its nodes.  note : in a sentence, what was done.  source : what a results file keeps of it.
    """

    T: Floats
    note: str
    source: Mapping[str, str | float]


def starts_of(runs: EarlierRuns, file: ScenarioFile, meshes: Mapping[str, BodyMesh],
              found: DocumentErrors) -> dict[str, TakenStart]:
    """Take over what bodies start with, by body; what cannot be taken is noted, and its body left out."""
    taken: dict[str, TakenStart] = {}
    for name, body in file.bodies.items():
        for region, stated in (body.regions or {}).items():
            if isinstance(stated.T0, FromRun):
                found.wrong(("bodies", name, "regions", region, "T0"), "a region starts from another run with its body",
                            "Write {from: ...} at the body's T0; regions that say no T0 of their own follow it.")
        if isinstance(body.T0, FromRun):
            with found.each():
                taken[name] = _taken(runs, name, body.T0, meshes[name])
    return taken


@dataclass(frozen=True)
class TakenCourse:
    """A body's temperatures from another run, over time.

    t : (n_t,) [s].  T : (n_t, n) [K] at its nodes.  note, source : as of a TakenStart.
    """

    t: Floats
    T: Floats
    note: str
    source: Mapping[str, str | float]


def courses_of(runs: EarlierRuns, file: ScenarioFile, meshes: Mapping[str, BodyMesh],
               found: DocumentErrors) -> dict[str, TakenCourse]:
    """Take over the temperatures that bodies are given from other runs, by body; what cannot be taken is noted."""
    taken: dict[str, TakenCourse] = {}
    for i, condition in enumerate(file.thermal.boundary):
        body, spec = condition.body, condition.temperature
        if isinstance(spec, FromFrames) and body is not None and body in meshes:
            with found.each():
                taken[body] = _course(runs, body, spec, meshes[body], ("thermal", "boundary", i, "temperature"),
                                      file.coupling.end)
    return taken


def _course(runs: EarlierRuns, name: str, spec: FromFrames, mesh: BodyMesh, key: Key, end: float) -> TakenCourse:
    body = runs.body(name, spec, key)
    t = body.run.times
    with runs.refused((*key, "from")):
        frames = body.run.course(body.there)
        result = moved(np.ascontiguousarray(frames.T), body.run.mesh_of(body.there), mesh.nodes_and_cells)
    note = f"body {name} has the temperatures of {body.named} from {t[0]:.9g} to {t[-1]:.9g} s, {len(t)} frames"
    if end > t[-1]:
        note += f"; until the end at {end:.9g} s the last one stays"
    if not result.same:
        note += (f"; on another mesh: interpolated there and back, the values of a node over time change by up to "
                 f"{result.worst:.3g} K (root of the sum of squares)")
    return TakenCourse(t, np.ascontiguousarray(result.values.T), note, body.record("all frames", result))


def _taken(runs: EarlierRuns, name: str, spec: FromRun, mesh: BodyMesh) -> TakenStart:
    key: Key = ("bodies", name, "T0")
    body = runs.body(name, spec, key)
    t = runs.time(body, spec, key)
    with runs.refused((*key, "from"), body):
        result = moved(body.run.temperatures(body.there, t), body.run.mesh_of(body.there), mesh.nodes_and_cells)
    note = body.begins("starts from", t) + meshes_sentence(result, "its temperatures", "K")
    return TakenStart(result.values, note, body.record(t, result) | {"rms": result.rms})
