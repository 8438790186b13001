"""CalculiX as a program of a half: meshes as a slab of solid elements one metre thick, tables, printed results.

Plane scenes only.  Elements are solids (C3D8, C3D8I, C3D6) between two equal layers of nodes, so a load has an exact
place: half of it on either layer.  ccx's own plane elements are expanded behind the scenes, with equations between
nodes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Property
from contact.half.program import Program, ProgramError, program_of, refuse_unknown
from contact.half.volume import VolumeMesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

REMEDY = ("Install CalculiX (Debian, Ubuntu: apt-get install calculix-ccx), or give its path: "
          "options: {program: /path/to/ccx}")
JOB = "half"
PIECES = 16  # straight pieces for each piece of a property that is curved
# Of the largest force or heat, and of the largest change: by itself ccx would stop at 0.5 % and 1 %.
CONTROLS = ("*CONTROLS, PARAMETERS=FIELD", "1.E-9, 1.E-8")


def calculix(options: Mapping[str, Any], *more: str) -> Program:
    """Return the program ccx that the options of a half name.  more : keys of options beside its own.

    Raises ValueError.
    """
    refuse_unknown(options, ("program", "time_limit", *more))
    return program_of(options, "ccx", REMEDY)


def run(program: Program, deck: Sequence[str]) -> str:
    """Run a deck and return what ccx printed to its .dat file.  Raises ProgramError."""
    files = program.run([JOB], {f"{JOB}.inp": "\n".join([*deck, ""])}, [f"{JOB}.dat"])
    return files[f"{JOB}.dat"]


def number(value: float) -> str:
    """Write a number: ccx reads no more than twenty characters of one."""
    return f"{value:.12e}"


def slab(mesh: VolumeMesh, x: Floats, hexahedron: str) -> Iterator[str]:
    """Yield nodes and elements of a mesh on coordinates x : (n, 2) [m], with the sets NALL, NFRONT, Pk of parts k.

    hexahedron : the type of element in place of a quad.  Node i is i + 1 in front, n + i + 1 behind.
    """
    n = len(x)
    yield "*NODE, NSET=NALL"
    for layer in (0, 1):
        for i, (a, b) in enumerate(x.tolist()):
            yield f"{layer * n + i + 1}, {number(a)}, {number(b)}, {layer}."
    yield from ("*NSET, NSET=NFRONT, GENERATE", f"1, {n}")
    count = 0
    for kind, cells, part in ((hexahedron, mesh.quads, mesh.quad_part), ("C3D6", mesh.triangles, mesh.triangle_part)):
        for k in np.unique(part).tolist():
            yield f"*ELEMENT, TYPE={kind}, ELSET=P{k}"
            for cell in cells[part == k].tolist():
                count += 1
                yield ", ".join(str(node) for node in (count, *(i + 1 for i in cell), *(n + i + 1 for i in cell)))


def both(nodes: NDArray[np.intp], n: int, degree: int, values: Floats) -> Iterator[str]:
    """Yield the data lines of loads: half of values : (m,) on either layer's node of nodes : (m,)."""
    for i, value in zip(nodes.tolist(), values.tolist(), strict=True):
        for node in (i + 1, n + i + 1):
            yield f"{node}, {degree}, {number(0.5 * value)}"


def held(nodes: NDArray[np.intp], n: int, degree: int, values: Floats) -> Iterator[str]:
    """Yield the data lines of prescribed values : (m,) at nodes : (m,), on both layers."""
    for i, value in zip(nodes.tolist(), values.tolist(), strict=True):
        for node in (i + 1, n + i + 1):
            yield f"{node}, {degree}, {degree}, {number(value)}"


def table(*properties: Property, shift: float = 0.0) -> Iterator[str]:
    """Yield the data lines of properties by temperature.  shift : [K] that temperatures of the deck are less."""
    knots = sorted({float(T) for p in properties if p.curve is not None for T in _knots(p)})
    if not knots:
        yield ", ".join(number(float(p.constant or 0.0)) for p in properties)
    for T in knots:
        yield ", ".join([*(number(float(p(np.array([T]))[0])) for p in properties), number(T - shift)])


def _knots(p: Property) -> Floats:
    """Temperatures between which a property is straight, or nearly."""
    assert p.curve is not None
    x = np.asarray(p.curve.x, dtype=np.float64)
    if p.curve.c.shape[0] <= 2:
        return x
    return np.unique(np.concatenate([np.linspace(a, b, PIECES + 1) for a, b in pairwise(x)]))


def printed(text: str, title: str, n: int, columns: int) -> Floats:
    """Return the last table of a .dat file whose title begins so: (n, columns), by node.  Raises ProgramError."""
    found: Floats | None = None
    reading = False
    for line in text.splitlines():
        words = line.split()
        if not words:
            continue
        if not words[0].lstrip("-").isdigit():
            reading = line.strip().startswith(title)
            found = np.full((n, columns), np.nan) if reading else found
        elif reading and found is not None and len(words) == columns + 1 and 0 < int(words[0]) <= n:
            found[int(words[0]) - 1] = [_value(word) for word in words[1:]]
    if found is None:
        raise ProgramError(f"ccx printed no {title}")
    # fault: a node without a result is taken -> if False: | contact/test_half_program
    if not np.isfinite(found).all():
        bad = int(np.flatnonzero(~np.isfinite(found).all(axis=1))[0])
        raise ProgramError(f"ccx printed no number for {title} of node {bad + 1}")
    return found


def _value(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return float("nan")


def refuse_axisymmetric(mesh: VolumeMesh) -> None:
    """Raise ValueError for a scene around an axis."""
    if mesh.axisymmetric:
        raise ValueError("the half ccx is for the plane; choose another half for a scene around an axis")
