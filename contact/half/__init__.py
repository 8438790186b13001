"""What every half is made of; a half of another package imports these names from here (docs/write_a_half.md).

>>> from contact.half import ContactSurfaces, Discard, Done, Variable, build_main
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from contact.half.moved import alias_moved

if TYPE_CHECKING:
    from contact.half.build import build_fmu
    from contact.half.build import main as build_main
    from contact.half.contact_client import ContactRefusedError, ContactSurfaces, History
    from contact.half.functions import Field, Property, Signal, field_from, property_from, signal_from
    from contact.half.interface import Interface, Pair, read_interface, write_interface
    from contact.half.linalg import SingularMatrixError, factorise
    from contact.half.model import Discard, Done, HalfModel, Link, Load, Outputs, Value, Values, Variable
    from contact.half.start import start_temperatures
    from contact.laws import Law, gap_factor, parse_law
    from contact.messages import Couplings, Facing, Tractions
    from contact.problem.errors import read as read_problem
    from contact.problem.mechanical import ForeignMechanical
    from contact.problem.thermal import ForeignThermal
    from contact.rpc.calls import LinkError
    from contact.rpc.link import open_link

__all__ = ["ContactRefusedError", "ContactSurfaces", "Couplings", "Discard", "Done", "Facing", "Field",
           "ForeignMechanical", "ForeignThermal", "HalfModel",
           "History", "Interface", "Law", "Link", "LinkError", "Load", "Outputs", "Pair", "Property", "Signal",
           "SingularMatrixError", "Tractions", "Value", "Values", "Variable", "build_fmu", "build_main", "factorise",
           "field_from", "gap_factor", "open_link", "parse_law", "property_from", "read_interface", "read_problem",
           "signal_from", "start_temperatures",
           "write_interface"]

_HOME = {
    "contact.half.build": ("build_fmu", "build_main"),
    "contact.half.contact_client": ("ContactRefusedError", "ContactSurfaces", "History"),
    "contact.half.functions": ("Field", "Property", "Signal", "field_from", "property_from", "signal_from"),
    "contact.half.interface": ("Interface", "Pair", "read_interface", "write_interface"),
    "contact.half.linalg": ("SingularMatrixError", "factorise"),
    "contact.half.model": ("Discard", "Done", "HalfModel", "Link", "Load", "Outputs", "Value", "Values", "Variable"),
    "contact.half.start": ("start_temperatures",),
    "contact.laws": ("Law", "gap_factor", "parse_law"),
    "contact.messages": ("Couplings", "Facing", "Tractions"),
    "contact.problem.errors": ("read_problem",),
    "contact.problem.mechanical": ("ForeignMechanical",),
    "contact.problem.thermal": ("ForeignThermal",),
    "contact.rpc.calls": ("LinkError",),
    "contact.rpc.link": ("open_link",),
}
_NAMED_THERE = {"build_main": "main", "read_problem": "read"}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}

alias_moved(__name__, field="contact.half.functions", property="contact.half.functions",
            signal="contact.half.functions", sparse="contact.half.linalg", surfaces="contact.half.contact_client")


def __getattr__(name: str) -> object:
    # Names are fetched when first asked for: what imports one module of this folder need not load the others.
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'contact.half' has no attribute {name!r}")
    return getattr(import_module(_MODULE_OF[name]), _NAMED_THERE.get(name, name))
