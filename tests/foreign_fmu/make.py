"""Makes the FMU of half.c: a thermal half of another tool, with names and units of its own, for n nodes."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
T_HOT, SLOPE, TAU = 120.0, 5.0, 30.0  # degC, K/MPa, s
SCALAR = '<ScalarVariable name="{}" valueReference="{}" causality="{}"><Real{}/></ScalarVariable>'
XML = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="wall" guid="{{wall}}" generationTool="another">
<CoSimulation modelIdentifier="wall" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"
 canSerializeFMUstate="true"/>
<UnitDefinitions><Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit></UnitDefinitions>
<ModelVariables>
{}
</ModelVariables><ModelStructure/></fmiModelDescription>
"""


def make(folder: Path, n: int, n_q: int, T_start: float = 20.0) -> Path:
    """The FMU of n nodes and n_q pair nodes that all start at T_start [degC]: temperatures `wall.T_0` and on [degC],
    positions `node1.x`, `node1.y` and on [no unit, mm], pressures `press(1)` and on [bar by declaration: MPa is meant].
    """
    binaries = folder / "wall"
    binaries.mkdir(parents=True)
    library = binaries / "wall.so"
    law = {"N": n, "Q": n_q, "T_START": T_start, "T_HOT": T_HOT, "SLOPE": SLOPE, "TAU": TAU}
    subprocess.run(["cc", "-O1", "-shared", "-fPIC", *(f"-D{k}={v}" for k, v in law.items()), str(HERE / "half.c"),
                    "-lm", "-o", str(library)], check=True, timeout=120)
    variables = [SCALAR.format(f"wall.T_{i}", i, "local", ' unit="degC"') for i in range(n)]
    variables += [SCALAR.format(f"node{i + 1}.{'xy'[j]}", 1000 + 2 * i + j, "input", ' start="0"')
                  for i in range(n) for j in range(2)]
    variables += [SCALAR.format(f"press({q + 1})", 100000 + q, "input", ' unit="furlong" start="0"')
                  for q in range(n_q)]
    out = folder / "wall.fmu"
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", XML.format("\n".join(variables)))
        archive.write(library, "binaries/linux64/wall.so")
    return out
