"""modelDescription.xml of a half for FMI 3.0: an array is one variable, with the value reference of its first value.

So the references are those of FMI 2.0, where the others of an array are left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from xml.sax.saxutils import quoteattr

import numpy as np

from contact.half.layout import VENDOR, Layout, unit_definition, variability_of
from contact.half.model import Variable

TYPES: Mapping[str, str] = {"Real": "Float64", "Integer": "Int32", "String": "String"}
TIME, START = "time", "time.start"


def time_references(layout: Layout) -> tuple[int, int]:
    """Return the value references of the time, which FMI 3.0 demands, and of the start, which the wrapper drops."""
    after = layout.n_real + len(layout.integers) + len(layout.texts)
    return after, after + 1


def model_description_3(layout: Layout, identifier: str, token: str, tool: str, description: str, version: str = "",
                        rights: str = "") -> str:
    """The XML text.  identifier : name of model and binary.  token : instantiationToken.  tool : generationTool.

    version, rights : of the half, and its license; "" where they are not known.
    Raises ValueError for a unit that is not SI, or a variable that is named as the time is.
    """
    variables = layout.variables
    if taken := {TIME, START} & {v.name for v in variables}:
        raise ValueError(f"a variable cannot be named {taken.pop()} in FMI 3.0: that is the time itself")
    time, start = time_references(layout)
    outputs = [v for v in variables if v.causality == "output"]
    places = "".join(f'<Block name={quoteattr(v.name)} on="{v.on}"/>' for v in variables if v.on)
    known = "".join(f"{name}={quoteattr(text)} " for name, text in (("version", version), ("license", rights)) if text)
    return "\n".join([
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="3.0" modelName={quoteattr(identifier)} '
        f'instantiationToken={quoteattr(token)} description={quoteattr(description)} '
        f'generationTool={quoteattr(tool)} {known}variableNamingConvention="structured">',
        f'<CoSimulation modelIdentifier={quoteattr(identifier)} needsExecutionTool="true" '
        'canBeInstantiatedOnlyOncePerProcess="false" canGetAndSetFMUState="true" canSerializeFMUState="true" '
        'canHandleVariableCommunicationStepSize="true"/>',
        "<UnitDefinitions>", *map(unit_definition, sorted({"s", *(v.unit for v in layout.reals)})),
        "</UnitDefinitions>", "<LogCategories>",
        *(f'<Category name="{name}"/>' for name in
          ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal", "logAll")),
        "</LogCategories>",
        "<ModelVariables>",
        f'<Float64 name="{TIME}" valueReference="{time}" causality="independent" variability="continuous" unit="s"/>',
        f'<Float64 name="{START}" valueReference="{start}" causality="parameter" variability="fixed" initial="exact" '
        'unit="s" start="0.0" description="when the half begins: the wrapper does not pass on the start time"/>',
        *(_variable(v, layout.first[v.name]) for v in variables), "</ModelVariables>",
        "<ModelStructure>",
        *(f'<Output valueReference="{layout.first[v.name]}"/>' for v in outputs),
        *(f'<InitialUnknown valueReference="{layout.first[v.name]}"/>' for v in outputs if v.variability != "constant"),
        "</ModelStructure>",
        *([f'<Annotations><Annotation type="{VENDOR}"><Blocks>{places}</Blocks></Annotation></Annotations>']
          if places else []),
        "</fmiModelDescription>", ""])


def _variable(variable: Variable, reference: int) -> str:
    constant, type_ = variable.variability == "constant", TYPES[variable.kind]
    about = (f'name={quoteattr(variable.name)} valueReference="{reference}" causality="{variable.causality}" '
             f'variability="{variability_of(variable)}"')
    if variable.causality != "input":
        about += f' initial="{"calculated" if variable.causality == "output" and not constant else "exact"}"'
    if variable.description:
        about += f" description={quoteattr(variable.description)}"
    inside = "".join(f'<Dimension start="{size}"/>' for size in variable.shape)
    starts = constant or variable.causality != "output"
    if variable.kind == "Real":
        about += f" unit={quoteattr(variable.unit)}"
        if starts:
            # All of them: that one value stands for all of an array is not to be relied on.
            values = np.broadcast_to(np.asarray(variable.start, dtype=np.float64), variable.shape)
            about += f' start="{" ".join(map(repr, values.ravel().tolist()))}"'
    elif starts and variable.kind == "String":
        inside += f"<Start value={quoteattr(str(variable.start))}/>"
    elif starts:
        about += f' start="{variable.start}"'
    return f"<{type_} {about}>{inside}</{type_}>"
