"""Field files of a finished run: frames of the journal to one .vtkhdf a half."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupler.record.vtkhdf import FieldFile

Arrays = dict[str, NDArray[Any]]


def write_field_files(folder: Path, meta: dict[str, Any], mesh: Arrays,
                      frames: Iterable[tuple[str, dict[str, Any], Arrays]]) -> list[Path]:
    """Write every half's frames to a file in `folder`; returns the files written.

    meta : the run's header; "fields" : half -> {"point": [...], "cell": [...]}, "field_files" : half ->
    name of its file.
    mesh : nodes, quads, triangles, quad_body, triangle_body.
    """
    fields, names = meta["fields"], meta["field_files"]
    body = np.concatenate([mesh["quad_body"], mesh["triangle_body"]]).astype(np.int32)
    with ExitStack() as stack:
        files = {
            half: stack.enter_context(FieldFile(
                folder / names[half], mesh["quads"], mesh["triangles"], len(mesh["nodes"]),
                tuple(about["point"]), tuple(about["cell"]), {"body": body}))
            for half, about in fields.items()
        }
        for _, m, a in frames:
            for half, file in files.items():
                values = {n: a[n] for n in (*fields[half]["point"], *fields[half]["cell"])}
                file.append(float(m["t_now"]), a["x"], values, values)
    return [folder / names[half] for half in fields]
