"""A checked scenario, all a run needs in SI and kelvin, and how a file becomes one."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from contact.half.functions import Signal, signal_from
from contact.half.interface import Interface, write_interface
from contact.problem.errors import UNKNOWN, Wrong, meant, wrongs
from contact.problem.part import Part
from contact.problem.thermal import ThermalProblem
from contact.problem.values import SignalName, did_you_mean
from coupler.errors import ScenarioError, together
from coupler.scenario.conditions import ConditionOutput, condition_outputs
from coupler.scenario.document import (
    Document,
    DocumentErrors,
    Key,
    document_from,
    dotted,
    read_document,
    scenario_error,
)
from coupler.scenario.frozen_entropy import frozen_entropy_wrong, held_capacity, lost_heat
from coupler.scenario.kinds import OWN, REPLAY, check_kind, fmu_path, understood_by
from coupler.scenario.mesh import mesh_path
from coupler.scenario.notes import contact_notes, mean_T0, scaled_temperatures, sign_notes, thermal_notes
from coupler.scenario.own_mesh import OwnMesh, own_mesh_of
from coupler.scenario.plausible import unlikely, unlikely_text
from coupler.scenario.plausible_flow import unlikely_creep
from coupler.scenario.plausible_laws import unlikely_laws
from coupler.scenario.plausible_loads import unlikely_loads
from coupler.scenario.probes import Probe, probe_notes, probes_of
from coupler.scenario.problems import problem_of
from coupler.scenario.quantities import with_overrides, with_plain_numbers
from coupler.scenario.recordings import TakenRecording, recordings_of, with_recording
from coupler.scenario.rule_model import Drive, Give, Rule
from coupler.scenario.rules import rules_of
from coupler.scenario.scales import loose_iterations, scaled, scales_of
from coupler.scenario.scene import Context, Scene, scene_of
from coupler.scenario.schema import ScenarioFile
from coupler.scenario.several import Several, several_of, several_wrongs
from coupler.scenario.si import ToSI
from coupler.scenario.starts import TakenCourse, TakenStart
from coupler.scenario.stated import NEAREST, Stated
from coupler.scenario.timing import CouplingOptions, Output, coupling_of, moves_on, output_of
from coupler.scenario.understood import CONSTANT
from coupler.scenario.unit_system import UnitSystem
from coupler.scenario.versions import notice, with_old_defaults
from coupler.scenario.warm import TakenMechanics
from coupler.scenario.wrongs import wrongs_of

Taken = TakenStart | TakenCourse | TakenMechanics | TakenRecording


@dataclass(frozen=True, eq=False)
class Scenario:
    """file : where it was read.  text : the file as it stood.  resolved : its values with overrides applied.

    overrides : dotted key -> what stands there instead of the file's own.
    hash : of resolved and of the mesh files, so it changes when anything does that results depend on.
    temperature_unit : "degC" or "K", for display; everything here is in kelvin but resolved.
    interface : mesh, surfaces and pairs.  signals : the named ones, in the units of the file.
    models : "thermal" and "mechanical" -> model.json (docs/design.md).
    conditions : by name, those whose heat or force a half of this package gives out.
    starts : what bodies took over from other runs.
    stated : what the file states, checked; materials, bodies, contact and halves in SI.
    recordings : role -> what a half `replay` plays.
    own_meshes : role -> the mesh of its half's own; without those that have the scene's.
    units : of the file's plain numbers where they are not SI; None where they are.
    """

    file: Path
    text: str
    resolved: Mapping[str, Any]
    overrides: Mapping[str, Any]
    hash: str
    title: str
    temperature_unit: str
    interface: Interface
    signals: Mapping[str, Signal]
    models: Mapping[str, Mapping[str, Any]]
    coupling: CouplingOptions
    probes: Mapping[str, Probe]
    output: Output
    rules: tuple[Rule, ...] = ()
    version_notes: tuple[str, ...] = ()
    starts: Mapping[str, Taken] = field(default_factory=dict)
    stated: ScenarioFile | None = None
    conditions: Mapping[str, ConditionOutput] = field(default_factory=dict)
    recordings: Mapping[str, TakenRecording] = field(default_factory=dict)
    own_meshes: Mapping[str, OwnMesh] = field(default_factory=dict)
    units: UnitSystem | None = None

    def __repr__(self) -> str:
        """Three lines: a field array of the mesh would be pages."""
        i, n = self.interface, len(self.interface.pairs)
        return (f"Scenario {self.title!r} ({self.file.name})\n"
                f"  {self.geometry}, bodies {', '.join(i.bodies)}; {len(i.nodes)} nodes, "
                f"{len(i.quads) + len(i.triangles)} cells, {n} contact pair{'' if n == 1 else 's'}\n"
                f"  halves {self.thermal_half} and {self.mechanical_half}, {self.coupling.scheme.value}, to t = "
                f"{self.coupling.end:g} s; probes {', '.join(self.probes) or 'none'}")

    @property
    def geometry(self) -> str:
        """"plane" or "axisymmetric"."""
        return self.interface.geometry

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know though it is no error: conditions moved to a node, bodies that overlap, pairs that
        face nothing, laws that do not join, radiation that is missing or counted twice, numbers of unlikely size."""
        found = [*self.version_notes, *(start.note for start in self.starts.values())]
        found += [note for own in self.own_meshes.values() for note in own.notes]
        for role, model in self.models.items():
            mesh = self.interface_of(role)
            for boundary in model.get("boundary", ()):
                name = str(boundary.get("at", ""))
                if name.endswith(NEAREST):
                    x, y = mesh.nodes[mesh.node_sets[name][0]]
                    found.append(f"no node lies at {name.removesuffix(NEAREST)}: the nearest one, "
                                 f"at ({x:.6g}, {y:.6g}) m, takes the condition")
        for role, model in self.models.items():
            kind = str(model["half"])
            if self.foreign[role] and fmu_path(kind, self.file.parent) is None and understood_by(
                    kind, self.file.parent) is None:
                found.append(f"the {role} half {kind} does not say what it reads of a scene ({CONSTANT}, "
                             "docs/write_a_half.md): what it leaves out nobody can tell")
        if self.stated is not None:
            found += unlikely(self.stated, self.interface, self.units)
            found += unlikely_loads(self.stated, self.units)
            found += unlikely_laws(self.stated, self.units)
            found += unlikely_creep(self.stated)
        found += lost_heat(self.models["mechanical"], self.coupling.scheme)
        found += held_capacity(self.models["mechanical"], self.models["thermal"],
                               mean_T0(self.models["thermal"], self.interface))
        found += moves_on(self.models["mechanical"], self.coupling.steady)
        thermal = self.models["thermal"]
        if self.temperature_unit != "K":
            given = [what for rule in self.rules for what in (*rule.do, rule.drive) if isinstance(what, Give | Drive)]
            found += scaled_temperatures(thermal, [g.name for g in given if g.half == "thermal"])
        found += loose_iterations(self.coupling) + probe_notes(self.probes)
        return tuple(found + contact_notes(self.interface, thermal, self.models["mechanical"]) +
                     thermal_notes(thermal, self.interface.pairs, mean_T0(thermal, self.interface)))

    @property
    def mesh_notes(self) -> tuple[str, ...]:
        """Where the meshes let temperatures leave their data; it takes a look at every cell."""
        return tuple(sign_notes(self.interface_of("thermal"), self.models["thermal"]))

    @property
    def thermal_half(self) -> str:
        """Kind of the thermal half."""
        return str(self.models["thermal"]["half"])

    @property
    def mechanical_half(self) -> str:
        """Kind of the mechanical half."""
        return str(self.models["mechanical"]["half"])

    @cached_property
    def several(self) -> Several | None:
        """How the bodies are divided among several thermal halves; None where there is one."""
        if self.stated is None:
            return None
        return several_of(self.stated.thermal, self.interface_of("thermal"), self.models["thermal"])

    def interface_of(self, role: str) -> Interface:
        """Return what the half of a role is built from: `interface`, or that of its own mesh."""
        return self.own_meshes[role].interface if role in self.own_meshes else self.interface

    @property
    def halves(self) -> tuple[str, ...]:
        """All halves: roles, and ROLE.NAME of several in one."""
        thermal = ("thermal",) if self.several is None else tuple(m.name for m in self.several.members)
        return (*thermal, "mechanical")

    @property
    def kinds(self) -> Mapping[str, str]:
        """Each of `halves` -> the kind of half that it is: an entry point, or the path of an FMU."""
        members = {} if self.several is None else {m.name: str(m.model["half"]) for m in self.several.members}
        return {name: members[name] if name in members else str(self.models[name]["half"]) for name in self.halves}

    @property
    def foreign(self) -> Mapping[str, bool]:
        """Role -> whether its half is of another package, or a prebuilt FMU."""
        return {role: str(model["half"]) not in OWN[role].values() for role, model in self.models.items()}

    def write_half(self, name: str, directory: Path) -> str:
        """Write interface.h5 and model.json, from which the half's FMU is built; returns the half's kind.

        name : one of `halves`.  directory : made where it does not exist.
        """
        members = () if self.several is None else self.several.members
        found = [(m.interface, m.model) for m in members if m.name == name]
        interface, told = found[0] if found else (
            with_recording(self.interface_of(name), self.recordings.get(name)), self.models[name])
        directory.mkdir(parents=True, exist_ok=True)
        write_interface(interface, directory / "interface.h5")
        model = json.dumps(told, indent=1, allow_nan=False)
        (directory / "model.json").write_text(model + "\n", encoding="utf-8")
        return str(told["half"])


# From a file to a checked Scenario.

def load_scenario(path: str | Path, overrides: Mapping[str, Any] | None = None) -> Scenario:
    """Read, override, check and mesh a scenario.

    path : the YAML file; meshes are looked for beside it.  overrides : dotted key -> value, put in place of
    the file's own before it is checked, e.g. {"mechanical.half": "rigid", "coupling.windows.3.size": 2.0}.
    Raises ScenarioError, naming file, line, key, value and remedy; its `others` are all else that is wrong.
    """
    return checked(read_document(Path(path)), overrides or {})


def scenario_from(text: str, path: Path, overrides: Mapping[str, Any]) -> Scenario:
    """The scenario of a text that stood in the file `path`; meshes are looked for beside it.  Raises ScenarioError."""
    return checked(document_from(path, text), overrides)


def checked_form(path: Path) -> tuple[Document, ScenarioFile]:
    """Read a scenario and check its form alone, key by key.  Raises ScenarioError."""
    document = with_plain_numbers(read_document(path))
    try:
        return document, ScenarioFile.model_validate(document.tree)
    except ValidationError as exc:
        raise scenario_error(document, exc) from None


def checked(read: Document, overrides: Mapping[str, Any]) -> Scenario:
    """The scenario of a document with values put in place of its own.  Raises ScenarioError."""
    document = with_overrides(read, overrides)
    try:
        return _checked(document, overrides)
    except ScenarioError as exc:
        # fault: a number in a wrong unit is told only after all errors are mended -> odd: list[str] = [] |
        #   coupler/test_scenario_plausible
        odd = unlikely_text(document.tree, document.system)
        for note in odd:
            exc.add_note(f"note: {note}")
        raise


def _errors_of_form(document: Document, error: ValidationError, overrides: Mapping[str, Any]) -> ScenarioError:
    """The error of a file whose form is wrong; where only keys are misspelt, with all that is wrong beside them.

    For that the file is checked again with the keys that were meant.  What then is wrong inside of them, or with the
    mapping around them, may come of the guess and is left out.
    """
    form = scenario_error(document, error)
    found = {w.key: w for w in wrongs(error)}
    if any(w.text != UNKNOWN for w in found.values()):
        return form
    guessed = {(*key[:-1], meant(w)) for key, w in found.items()}
    tree = _as_meant(document.tree, found, ())
    if tree == document.tree:
        return form  # of a key that stands elsewhere in the tree nothing can be guessed
    try:
        _checked(replace(document, tree=tree), overrides)
    except ScenarioError as more:
        around = {dotted(key[:-1]) for key in found}
        inside = tuple(dotted(key) + "." for key in guessed)
        # fault: errors across fields hidden by a misspelt key -> others: list[ScenarioError] = [] |
        #   coupler/test_scenario_errors
        others = [e for e in (more, *more.others) if e.key not in around and not f"{e.key}.".startswith(inside)]
        return together([form, *form.others, *others])
    return form


def _as_meant(node: Any, unknown: Mapping[Key, Wrong], key: Key) -> Any:
    """A tree with the keys that unknown ones were meant to be in their place, or nothing."""
    if isinstance(node, list):
        return [_as_meant(one, unknown, (*key, i)) for i, one in enumerate(node)]
    if not isinstance(node, dict):
        return node
    told = {name: unknown.get((*key, name)) for name in node}
    names = {name: name if wrong is None else meant(wrong) for name, wrong in told.items()}
    return {names[name]: _as_meant(one, unknown, (*key, name)) for name, one in node.items()
            if told[name] is None or (names[name] and names[name] not in node)}


def _checked(document: Document, overrides: Mapping[str, Any]) -> Scenario:
    try:
        file = ScenarioFile.model_validate(document.tree)
    except ValidationError as exc:
        raise _errors_of_form(document, exc, overrides) from None
    notes = notice(file, document.path.name)
    file = with_old_defaults(file)
    found = DocumentErrors(document)
    signals = _signals(document, file, found)
    convert = ToSI(document, file.units.temperature.value, file.signals, found.wrong)
    stated = in_si(file, convert)
    scene = scene_of(document, stated, found)
    meshed = {role: own_mesh_of(document, stated, scene, role, found) for role in OWN}
    own_meshes = {role: own for role, own in meshed.items() if own is not None}
    context = Context(document, stated, convert, scene, found)
    problems = problems_of(context, {role: own.interface for role, own in own_meshes.items()})
    written = {role: problem.plain() for role, problem in problems.items()}
    recordings = recordings_of(document, file, scene.interface, found)
    coupling, output = None, None
    with found.each():
        coupling = scaled(coupling_of(document, file.coupling, written),
                          scales_of(scene.interface, written, file.coupling.end), document)
    if (lack := frozen_entropy_wrong(file, file.coupling.scheme, ("coupling", "scheme"))) is not None:
        found.wrong(lack.key, lack.text, lack.remedy)
    conditions = condition_outputs(written, [p.name for p in scene.interface.pairs])
    probes = probes_of(context, conditions)
    rules = rules_of(context, written, conditions, coupling.adaptive.least if coupling and coupling.adaptive else 0.0)
    with found.each():
        output = output_of(document, file.output, file.coupling.end)
    found.stop()
    assert coupling is not None, "found.stop has raised"
    assert output is not None, "found.stop has raised"
    return Scenario(
        file=document.path,
        text=document.text,
        resolved=document.tree,
        overrides=dict(overrides),
        hash=_hash(document, file, _taken(scene) | recordings),
        title=file.title or document.path.stem,
        temperature_unit=file.units.temperature.value,
        interface=scene.interface,
        signals=signals,
        models=written,
        coupling=coupling,
        probes=probes,
        conditions=conditions,
        rules=rules,
        output=output,
        version_notes=tuple(notes),
        starts=_taken(scene) | recordings,
        stated=stated,
        recordings=recordings,
        own_meshes=own_meshes,
        units=document.system,
    )


def _signals(document: Document, file: ScenarioFile, found: DocumentErrors) -> dict[str, Signal]:
    """The named signals, used or not."""
    signals = {}
    for name, spec in file.signals.items():
        if isinstance(spec, SignalName):
            found.wrong(("signals", name), "a signal is a number or a table, not the name of another",
                        did_you_mean(spec, set(file.signals) - {name}))
        else:
            signals[name] = signal_from(spec)
    return signals


def in_si(file: ScenarioFile, convert: ToSI) -> ScenarioFile:
    """What a file says of bodies, contact and halves, in SI; materials and halves not used stay as they are."""
    own = {role: OWN[role].keys() - {REPLAY} for role in OWN}  # what is told all of a scene needs it in SI
    foreign = {role for role in ("thermal", "mechanical") if getattr(file, role).half not in own[role]}
    used = set(file.materials) if foreign else {part.material for body in file.bodies.values()
                                                     for part in body.parts.values()}
    kind = file.mechanical.half
    chosen = ("elastic", "rigid", "rod") if "mechanical" in foreign else (kind,)
    blocks = {name: convert.part(block, ("mechanical", name)) for name in chosen
              if (block := getattr(file.mechanical, name)) is not None}
    return file.model_copy(update={
        "materials": {n: convert.part(m, ("materials", n)) if n in used else m for n, m in file.materials.items()},
        "bodies": {n: convert.part(b, ("bodies", n)) for n, b in file.bodies.items()},
        "contact": {n: convert.part(p, ("contact", n)) for n, p in file.contact.items()},
        "thermal": convert.part(file.thermal, ("thermal",)),
        "mechanical": file.mechanical.model_copy(update=blocks)})


def problems_of(c: Context, own: Mapping[str, Interface]) -> dict[str, Part]:
    """What each half is told, by role; what is wrong with it is noted.  own : role -> the mesh of its half's own."""
    file = c.file
    kinds = {"thermal": file.thermal.half, "mechanical": file.mechanical.half}
    for role, kind in kinds.items():
        with c.found.each():
            check_kind(c.document, role, kind)
    stated = Stated(file, c.interface, c.convert.unit, c.convert.offset, c.document.path.parent)
    seen = {role: replace(stated, interface=own.get(role, c.interface)) for role in kinds}
    problems = {role: problem_of(seen[role], role, kind) for role, kind in kinds.items()}
    # A pair whose surface is wrong was told there; that it is missing where it is named would send a reader astray.
    # fault: a pair with a wrong surface is told to be missing -> lost = set() | coupler/test_scenario_errors
    lost = file.contact.keys() - {pair.name for pair in c.interface.pairs} if c.found else set()
    for key, text, remedy in wrongs_of(stated, seen, problems):
        if key[-1:] and key[-1] in lost:
            continue
        c.found.wrong(key, text, remedy)
    thermal = problems["thermal"]
    assert isinstance(thermal, ThermalProblem), "every thermal half is told one"
    for name, one in file.thermal.halves.items():
        if one.half is not None:
            with c.found.each():
                check_kind(c.document, "thermal", one.half, ("thermal", "halves", name, "half"))
    for wrong in several_wrongs(file.thermal, seen["thermal"].interface, thermal):
        c.found.wrong(wrong.key, wrong.text, wrong.remedy)
    return problems


def _taken(scene: Scene) -> dict[str, Taken]:
    """All that came from other runs."""
    return {**scene.starts, **{f"{body} over time": course for body, course in scene.courses.items()},
            **{f"{body} mechanics": taken for body, taken in scene.mechanics.items()}}


def _hash(document: Document, file: ScenarioFile, starts: Mapping[str, Taken]) -> str:
    """Of the values, not the text: comments, the order of keys and a study change no result.

    Mesh files, FMUs and the results that bodies start from do.
    """
    # fault: a study makes another scenario -> values = {key: value for key, value in document.tree.items() if key} |
    #   coupler/test_study_run
    values = {key: value for key, value in document.tree.items() if key != "study"}
    digest = hashlib.sha256(json.dumps(_as_numbers(values), sort_keys=True, allow_nan=False).encode())
    for mesh in (*(body.mesh for body in file.bodies.values()), *file.thermal.meshes.values(),
                 *file.mechanical.meshes.values()):
        # fault: hash of the text, not of the mesh -> if False: | coupler/test_scenario_mesh
        if mesh.file is not None:
            digest.update(hashlib.sha256(mesh_path(mesh.file, document.path.parent).read_bytes()).digest())
    for start in starts.values():
        # fault: another run to start from is the same scenario -> pass |
        #   coupler/test_starts_from_runs::test_another_source_is_another_scenario
        digest.update(str(start.source["sha256"]).encode())
    for kind in (file.thermal.half, file.mechanical.half):
        if (fmu := fmu_path(kind, document.path.parent)) is not None:
            # fault: an FMU named by its path is not part of the scenario's hash -> pass | coupler/test_fmu_by_path
            digest.update(hashlib.sha256(fmu.read_bytes()).digest())
    return digest.hexdigest()[:32]


def _as_numbers(value: Any) -> Any:
    """A tree whose numbers are all floats: 2, 2.0 and 2 m are one value."""
    if isinstance(value, dict):
        return {key: _as_numbers(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_as_numbers(one) for one in value]
    # fault: 2 and 2.0 make two scenarios -> return value | coupler/test_scenario_units
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value
