"""What an FMU's entry script needs before any package of ours is loaded.  Standard library only.

A copy of this file travels in every FMU under a name of its own.  All FMUs of a process share one interpreter: the
first `contact` that is loaded serves all of them, so another one is refused, never silently used.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib
import importlib.util
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

# Packages this module has found right, by name.  The wrapper runs an entry script twice and swallows what the second
# run raises: sources edited in between would show as a class without a name.
_right: dict[str, str] = {}
# What a loaded package was when an FMU first asked for it; its files may have been edited since.
LOADED = "_slideline_sources"


def sources_hash(package: Path) -> str:
    """Hash the names and texts of all .py files of a package directory."""
    digest = hashlib.sha256()
    files = sorted((p.relative_to(package).as_posix(), p) for p in package.rglob("*.py"))
    for name, path in files:
        text = path.read_bytes()
        digest.update(f"{name}\0{len(text)}\0".encode())
        digest.update(text)
    return digest.hexdigest()[:16]


def use_packages(packages: Mapping[str, str]) -> None:
    """Load packages (name -> sources_hash): the installed ones where the sources are the same, else the FMU's own.

    The installed ones come first because caches of compiled kernels belong to a file's place: a fresh copy would
    compile again.  Raises RuntimeError if a package of other sources is already loaded.
    """
    own = Path(__file__).parent / "packages"
    for name, expected in packages.items():
        if _right.get(name) == expected:
            continue
        if name in sys.modules:
            loaded = Path(next(iter(sys.modules[name].__path__)))
            # fault: sources edited since they were loaded are taken for those loaded -> was = sources_hash(loaded) |
            #   contact/test_half_build
            was = getattr(sys.modules[name], LOADED, None) or sources_hash(loaded)
            if was != expected:
                raise RuntimeError(
                    f"this process has already loaded another '{name}' (from {loaded}) than the one this FMU was "
                    f"built with: build the FMU again, or run each half in a process of its own")
        elif not _installed_is(name, expected):
            sys.path.insert(0, str(own))
            try:
                importlib.invalidate_caches()
                importlib.import_module(name)
            finally:
                sys.path.remove(str(own))
        setattr(importlib.import_module(name), LOADED, expected)
        _right[name] = expected


def _installed_is(name: str, expected: str) -> bool:
    spec = importlib.util.find_spec(name)
    if spec is None or spec.origin is None:
        return False
    return sources_hash(Path(spec.origin).parent) == expected


def keep_alive(namespace: dict[str, Any]) -> None:
    """Add a reference to an entry script's namespace; to be called each time the script runs.

    pythonfmu's wrapper runs the script once more an instance and then gives up a reference it never had: without
    this the namespace of a script as short as ours is freed under its module, and the second instance crashes.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(namespace))


def half(load: str, packages: Mapping[str, str], fmi: int = 2) -> tuple[type, Callable[..., Any]]:
    """Return the base class of a half's slave, and the half's load function, named "module:function".  fmi : 2 or 3."""
    use_packages(packages)
    base: type = (importlib.import_module("contact.half.slave3").HalfSlave3 if fmi == 3 else
                  importlib.import_module("contact.half.slave").HalfSlave)
    module, _, name = load.partition(":")
    function: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return base, function
