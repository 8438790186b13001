"""A scene's two FMUs as one file for other masters: SSP 1.0, what goes where (ssd), values to begin with (ssv).

Source: System Structure and Parameterization, version 1.0, Modelica Association, 2019.
"""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from coupler.errors import ScenarioError
from coupler.fmu.description import read_description, unpack
from coupler.fmu.scratch import scratch_folder
from coupler.fmu.variables import VariableBlock
from coupler.scenario import Scenario

COMMON = "http://ssp-standard.org/SSP1/SystemStructureCommon"
DESCRIPTION = "http://ssp-standard.org/SSP1/SystemStructureDescription"
VALUES = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
TYPES = ("Real", "Integer", "Boolean", "String")  # of SSP 1.0 that a variable of FMI 2.0 may have
ZIP_TIME = (1980, 1, 1, 0, 0, 0)  # fixed, so that equal contents make equal files

Fields = Mapping[str, VariableBlock]


def check_one_system(scenario: Scenario, fmi: int) -> None:
    """Raise ScenarioError for a scene whose exchange no connections of an SSP file can say."""
    for wrong, why, remedy in (
            (fmi != 2, "SSP 1.0 knows no arrays", "Leave --fmi 3 out"),
            (scenario.several is not None, "several thermal halves iterate heat between them in each step",
             "Leave thermal.halves out"),
            (bool(scenario.own_meshes), "what goes between two meshes is mapped by the coupler",
             " and ".join(f"Leave {role}.meshes out" for role in scenario.own_meshes))):
        if wrong:
            raise ScenarioError(f"no system of two FMUs can be written: {why}", key="--ssp", remedy=remedy)


def write_ssp(scenario: Scenario, fmus: Mapping[str, Path], out: Path) -> Path:
    """Write the FMUs of a scene as a system: SystemStructure.ssd, and of each half its FMU and its values (ssv).

    fmus : role -> FMU, of FMI 2.0.  An output of one half goes to the input of the same name of the other.
    Returns out.  Raises HalfError where an FMU cannot be read, ScenarioError where one is not of FMI 2.0.
    """
    with scratch_folder() as scratch:
        described = {role: read_description(unpack(fmu, scratch / role)) for role, fmu in fmus.items()}
    for role, description in described.items():
        if description.fmi != 2:
            raise ScenarioError(f"no system of two FMUs can be written: the {role} half is of FMI {description.fmi}, "
                                "and SSP 1.0 knows no arrays", key="--ssp", remedy="Use an FMU of FMI 2.0")
    fields = {role: description.fields for role, description in described.items()}
    members = {"SystemStructure.ssd": structure(scenario, fields),
               **{f"resources/{role}.ssv": values(role, own, fields) for role, own in fields.items()}}
    with tempfile.TemporaryDirectory(dir=out.parent, prefix=".ssp-") as made:
        new = Path(made) / "new.ssp"
        with zipfile.ZipFile(new, "w") as archive:
            for name, text in members.items():
                archive.writestr(_member(name, zipfile.ZIP_DEFLATED), text)
            for role, fmu in fmus.items():
                archive.writestr(_member(f"resources/{role}.fmu", zipfile.ZIP_STORED), fmu.read_bytes())
        new.replace(out)
    return out


def _member(name: str, how: int) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name, ZIP_TIME)
    info.compress_type, info.external_attr = how, 0o644 << 16
    return info


def connected(fields: Mapping[str, Fields]) -> Iterator[tuple[str, str, str]]:
    """Yield (role, role, block): what goes from one half to another.  fields : role -> block -> where it lies."""
    for start, outputs in fields.items():
        for end, inputs in fields.items():
            for name, of in outputs.items():
                to = inputs.get(name)
                # fault: an SSP system connects inputs with inputs -> if to is None: | coupler/test_ssp
                if to is None or of.block.causality != "output" or to.block.causality != "input":
                    continue
                if of.block.shape == to.block.shape and of.block.kind == to.block.kind:
                    yield start, end, name


def names_of(name: str, shape: tuple[int, ...]) -> Iterator[str]:
    """Yield the variables of a block, as FMUs of FMI 2.0 spell them: T[1], T[2], ... or x[1,1], x[1,2], ..."""
    if not shape:
        yield name
        return
    for index in np.ndindex(shape):
        # fault: variables of an SSP system are counted from 0 -> yield f"{name}[{','.join(str(i) for i in index)}]" |
        #   coupler/test_ssp
        yield f"{name}[{','.join(str(i + 1) for i in index)}]"


def structure(scenario: Scenario, fields: Mapping[str, Fields]) -> str:
    """Return SystemStructure.ssd: components with their connectors, connections, and from when to when it runs."""
    lines = [f'{HEAD}<ssd:SystemStructureDescription xmlns:ssd="{DESCRIPTION}" xmlns:ssc="{COMMON}" version="1.0" '
             f'name={quoteattr(scenario.title)} generationTool="Slideline">', '<ssd:System name="scene">',
             "<ssd:Elements>"]
    for role, own in fields.items():
        lines += [f'<ssd:Component name="{role}" type="application/x-fmu-sharedlibrary" '
                  f'source="resources/{role}.fmu">', "<ssd:Connectors>", *_connectors(own), "</ssd:Connectors>",
                  f'<ssd:ParameterBindings><ssd:ParameterBinding source="resources/{role}.ssv"/>'
                  "</ssd:ParameterBindings>", "</ssd:Component>"]
    lines += ["</ssd:Elements>", "<ssd:Connections>"]
    for start, end, name in connected(fields):
        lines += [f'<ssd:Connection startElement="{start}" startConnector={connector} endElement="{end}" '
                  f"endConnector={connector}/>"
                  for connector in map(quoteattr, names_of(name, fields[start][name].block.shape))]
    return "\n".join([*lines, "</ssd:Connections>", "</ssd:System>",
                      f'<ssd:DefaultExperiment startTime="0" stopTime="{scenario.coupling.end!r}"/>',
                      "</ssd:SystemStructureDescription>", ""])


def _connectors(own: Fields) -> Iterator[str]:
    for name, field in own.items():
        kind, cause = field.block.kind, field.block.causality
        if kind not in TYPES or cause not in ("input", "output", "parameter"):
            continue
        unit = f' unit="{field.declared}"' if kind == "Real" and field.declared != "1" else ""
        for connector in map(quoteattr, names_of(name, field.block.shape)):
            yield f'<ssd:Connector name={connector} kind="{cause}"><ssc:{kind}{unit}/></ssd:Connector>'


def values(role: str, own: Fields, fields: Mapping[str, Fields]) -> str:
    """Return the ssv of a half: its parameters, and its inputs that no half gives, as they begin."""
    given = {name for _, end, name in connected(fields) if end == role}
    lines = [f'{HEAD}<ssv:ParameterSet xmlns:ssv="{VALUES}" xmlns:ssc="{COMMON}" version="1.0" name="{role}">',
             "<ssv:Parameters>"]
    for name, field in own.items():
        free = field.block.causality == "parameter" or (field.block.causality == "input" and name not in given)
        if free and field.start is not None and field.block.kind in TYPES:
            lines.append(f"<ssv:Parameter name={quoteattr(name)}><ssv:{field.block.kind} "
                         f"value={quoteattr(field.start)}/></ssv:Parameter>")
    return "\n".join([*lines, "</ssv:Parameters>", "</ssv:ParameterSet>", ""])
