"""Makes the FMU of half.c: a thermal half of another tool, with names and units of its own, for n nodes."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__).resolve().parent
T_HOT, SLOPE, TAU = 120.0, 5.0, 30.0  # degC, K/MPa, s
SCALAR = '<ScalarVariable name="{}" valueReference="{}" causality="{}"><Real{}/></ScalarVariable>'
XML = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="wall" guid="{{wall}}" generationTool="another">
<CoSimulation modelIdentifier="wall" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="{state}"
 canSerializeFMUstate="{state}"/>
<UnitDefinitions><Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit></UnitDefinitions>
<ModelVariables>
{variables}
</ModelVariables><ModelStructure/></fmiModelDescription>
"""


def make(folder: Path, n: int, n_q: int, T_start: float = 20.0) -> Path:
    """The FMU of n nodes and n_q pair nodes that all start at T_start [degC]: temperatures `wall.T_0` and on [degC],
    positions `node1.x`, `node1.y` and on [no unit, mm], pressures `press(1)` and on [bar by declaration: MPa is meant].
    """
    variables = [SCALAR.format(f"wall.T_{i}", i, "local", ' unit="degC"') for i in range(n)]
    variables += [SCALAR.format(f"node{i + 1}.{'xy'[j]}", 1000 + 2 * i + j, "input", ' start="0"')
                  for i in range(n) for j in range(2)]
    variables += [SCALAR.format(f"press({q + 1})", 100000 + q, "input", ' unit="furlong" start="0"')
                  for q in range(n_q)]
    return _packed(folder, variables, {"N": n, "Q": n_q, "T_START": T_start})


def make_wall(folder: Path, n: int, n_q: int, T_start: float, *wrong: str, unit: str = "K", state: bool = True) -> Path:
    """The same with the names of the border: its `T` stand in `unit`, which is what it says of them.

    T_start : as it gives it out.  wrong : what is wrong with it, as half.c names it.
    """
    variables = [SCALAR.format(f"T[{i + 1}]", i, "output", f' unit="{unit}"') for i in range(n)]
    variables += _x(n, "input", ' unit="m" start="0"')
    variables += [SCALAR.format(f"contact.t_N[{q + 1}]", 100000 + q, "input", ' unit="Pa" start="0"')
                  for q in range(n_q)]
    law = {"N": n, "Q": n_q, "T_START": T_start, "T_HOT": T_HOT + T_start, "SLOPE": 0.0}
    return _packed(folder, variables, law, wrong, state=state)


def make_body(folder: Path, X: NDArray[np.float64], scale: float, *wrong: str, unit: str = "m") -> Path:
    """A mechanical half that stays where its mesh X : (n, 2) [m] is; its x are `scale` times that, in `unit`."""
    n = len(X)
    variables = [SCALAR.format(f"T[{i + 1}]", i, "input", ' unit="K" start="300"') for i in range(n)]
    variables += _x(n, "output", f' unit="{unit}"')
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "mesh.h").write_text(", ".join(map(repr, X.ravel().tolist())))
    return _packed(folder, variables, {"N": n, "Q": 0, "T_START": 300.0, "SCALE": scale}, ("BODY", *wrong))


def _x(n: int, causality: str, more: str) -> list[str]:
    return [SCALAR.format(f"x[{i + 1},{j + 1}]", 1000 + 2 * i + j, causality, more) for i in range(n) for j in range(2)]


def _packed(folder: Path, variables: list[str], law: dict[str, float], wrong: tuple[str, ...] = (),
            state: bool = True) -> Path:
    binaries = folder / "wall"
    binaries.mkdir(parents=True)
    library = binaries / "wall.so"
    law = {"T_HOT": T_HOT, "SLOPE": SLOPE, "TAU": TAU, **law}
    subprocess.run(["cc", "-O1", "-shared", "-fPIC", f"-I{folder}", *(f"-D{k}={v}" for k, v in law.items()),
                    *(f"-D{word}" for word in wrong), str(HERE / "half.c"), "-lm", "-o", str(library)], check=True,
                   timeout=120)
    out = folder / "wall.fmu"
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", XML.format(variables="\n".join(variables), state=str(state).lower()))
        archive.write(library, "binaries/linux64/wall.so")
    return out
