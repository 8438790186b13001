"""The thermal half: 2-D transient heat conduction with contact, behind FMI (physics: Eqs. 1-13, 22).

>>> from thermal_fmu import ThermalVolume, thermal_half

A half of another package that solves for heat inside bodies alone takes these names from here (docs/write_a_half.md).
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from contact.half.volume import VolumeMesh
    from thermal_fmu.half import thermal_half, thermal_program_half
    from thermal_fmu.program import HeatAnswer, HeatTask, ThermalProgram
    from thermal_fmu.volume import ThermalVolume, VolumeMaterial

__all__ = ["HeatAnswer", "HeatTask", "ThermalProgram", "ThermalVolume", "VolumeMaterial", "VolumeMesh", "thermal_half",
           "thermal_program_half"]

_MODULE_OF = {"thermal_half": "thermal_fmu.half", "thermal_program_half": "thermal_fmu.half",
              "HeatAnswer": "thermal_fmu.program", "HeatTask": "thermal_fmu.program",
              "ThermalProgram": "thermal_fmu.program", "ThermalVolume": "thermal_fmu.volume",
              "VolumeMaterial": "thermal_fmu.volume", "VolumeMesh": "contact.half.volume"}


def __getattr__(name: str) -> object:
    # Names are fetched when first asked for: a module of this package is loaded without all the others.
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'thermal_fmu' has no attribute {name!r}")
    return getattr(import_module(_MODULE_OF[name]), name)
