"""Makes the FMU of half.c: a thermal half of another tool, with names and units of its own, for n nodes.

fmi : 2, or 3, in which it is the same half with arrays in place of scalars (fmi3.c).
"""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__).resolve().parent
T_HOT, SLOPE, TAU = 120.0, 5.0, 30.0  # degC, K/MPa, s
SCALAR = '<ScalarVariable name="{}" valueReference="{}" causality="{}"><Real{}/></ScalarVariable>'
ARRAY = '<Float64 name="{}" valueReference="{}" causality="{}"{}>{}</Float64>'
TIME = '<Float64 name="time" valueReference="0" causality="independent" variability="continuous" unit="s"/>'
# Value references of half.c (the first of each) and of fmi3.c.
TEMPERATURES, POSITIONS, PRESSURES = (0, 1), (1000, 2), (100000, 3)
XML = {2: """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="wall" guid="{{wall}}" generationTool="another">
<CoSimulation modelIdentifier="wall" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="{state}"
 canSerializeFMUstate="{state}"/>
<UnitDefinitions><Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit></UnitDefinitions>
<ModelVariables>
{variables}
</ModelVariables><ModelStructure/></fmiModelDescription>
""", 3: """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="wall" instantiationToken="{{wall}}" generationTool="another">
<CoSimulation modelIdentifier="wall" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUState="{state}"
 canSerializeFMUState="{state}"/>
<UnitDefinitions><Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit></UnitDefinitions>
<ModelVariables>
{variables}
</ModelVariables><ModelStructure/></fmiModelDescription>
"""}


def make(folder: Path, n: int, n_q: int, T_start: float = 20.0, fmi: int = 2) -> Path:
    """The FMU of n nodes and n_q pair nodes that all start at T_start [degC]: temperatures `wall.T_0` and on [degC],
    positions `node1.x`, `node1.y` and on [no unit, mm], pressures `press(1)` and on [bar by declaration: MPa is meant].

    Of FMI 3.0 they are the arrays `wall.T`, `nodes` (n, 2) and `press`.
    """
    if fmi == 3:
        variables = [TIME, _array("wall.T", TEMPERATURES, "local", (n,), "degC"), _array("nodes", POSITIONS, "input",
                                                                                         (n, 2)),
                     _array("press", PRESSURES, "input", (n_q,), "furlong")]
    else:
        variables = [SCALAR.format(f"wall.T_{i}", i, "local", ' unit="degC"') for i in range(n)]
        variables += [SCALAR.format(f"node{i + 1}.{'xy'[j]}", 1000 + 2 * i + j, "input", ' start="0"')
                      for i in range(n) for j in range(2)]
        variables += [SCALAR.format(f"press({q + 1})", 100000 + q, "input", ' unit="furlong" start="0"')
                      for q in range(n_q)]
    return _packed(folder, variables, {"N": n, "Q": n_q, "T_START": T_start}, fmi=fmi)


def make_wall(folder: Path, n: int, n_q: int, T_start: float, *wrong: str, unit: str = "K", state: bool = True,
              fmi: int = 2) -> Path:
    """The same with the names of the border: its `T` stand in `unit`, which is what it says of them.

    T_start : as it gives it out.  wrong : what is wrong with it, as half.c (and fmi3.c) names it.
    """
    variables = [TIME] if fmi == 3 else []
    variables += _block("T", TEMPERATURES, "output", (n,), unit, fmi)
    variables += _block("x", POSITIONS, "input", (n, 2), "m", fmi)
    variables += _block("contact.t_N", PRESSURES, "input", (n_q,), "Pa", fmi)
    law = {"N": n, "Q": n_q, "T_START": T_start, "T_HOT": T_HOT + T_start, "SLOPE": 0.0}
    return _packed(folder, variables, law, wrong, state, fmi)


def make_body(folder: Path, X: NDArray[np.float64], scale: float, *wrong: str, unit: str = "m", fmi: int = 2) -> Path:
    """A mechanical half that stays where its mesh X : (n, 2) [m] is; its x are `scale` times that, in `unit`."""
    n = len(X)
    variables = [TIME] if fmi == 3 else []
    variables += _block("T", TEMPERATURES, "input", (n,), "K", fmi)
    variables += _block("x", POSITIONS, "output", (n, 2), unit, fmi)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "mesh.h").write_text(", ".join(map(repr, X.ravel().tolist())))
    return _packed(folder, variables, {"N": n, "Q": 0, "T_START": 300.0, "SCALE": scale}, ("BODY", *wrong), fmi=fmi)


def _block(name: str, first: tuple[int, int], causality: str, shape: tuple[int, ...], unit: str, fmi: int) -> list[str]:
    if fmi == 3:
        return [_array(name, first, causality, shape, unit)]
    more = f' unit="{unit}"' + (' start="0"' if causality == "input" else "")
    return [SCALAR.format(f"{name}[{','.join(str(k + 1) for k in index)}]", first[0] + at, causality, more)
            for at, index in enumerate(np.ndindex(shape))]


def _array(name: str, first: tuple[int, int], causality: str, shape: tuple[int, ...], unit: str = "") -> str:
    more = (f' unit="{unit}"' if unit else "") + (
        f' start="{" ".join(["0"] * int(np.prod(shape)))}"' if causality == "input" else "")
    return ARRAY.format(name, first[1], causality, more, "".join(f'<Dimension start="{size}"/>' for size in shape))


def _packed(folder: Path, variables: list[str], law: dict[str, float], wrong: tuple[str, ...] = (),
            state: bool = True, fmi: int = 2) -> Path:
    binaries = folder / "wall"
    binaries.mkdir(parents=True)
    library = binaries / "wall.so"
    law = {"T_HOT": T_HOT, "SLOPE": SLOPE, "TAU": TAU, **law}
    subprocess.run(["cc", "-O1", "-shared", "-fPIC", f"-I{folder}", *(f"-D{k}={v}" for k, v in law.items()),
                    *(f"-D{word}" for word in wrong), str(HERE / ("fmi3.c" if fmi == 3 else "half.c")), "-lm",
                    "-o", str(library)], check=True, timeout=120)
    out = folder / "wall.fmu"
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml",
                         XML[fmi].format(variables="\n".join(variables), state=str(state).lower()))
        archive.write(library, f"binaries/{'x86_64-linux' if fmi == 3 else 'linux64'}/wall.so")
    return out
