"""All bodies in one numbering: the Interface that both halves and the coupler share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import field_from, property_from
from contact.half.interface import Interface, Pair
from coupler.scenario.document import Document, Key, did_you_mean
from coupler.scenario.mesh import Body, BodyMesh, Floats, Ints, MeshError, file_mesh, rectangle_mesh
from coupler.scenario.physics import Axes, ContactForm, ContactPair, Latent, Phases
from coupler.scenario.schema import Geometry, ScenarioFile, TemperatureUnit
from coupler.scenario.values import FieldSum, Polynomial, PropertyTable, SignalTable, Supported, Term

# From what the file says to SI and kelvin: temperatures, signals, properties.

ZERO_CELSIUS = 273.15  # K

Json = Any  # a number, or the table of a signal or property as model.json has it


@dataclass(frozen=True)
class Convert:
    """Knows the file's unit of temperature and its named signals.  Every method raises ScenarioError."""

    document: Document
    file: ScenarioFile

    @property
    def offset(self) -> float:
        """What to add to a temperature of the file to have kelvin."""
        return ZERO_CELSIUS if self.file.units.temperature is TemperatureUnit.DEGC else 0.0

    def kelvin(self, T: float, key: Key) -> float:
        """A temperature of the file in K.  Differences of temperature are never converted."""
        # fault: absolute zero unguarded -> if False: | coupler/test_scenario_errors
        if T + self.offset < 0:
            raise self.document.error(
                key,
                f"{T:g} {self.file.units.temperature.value} is below absolute zero",
                "Check units.temperature (degC or K).",
            )
        # fault: temperatures not converted -> return T | coupler/test_scenario_load
        return T + self.offset

    def signal(self, spec: float | str | SignalTable, key: Key, least: float | None = None) -> Json:
        """A SIGNAL of model.json.  least : no value may be smaller."""
        def check(value: float, at: Key) -> float:
            if least is not None and value < least:
                raise self.document.error(at, f"must not be less than {least:g}, but reaches {value:g}")
            return value

        # fault: every signal shifted to kelvin -> return self._mapped(spec, key, self.kelvin) |
        #   coupler/test_scenario_load
        return self._mapped(spec, key, check)

    def temperature(self, spec: float | str | SignalTable, key: Key) -> Json:
        """A SIGNAL of model.json in K."""
        return self._mapped(spec, key, self.kelvin)

    def field(self, spec: float | str | SignalTable | FieldSum, key: Key, least: float | None = None) -> Json:
        """A FIELD of model.json.  least : no value may be smaller (a sum is checked where it stands: Context)."""
        return self._sum(spec, key) if isinstance(spec, FieldSum) else self.signal(spec, key, least)

    def temperature_field(self, spec: float | str | SignalTable | FieldSum, key: Key) -> Json:
        """A FIELD of model.json in K.  A sum has one term more: what makes kelvin of the file's unit."""
        if not isinstance(spec, FieldSum):
            return self.temperature(spec, key)
        terms = self._sum(spec, key)["terms"]
        # fault: a sum of temperatures left in degC -> return {"terms": [*terms, {"t": self.offset}] if False else
        #   terms} | coupler/test_scenario_thermal
        return {"terms": [*terms, {"t": self.offset}] if self.offset else terms}

    def _sum(self, spec: FieldSum, key: Key) -> Json:
        return {"terms": [self._term(term, (*key, "terms", i)) for i, term in enumerate(spec.terms)]}

    def _term(self, term: Term, key: Key) -> Json:
        profiles = {name: getattr(term, name).model_dump(mode="json") for name in ("x", "y")
                    if getattr(term, name) is not None}
        return {"t": self.signal(term.t, (*key, "t")), **profiles}

    def property(self, spec: float | PropertyTable | Polynomial, key: Key) -> Json:
        """A PROPERTY of model.json, its temperatures in K."""
        if isinstance(spec, PropertyTable):
            return {
                "T": [self.kelvin(T, (*key, "T", i)) for i, T in enumerate(spec.T)],
                "value": list(spec.value),
            }
        if isinstance(spec, Polynomial):
            return {"polynomial": list(spec.polynomial), "T_ref": self.kelvin(spec.T_ref, (*key, "T_ref"))}
        return spec

    def _mapped(self, spec: float | str | SignalTable, key: Key, each: Callable[[float, Key], float]) -> Json:
        if isinstance(spec, str):
            if spec not in self.file.signals:
                raise self.document.error(
                    key, f"there is no signal {spec!r}", did_you_mean(spec, self.file.signals)
                )
            named = self.file.signals[spec]
            if isinstance(named, str):
                raise self.document.error(
                    ("signals", spec), "a signal is a number or a table, not another's name"
                )
            # What is wrong is its use here, so the key stays that of the user, not of the signal.
            return self._table(named, lambda v, i: each(v, key))
        where = ("value",) if isinstance(spec, SignalTable) else ()
        return self._table(spec, lambda v, i: each(v, (*key, *where, *((i,) if where else ()))))

    def _table(self, spec: float | SignalTable, each: Callable[[float, int], float]) -> Json:
        if isinstance(spec, SignalTable):
            return {"t": list(spec.t), "value": [each(v, i) for i, v in enumerate(spec.value)]}
        return each(spec, 0)


def kinks_in(model: Json) -> Iterator[float]:
    """Times [s] of every signal table anywhere in a model."""
    for times in _tables_in(model):
        yield from times


def jumps_in(model: Json) -> Iterator[float]:
    """Times [s] at which a signal anywhere in a model has two values."""
    for times in _tables_in(model):
        yield from (t for t, after in pairwise(times) if t == after)


def _tables_in(model: Json) -> Iterator[list[float]]:
    if isinstance(model, Mapping):
        if "t" in model and "value" in model and len(model["t"]) > 1:
            yield model["t"]
        for inner in model.values():
            yield from _tables_in(inner)
    elif isinstance(model, list):
        for inner in model:
            yield from _tables_in(inner)


# The node set that stands for a named point where no node lies.
NEAREST = ".nearest"


@dataclass(frozen=True)
class Scene:
    """interface : the mesh.  points : name -> (body, (2,) [m]), named places with or without a node."""

    interface: Interface
    points: Mapping[str, tuple[str, Floats]]


def scene_of(document: Document, file: ScenarioFile, convert: Convert) -> Scene:
    """Mesh every body, join them, and pair their surfaces.  Raises ScenarioError."""
    meshes = {name: _mesh(document, name, body) for name, body in file.bodies.items()}
    start = np.concatenate([[0], np.cumsum([len(m.nodes) for m in meshes.values()])])
    surfaces: dict[str, Ints] = {}
    node_sets: dict[str, Ints] = {}
    points: dict[str, tuple[str, Floats]] = {}
    for (body, mesh), first in zip(meshes.items(), start[:-1], strict=True):
        surfaces |= {f"{body}.{s}": (edges + first).astype(np.int32) for s, edges in mesh.surfaces.items()}
        node_sets |= {f"{body}.{s}": (ids + first).astype(np.int32) for s, ids in mesh.node_sets.items()}
        points |= {f"{body}.{s}": (body, at) for s, at in mesh.points.items()}
        for s, at in mesh.points.items():
            if s not in mesh.node_sets:
                distance = np.linalg.norm(mesh.nodes - at, axis=1)
                node_sets[f"{body}.{s}{NEAREST}"] = np.array([first + int(distance.argmin())], dtype=np.int32)
    nodes = np.concatenate([m.nodes for m in meshes.values()])
    _check_radius(document, file, nodes, start)
    interface = Interface(
        geometry=file.geometry.value,
        nodes=nodes,
        bodies=tuple(meshes),
        materials=tuple(b.material for b in file.bodies.values()),
        quads=_joined([m.quads for m in meshes.values()], start),
        quad_body=_owner([m.quads for m in meshes.values()]),
        triangles=_joined([m.triangles for m in meshes.values()], start),
        triangle_body=_owner([m.triangles for m in meshes.values()]),
        surfaces=surfaces,
        node_sets=node_sets,
        pairs=_pairs(document, file, convert, nodes, surfaces),
    )
    return Scene(interface, points)


def surface_key(document: Document, known: Mapping[str, Any], name: str, key: Key) -> str:
    """The name if such a surface exists.  Raises ScenarioError saying which do."""
    if name not in known:
        raise document.error(key, f"there is no surface {name!r}", did_you_mean(name, known))
    return name


def _mesh(document: Document, name: str, body: Body) -> BodyMesh:
    try:
        if body.mesh.rectangle is not None:
            return rectangle_mesh(body.mesh.rectangle)
        assert body.mesh.file is not None
        return file_mesh(body.mesh.file, document.path.parent)
    except MeshError as exc:
        raise document.error(("bodies", name, "mesh", *exc.at), f"body {name!r}: {exc}", exc.remedy) from exc


def _joined(parts: list[Ints], start: NDArray[np.integer]) -> Ints:
    return np.concatenate([p + first for p, first in zip(parts, start[:-1], strict=True)]).astype(np.int32)


def _owner(parts: list[Ints]) -> Ints:
    return np.repeat(np.arange(len(parts)), [len(p) for p in parts]).astype(np.int32)


def _check_radius(document: Document, file: ScenarioFile, nodes: Floats, start: NDArray[np.integer]) -> None:
    if file.geometry is not Geometry.AXISYMMETRIC:
        return
    for name, a, b in zip(file.bodies, start[:-1], start[1:], strict=True):
        if (nodes[a:b, 0] < 0).any():
            raise document.error(
                ("bodies", name, "mesh"),
                f"body {name!r} reaches to the left of the axis r = 0",
                "In axisymmetric geometry x is the radius.",
            )


def _pairs(
    document: Document,
    file: ScenarioFile,
    convert: Convert,
    nodes: Floats,
    surfaces: Mapping[str, Ints],
) -> tuple[Pair, ...]:
    pairs: list[Pair] = []
    for name, pair in file.contact.items():
        slave = surface_key(document, surfaces, pair.slave, ("contact", name, "slave"))
        master = surface_key(document, surfaces, pair.master, ("contact", name, "master"))
        if slave != master and np.intersect1d(surfaces[slave], surfaces[master]).size:
            raise document.error(("contact", name, "master"), f"{slave} and {master} have nodes in common",
                                 "The two sides of a pair must not meet in a node; a surface that folds onto itself "
                                 "is both its slave and its master.")
        for other in pairs:
            if {other.slave, other.master} == {slave, master}:
                raise document.error(
                    ("contact", name), f"the pair {other.name!r} already joins {slave} and {master}"
                )
        eps_N = _penalty(document, file, convert, name, nodes, surfaces)
        # fault: friction of a scenario lost on the way -> pairs.append(Pair(name, slave, master, pair.gap_max, eps_N,
        #   eps_T=_stick(pair), | coupler/test_scenario_contact
        # fault: stiffness of sticking lost on the way -> pairs.append(Pair(name, slave, master, pair.gap_max, eps_N,
        #   mu=pair.mu, | coupler/test_scenario_contact
        pairs.append(Pair(name, slave, master, pair.gap_max, eps_N, mu=pair.mu, eps_T=_stick(pair),
                          two_pass=pair.two_pass, by_node=pair.form is ContactForm.NODES))
    return tuple(pairs)


def _stick(pair: ContactPair) -> float:
    """eps_T [Pa/m], 0 for that of the penalty."""
    return 0.0 if pair.friction is None or pair.friction.stick == "auto" else float(pair.friction.stick)


def _penalty(document: Document, file: ScenarioFile, convert: Convert, name: str, nodes: Floats,
             surfaces: Mapping[str, Ints]) -> float:
    """eps_N [Pa/m]: as given, or E/h with h the mean slave edge and E the smaller of the bodies' at their T0.

    A pair of which a body has no E needs none: no half solves for its stress.
    """
    pair = file.contact[name]
    if pair.penalty != "auto":
        return float(pair.penalty)
    stiffness = []
    for surface in (pair.slave, pair.master):
        body = file.bodies[surface.split(".")[0]]
        material = file.materials.get(body.material)
        if material is None or material.E is None:
            return 0.0
        T0 = convert.kelvin(body.T0, ("bodies", surface.split(".")[0], "T0"))
        E = property_from(convert.property(material.E, ("materials", body.material, "E")))
        stiffness.append(float(E(np.array([T0]))[0]))
    ends = nodes[surfaces[pair.slave]]
    h = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())
    if min(stiffness) <= 0:
        raise document.error(("contact", name, "penalty"), "E is not positive at T0, so E/h is no penalty",
                             "State the penalty as a number [Pa/m].")
    # fault: penalty from the stiffer body -> return max(stiffness) / h | coupler/test_scenario_load
    return min(stiffness) / h


# Data of a material as model.json has them: SI, kelvin, radians.

def datum(convert: Convert, spec: float | PropertyTable | Polynomial | Phases | Axes | Latent, key: Key) -> Json:
    """A PROPERTY, PHASED, CONDUCTIVITY or latent heat of model.json.  Raises ScenarioError below 0 K."""
    if isinstance(spec, Phases):
        return {name: convert.property(getattr(spec, name), (*key, name)) for name in ("solid", "liquid")}
    if isinstance(spec, Axes):
        return {**{name: datum(convert, getattr(spec, name), (*key, name)) for name in ("k_1", "k_2")},
                # fault: degrees taken for radians -> "angle": spec.angle, "turns": spec.turns} |
                #   coupler/test_scenario_thermal
                "angle": radians(spec.angle), "turns": spec.turns}
    if isinstance(spec, Latent):
        keys = ("T_m", "T_m") if spec.T_m is not None else ("T_s", "T_l")
        T_s, T_l = (convert.kelvin(T, (*key, name)) for T, name in zip(spec.limits, keys, strict=True))
        # fault: latent heat halved on its way to the half -> return {"L": 0.5 * spec.L, "T_s": T_s, "T_l": T_l} |
        #   thermal_fmu/test_thermal_fmu
        return {"L": spec.L, "T_s": T_s, "T_l": T_l}
    return convert.property(spec, key)


def properties_of(datum: Json, key: Key) -> Iterator[tuple[Key, Json]]:
    """Every PROPERTY inside a datum of model.json, with its key."""
    parts = [n for n in ("solid", "liquid", "k_1", "k_2") if isinstance(datum, Mapping) and n in datum]
    for name in parts:
        yield from properties_of(datum[name], (*key, name))
    if not parts:
        yield key, datum


# What the writers of both models share: looking up names, places and materials of one scenario.

Model = dict[str, Json]
FORMAT = 1  # of model.json


@dataclass(frozen=True)
class Context:
    """One scenario, checked for its form and meshed."""

    document: Document
    file: ScenarioFile
    convert: Convert
    scene: Scene

    @property
    def interface(self) -> Interface:
        return self.scene.interface

    def common(self, boundary: Supported, key: Key) -> Model:
        """Where a condition stands, and its name if it has one."""
        return {"on": self.where(boundary, key), **({"name": boundary.name} if boundary.name else {})}

    def where(self, boundary: Supported, key: Key) -> str:
        """The surface or node set a condition stands on.  Raises ScenarioError where it does not exist."""
        if boundary.on is not None:
            return surface_key(self.document, self.interface.surfaces, boundary.on, (*key, "on"))
        name = boundary.where
        if name in self.interface.node_sets:
            return name
        if name + NEAREST in self.interface.node_sets:
            return name + NEAREST
        raise self.document.error((*key, "at"), f"there is no point {name!r}",
                                  did_you_mean(name, self.interface.node_sets))

    def temperatures(self, spec: Any, key: Key, on: str) -> Json:
        """A FIELD in K on a surface or node set.  Raises ScenarioError where it is below 0 K at a node of it."""
        field = self.convert.temperature_field(spec, key)
        if isinstance(spec, FieldSum) and (T := self._least(field, on)) < 0.0:
            raise self.document.error(
                (*key, "terms"), f"the sum reaches {T - self.convert.offset:g} {self.file.units.temperature.value} on "
                f"{on}, which is below absolute zero", "A sum of temperatures needs a constant term, such as {t: 20}.")
        return field

    def not_negative(self, spec: Any, key: Key, on: str) -> Json:
        """A FIELD that must not be negative.  Raises ScenarioError where it is, at a node of a surface."""
        field = self.convert.field(spec, key, least=0.0)
        if isinstance(spec, FieldSum) and (value := self._least(field, on)) < 0.0:
            raise self.document.error((*key, "terms"), f"must not be less than 0, but reaches {value:g} on {on}")
        return field

    def _least(self, field: Json, on: str) -> float:
        """The smallest value of a FIELD at the nodes of a place in the reference, at any time."""
        known = field_from(field)
        sets = self.interface.surfaces if on in self.interface.surfaces else self.interface.node_sets
        x = self.interface.nodes[np.unique(sets[on])]
        # Linear in time between the times of its signals, so the smallest value is at one of them.
        times = np.unique(np.concatenate([s.t for s in known.signals]))
        # fault: fields below zero not looked for -> return min(float(known.at(x, t, side).min()) for t in times[:0] for
        #   side in (-1, 1)) if False else 0.0 | coupler/test_scenario_thermal
        return min(float(known.at(x, t, side).min()) for t in times for side in (-1, 1))

    def names_once(self, boundary: Sequence[Supported], place: Key) -> None:
        """Each name once, for it becomes an input of the half.  Raises ScenarioError."""
        seen: dict[str, int] = {}
        for i, b in enumerate(boundary):
            if b.name is not None and seen.setdefault(b.name, i) != i:
                raise self.document.error(
                    (*place, i, "name"),
                    f"the name {b.name!r} is already that of entry {seen[b.name]}",
                    "Each named condition is one input load.<name>.",
                )

    def known_only(self, given: Iterable[str], known: Mapping[str, Any], key: Key, what: str) -> None:
        """Every given name is known.  Raises ScenarioError."""
        for name in given:
            if name not in known:
                raise self.document.error(
                    (*key, name), f"there is no {what} {name!r}", did_you_mean(name, known)
                )

    def no_options(self, role: str, options: Mapping[str, Any]) -> None:
        """Options under one of our own halves would be ignored, so they are an error."""
        if options:
            raise self.document.error((role, "options"), "options are for halves of other packages",
                                      "Our own halves have keys of their own.")

    def materials(self, kind: str, needs: Sequence[str], also: Sequence[str] = ()) -> Model:
        """The materials in use, with what a half needs of them, and also these where given.

        Raises ScenarioError where something needed is missing.
        """
        used = dict.fromkeys(b.material for b in self.file.bodies.values())
        for name in used:
            missing = [key for key in needs if getattr(self.file.materials[name], key) is None]
            if missing:
                raise self.document.error(
                    ("materials", name),
                    f"material {name!r} lacks {', '.join(missing)}, which the half {kind!r} needs",
                    "Add them, in SI.",
                )
        return {name: self.material(name, (*needs, *also)) for name in used}

    def material(self, name: str, keys: Iterable[str]) -> Model:
        """The given ones of these data, properties of temperature in K."""
        material, at = self.file.materials[name], ("materials", name)
        given = {key: getattr(material, key) for key in keys if getattr(material, key) is not None}
        return {key: self.convert.kelvin(value, (*at, key)) if key == "T_ref" else
                datum(self.convert, value, (*at, key)) for key, value in given.items()}
