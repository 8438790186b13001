"""A checked scenario: all a run needs, in SI and kelvin."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from contact.half.functions import Signal
from contact.half.interface import Interface, write_interface
from coupler.scenario.notes import contact_notes, thermal_notes
from coupler.scenario.probes import Probe
from coupler.scenario.problems import NEAREST
from coupler.scenario.rule_model import Rule
from coupler.scenario.schema import ScenarioFile
from coupler.scenario.timing import CouplingOptions, Output


@dataclass(frozen=True, eq=False)
class Scenario:
    """file : where it was read.  text : the file as it stood.  resolved : its values with overrides applied.

    overrides : dotted key -> what stands there instead of the file's own.
    hash : of resolved and of the mesh files, so it changes when anything does that results depend on.
    temperature_unit : "degC" or "K", for display; everything here is in kelvin but resolved.
    interface : mesh, surfaces and pairs.  signals : the named ones, in the units of the file.
    models : "thermal" and "mechanical" -> model.json (docs/design.md).
    stated : what the file states, checked; materials, bodies, contact and halves in SI.
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
    stated: ScenarioFile | None = None

    @property
    def geometry(self) -> str:
        """"plane" or "axisymmetric"."""
        return self.interface.geometry

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know though it is no error: conditions moved to a node, bodies that overlap, pairs that
        face nothing, laws that do not join, radiation that is missing or counted twice."""
        found = [*self.version_notes]
        for model in self.models.values():
            for boundary in model.get("boundary", ()):
                name = str(boundary.get("at", ""))
                if name.endswith(NEAREST):
                    x, y = self.interface.nodes[self.interface.node_sets[name][0]]
                    found.append(f"no node lies at {name.removesuffix(NEAREST)}: the nearest one, "
                                 f"at ({x:.6g}, {y:.6g}) m, takes the condition")
        thermal = self.models["thermal"]
        return tuple(found + contact_notes(self.interface, thermal, self.models["mechanical"]) +
                     thermal_notes(thermal, self.interface.pairs))

    @property
    def thermal_half(self) -> str:
        """Kind of the thermal half."""
        return str(self.models["thermal"]["half"])

    @property
    def mechanical_half(self) -> str:
        """Kind of the mechanical half."""
        return str(self.models["mechanical"]["half"])

    def write_half(self, role: str, directory: Path) -> str:
        """Write interface.h5 and model.json, from which the half's FMU is built; returns the half's kind.

        role : "thermal" or "mechanical".  directory : made where it does not exist.
        """
        directory.mkdir(parents=True, exist_ok=True)
        write_interface(self.interface, directory / "interface.h5")
        model = json.dumps(self.models[role], indent=1, allow_nan=False)
        (directory / "model.json").write_text(model + "\n", encoding="utf-8")
        return str(self.models[role]["half"])
