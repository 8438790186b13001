"""Where every variable of a half lies: value references, and the variables all halves have."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from contact.half.interface import Interface
from contact.half.model import Floats, Value, Variable


def standard_variables(interface: Interface, packages: str) -> tuple[Variable, ...]:
    """What every half has beside its own fields.  packages : the hashes of the packages inside the FMU."""
    def constant(name: str, text: str) -> Variable:
        return Variable(name, kind="String", start=text, variability="constant")

    return (
        Variable("status.dt_suggest", unit="s", description="a step worth trying after a discard, 0: no idea"),
        Variable("status.dt_stable", unit="s", description="largest step thought stable, 0: unknown"),
        Variable("status.code", kind="Integer", start=0,
                 description="0 well, 1 step discarded, 2 the half failed, 3 interrupted"),
        Variable("control.event", causality="input", kind="Integer", start=0,
                 description="rises at events the half cannot see itself"),
        Variable("control.method", causality="input", kind="Integer", start=0,
                 description="solution method, 0: as in model.json"),
        Variable("status.message", kind="String", start=""),
        constant("mesh.hash", interface.mesh_hash),
        constant("surfaces.hash", interface.surfaces_hash),
        constant("geometry", interface.geometry),
        constant("packages.hash", packages),
        Variable("contact.link", causality="parameter", kind="String", start="direct",
                 description="how the contact service is reached"),
    )


@dataclass(frozen=True)
class Layout:
    """The order of a half's scalars: value reference = place.

    reals, integers, texts : the variables of each kind; Reals first, and of the Reals what is set from outside first.
    first : name -> value reference of its first scalar.
    n_set : how many Real scalars are inputs or parameters.  n_real : all Real scalars.
    """

    reals: tuple[Variable, ...]
    integers: tuple[Variable, ...]
    texts: tuple[Variable, ...]
    first: Mapping[str, int]
    n_set: int
    n_real: int

    @property
    def variables(self) -> tuple[Variable, ...]:
        return self.reals + self.integers + self.texts

    # Worked out once: a step asks for these hundreds of times.

    @cached_property
    def outputs(self) -> Mapping[str, Variable]:
        """The outputs by name."""
        return {v.name: v for v in self.variables if v.causality == "output"}

    @cached_property
    def real_inputs(self) -> tuple[tuple[str, int, int, tuple[int, ...]], ...]:
        """Name, first and last + 1 place, and shape of every Real that is set from outside."""
        return tuple((v.name, self.first[v.name], self.first[v.name] + v.size, v.shape)
                     for v in self.reals if v.causality != "output")

    def block(self, store: Floats, variable: Variable) -> Floats:
        """Return the part of a store that belongs to a Real variable, in its shape and unit (a view).

        store : (n_real,), each in the unit of its variable.
        """
        at = self.first[variable.name]
        return store[at : at + variable.size].reshape(variable.shape)

    def name_of(self, reference: int) -> str:
        """Name of the variable a value reference belongs to."""
        for variable in self.variables:
            if self.first[variable.name] <= reference < self.first[variable.name] + variable.size:
                return variable.name
        return f"value reference {reference}"

    def not_finite(self, store: Floats, causality: str) -> str:
        """Return the name of the first Real of a causality that holds NaN or infinity, or "".

        store : (n_real,), each in the unit of its variable.
        """
        for variable in self.reals:
            if variable.causality == causality and not np.isfinite(self.block(store, variable)).all():
                return variable.name
        return ""

    def start_store(self) -> Floats:
        """Return the start values (n_real,), each in the unit of its variable.

        Outputs that are not constant are NaN until the half has started.
        """
        store = np.full(self.n_real, np.nan)
        for variable in self.reals:
            if variable.causality != "output" or variable.variability == "constant":
                self.block(store, variable)[...] = variable.start
        return store


def layout_of(own: Iterable[Variable], standard: Iterable[Variable]) -> Layout:
    """Lay out a half's own variables, then those standard ones it does not declare itself.

    Raises ValueError for a name used twice.
    """
    declared = tuple(own)
    names = [v.name for v in declared]
    twice = sorted({n for n in names if names.count(n) > 1}) if len(set(names)) < len(names) else []
    if twice:
        raise ValueError(f"variables declared twice: {', '.join(twice)}")
    everything = declared + tuple(v for v in standard if v.name not in set(names))

    def kind(name: str) -> tuple[Variable, ...]:
        return tuple(v for v in everything if v.kind == name)

    reals = tuple(sorted(kind("Real"), key=lambda v: v.causality == "output"))
    integers, texts = kind("Integer"), kind("String")
    first, at = {}, 0
    for variable in reals + integers + texts:
        first[variable.name] = at
        at += variable.size
    return Layout(reals, integers, texts, first,
                  n_set=sum(v.size for v in reals if v.causality != "output"), n_real=sum(v.size for v in reals))


def checked_output(variable: Variable, value: Value) -> Value:
    """An output as the layout wants it.  Raises ValueError where its shape or kind is another."""
    if variable.kind == "Real":
        if variable.shape == () and isinstance(value, float):
            return float(value)
        array = np.asarray(value, dtype=np.float64)
        if array.shape != variable.shape:
            raise ValueError(f"output {variable.name} has shape {array.shape}, not {variable.shape}")
        return array
    if variable.kind == "Integer":
        if isinstance(value, str) or int(value) != value:
            raise ValueError(f"output {variable.name}: {value!r} is not a whole number")
        return int(value)
    if not isinstance(value, str):
        raise ValueError(f"output {variable.name}: {value!r} is not a text")
    return value


# Units of FMI variables: from "W/m2K" to the exponents of the SI base units.

# Exponents (kg, m, s, K, A, mol, cd, rad) of every symbol a unit may be made of; all of them coherent, factor 1.
BASE = ("kg", "m", "s", "K", "A", "mol", "cd", "rad")
_SYMBOLS = {
    "kg": (1,), "m": (0, 1), "s": (0, 0, 1), "K": (0, 0, 0, 1), "rad": (0, 0, 0, 0, 0, 0, 0, 1), "1": (),
    "N": (1, 1, -2), "Pa": (1, -1, -2), "J": (1, 2, -2), "W": (1, 2, -3),
}
_TOKEN = re.compile(r"(kg|rad|Pa|[mskKNJW1])(\d?)")
_PRODUCT = re.compile(rf"{_TOKEN.pattern}(\.?{_TOKEN.pattern})*")


def base_exponents(unit: str) -> dict[str, int]:
    """Exponents of the base units of `unit`: symbols side by side or by dots, powers as digits, at most one "/".

    "W/m2K" is {"kg": 1, "s": -3, "K": -1}, "N.m" what J is.  Raises ValueError for what is not such a unit.
    """
    total = dict.fromkeys(BASE, 0)
    parts = unit.split("/")
    if len(parts) > 2:
        raise ValueError(f"unit {unit!r}: one '/' at most")
    for sign, part in zip((1, -1), parts, strict=False):
        tokens = _TOKEN.findall(part)
        symbols = [symbol for symbol, _ in tokens]
        # A symbol twice in a row is a prefix in disguise: "mm" is not m2.
        # fault: a moment has no unit -> if not part or _TOKEN.sub("", part) or len(set(symbols)) < len(symbols): |
        #   contact/test_half_describe mechanical_fmu/test_named_forces
        if not _PRODUCT.fullmatch(part) or len(set(symbols)) < len(symbols) or not _SYMBOLS.keys() >= set(symbols):
            raise ValueError(f"unit {unit!r} is not made of {', '.join(_SYMBOLS)} and powers")
        for symbol, power in tokens:
            for base, exponent in zip(BASE, _SYMBOLS[symbol], strict=False):
                total[base] += sign * exponent * int(power or 1)
    return {base: exponent for base, exponent in total.items() if exponent}


# modelDescription.xml of a half, written as text: 20 000 variables in a tenth of a second.

VENDOR = "slideline"  # the name of the annotation of a modelDescription.xml that says what arrays are on


def model_description(layout: Layout, identifier: str, guid: str, tool: str, description: str, version: str = "",
                      rights: str = "") -> str:
    """The XML text.  identifier : name of model and binary.  tool : generationTool.

    version, rights : of the half, and its license; "" where they are not known.
    Raises ValueError for a unit that is not SI or a name that is not a structured one.
    """
    variables = layout.variables
    scalars: list[str] = []
    outputs: list[int] = []
    unknown: list[int] = []
    for variable in variables:
        first = len(scalars) + 1
        scalars.extend(_scalars(variable, layout.first[variable.name]))
        if variable.causality == "output":
            numbers = range(first, len(scalars) + 1)
            outputs.extend(numbers)
            if variable.variability != "constant":
                unknown.extend(numbers)
    units = sorted({v.unit for v in layout.reals})
    # fault: an FMU says nothing of its version and license -> known = "" | contact/test_papers
    known = "".join(f"{name}={quoteattr(text)} " for name, text in (("version", version), ("license", rights)) if text)
    return "\n".join([
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="2.0" modelName={quoteattr(identifier)} guid={quoteattr(guid)} '
        f'description={quoteattr(description)} generationTool={quoteattr(tool)} {known}'
        'variableNamingConvention="structured">',
        f'<CoSimulation modelIdentifier={quoteattr(identifier)} needsExecutionTool="true" '
        'canHandleVariableCommunicationStepSize="true" canInterpolateInputs="false" '
        'canBeInstantiatedOnlyOncePerProcess="false" canNotUseMemoryManagementFunctions="true" '
        'canGetAndSetFMUstate="true" canSerializeFMUstate="true"/>',
        "<UnitDefinitions>", *map(unit_definition, units), "</UnitDefinitions>",
        "<LogCategories>",
        *(f'<Category name="{name}"/>' for name in
          ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal", "logAll")),
        "</LogCategories>", *_places(variables),
        "<ModelVariables>", *scalars, "</ModelVariables>",
        "<ModelStructure>",
        "<Outputs>", *(f'<Unknown index="{i}"/>' for i in outputs), "</Outputs>",
        "<InitialUnknowns>", *(f'<Unknown index="{i}"/>' for i in unknown), "</InitialUnknowns>",
        "</ModelStructure>", "</fmiModelDescription>", ""])


def block_table(layout: Layout, xml: bytes) -> dict[str, Any]:
    """What a model description says of arrays, an array a row, for who would else read it scalar by scalar.

    xml : the description itself; the hash of its variables says which one the table is of.  Rows are in their order:
    name, shape, kind, causality, variability, unit, description, what its rows belong to, first value reference (of
    the others in turn, last index fastest), start of a scalar as written.
    """
    rows = []
    for v in layout.variables:
        start = None
        if not v.shape and (v.causality != "output" or v.variability == "constant"):
            start = repr(float(np.asarray(v.start))) if v.kind == "Real" else str(v.start)
        rows.append([v.name, list(v.shape), v.kind, v.causality, variability_of(v), v.unit if v.kind == "Real" else "1",
                     v.description, v.on, layout.first[v.name], start])
    return {"variables": variables_hash(xml), "blocks": rows}


def variables_hash(xml: bytes) -> str:
    """Return the hash of what a model description says of its variables; the rest of it may say more later on."""
    return hashlib.sha256(xml.partition(b"<ModelVariables>")[2].partition(b"</ModelVariables>")[0]).hexdigest()


def variability_of(variable: Variable) -> str:
    """Return how a variable may change, in the words of FMI."""
    return variable.variability or (
        "fixed" if variable.causality == "parameter" else "continuous" if variable.kind == "Real" else "discrete")


def _places(variables: Iterable[Variable]) -> list[str]:
    """The annotation that says what the rows of arrays belong to: FMI 2.0 has shapes, but no word for it."""
    told = [v for v in variables if v.on]
    if not told:
        return []
    blocks = (f'<Block name={quoteattr(v.name)} on="{v.on}"/>' for v in told)
    return [f'<VendorAnnotations><Tool name="{VENDOR}"><Blocks>', *blocks, "</Blocks></Tool></VendorAnnotations>"]


def scalar_names(variable: Variable) -> Iterator[str]:
    """Names of a variable's scalars in the order of their value references: 1-based, last index fastest."""
    if not variable.shape:
        yield variable.name
        return
    for index in product(*(range(1, n + 1) for n in variable.shape)):
        yield f"{variable.name}[{','.join(map(str, index))}]"


def _scalars(variable: Variable, reference: int) -> list[str]:
    constant = variable.variability == "constant"
    middle = f' causality="{variable.causality}" variability="{variability_of(variable)}"'
    if variable.causality != "input":
        calculated = variable.causality == "output" and not constant
        middle += f' initial="{"calculated" if calculated else "exact"}"'
    if variable.description:
        middle += f" description={quoteattr(variable.description)}"
    unit = f" unit={quoteattr(variable.unit)}" if variable.kind == "Real" else ""
    starts: Iterator[str] | None = None
    if constant or variable.causality != "output":
        starts = iter([f" start={quoteattr(str(variable.start))}"])
        if variable.kind == "Real":
            values = np.broadcast_to(np.asarray(variable.start, dtype=np.float64), variable.shape)
            starts = (f' start="{value!r}"' for value in values.ravel().tolist())
    return [f'<ScalarVariable name={quoteattr(name)} valueReference="{reference + i}"{middle}>'
            f"<{variable.kind}{unit}{next(starts) if starts else ''}/></ScalarVariable>"
            for i, name in enumerate(scalar_names(variable))]


def unit_definition(unit: str) -> str:
    """Return what a unit is of SI base units, as XML.  Raises ValueError for one that is not SI."""
    exponents = "".join(f' {base}="{power}"' for base, power in base_exponents(unit).items())
    return f"<Unit name={quoteattr(unit)}><BaseUnit{exponents}/></Unit>"
