"""What the writers of both models share: looking up names, places and materials of one scenario."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from contact.half.field import field_from
from contact.half.interface import Interface
from coupler.scenario.convert import Convert, Json
from coupler.scenario.convert_material import datum
from coupler.scenario.document import Document, Key
from coupler.scenario.quantity import did_you_mean
from coupler.scenario.scene import NEAREST, Scene, surface_key
from coupler.scenario.schema import ScenarioFile
from coupler.scenario.schema_field import FieldSum
from coupler.scenario.schema_halves import Supported

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
