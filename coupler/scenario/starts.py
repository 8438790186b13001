"""What bodies start with where another run left it: temperatures at every node, and what taking them over did."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from contact.problem.start import FromFrames
from contact.problem.values import did_you_mean
from coupler.scenario.bodies import FromRun
from coupler.scenario.document import Document, DocumentErrors, Key
from coupler.scenario.earlier_run import EarlierRun, EarlierRunError, earlier_run
from coupler.scenario.mesh import BodyMesh, Floats
from coupler.scenario.schema import ScenarioFile
from coupler.scenario.transfer import BodyNodes, Moved, frames_around, moved


@dataclass(frozen=True)
class TakenStart:
    """A body's start from another run.

    T : (n,) [K] at its nodes.  note : in a sentence, what was done.  source : what a results file keeps of it.
    """

    T: Floats
    note: str
    source: Mapping[str, str | float]


def starts_of(document: Document, file: ScenarioFile, meshes: Mapping[str, BodyMesh],
              found: DocumentErrors) -> dict[str, TakenStart]:
    """Take over what bodies start with, by body; what cannot be taken is noted, and its body left out."""
    runs: dict[Path, EarlierRun] = {}
    taken: dict[str, TakenStart] = {}
    for name, body in file.bodies.items():
        for region, stated in (body.regions or {}).items():
            if isinstance(stated.T0, FromRun):
                found.wrong(("bodies", name, "regions", region, "T0"), "a region starts from another run with its body",
                            "Write {from: ...} at the body's T0; regions that say no T0 of their own follow it.")
        if isinstance(body.T0, FromRun):
            with found.each():
                taken[name] = _taken(document, name, body.T0, meshes[name], runs)
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


def courses_of(document: Document, file: ScenarioFile, meshes: Mapping[str, BodyMesh],
               found: DocumentErrors) -> dict[str, TakenCourse]:
    """Take over the temperatures that bodies are given from other runs, by body; what cannot be taken is noted."""
    taken: dict[str, TakenCourse] = {}
    for i, condition in enumerate(file.thermal.boundary):
        body, spec = condition.body, condition.temperature
        if isinstance(spec, FromFrames) and body is not None and body in meshes:
            with found.each():
                taken[body] = _course(document, body, spec, meshes[body], ("thermal", "boundary", i, "temperature"),
                                      file.coupling.end)
    return taken


def _course(document: Document, name: str, spec: FromFrames, mesh: BodyMesh, key: Key, end: float) -> TakenCourse:
    path, there = run_path(spec, document.path.parent), spec.body or name
    try:
        run = earlier_run(path)
        if there not in run.bodies:
            raise document.error((*key, "body") if spec.body else key, f"{path.name} has no body {there!r}",
                                 did_you_mean(there, run.bodies))
        frames, source = run.course(there), run.mesh_of(there)
        result = moved(np.ascontiguousarray(frames.T), source, BodyNodes(mesh.nodes, mesh.quads, mesh.triangles))
    except (EarlierRunError, ValueError) as exc:
        raise document.error((*key, "from"), str(exc), getattr(exc, "remedy", "")) from exc
    T = np.ascontiguousarray(result.values.T)
    note = (f"body {name} has the temperatures of {spec.path}"
            + (f", body {there}," if there != name else "") + f" from {run.times[0]:.9g} to {run.times[-1]:.9g} s, "
            f"{len(run.times)} frames")
    if end > run.times[-1]:
        note += f"; until the end at {end:.9g} s the last one stays"
    if not result.same:
        note += (f"; on another mesh: interpolated there and back, the values of a node over time change by up to "
                 f"{result.worst:.3g} K (root of the sum of squares)")
    return TakenCourse(run.times, T, note, {"body": name, "from": spec.path, "of": there, "t": "all frames",
                                            "sha256": run.sha256, "outcome": run.outcome, "worst": result.worst})


def run_path(spec: FromRun | FromFrames, folder: Path) -> Path:
    """Where the results file is: paths are relative to the scenario's folder."""
    return (folder / spec.path).resolve()


def _taken(document: Document, name: str, spec: FromRun, mesh: BodyMesh, runs: dict[Path, EarlierRun]) -> TakenStart:
    key: Key = ("bodies", name, "T0")
    path = run_path(spec, document.path.parent)
    try:
        # Several bodies may start from one run: its file is read once.
        run = runs[path] if path in runs else runs.setdefault(path, earlier_run(path))
    except EarlierRunError as exc:
        raise document.error((*key, "from"), str(exc), exc.remedy) from exc
    there = spec.body or name
    if there not in run.bodies:
        at: Key = (*key, "body") if spec.body else key
        raise document.error(at, f"{path.name} has no body {there!r}",
                             did_you_mean(there, run.bodies) + ("" if spec.body else " Say which one: body: NAME."))
    try:
        t = run.time(spec.t)
    except EarlierRunError as exc:
        raise document.error((*key, "t"), str(exc), exc.remedy) from exc
    target = BodyNodes(mesh.nodes, mesh.quads, mesh.triangles)
    try:
        result = moved(run.temperatures(there, t), run.mesh_of(there), target)
    except (EarlierRunError, ValueError) as exc:
        raise document.error((*key, "from"), f"body {there!r} of {path.name} cannot be taken over: {exc}",
                             getattr(exc, "remedy", "")) from exc
    source: dict[str, str | float] = {
        "body": name, "from": spec.path, "of": there, "t": t, "sha256": run.sha256, "outcome": run.outcome,
        "worst": result.worst, "rms": result.rms}
    return TakenStart(result.values, _sentence(name, there, spec.path, t, run, result), source)


def _sentence(name: str, there: str, path: str, t: float, run: EarlierRun, result: Moved) -> str:
    said = f"body {name} starts from {path}" + (f", body {there}," if there != name else "") + f" at {t:.9g} s"
    if run.outcome != "completed":
        said += f" (that run ended early: {run.outcome})"
    between = [f"{run.times[k]:.9g}" for k, _ in frames_around(run.times, t)]
    if len(between) == 2:
        said += f", between its frames at {between[0]} and {between[1]} s"
    if result.same:
        return f"{said}: the mesh is the same, every value as it was"
    said += (f", on another mesh: interpolated there and back, its temperatures change by up to {result.worst:.3g} K "
             f"({result.rms:.3g} K rms)")
    if result.outside:
        said += (f"; {result.outside} node{'s' * (result.outside > 1)} lie{'s' * (result.outside == 1)} up to "
                 f"{result.farthest:.3g} m outside the mesh there and take the value of its edge")
    return said
