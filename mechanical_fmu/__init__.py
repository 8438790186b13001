"""The mechanical halves: `elastic` (finite elements) and `rigid` (prescribed motion), behind FMI.

>>> from mechanical_fmu import MechanicalVolume, mechanical_half

A half of another package that solves for forces inside bodies alone takes these names from here
(docs/write_a_half.md).
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from contact.half.volume import VolumeMesh
    from mechanical_fmu.elastic_half import mechanical_half, mechanical_program_half
    from mechanical_fmu.given import ElasticMaterial, MechanicalVolume
    from mechanical_fmu.program import DisplacementAnswer, ForceTask, MechanicalProgram

__all__ = ["DisplacementAnswer", "ElasticMaterial", "ForceTask", "MechanicalProgram", "MechanicalVolume", "VolumeMesh",
           "mechanical_half", "mechanical_program_half"]

_MODULE_OF = {"mechanical_half": "mechanical_fmu.elastic_half",
              "mechanical_program_half": "mechanical_fmu.elastic_half",
              "DisplacementAnswer": "mechanical_fmu.program", "ForceTask": "mechanical_fmu.program",
              "MechanicalProgram": "mechanical_fmu.program", "MechanicalVolume": "mechanical_fmu.given",
              "ElasticMaterial": "mechanical_fmu.given", "VolumeMesh": "contact.half.volume"}


def __getattr__(name: str) -> object:
    # Names are fetched when first asked for: a module of this package is loaded without all the others.
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'mechanical_fmu' has no attribute {name!r}")
    return getattr(import_module(_MODULE_OF[name]), name)
