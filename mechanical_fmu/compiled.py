"""The decorator of compiled functions that call one another across files.

numba keeps a compiled function beside its source file and looks at the age of THAT file alone: a change in a file it
calls into would go unnoticed, and old machine code answer for new source.  Here the stamp of a function is a hash of
the text of every file of the package that holds such functions.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """The function compiled by numba, and cached until any file with such functions changes."""
    # Division as in numpy: checks that could raise cost a tenth, and nothing may raise out of a half's loop.
    dispatcher: Any = njit(cache=True, error_model="numpy")(function)
    # numba has no public way to say this; test_points_cache.py notices if it moves.
    dispatcher._cache._cache_file._source_stamp = stamp()
    return cast(F, dispatcher)


@cache
def stamp() -> str:
    """Hash of every source file here that has compiled functions or the constants frozen into them."""
    text = sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        source = path.read_bytes()
        if b"import kernel" in source or path.name == "point_layout.py":
            text.update(source)
    return text.hexdigest()
