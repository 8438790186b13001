"""From a half's directory (interface.h5, model.json) to its FMU."""

from __future__ import annotations

import hashlib
import importlib
import json
import os
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pythonfmu

from contact.compiled import interpret
from contact.half import entry, papers
from contact.half.interface import Interface
from contact.half.layout import block_table, layout_of, model_description, standard_variables
from contact.half.layout3 import model_description_3
from contact.half.model import load_directory

_ENTRY = '''\
import half_entry_{tag} as entry

entry.keep_alive(globals())
HalfSlave, load = entry.half({load!r}, {packages!r})


class {identifier}(HalfSlave):
    identity = {guid!r}
    packages = {packages!r}
    load = staticmethod(load)
'''
# The wrapper of pythonfmu3 looks for a class whose bases name Fmi3Slave; it runs the script once.
_ENTRY_3 = '''\
import half_entry_{tag} as entry

Fmi3Slave, load = entry.half({load!r}, {packages!r}, 3)


class {identifier}(Fmi3Slave):
    identity = {guid!r}
    packages = {packages!r}
    load = staticmethod(load)
'''
# Fixed, so that equal contents make equal files.
_ZIP_TIME = (1980, 1, 1, 0, 0, 0)


def build_fmu(directory: Path, out: Path, *, package: str, load: str | Mapping[str, str],
              uses: Sequence[str] = (), fmi: int = 2) -> Path:
    """Build the FMU of the half in `directory`, whole or not at all.

    package : top-level import package of the half.  load : "module:function" of it, a contact.half.model.Load; of a
    package with several halves one for each `half` of model.json.  uses : other import packages that it is made of, as
    thermal_fmu, which travel with it.  fmi : 2, or 3 (arrays; the wrapper is that of pythonfmu3).
    Returns out.  Raises ValueError where the directory's files do not make a half, or there is no wrapper.
    """
    wrapper = _wrapper_of(fmi)
    interface, model = load_directory(directory)
    if not isinstance(load, str):
        if (half := str(model.get("half"))) not in load:
            raise ValueError(f"model.json: half must be one of {', '.join(load)}, not {half}")
        load = load[half]
    packages = {name: entry.sources_hash(package_directory(name)) for name in ("contact", *uses, package)}
    module, _, function = load.partition(":")
    half = getattr(importlib.import_module(module), function)(interface, model)
    needs = papers.requirements({name: package_directory(name) for name in packages}, {*packages, "pythonfmu"})
    origin = papers.origin_of(package)
    version = [] if fmi == 2 else [f"FMI {fmi}", _version(wrapper)]
    # fault: FMUs with other requirements inside have one name -> guid = content_hash(interface, model, packages) |
    #   contact/test_half_build
    guid = content_hash(interface, model, packages, [*needs, origin.name, origin.version, origin.license, *version])
    kind = "".join(c if c.isalnum() else "_" for c in str(model.get("half", package)))
    identifier = f"{kind}_half_{guid[:8]}"
    standard = standard_variables(interface, " ".join(f"{k}:{v}" for k, v in packages.items()))
    layout = layout_of(half.variables, standard)
    tool = f"{'PythonFMU' if fmi == 2 else 'PythonFMU3'} {_version(wrapper)} (Slideline)"
    describe = model_description if fmi == 2 else model_description_3
    xml = describe(layout, identifier, guid, tool, f"{kind} half", origin.version, origin.license).encode()
    script = (_ENTRY if fmi == 2 else _ENTRY_3).format(tag=guid[:8], load=load, packages=packages,
                                                       identifier=identifier, guid=guid)
    members: dict[str, bytes | Path] = {
        "modelDescription.xml": xml,
        "documentation/index.html": papers.page(layout, f"{kind} half", origin, needs, fmi).encode(),
        "resources/requirements.txt": "".join(f"{need}\n" for need in needs).encode(),
        **({"resources/blocks.json": json.dumps(block_table(layout, xml)).encode()} if fmi == 2 else {}),
        "resources/slavemodule.txt": identifier.encode(),
        f"resources/{identifier}.py": script.encode(),
        f"resources/half_entry_{guid[:8]}.py": Path(entry.__file__),
        "resources/interface.h5": directory / "interface.h5",
        "resources/model.json": directory / "model.json",
        **{f"resources/packages/{name}/{inner}": path
           for name in packages for inner, path in _files(package_directory(name))},
        **_wrapped(identifier, wrapper),
    }
    _write_zip(members, out)
    return out


def main(package: str, load: str | Mapping[str, str], uses: Sequence[str] = ()) -> None:
    """The body of a half's `python -m MODULE DIRECTORY OUT.fmu [--fmi 3]`; exit code 2 and one line on a wrong input.

    package, load, uses : as of build_fmu.
    """
    words, fmi = sys.argv[1:], 2
    if words[2:] == ["--fmi", "3"]:
        words, fmi = words[:2], 3
    if len(words) != 2:
        raise SystemExit(f"usage: python -m {package}.build DIRECTORY OUT.fmu [--fmi 3]")
    interpret()
    try:
        build_fmu(Path(words[0]), Path(words[1]), package=package, load=load, uses=uses, fmi=fmi)
    except ValueError as exc:
        print(exc, file=sys.stderr)
        raise SystemExit(2) from exc


def content_hash(interface: Interface, model: dict[str, Any], packages: dict[str, str],
                 told: Sequence[str] = ()) -> str:
    """32 hex digits that change with anything an FMU's answers depend on.

    told : what else it says of itself, the versions it needs and where it is from.
    """
    digest = hashlib.sha256()

    def add(name: str, value: bytes) -> None:
        digest.update(f"{name}\0{len(value)}\0".encode())
        digest.update(value)

    for field in fields(interface):
        for name, value in _parts(field.name, getattr(interface, field.name)):
            add(name, value)
    versions = {"python": sys.version_info[:3], "pythonfmu": _version(pythonfmu), "numpy": np.__version__}
    add("rest", json.dumps([model, packages, versions, *told], sort_keys=True).encode())
    return digest.hexdigest()[:32]


def package_directory(name: str) -> Path:
    """Directory of an import package.  Raises ValueError if it is not installed, or not a package."""
    found = importlib.util.find_spec(name)
    if found is None or found.origin is None or not found.submodule_search_locations:
        raise ValueError(f"no package {name!r} is installed")
    return Path(found.origin).parent


def _parts(name: str, value: Any) -> Iterator[tuple[str, bytes]]:
    if isinstance(value, np.ndarray):
        yield f"{name} {value.dtype.str} {value.shape}", np.ascontiguousarray(value).tobytes()
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from _parts(f"{name}/{key}", item)
    else:
        yield name, repr(value).encode()


def _files(package: Path) -> Iterator[tuple[str, Path]]:
    for path in sorted(package.rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts and path.suffix != ".pyc":
            yield path.relative_to(package).as_posix(), path


def _wrapper_of(fmi: int) -> Any:
    """The package of the native wrapper.  Raises ValueError where it is not installed."""
    if fmi == 2:
        return pythonfmu
    # fault: without the wrapper of FMI 3.0 a build ends in a traceback -> if False: | contact/test_half_build3
    if importlib.util.find_spec("pythonfmu3") is None:
        raise ValueError("FMI 3.0 needs the package pythonfmu3: pip install 'slideline[fmi3]'")
    return importlib.import_module("pythonfmu3")


def _wrapped(identifier: str, wrapper: Any) -> dict[str, bytes | Path]:
    """pythonfmu's own modules, and the native wrapper of a package under the model's name."""
    home = Path(pythonfmu.__file__).parent
    binaries = Path(wrapper.__file__).parent / "resources" / "binaries"
    modules: dict[str, bytes | Path] = {f"resources/pythonfmu/{p.name}": p for p in sorted(home.glob("*.py"))}
    for path in sorted(binaries.rglob("*")):
        if path.suffix in (".so", ".dll", ".dylib"):
            modules[f"binaries/{path.parent.relative_to(binaries).as_posix()}/{identifier}{path.suffix}"] = path
    return modules


def _version(module: Any) -> str:
    return str(module.__version__)


def _write_zip(members: dict[str, bytes | Path], out: Path) -> None:
    with tempfile.TemporaryDirectory(dir=out.parent, prefix=".fmu-") as scratch:
        new = Path(scratch) / "new.fmu"
        with zipfile.ZipFile(new, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
            for name, content in members.items():
                info = zipfile.ZipInfo(name, _ZIP_TIME)
                info.compress_type = zipfile.ZIP_DEFLATED
                info.external_attr = 0o644 << 16
                archive.writestr(info, content if isinstance(content, bytes) else content.read_bytes())
        os.replace(new, out)
