"""The decorator of compiled functions that call one another across files.

numba keeps a compiled function beside its source file and looks at the age of THAT file alone: a change in a file it
calls into, or takes a constant from, would go unnoticed, and old machine code answer for new source.  Here the stamp of
a function is a hash of its file and of every file beside its package that this one imports, directly or not.

Several processes that need the same function at once (halves, studies, tests) compile it once: the others wait for it.
"""

from __future__ import annotations

import contextlib
import re
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])

WAIT = 30.0  # s for a function that another process compiles; one that was stopped meanwhile is not waited for longer
IMPORT = re.compile(rb"^[ \t]*(?:from|import)[ \t]+([\w.]+)", re.MULTILINE)


class _Mode:
    """Whether kernels that are imported from now on stay plain Python."""

    interpreted = False


def interpret() -> None:
    """Leave kernels that are imported from now on as plain Python, with the same numbers.

    For programs that read a scene and solve nothing: numba takes half a second to import, the kernels that look at a
    scene 12 s to compile, and what they do there is done in less without either.  To be called before any kernel is
    imported.
    """
    _Mode.interpreted = True


def kernel(function: F) -> F:
    """The function compiled by numba, and cached until a file it is compiled from changes."""
    # Division as in numpy: checks that could raise cost a tenth, and nothing may raise out of a half's loop.
    return _cached(function, cache=True, error_model="numpy")


def inner(function: F) -> F:
    """A kernel that makes no array.  It borrows those of its caller without counting, which costs as much as the work
    of a small kernel, in time and in compiling."""
    return _cached(function, cache=True, error_model="numpy", _nrt=False)


def one_of(functions: Sequence[Callable[..., Any]]) -> Callable[..., Any]:
    """Compile the function that calls functions[i](*arguments) for (i, *arguments); an i beyond them calls the last.

    The functions are inner kernels that take and return the same types.  They are compiled into a chain of comparisons,
    which costs less than a call through a pointer.  The chain keeps no cache of its own (numba cannot recognise one
    that stands on other functions in a later process): it becomes part of the kernel that calls it.
    """
    first, others = functions[0], functions[1:]
    if not others:
        return _compiled(lambda i, *arguments: first(*arguments), error_model="numpy", _nrt=False)
    rest = one_of(others)

    def chosen(i: int, *arguments: Any) -> Any:
        # fault: the last of several functions whatever the number -> if i < 0: | contact/test_compiled
        if i <= 0:
            return first(*arguments)
        return rest(i - 1, *arguments)

    return _compiled(chosen, error_model="numpy", _nrt=False)


def _compiled(function: F, **options: Any) -> F:
    if _Mode.interpreted:
        return function
    # Here and not above: who interprets spares its half second.
    from numba import njit

    return cast(F, njit(**options)(function))


def _cached(function: F, **options: Any) -> F:
    dispatcher: Any = _compiled(function, **options)
    if dispatcher is function:
        return function
    path = Path(function.__code__.co_filename)
    # numba has no public way to say this; test_compiled.py notices if it moves.
    files = dispatcher._cache._cache_file
    files._source_stamp = stamp(path, path.parents[function.__module__.count(".")])
    files._load_index = partial(_index_or_none, files._load_index)
    dispatcher.compile = partial(_compile_alone, dispatcher.compile, Path(files._index_path + ".lock"))
    return cast(F, dispatcher)


def _compile_alone(compile_: Callable[[Any], Any], lock: Path, signature: Any) -> Any:
    """Load a function from the cache, or compile it, while no other process does.

    Two at once would do the same work, and each might write its code under the name the other has put in the index.
    """
    from numba.core.compiler_lock import global_compiler_lock

    # The lock of threads first: one of them that waits for a file may not hold up the one that has it.
    # fault: processes that need one function at once all compile it -> with global_compiler_lock: |
    #   contact/test_compiled
    with global_compiler_lock, _locked(lock):
        return compile_(signature)


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold a lock file; after WAIT, in a folder that cannot be written, and on Windows go on without."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.open("w")
    except OSError:  # numba keeps nothing there either
        yield
        return
    with file:
        end = time.monotonic() + WAIT
        while True:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except OSError:
                if time.monotonic() > end:
                    break
                time.sleep(0.01)
        try:
            yield
        finally:
            # By name, not by closing: a process forked meanwhile has the file, too.
            fcntl.flock(file, fcntl.LOCK_UN)


def _index_or_none(load: Callable[[], dict[Any, str]]) -> dict[Any, str]:
    """Read what is cached of a function; nothing where it names classes this source no longer has."""
    try:
        return load()
    # fault: a cache with classes of an older source stops the program -> except KeyError: | contact/test_compiled
    except (AttributeError, ModuleNotFoundError):
        # numba reads the classes in the signatures before it compares the stamp, so an older source may stop it here.
        return {}


@cache
def stamp(path: Path, root: Path) -> str:
    """Hash of a source file and of all it imports from below root, the place packages are imported from."""
    found, ahead = {path}, [path]
    while ahead:
        new = {other for name in IMPORT.findall(_text(ahead.pop())) for other in _files(name.decode(), root)} - found
        found |= new
        # fault: compiled code blind to other files -> ahead += [] | contact/test_compiled
        ahead += new
    total = sha256()
    for each in sorted(found):
        total.update(sha256(_text(each)).digest())
    return total.hexdigest()


@cache
def _text(path: Path) -> bytes:
    return path.read_bytes()


@cache
def _files(name: str, root: Path) -> tuple[Path, ...]:
    """The sources of a dotted name: one file, or all of a package, whose names may be files."""
    place = root.joinpath(*name.split("."))
    if place.with_suffix(".py").is_file():
        return (place.with_suffix(".py"),)
    return tuple(sorted(place.glob("*.py")))
