"""One scenario while it is checked."""

from __future__ import annotations

from dataclasses import dataclass

from contact.half.interface import Interface
from coupler.scenario.document import Document, DocumentErrors
from coupler.scenario.scene import Scene
from coupler.scenario.schema import ScenarioFile
from coupler.scenario.si import ToSI


@dataclass(frozen=True)
class Context:
    """One scenario, checked for its form, in SI and meshed.  found : what is wrong with it so far."""

    document: Document
    file: ScenarioFile
    convert: ToSI
    scene: Scene
    found: DocumentErrors

    @property
    def interface(self) -> Interface:
        return self.scene.interface
