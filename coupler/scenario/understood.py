"""What a half of another package reads of its scene, as it declares, and which conditions it would leave out.

A half declares it as a text of words, paths of its model.json without names and numbers of places: `boundary.flux`,
`materials.k`, `pairs.conduction`; a path stands for all below it.  The text is the constant UNDERSTANDS of the module
that its entry point names, read from the source, for the coupler never imports a half; or the constant String output
`understands` of an FMU that lies ready.
"""

from __future__ import annotations

import ast
import importlib.util
import re
import zipfile
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from html import unescape
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

from pydantic.fields import FieldInfo

from contact.problem.errors import Wrong
from contact.problem.part import Part
from contact.problem.values import At, covers, did_you_mean

CONSTANT = "UNDERSTANDS"
OUTPUT = "understands"
def words_of(text: str) -> frozenset[str]:
    """Return the paths of a text, parted by blanks, commas or new lines."""
    return frozenset(text.replace(",", " ").split())


# Parts that are one datum: laws, curves, starts.  What is below them no half can take or leave alone.
_WHOLE = ("contact.problem.curves", "contact.problem.laws", "contact.problem.start", "contact.problem.flow")
# What steers a solution, names a place, or is answered by the contact service: no condition of the scene.
_NO_CONDITION = words_of("""
    half format options ignore method theta increments adaptive sigma_SB tolerance cuts element start skip rigid rod
    boundary.on boundary.at boundary.body boundary.name gravity.name bodies.material bodies.T0 bodies.drawn_at
    bodies.element bodies.reference pairs.slave pairs.master pairs.gap_max pairs.form pairs.two_pass pairs.clearance
    pairs.interference pairs.tied pairs.resistance pairs.penalty pairs.augmented pairs.friction.stick""")
# What is the other half's to read.
_OTHERS: Mapping[str, frozenset[str]] = {
    "thermal": words_of("""materials.E materials.nu materials.alpha materials.T_ref materials.plastic materials.creep
        materials.liquid pairs.friction.mu"""),
    "mechanical": words_of("""materials.rho materials.k materials.c materials.latent bodies.Q_T bodies.Q_T_factor
        pairs.conduction pairs.radiation pairs.friction.share""")}
ROOTS = ("boundary", "materials", "bodies", "pairs", "gravity", "dynamics", "state", "thermoelastic_heat", "adiabatic")


@dataclass(frozen=True)
class Condition:
    """One datum of a scene.  key : where it stands in the half's model.json.  path : that without names and numbers."""

    key: At
    path: str


def conditions(role: str, problem: Part) -> Iterator[Condition]:
    """Yield what a scene states for a half beyond defaults.  role : thermal or mechanical."""
    yield from _below(problem, (), "", _NO_CONDITION | _OTHERS[role])


def _below(part: Part, key: At, path: str, left_out: Collection[str]) -> Iterator[Condition]:
    for name, field in type(part).model_fields.items():
        value = getattr(part, name, None)
        at = f"{path}.{name}" if path else name
        if value is None or at in left_out or _is_default(field, value):
            continue
        yield from _of_value(value, (*key, name), at, left_out)


def _of_value(value: Any, key: At, path: str, left_out: Collection[str]) -> Iterator[Condition]:
    if isinstance(value, Part) and type(value).__module__ not in _WHOLE:
        found = list(_below(value, key, path, left_out))
        # A part that says nothing beyond defaults is said by being there, as `dynamics: {}`.
        yield from found or [Condition(key, path)]
    elif path in ("boundary", "materials", "bodies", "pairs"):
        items = value.items() if isinstance(value, Mapping) else enumerate(value)
        for name, one in items:
            yield from _below(one, (*key, name), path, left_out)
    else:
        yield Condition(key, path)


def _is_default(field: FieldInfo, value: Any) -> bool:
    return not field.is_required() and bool(value == field.get_default(call_default_factory=True))


def left_out(role: str, problem: Part, words: Collection[str], ignore: Collection[str]) -> Iterator[Wrong]:
    """Tell each condition that a half would leave out, once a path.

    words : what it declares to understand.  ignore : what the scenario says may be left out.
    """
    for word in ignore:
        if word.split(".")[0] not in ROOTS:
            yield Wrong(("ignore",), f"there is no condition {word!r}", did_you_mean(word.split(".")[0], ROOTS))
    told: set[str] = set()
    for condition in conditions(role, problem):
        path = condition.path
        # fault: conditions that a half leaves out are not told -> if True: | coupler/test_understood
        if path in told or covers(words, path) or covers(ignore, path):
            continue
        told.add(path)
        yield Wrong(condition.key, f"the half would leave this out: it does not understand {path}",
                    f"Choose one that does, or accept it: {role}: {{ignore: [{path}]}}")


def declared_by(entry: EntryPoint) -> frozenset[str] | None:
    """Return the words that the module of an entry point declares, None where it declares nothing."""
    top, *inner = entry.module.split(".")
    spec = importlib.util.find_spec(top)  # of a top-level name: it is found, not imported
    if spec is None or spec.origin is None:
        return None
    path = Path(spec.origin).parent.joinpath(*inner) if inner else Path(spec.origin)
    source = next((p for p in (path.with_suffix(".py"), path / "__init__.py", path) if p.is_file()), None)
    if source is None:
        return None
    for node in ast.parse(source.read_text(encoding="utf-8")).body:
        names = node.targets if isinstance(node, ast.Assign) else []
        if any(isinstance(n, ast.Name) and n.id == CONSTANT for n in names) and isinstance(node, ast.Assign):
            text = ast.literal_eval(node.value)
            return words_of(str(text))
    return None


def declared_in(fmu: Path) -> frozenset[str] | None:
    """Return the words that an FMU declares, None where it declares nothing, or is no FMU: that is told elsewhere."""
    try:
        with zipfile.ZipFile(fmu) as archive:
            text = archive.read("modelDescription.xml").decode("utf-8", "replace")
    except (OSError, KeyError, zipfile.BadZipFile):
        return None
    scalar = re.search(rf'<ScalarVariable\b[^>]*\bname="{OUTPUT}"[^>]*>\s*<String\b[^>]*\bstart="([^"]*)"', text)
    typed = re.search(rf'<String\b[^>]*\bname="{OUTPUT}"[^>]*>\s*<Start\b[^>]*\bvalue="([^"]*)"', text)  # FMI 3.0
    # fault: what a half of FMI 3.0 understands is not read -> found = scalar | coupler/test_understood
    found = scalar or typed
    return None if found is None else words_of(unescape(found[1]))
