"""Modules that have moved: each can be imported for one version more, fetches its names from their new place and warns.

They have no files: a package names those of its own when it is imported itself, which is before any of them is.
"""

from __future__ import annotations

import sys
import warnings
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

MOVED: dict[str, str] = {}
"""Old name -> new name, of all packages imported so far."""


class MovedModule(ModuleType):
    """A module whose names are now in another.

    Each name fetched gives a DeprecationWarning that says where to import it from: the package of the new module where
    the name is one of its public names, else the new module itself.  Raises AttributeError for a name it does not have.
    """

    def __getattr__(self, name: str) -> Any:
        new = MOVED[self.__name__]
        module = import_module(new)
        if name.startswith("__") or not hasattr(module, name):
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        package = new.rpartition(".")[0]
        place = package if name in getattr(sys.modules[package], "__all__", ()) else new
        warnings.warn(f"{self.__name__} has moved: import {name} from {place}", DeprecationWarning, stacklevel=2)
        return getattr(module, name)


def alias_moved(package: str, **new: str) -> None:
    """Let modules of a package that moved be imported still: NAME="its.new.place"."""
    for name, place in new.items():
        old = f"{package}.{name}"
        MOVED[old] = place
        module = MovedModule(old)
        module.__spec__ = ModuleSpec(old, None)
        sys.modules[old] = module
        setattr(sys.modules[package], name, module)
