"""What an FMU carries for its reader: a page about it, and what Python packages it needs.

The wrapper of a Python FMU brings neither Python nor packages: whoever loads it must have both.
"""

from __future__ import annotations

import functools
import os
import re
import sys
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from html import escape
from importlib.metadata import PackageNotFoundError, distributions, entry_points, metadata
from pathlib import Path

from contact.half.layout import Layout

GROUP = "slideline.halves"
UNNAMED = frozenset({"", "UNKNOWN"})
# To parse the sources, and the standard library's list of what is installed, took half of the time of a build.
_IMPORT = re.compile(r"^[ \t]*(?:from[ \t]+(\w[\w.]*)[ \t]+import\b|import[ \t]+(\w[^#;\n]*))", re.MULTILINE)


@dataclass(frozen=True)
class Origin:
    """Of the distribution that a half is from: name, version and license, "" where it does not say."""

    name: str = ""
    version: str = ""
    license: str = ""


def origin_of(package: str) -> Origin:
    """Return what the distribution of an import package says of itself; nothing where it is not installed as one."""
    # First by its entry point: what is installed to be edited lists no packages.
    found = [entry.dist.name for entry in entry_points(group=GROUP)
             if entry.module.partition(".")[0] == package and entry.dist is not None]
    found += installed().get(package, [])
    if not found:
        return Origin()
    about = metadata(found[0])
    told = next((about[key] for key in ("License-Expression", "License") if key in about), "")
    return Origin(found[0], about["Version"], "" if told in UNNAMED else " ".join(told.split())[:80])


def places() -> tuple[tuple[str, int], ...]:
    """Return the folders of sys.path, and when a package was last put into each or taken from it [ns]."""
    return tuple((place, _changed(place)) for place in sys.path)


def _changed(place: str) -> int:
    try:
        # fault: a half that is installed while the program runs stays unknown -> return 0 | coupler/test_halves
        return os.stat(place or os.curdir).st_mtime_ns
    except OSError:
        return 0


def installed() -> Mapping[str, list[str]]:
    """Return the distributions that bring an import package, as importlib.metadata.packages_distributions does."""
    return _installed(places())


@functools.lru_cache(maxsize=1)
def _installed(known: tuple[tuple[str, int], ...]) -> Mapping[str, list[str]]:
    """The distributions that are found in places as they are now: 0.1 s, a quarter of a build."""
    found: dict[str, list[str]] = {}
    for distribution in distributions():
        top = (distribution.read_text("top_level.txt") or "").split()
        # What does not say its packages has a list of its files: numpy/linalg/linalg.py,sha256=...,1234
        tops = top or {line.partition(",")[0].partition("/")[0]
                       for line in (distribution.read_text("RECORD") or "").splitlines()}
        for name in {word.partition(".")[0] for word in tops if not word.endswith(("-info", ".pth"))}:
            if (said := distribution.metadata["Name"]) not in found.setdefault(name, []):
                found[name].append(said)
    return found


def imported(source: str) -> set[str]:
    """Return the top names that lines of a source import; one of its text that reads as an import is taken for one."""
    names: set[str] = set()
    for match in _IMPORT.finditer(source):
        names |= {match[1].partition(".")[0]} if match[1] else {
            part.split()[0].partition(".")[0] for part in match[2].split(",") if part.strip()}
    return names


def requirements(packages: Mapping[str, Path], travels: Collection[str]) -> list[str]:
    """Return `name==version` of every distribution that packages import, as it is installed here.

    packages : import package -> its folder.  travels : what the FMU brings itself.
    """
    names: set[str] = set()
    for folder in packages.values():
        for path in folder.rglob("*.py"):
            # fault: what modules inside of a package import is not told -> names |= set() | contact/test_papers
            names |= imported(path.read_text(encoding="utf-8"))
    known, found = installed(), set()
    for name in names - sys.stdlib_module_names - set(travels):
        for distribution in known.get(name, [])[:1]:
            try:
                found.add(f"{distribution}=={metadata(distribution)['Version']}")
            except PackageNotFoundError:
                continue  # half removed: it cannot be what this build imported
    return sorted(found, key=str.lower)


def page(layout: Layout, title: str, origin: Origin, needs: Collection[str], fmi: int = 2) -> str:
    """Return documentation/index.html: what the FMU is, what it needs, its variables block by block.  fmi : 2 or 3."""
    rows = "\n".join(
        f"<tr><td><code>{escape(v.name)}{_shape(v.shape)}</code></td><td>{v.causality}</td><td>"
        f"{escape(v.unit) if v.kind == 'Real' else v.kind}</td><td>{escape(v.description)}</td></tr>"
        for v in layout.variables)
    made = f" It is of {escape(origin.name)} {escape(origin.version)}." if origin.name else ""
    python = ".".join(map(str, sys.version_info[:2]))
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>
<style>body {{ font: 16px/1.5 sans-serif; max-width: 60em; margin: 2em auto }} td, th {{ text-align: left;
padding-right: 1.5em; vertical-align: top }}</style></head><body>
<h1>{escape(title)}</h1>
<p>A half of a thermomechanical contact problem, for FMI {fmi}.0 co-simulation.{made}</p>
<h2>What it needs</h2>
<p>The binary is a wrapper around Python: the process that loads it must have Python {python} or newer, and these
packages (<code>resources/requirements.txt</code>). Its own sources travel with it.</p>
<ul>{''.join(f'<li>{escape(need)}</li>' for need in needs)}</ul>
<h2>What a master must know</h2>
<ul>
<li>A step may be discarded (fmi{fmi}Discard): restore a saved state and take a shorter one; <code>status.message</code>
says why, <code>status.dt_suggest</code> which step is worth trying.</li>
<li>All units are SI, temperatures kelvin. {_ARRAYS[fmi]}</li>
<li>Inputs hold through a step. A state has the inputs in it.</li>
<li>One thread calls one instance.</li>
</ul>
<h2>Variables</h2>
<table><tr><th>block</th><th>causality</th><th>unit</th><th>meaning</th></tr>
{rows}
</table></body></html>
"""


_ARRAYS = {2: "Arrays are scalars with 1-based indices, their value references\nconsecutive.",
           3: "An array is one variable, its values row by row. The wrapper does not\npass on the start time: set "
              "<code>time.start</code> where a run begins at another time than 0 s."}


def _shape(shape: tuple[int, ...]) -> str:
    return f"[{','.join(f'1..{n}' for n in shape)}]" if shape else ""
