"""FMUs with names of their own: a copy whose description has the names, units and signs of the border (`bind`).

Of FMI 2.0 a block is the scalars that a pattern names, of FMI 3.0 an array as well.

An FMU knows its variables by number, so a description with other names is the same FMU; the file itself is not touched.
"""

from __future__ import annotations

import difflib
import math
import re
import zipfile
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from contact.half.layout import base_exponents
from contact.problem.values import did_you_mean
from coupler.errors import HalfError, ScenarioError, together
from coupler.fmu.bounds import scenario_border
from coupler.fmu.description import check_size, with_description
from coupler.fmu.description3 import shapes_of
from coupler.fmu.names import BLOCKS, OUT, Face, face_of
from coupler.fmu.units import COMMON, Conversion, DeclaredUnit, conversion_of, declared_units, type_units, unit_of

if TYPE_CHECKING:
    from coupler.scenario import Scenario
    from coupler.scenario.schema import Binding

XML = "modelDescription.xml"
AXES = {"xy": "xy", "XY": "XY"}
PLACEHOLDER = re.compile(r"\{(i0?|j0?|xy|XY)\}")
NAMED = 3  # variables that an error names


class BindError(ValueError):
    """A binding that does not fit.  remedy : what to do."""

    def __init__(self, message: str, remedy: str = "") -> None:
        super().__init__(message)
        self.remedy = remedy


def bind(scenario: Scenario, role: str, fmu: Path, out: Path) -> Path:
    """Return the FMU of a role with the names of the border: `fmu` itself where the scenario binds nothing.

    A half that is no path of an FMU has these names; what is bound stays in the scenario, so that a swap is one word.
    out : where the copy is written.  Raises ScenarioError, for each binding that does not fit.
    """
    bindings = _bindings(scenario, role)
    if not bindings or fmu.suffix != ".fmu":
        return fmu
    rows = scenario_border(scenario, role).rows
    try:
        with zipfile.ZipFile(fmu) as archive:
            # fault: a description of any size is read -> pass | coupler/test_bind
            check_size(archive, fmu)
            root = ElementTree.fromstring(archive.read(XML))
        shapes = shapes_of(root) if _is_3(root) else {}
    except (HalfError, OSError, KeyError, ValueError, zipfile.BadZipFile, ElementTree.ParseError) as exc:
        raise ScenarioError(f"{fmu} cannot be read as an FMU ({exc})", file=str(scenario.file), key=f"{role}.half",
                            remedy="Give an FMU of FMI 2.0 or 3.0 for co-simulation") from exc
    errors = list(_bound(root, shapes, bindings, role, rows, lambda *a: _error(scenario, role, *a)))
    if errors:
        raise together(errors)
    xml = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return with_description(fmu, lambda _: xml, out)


def check_bindings(scenario: Scenario, scratch: Path) -> None:
    """Look at all bindings of a scenario.  scratch : an empty folder.  Raises ScenarioError."""
    for role in ("thermal", "mechanical"):
        if _bindings(scenario, role):
            bind(scenario, role, Path(str(scenario.models[role]["half"])), scratch / f"{role}.fmu")


def _bindings(scenario: Scenario, role: str) -> Mapping[str, Binding]:
    found: Mapping[str, Binding] = getattr(scenario.stated, role).bind if scenario.stated is not None else {}
    return found


def _error(scenario: Scenario, role: str, name: str, message: str, remedy: str) -> ScenarioError:
    key = f"{role}.bind" + (f".{name}" if name else "")
    return ScenarioError(message, file=str(scenario.file), key=key, remedy=remedy)


@dataclass(frozen=True)
class _Bound:
    """A variable under its name at the border."""

    name: str
    node: ElementTree.Element


def _is_3(root: ElementTree.Element) -> bool:
    """Whether a description is of FMI 3.0, where an element of ModelVariables is of the variable's type."""
    return root.get("fmiVersion", "").startswith("3.")


def _value(node: ElementTree.Element) -> ElementTree.Element:
    """The element of a variable that says its type and its unit: of FMI 3.0 itself, of FMI 2.0 its first."""
    return node if node.tag != "ScalarVariable" else next(iter(node), node)


def _bound(root: ElementTree.Element, shapes: Mapping[str, tuple[int, ...]], bindings: Mapping[str, Binding], role: str,
           rows: Mapping[str, int], error: Callable[[str, str, str], ScenarioError]) -> Iterator[ScenarioError]:
    """Give variables of a description the names of the border, in place; yields what does not fit.

    shapes : of its arrays, by name.
    """
    nodes = {node.get("name", ""): node for node in root.iterfind("ModelVariables/*")}
    declared, types = declared_units(root), type_units(root)
    taken: dict[int, str] = {}
    for number, (name, binding) in enumerate(bindings.items()):
        try:
            face = face_of(name)
            if face is None or face.kind != "Real" or not face.causality(role):
                raise BindError(f"a {role} half has no {name!r} at its border",
                                did_you_mean(name, [n for n, f in BLOCKS.items() if f.causality(role)]))
            if binding.name in shapes:
                found = [_array(nodes, shapes[binding.name], name, binding, face, rows.get(name))]
            else:
                found = _variables(nodes, shapes, name, binding, face, rows.get(name))
            if found[0].name in nodes or name in nodes:
                raise BindError(f"the FMU has variables {name} already", "Leave this binding out")
            # fault: of two bindings of the same variables the first is lost -> twice = None | coupler/test_bind
            twice = next((taken[id(one.node)] for one in found if id(one.node) in taken), None)
            if twice is not None:
                raise BindError(f"{binding.name!r} are bound as {twice} already",
                                "A variable is one block at the border: leave one of the two out")
            unit = f"bound_{number}"
            how = _conversion(found, binding, face, declared, types)
            taken |= {id(one.node): name for one in found}
            for one in found:
                _rename(one, role, face, unit)
            _define(root, unit, face.unit, how)
        except BindError as exc:
            yield error(name, str(exc), exc.remedy)


def _array(nodes: Mapping[str, ElementTree.Element], shape: tuple[int, ...], name: str, binding: Binding, face: Face,
           rows: int | None) -> _Bound:
    """The array that is a block.  rows : how many the scene has, where it says so."""
    expected = (shape[0] if rows is None else rows, 2)[: face.rank] if face.rank else ()
    # fault: an array of another shape than the mesh's is bound -> if False: | coupler/test_bind3
    if shape != expected:
        raise BindError(f"the array {binding.name!r} has shape {shape}, but {name} has shape {expected} in this scene",
                        "An FMU is of one mesh: bind one that was made for this scene")
    return _Bound(name, nodes[binding.name])


def _variables(nodes: Mapping[str, ElementTree.Element], arrays: Collection[str], name: str, binding: Binding,
               face: Face, rows: int | None) -> list[_Bound]:
    """The scalars that a pattern names, one of each index.

    arrays : names of what are none.  rows : how many the scene has, where it says so.
    """
    words = PLACEHOLDER.findall(binding.name)
    used = set(words)
    # fault: a placeholder that comes twice ends in the error of a library -> if False: | coupler/test_bind
    if len(words) > len(used):
        raise BindError(f"the pattern {binding.name!r} has {{{next(w for w in words if words.count(w) > 1)}}} twice",
                        "Each placeholder stands once")
    across = used - {"i", "i0"}
    if len(used - across) != min(face.rank, 1) or len(across) != max(face.rank - 1, 0):
        want = ("no {i}", "one {i} (or {i0}, from 0)", "one {i} (or {i0}) and one {j}, {j0}, {xy} or {XY}")[face.rank]
        raise BindError(f"the pattern {binding.name!r} must have {want}", "{i} stands for the number of a row, from 1; "
                        "{j} of a column; {xy} for x and y; or give the name of an array of FMI 3.0")
    found: dict[tuple[int, ...], ElementTree.Element] = {}
    pattern = _pattern(binding.name)
    for text, node in nodes.items():
        if text not in arrays and (match := pattern.fullmatch(text)):
            at = _index(match)
            # fault: of two variables of one number the later is taken -> if False: | coupler/test_bind
            if at in found:
                raise BindError(f"the pattern {binding.name!r} names {found[at].get('name')!r} and {text!r}, both "
                                f"{_at(at)}", "Each number must be one variable: let the pattern name one of them")
            found[at] = node
    if not found:
        near = difflib.get_close_matches(_example(binding.name), nodes, NAMED, 0.0)
        raise BindError(f"no variable of the FMU has a name like {binding.name!r}", f"It has {', '.join(near)}, ...")
    shape = tuple(max(column) for column in zip(*found, strict=True))
    # Of what the scene does not count, there are as many as there are.
    expected = (shape[0] if rows is None else rows, 2)[: face.rank] if face.rank else ()
    # fault: fewer variables than the mesh has nodes are bound -> if not found: | coupler/test_bind
    if shape != expected or len(found) != math.prod(shape) or min(map(min, found), default=1) < 1:
        raise BindError(f"the pattern {binding.name!r} names {len(found)} variables, the last one {_at(shape)}, but "
                        f"{name} has shape {expected} in this scene",
                        "An FMU is of one mesh: bind one that was made for this scene; numbers begin at 1 ({i0}: at 0)")
    return [_Bound(f"{name}[{','.join(map(str, index))}]" if index else name, found[index])
            for index in sorted(found)]


def _at(shape: tuple[int, ...]) -> str:
    return f"[{','.join(map(str, shape))}]"


def _pattern(text: str) -> re.Pattern[str]:
    parts, last = [], 0
    for found in PLACEHOLDER.finditer(text):
        word = found[1]
        parts += [re.escape(text[last:found.start()]), f"(?P<{word}>{f'[{AXES[word]}]' if word in AXES else '[0-9]+'})"]
        last = found.end()
    return re.compile("".join(parts) + re.escape(text[last:]))


def _index(match: re.Match[str]) -> tuple[int, ...]:
    """From 1, row and column."""
    found = {"ij".index(word[0]) if word not in AXES else 1:
             AXES[word].index(text) + 1 if word in AXES else int(text) + word.endswith("0")
             for word, text in match.groupdict().items()}
    return tuple(found[k] for k in sorted(found))


def _example(pattern: str) -> str:
    return PLACEHOLDER.sub(lambda m: m[1][0] if m[1] in AXES else "1", pattern)


def _conversion(found: list[_Bound], binding: Binding, face: Face,
                declared: Mapping[str, DeclaredUnit], types: Mapping[str, str]) -> Conversion:
    """How numbers of variables become those of the border: by the unit stated, else by the one the FMU declares.

    types : the units of the FMU's types, by name.
    """
    values = [_value(one.node) for one in found]
    # fault: whole numbers are bound as a field -> kinds = set() | coupler/test_bind3
    kinds = {value.tag for value in values} - {"Real", "Float64"}
    if kinds:
        raise BindError(f"{binding.name!r} are of type {kinds.pop()}, not Real", "Bind variables of type Real (of FMI "
                        "3.0 Float64)")
    units = {binding.unit} if binding.unit else {
        # fault: numbers without a unit are taken for SI -> unit_of(v, types) or face.unit for v in values} |
        #   coupler/test_bind
        unit_of(v, types) for v in values}
    if "" in units and face.unit == "1":
        units = (units - {""}) | {"1"}
    if "" in units:
        raise BindError(f"the FMU does not say what {binding.name!r} are in", f"State a `unit`: {face.unit}, or what "
                        "they are in")
    if len(units) > 1:
        raise BindError(f"{binding.name!r} are in {' and '.join(sorted(units))}", "State one `unit`")
    unit = units.pop() if units else face.unit
    how = conversion_of(unit, face.unit, declared)
    if how is None:
        raise BindError(f"{binding.name!r} are in {unit}, which cannot be made {face.unit}",
                        f"State a `unit` that is known ({face.unit}, {', '.join(_units_of(face.unit)) or 'no other'}), "
                        "or define it in the FMU")
    # fault: the sign of a binding is lost -> sign = 1.0 | coupler/test_bind
    sign = float(binding.sign)
    return Conversion(sign * how.factor, sign * how.offset + binding.offset)


def _units_of(unit: str) -> list[str]:
    return [name for name, (si, _) in COMMON.items() if si == unit]


def _rename(one: _Bound, role: str, face: Face, unit: str) -> None:
    one.node.set("name", one.name)
    if one.node.get("causality", "local") == "local" and face.causality(role) == OUT:
        one.node.set("causality", OUT)  # it can be read like one
    value = _value(one.node)
    value.set("unit", unit)
    value.attrib.pop("declaredType", None)


def _define(root: ElementTree.Element, name: str, unit: str, how: Conversion) -> None:
    """Define a unit by what it is in SI."""
    place = root.find("UnitDefinitions")
    if place is None:
        place = ElementTree.Element("UnitDefinitions")
        # Before the types, as the schemas have it.
        after = ("TypeDefinitions", "LogCategories", "DefaultExperiment", "VendorAnnotations", "Annotations",
                 "ModelVariables")
        at = next(k for k, child in enumerate(root) if child.tag in after)
        root.insert(at, place)
    new = ElementTree.SubElement(place, "Unit", name=name)
    powers = {} if unit == "1" else {base: str(n) for base, n in base_exponents(unit).items()}
    ElementTree.SubElement(new, "BaseUnit", {**powers, "factor": repr(how.factor), "offset": repr(how.offset)})
