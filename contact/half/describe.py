"""modelDescription.xml of a half, written as text: 20 000 variables in a tenth of a second."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from xml.sax.saxutils import quoteattr

import numpy as np

from contact.half.layout import Layout
from contact.half.model import Variable
from contact.half.units import base_exponents


def model_description(layout: Layout, identifier: str, guid: str, tool: str, description: str) -> str:
    """The XML text.  identifier : name of model and binary.  tool : generationTool.

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
    return "\n".join([
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="2.0" modelName={quoteattr(identifier)} guid={quoteattr(guid)} '
        f'description={quoteattr(description)} generationTool={quoteattr(tool)} '
        'variableNamingConvention="structured">',
        f'<CoSimulation modelIdentifier={quoteattr(identifier)} needsExecutionTool="true" '
        'canHandleVariableCommunicationStepSize="true" canInterpolateInputs="false" '
        'canBeInstantiatedOnlyOncePerProcess="false" canNotUseMemoryManagementFunctions="true" '
        'canGetAndSetFMUstate="true" canSerializeFMUstate="true"/>',
        "<UnitDefinitions>", *map(_unit, units), "</UnitDefinitions>",
        "<LogCategories>",
        *(f'<Category name="{name}"/>' for name in
          ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal", "logAll")),
        "</LogCategories>",
        "<ModelVariables>", *scalars, "</ModelVariables>",
        "<ModelStructure>",
        "<Outputs>", *(f'<Unknown index="{i}"/>' for i in outputs), "</Outputs>",
        "<InitialUnknowns>", *(f'<Unknown index="{i}"/>' for i in unknown), "</InitialUnknowns>",
        "</ModelStructure>", "</fmiModelDescription>", ""])


def scalar_names(variable: Variable) -> Iterator[str]:
    """Names of a variable's scalars in the order of their value references: 1-based, last index fastest."""
    if not variable.shape:
        yield variable.name
        return
    for index in product(*(range(1, n + 1) for n in variable.shape)):
        yield f"{variable.name}[{','.join(map(str, index))}]"


def _scalars(variable: Variable, reference: int) -> list[str]:
    constant = variable.variability == "constant"
    variability = variable.variability or (
        "fixed" if variable.causality == "parameter" else "continuous" if variable.kind == "Real" else "discrete")
    middle = f' causality="{variable.causality}" variability="{variability}"'
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


def _unit(unit: str) -> str:
    exponents = "".join(f' {base}="{power}"' for base, power in base_exponents(unit).items())
    return f"<Unit name={quoteattr(unit)}><BaseUnit{exponents}/></Unit>"
