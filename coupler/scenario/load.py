"""From a file to a checked Scenario."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from contact.half.functions import Signal, signal_from
from coupler.scenario.document import Document, did_you_mean, document_from, read_document, scenario_error
from coupler.scenario.edits import apply_overrides
from coupler.scenario.mesh import mesh_path
from coupler.scenario.models import models
from coupler.scenario.probes import probes_of
from coupler.scenario.rules import rules_of
from coupler.scenario.scenario import Scenario
from coupler.scenario.scene import Context, Convert, scene_of
from coupler.scenario.schema import ScenarioFile
from coupler.scenario.timing import coupling_of, output_of
from coupler.scenario.values import SignalTable, fmu_path


def load_scenario(path: str | Path, overrides: Mapping[str, Any] | None = None) -> Scenario:
    """Read, override, check and mesh a scenario.

    path : the YAML file; meshes are looked for beside it.  overrides : dotted key -> value, put in place of
    the file's own before it is checked, e.g. {"mechanical.half": "rigid", "coupling.windows.3.size": 2.0}.
    Raises ScenarioError, naming file, line, key, value and remedy, for the first thing found wrong.
    """
    return checked(read_document(Path(path)), overrides or {})


def scenario_from(text: str, path: Path, overrides: Mapping[str, Any]) -> Scenario:
    """The scenario of a text that stood in the file `path`; meshes are looked for beside it.  Raises ScenarioError."""
    return checked(document_from(path, text), overrides)


def checked(read: Document, overrides: Mapping[str, Any]) -> Scenario:
    """The scenario of a document with values put in place of its own.  Raises ScenarioError."""
    document = apply_overrides(read, overrides)
    try:
        file = ScenarioFile.model_validate(document.tree)
    except ValidationError as exc:
        raise scenario_error(document, exc) from None
    convert = Convert(document, file)
    signals = _signals(document, file)
    scene = scene_of(document, file, convert)
    context = Context(document, file, convert, scene)
    written = models(context)
    coupling = coupling_of(document, file.coupling, written)
    return Scenario(
        file=document.path,
        text=document.text,
        resolved=document.tree,
        overrides=dict(overrides),
        hash=_hash(document, file),
        title=file.title or document.path.stem,
        temperature_unit=file.units.temperature.value,
        interface=scene.interface,
        signals=signals,
        models=written,
        coupling=coupling,
        probes=probes_of(context),
        rules=rules_of(context, written, coupling.adaptive.least if coupling.adaptive else 0.0),
        output=output_of(document, file.output, coupling.end),
    )


def _signals(document: Document, file: ScenarioFile) -> dict[str, Signal]:
    """The named signals, used or not."""
    signals = {}
    for name, spec in file.signals.items():
        if isinstance(spec, str):
            raise document.error(
                ("signals", name),
                "a signal is a number or a table, not the name of another",
                did_you_mean(spec, set(file.signals) - {name}),
            )
        signals[name] = signal_from(
            {"t": spec.t, "value": spec.value} if isinstance(spec, SignalTable) else spec
        )
    return signals


def _hash(document: Document, file: ScenarioFile) -> str:
    """Of the values, not the text: comments, the order of keys and a study change no result; mesh files and FMUs do."""
    # fault: a study makes another scenario -> values = {key: value for key, value in document.tree.items() if key} |
    #   coupler/test_study_run
    values = {key: value for key, value in document.tree.items() if key != "study"}
    digest = hashlib.sha256(json.dumps(values, sort_keys=True, allow_nan=False).encode())
    for body in file.bodies.values():
        # fault: hash of the text, not of the mesh -> if False: | coupler/test_scenario_mesh
        if body.mesh.file is not None:
            digest.update(
                hashlib.sha256(mesh_path(body.mesh.file, document.path.parent).read_bytes()).digest()
            )
    for kind in (file.thermal.half, file.mechanical.half):
        if (fmu := fmu_path(kind, document.path.parent)) is not None:
            # fault: an FMU named by its path is not part of the scenario's hash -> pass | coupler/test_fmu_by_path
            digest.update(hashlib.sha256(fmu.read_bytes()).digest())
    return digest.hexdigest()[:32]
