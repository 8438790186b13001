"""What the half `replay` plays: a half's outputs in all frames of another run of the same scene."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.recording import ENERGIES, OUTPUTS, Recording
from coupler.scenario.document import Document, DocumentErrors, Key
from coupler.scenario.earlier_run import MAX_COURSE, EarlierRun, EarlierRunError, dataset, earlier_run, opened
from coupler.scenario.kinds import REPLAY
from coupler.scenario.schema import ScenarioFile

Floats = NDArray[np.float64]

ENDS_AT = 1e-9  # of the end: so much earlier a recording may end
ALL_OF_IT = 1e-6  # of the heat a run made: so well the heat of its frames adds up to it
GROUP = "exchange"  # of a results file: what is told of pair nodes, in every frame
CELLS = ("E_M", "E_S")
WORDS = {"T": "T", "f_s": "solid fraction", "x": "x", "contact.t_N": "contact pressure", "contact.gap": "gap"}


@dataclass(frozen=True)
class TakenRecording:
    """What a half plays.  note : in a sentence, what it is.  source : what a results file keeps of it."""

    recording: Recording
    note: str
    source: Mapping[str, str | float]


def recordings_of(document: Document, file: ScenarioFile, interface: Interface,
                  found: DocumentErrors) -> dict[str, TakenRecording]:
    """Read what the halves `replay` of a scenario play, by role; what is wrong with it is noted."""
    taken: dict[str, TakenRecording] = {}
    for role in OUTPUTS:
        half = getattr(file, role)
        if half.half != REPLAY:
            continue
        if half.replay is None:
            found.wrong((role, "half"), "the half `replay` needs a run to play",
                        f"Add {role}: {{replay: {{from: run.h5}}}}, or --set {role}.replay.from=run.h5.")
            continue
        with found.each():
            taken[role] = _taken(document, role, half.replay.path, interface, file.coupling.end)
    return taken


def _taken(document: Document, role: str, stated: str, interface: Interface, end: float) -> TakenRecording:
    key: Key = (role, REPLAY, "from")
    try:
        run = earlier_run((document.path.parent / stated).resolve())
        with opened(run.path) as f:
            # fault: a run of another scene is played -> pass | coupler/test_replay
            _same_scene(f, run, interface)
            windows = np.asarray(dataset(f, "t", "f", 1)[()], dtype=np.float64)
            made = _made(f, run)
        # fault: a recording that ends early is played on -> if False: | coupler/test_replay
        if run.times[-1] < end * (1.0 - ENDS_AT):
            raise EarlierRunError(f"{run.path.name} ends at {run.times[-1]:.9g} s, this scenario at {end:.9g} s",
                                  f"Set coupling.end={run.times[-1]:.9g}, or run it to the end.")
        outputs = dict(_outputs(run, role, interface))
    except EarlierRunError as exc:
        raise document.error(key, str(exc), exc.remedy) from exc
    lost = [n for n in ENERGIES if role == "mechanical" and made.get(n) and not _is_whole(outputs.get(n), made[n])]
    played = {n: v for n, v in outputs.items() if n not in ENERGIES or (n in made and n not in lost)}
    recording = Recording(run.times, played)
    note = f"the {role} half plays {stated}: {' '.join(_coarse(recording, windows))}"
    if run.outcome != "completed":
        note += f"; that run ended early: {run.outcome}"
    for name in lost:
        note += (f"; the {made[name]:.4g} J of {name} that it made are not played, for its frames tell of less: "
                 "record a frame a window (output.fields.every: 1) with one mechanical substep")
    return TakenRecording(recording, note, {"half": role, "from": stated, "sha256": run.sha256, "outcome": run.outcome})


def _same_scene(f: h5py.File, run: EarlierRun, interface: Interface) -> None:
    """Raises EarlierRunError where a run was of another mesh or of other pairs."""
    known = _told(f, "header", run).get("mesh")
    if not isinstance(known, dict) or GROUP not in f:
        raise EarlierRunError(f"{run.path.name} was written by a version that kept no exchange in it", "Run it again.")
    for name, own, what in (("mesh.hash", interface.mesh_hash, "mesh is not that"),
                            ("surfaces.hash", interface.surfaces_hash, "contact pairs are not those")):
        if known.get(name) != own:
            raise EarlierRunError(f"{run.path.name} is a run of another scene: its {what} of this one ({name} is "
                                  f"{known.get(name)}, here {own})", "Record a run of this scene.")


def _told(f: h5py.File, name: str, run: EarlierRun) -> dict[str, Any]:
    """An attribute of a results file that holds an object of JSON.  Raises EarlierRunError."""
    try:
        found = json.loads(f.attrs[name])
    except (KeyError, TypeError, ValueError):
        found = None
    # fault: totals of a stranger's file end in the error of a list -> if False: | coupler/test_replay
    if not isinstance(found, dict):
        raise EarlierRunError(f"{run.path.name}: {name} is not as this program writes it", "Run it again.")
    return found


def _made(f: h5py.File, run: EarlierRun) -> dict[str, float]:
    """Energy -> what the run made of it in all [J].  Raises EarlierRunError."""
    made = _told(f, "totals", run).get("made", {})
    if not isinstance(made, dict) or not all(isinstance(v, int | float) for v in made.values()):
        raise EarlierRunError(f"{run.path.name}: totals are not as this program writes them", "Run it again.")
    return {str(name): float(value) for name, value in made.items()}


def _is_whole(rows: Floats | None, made: float) -> bool:
    # fault: heat of which frames tell a part is played as if it were all -> return rows is not None |
    #   coupler/test_replay
    return rows is not None and abs(float(rows[1:].sum()) - made) <= ALL_OF_IT * abs(made)


def _coarse(recording: Recording, windows: Floats) -> Iterator[str]:
    """Tell in words how coarse a recording is in time.  windows : (n,) [s], the ends of the windows of that run."""
    t = recording.t
    if t.size < 2:
        yield "one frame, so nothing moves"
        return
    # fault: windows that are not recorded are not told -> every = True | coupler/test_replay
    every = bool(np.isin(windows, t).all())
    yield (f"{t.size} frames to {t[-1]:.9g} s, up to {np.diff(t).max():.6g} s apart, "
           + ("one at the end of each of its windows" if every else f"of its {windows.size - 1} windows: it is too "
              "coarse, output.fields.every: 1 records each") + ".")
    if t.size < 3:
        yield "How far the straight lines between are off nobody can tell"
        return
    off = {n: recording.coarseness(n) for n in WORDS if n in recording.outputs}
    units = {n: unit for of in OUTPUTS.values() for n, unit in of.items()}
    told = [f"{WORDS[n]} {worst:.3g} {units[n]} (at {at:.6g} s)" for n, (worst, at) in off.items() if worst > 0.0]
    yield ("Linear interpolation may be off by about " + ", ".join(told) + " (by leaving out each frame in turn)"
           if told else "All recorded values are linear between frames")


def _outputs(run: EarlierRun, role: str, interface: Interface) -> Iterator[tuple[str, Floats]]:
    """Yield what a run kept of a half's outputs, a row a frame.  Raises EarlierRunError."""
    n, cells, n_q = len(interface.nodes), len(interface.quads) + len(interface.triangles), len(interface.pair_nodes)
    path = run.path.with_name(run.field_files[role])
    with opened(path) as f:
        if role == "thermal":
            yield "T", _rows(f, "VTKHDF/PointData/T", run, n)
            if "f_s" in f["VTKHDF/PointData"]:
                yield "f_s", _rows(f, "VTKHDF/PointData/f_s", run, n)
            return
        yield "x", np.ascontiguousarray(_rows(f, "VTKHDF/Points", run, n, 3)[..., :2])
        for name in CELLS:
            if name in f["VTKHDF/CellData"]:
                yield name, _rows(f, f"VTKHDF/CellData/{name}", run, cells)
    with opened(run.path) as f:
        for name in (name for name in OUTPUTS[role] if name in f[GROUP]):
            yield name, _of(f, f"{GROUP}/{name}", (len(run.times), n_q))


def _rows(f: h5py.File, name: str, run: EarlierRun, n: int, width: int = 0) -> Floats:
    """A field (n_t, n) or (n_t, n, width) of a field file.  Raises EarlierRunError."""
    values = _of(f, name, (n * len(run.times), *((width,) if width else ())))
    return values.reshape(len(run.times), n, *((width,) if width else ()))


def _of(f: h5py.File, name: str, shape: tuple[int, ...]) -> Floats:
    data: Any = dataset(f, name, "f", len(shape))
    if data.shape != shape:
        raise EarlierRunError(f"{Path(f.filename).name}: {name} has shape {data.shape}, not {shape}")
    if data.size > MAX_COURSE:
        raise EarlierRunError(f"{Path(f.filename).name}: {data.size} values of {name} are more than {MAX_COURSE}",
                              "Keep fewer frames (output.fields) in that run.")
    values = np.asarray(data[()], dtype=np.float64)
    if not np.isfinite(values).all():
        raise EarlierRunError(f"{Path(f.filename).name}: {name} is not finite everywhere")
    return values


def with_recording(interface: Interface, taken: TakenRecording | None) -> Interface:
    """Return the interface that a half is told, with what it plays."""
    if taken is None:
        return interface
    return dataclasses.replace(interface, start=interface.start | taken.recording.arrays)
