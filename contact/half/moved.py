"""Modules that have moved: each stays for one version, fetches its names from their new place and warns."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from importlib import import_module
from typing import Any


def moved(old: str, new: str) -> Callable[[str], Any]:
    """Make the `__getattr__` of module `old`, whose names are now in module `new`.

    Each name fetched gives a DeprecationWarning that says where to import it from: the package of `new` where the
    name is one of its public names, else `new` itself.  Raises AttributeError for a name that `new` does not have.
    """
    package = new.rpartition(".")[0]

    def fetch(name: str) -> Any:
        module = import_module(new)
        if name.startswith("__") or not hasattr(module, name):
            raise AttributeError(f"module {old!r} has no attribute {name!r}")
        place = package if name in getattr(sys.modules[package], "__all__", ()) else new
        warnings.warn(f"{old} has moved: import {name} from {place}", DeprecationWarning, stacklevel=2)
        return getattr(module, name)

    return fetch
