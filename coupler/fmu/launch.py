"""Halves of a scenario: built into FMUs in a cache named by content, loaded in this process or each in its own.

A half is an installed package with an entry point in the group `slideline.halves` (name -> module); the module is run
as `python -m MODULE DIRECTORY OUT.fmu` in a process of its own, so the coupler never imports a half.  An FMU that lies
ready, of whatever tool, is named by its path instead.
"""

from __future__ import annotations

import contextlib
import difflib
import hashlib
import io
import os
import secrets
import shutil
import tempfile
import time
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import lru_cache, partial
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any

from contact.half.build import content_hash, package_directory
from contact.half.entry import sources_hash
from contact.half.model import load_directory
from contact.half.papers import places
from coupler.errors import HalfError, ScenarioError
from coupler.fmu.bind import bind
from coupler.fmu.builders import run_builder
from coupler.fmu.description import SAFE_WORDS, is_safe, read_description, unpack, with_description
from coupler.fmu.fmi import load_half
from coupler.fmu.half import Half
from coupler.fmu.replayed import Place
from coupler.fmu.scratch import scratch_folder

if TYPE_CHECKING:  # a server of a role launches what it is sent: it reads no scenario, whose import takes 0.6 s
    from coupler.scenario import Scenario

GROUP = "slideline.halves"
OWN_TOOL = "(Slideline)"  # how contact.half.build ends the name of the tool
KEEP_DAYS = 30  # an FMU not used for so long is dropped from the cache
CAP = 2_000_000_000  # bytes of the cache; beyond it those used longest ago go
USED_LATELY = 86400.0  # s
SIZE = "size.txt"  # beside a cached FMU: its bytes and those of what it unpacks to
DIGEST = "half.sha256"  # beside a cached FMU: the checksum of the archive
VERDICTS = "verdicts"  # the folder in the cache of what was found of halves (coupler.verify.verdicts)


def known_halves() -> dict[str, EntryPoint]:
    """The kinds of halves that are installed."""
    return dict(_installed(places()))


@lru_cache(maxsize=4)
def _installed(known: tuple[tuple[str, int], ...]) -> dict[str, EntryPoint]:
    """The kinds that are found in places as they are now: 8 ms for all that is installed, 20 times a run."""
    return {point.name: point for point in entry_points(group=GROUP)}


def build_half(kind: str, directory: Path, cache: Path | None = None, fmi: int = 2) -> Path:
    """The FMU of the half of `kind` whose interface.h5 and model.json are in `directory`.

    kind : an entry point's name, or the path of a prebuilt FMU, which is copied to the cache as it is.
    fmi : 2 or 3, of what is built.
    cache : where FMUs are kept (default: cache_directory()).  The same content is built once; beside the FMU lies
    what it unpacks to, which load_half then uses.  Raises HalfError for an unknown kind, or with the builder's words.
    """
    if kind.endswith(".fmu"):
        return _ready(Path(kind), cache_directory() if cache is None else cache)
    known = known_halves()
    if kind not in known:
        near = difflib.get_close_matches(kind, known, 1)
        raise HalfError(f"no half of kind {kind!r} is installed; there are {', '.join(sorted(known)) or 'none'}"
                        + (f"; did you mean {near[0]!r}?" if near else ""))
    module = known[kind].module
    cache = cache_directory() if cache is None else cache
    place = cache / f"{kind}-{'fmi3-' if fmi == 3 else ''}{_key(kind, module, directory)}"
    common = _common_builders() if known[kind].name in _own_kinds() else None
    return _cached(place, lambda new: run_builder(kind, module, _words(directory, new, fmi), new, common))


def _words(directory: Path, out: Path, fmi: int) -> list[str]:
    return [str(directory.absolute()), str(out), *(["--fmi", "3"] if fmi == 3 else [])]


def _own_kinds() -> frozenset[str]:
    from coupler.scenario.kinds import SHIPPED

    return SHIPPED


def _common_builders() -> tuple[str, list[str]]:
    """What the sources of this project's builders are now, and their modules."""
    modules = sorted({point.module for name, point in known_halves().items() if name in _own_kinds()})
    packages = sorted({"contact", *(module.partition(".")[0] for module in modules)})
    return " ".join(sources_hash(package_directory(name)) for name in packages), modules


def _ready(fmu: Path, cache: Path) -> Path:
    """The copy of an FMU in the cache, named by its content, unpacked beside."""
    try:
        content = fmu.read_bytes()
    except OSError as exc:
        raise HalfError(f"{fmu} cannot be read ({exc.strerror})") from exc
    if not zipfile.is_zipfile(io.BytesIO(content)):  # told by its own path, not by that of a copy
        raise HalfError(f"{fmu} cannot be unpacked: an FMU is a zip archive, this is none")
    return put_ready(content, cache)


def put_ready(content: bytes, cache: Path) -> Path:
    """Return the place in the cache of a prebuilt FMU, put there if it is not yet."""
    return _cached(ready_place(hashlib.sha256(content).hexdigest(), cache),
                   lambda new: new.write_bytes(content))


def ready_place(digest: str, cache: Path) -> Path:
    """Return the folder in the cache of a prebuilt FMU.  digest : SHA-256 of it, in hexadecimal digits."""
    return cache / f"ready-{digest[:32]}"


def _cached(place: Path, make: Callable[[Path], object]) -> Path:
    """The FMU at a place of the cache, made if it is not there yet."""
    fmu = place / "half.fmu"
    if fmu.is_file() and not is_whole(fmu):
        _set_aside(place)
    if not fmu.is_file():
        _put(place, make)
    # A cache that belongs to another user may be read all the same.
    with contextlib.suppress(OSError):
        os.utime(place)
    return fmu


def is_whole(fmu: Path) -> bool:
    """Whether an FMU of the cache and what it unpacks to are as they were made, by their checksums.

    A crash of the machine leaves files cut or empty: the FMU would otherwise be refused for ever.
    """
    try:
        # What is as it was put there has not to be inflated: 5 ms instead of 18.
        as_put = hashlib.sha256(fmu.read_bytes()).hexdigest() == _kept(fmu.parent, DIGEST)
        with zipfile.ZipFile(fmu) as archive:
            for info in archive.infolist():
                # fault: an archive in the cache is not looked at -> if False: | coupler/test_cache
                if not as_put:
                    archive.read(info)  # checks its checksum
                # fault: what is unpacked in the cache is not looked at -> if False: | coupler/test_cache
                if not info.is_dir() and zlib.crc32((fmu.with_suffix("") / info.filename).read_bytes()) != info.CRC:
                    return False
            return bool(archive.infolist())
    except (OSError, ValueError, EOFError, NotImplementedError, zipfile.BadZipFile, zlib.error):
        return False


def _kept(place: Path, name: str) -> str:
    """A text that was put beside an FMU; "" where an older version put none, or a crash of the machine cut it."""
    try:
        return (place / name).read_text(encoding="ascii")
    except (OSError, ValueError):
        return ""


def _set_aside(place: Path) -> None:
    """Remove a place of the cache that is damaged.  Raises HalfError where it cannot be removed."""
    aside = place.with_name(f".build-damaged-{secrets.token_hex(4)}")
    try:
        os.replace(place, aside)
    except OSError as exc:
        raise HalfError(f"{place} is damaged and cannot be replaced ({exc.strerror}); remove it, or set "
                        "SLIDELINE_CACHE to a directory of your own") from exc
    shutil.rmtree(aside, ignore_errors=True)


def cache_directory() -> Path:
    """SLIDELINE_CACHE, else ~/.cache/slideline, else a directory of this user's among the temporary ones.

    The second is passed over where FMUs cannot be loaded from it (see coupler.fmu.description) or it cannot be written.
    Raises HalfError if none will do.
    """
    chosen = os.environ.get("SLIDELINE_CACHE")
    if chosen:
        return _chosen_cache(Path(chosen).absolute())
    home = Path.home() / ".cache" / "slideline"
    if is_safe(home):
        try:
            home.mkdir(mode=0o700, parents=True, exist_ok=True)
        except OSError:
            pass  # a read-only home: the next choice serves
        else:
            if os.access(home, os.W_OK):
                return home
    own = Path(tempfile.gettempdir()) / f"slideline-{os.getuid() if hasattr(os, 'getuid') else 'cache'}"
    own.mkdir(mode=0o700, exist_ok=True)
    # FMUs are programs: a directory somebody else made could hold somebody else's.
    if own.is_symlink() or (hasattr(os, "getuid") and own.stat().st_uid != os.getuid()):
        raise HalfError(f"{own} belongs to another user; set SLIDELINE_CACHE to a directory of your own")
    return own


def _chosen_cache(path: Path) -> Path:
    if not is_safe(path):
        raise HalfError(f"SLIDELINE_CACHE is {path}: FMUs cannot be loaded from there; {SAFE_WORDS}")
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as exc:
        raise HalfError(f"SLIDELINE_CACHE is {path}: no such folder can be made ({exc.strerror})") from exc
    return path


def _key(kind: str, module: str, directory: Path) -> str:
    from coupler.scenario.kinds import OWN

    package = module.partition(".")[0]
    try:
        interface, model = load_directory(directory)
        # A half of another package may be made of ours: what it is built of is not known here, so all of it counts.
        known = known_halves()
        ours = {known[name].module.partition(".")[0] for kinds in OWN.values() for name in kinds.values()}
        used = ("contact", package) if package in ours else ("contact", *sorted(ours), package)
        sources = {name: sources_hash(package_directory(name)) for name in used}
    except ValueError as exc:
        raise HalfError(str(exc), half=kind) from exc
    return content_hash(interface, model, sources)


def _put(place: Path, make: Callable[[Path], object]) -> None:
    """Make half.fmu and unpack it in a scratch directory, then move both into place at once."""
    place.parent.mkdir(parents=True, exist_ok=True)
    _drop_old(place.parent)
    scratch = Path(tempfile.mkdtemp(dir=place.parent, prefix=".build-"))
    try:
        make(scratch / "half.fmu")
        unpack(scratch / "half.fmu", scratch / "half")
        (scratch / SIZE).write_text(str(_bytes_in(scratch)), encoding="ascii")
        (scratch / DIGEST).write_text(hashlib.sha256((scratch / "half.fmu").read_bytes()).hexdigest(), encoding="ascii")
        try:
            os.replace(scratch, place)
        except OSError:
            # Another process was quicker; what it built is the same.
            if not (place / "half.fmu").is_file():
                raise
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def _drop_old(cache: Path) -> None:
    limit = time.time() - KEEP_DAYS * 86400
    killed = time.time() - 86400  # what a killed builder left; none works for a day
    for place in (*cache.glob(".build-*"), *cache.glob(".unpack-*")):
        with contextlib.suppress(FileNotFoundError):
            if place.stat().st_mtime < killed:
                shutil.rmtree(place, ignore_errors=True)
    for place in cache.glob("*-" + "[0-9a-f]" * 32):
        with contextlib.suppress(FileNotFoundError):  # another process may be dropping it too
            if place.stat().st_mtime < limit:
                shutil.rmtree(place, ignore_errors=True)
    for verdict in (cache / VERDICTS).glob("*"):
        with contextlib.suppress(FileNotFoundError):
            if verdict.stat().st_mtime < limit:
                verdict.unlink()
    drop_to(cache, CAP, spare=USED_LATELY)


def cached_halves(cache: Path) -> list[tuple[Path, float, int]]:
    """The built halves of a cache, the one used longest ago first: place, time of its last use [s], bytes."""
    found = []
    for place in cache.glob("*-" + "[0-9a-f]" * 32):
        with contextlib.suppress(FileNotFoundError):  # another process may be dropping it
            found.append((place, place.stat().st_mtime, _size_of(place)))
    return sorted(found, key=lambda row: row[1])


def _size_of(place: Path) -> int:
    """Bytes of a cached half, as it was put there: each build asks it of all, and a half is 200 files."""
    size = _kept(place, SIZE)
    # fault: the files of all cached halves are counted at every build -> return _bytes_in(place) | coupler/test_cache
    return int(size) if size.isdecimal() else _bytes_in(place)


def _bytes_in(place: Path) -> int:
    return sum(f.stat().st_size for f in place.rglob("*") if f.is_file() and f.name not in (SIZE, DIGEST))


def drop_to(cache: Path, most: float, spare: float = 0.0) -> int:
    """Drop the halves used longest ago until the cache holds at most so many bytes; returns how many were dropped.

    spare [s] : those used within this time stay, a run may have them open.
    """
    places, dropped = cached_halves(cache), 0
    size = sum(bytes_of for _, _, bytes_of in places)
    for place, used, bytes_of in places:
        # fault: cache: the cap is not kept -> if True: | coupler/test_tools
        if size <= most or used > time.time() - spare:
            break
        shutil.rmtree(place, ignore_errors=True)
        size, dropped = size - bytes_of, dropped + 1
    return dropped


def clear_cache(cache: Path) -> int:
    """Drop all built halves of a cache, verdicts on halves, and what killed builders left.

    Returns how many halves were dropped.
    """
    dropped = drop_to(cache, 0.0)
    # fault: verdicts stay in a cache that is cleared -> for place in (*cache.glob(".build-*"),
    #   *cache.glob(".unpack-*")): | coupler/test_verdicts_kept
    for place in (*cache.glob(".build-*"), *cache.glob(".unpack-*"), cache / VERDICTS):
        shutil.rmtree(place, ignore_errors=True)
    return dropped


# The two halves of a run.

@dataclass(frozen=True)
class Launched:
    """The two halves, loaded but not initialised.

    link : how they reach contact (parameter contact.link).  asked : what a contact service in a process of its own was
    asked so far, by verb.  restarts : whose process was started anew, in words.  places : where halves in processes
    stand, by role; none of one that cannot be brought there again.  recover : brings them to such places.
    """

    thermal: Half
    mechanical: Half
    link: str
    asked: Callable[[], dict[str, Any]] = dict
    restarts: Sequence[str] = ()
    places: Callable[[], dict[str, Place]] = dict
    recover: Callable[[Mapping[str, Place]], None] | None = None


def is_foreign(fmu: Path) -> bool:
    """Whether an FMU in the cache is another tool's: its binary may crash, hang or end the process that it is in."""
    # fault: every FMU counts as ours -> return False | coupler/test_foreign_binary
    return not read_description(fmu.with_suffix("")).tool.endswith(OWN_TOOL)


@contextmanager
def launch(scenario: Scenario, *, processes: bool, hosts: Path | None = None,
           join: Callable[[Scenario, str, Mapping[str, Half]], Half] | None = None,
           built: Callable[[Mapping[str, Path]], object] = lambda fmus: None) -> Iterator[Launched]:
    """Build and load both halves; close them, and end their processes, on the way out.

    hosts : a file that says on which machines the halves and contact run (coupler.fmu.hosts).  join : makes the half
    of a role, one and on the scene's mesh, of those by name (coupler.schemes.mapped.joined); needed by scenes that have
    several, or a half with a mesh of its own.  built : called with the FMUs by name before any is loaded; what it
    raises ends all.
    Raises HalfError naming the half that cannot be built or loaded.
    """
    with ExitStack() as stack:
        scratch = stack.enter_context(scratch_folder())
        fmus = _built(scenario, {name: scratch / name for name in scenario.halves})
        built(fmus)

        def of_role(role: str, halves: Mapping[str, Half]) -> Half:
            if role not in scenario.own_meshes and (role != "thermal" or scenario.several is None):
                return halves[role]
            assert join is not None, "several halves in a role, and one on a mesh of its own, are launched with a join"
            return join(scenario, role, halves)

        # fault: a foreign binary runs in the coupler's own process -> if processes: | coupler/test_foreign_binary
        if processes or hosts is not None or any(is_foreign(fmu) for fmu in fmus.values()):
            from coupler.fmu.hosts import read_hosts
            from coupler.fmu.processes import processes as in_processes  # embedded runs do not load zenoh

            deadlines = {name: seconds for name in fmus
                         if (seconds := scenario.coupling.deadlines.get(name.partition(".")[0])) is not None}
            hosted = stack.enter_context(in_processes(fmus, step_deadlines=deadlines,
                                                      restarts=scenario.coupling.restart,
                                                      hosts=None if hosts is None else read_hosts(hosts, tuple(fmus))))
            remote = hosted.halves
            yield Launched(of_role("thermal", remote), of_role("mechanical", remote), hosted.contact_link,
                           hosted.asked, hosted.restarts,
                           lambda: {n: half.at for n, half in remote.items() if half.at is not None}, hosted.recover)
            return
        halves = {}
        for name, fmu in fmus.items():
            halves[name] = load_half(fmu, None, name, past_lists=True)
            stack.callback(halves[name].close)
        yield Launched(of_role("thermal", halves), of_role("mechanical", halves), scenario.coupling.link)


def _built(scenario: Scenario, folders: Mapping[str, Path], fmi: int = 2) -> dict[str, Path]:
    """The FMUs of roles, in the cache, with the names of the border.  fmi : 2 or 3, of those that are built.

    folders : where what they are built from is written.  Builders are processes of their own, and run at once.
    """
    from coupler.scenario.kinds import OWN

    kinds = {role: scenario.write_half(role, folder) for role, folder in folders.items()}
    # One of several is no FMU that lies ready, so no names of its own are bound.
    bound = [str(bind(scenario, name, Path(kind), folders[name] / "bound.fmu")) if name in OWN else kind
             for name, kind in kinds.items()]
    with ThreadPoolExecutor(len(bound)) as builders:
        return dict(zip(folders, builders.map(partial(build_half, fmi=fmi), bound, folders.values()),
                        strict=True))


def make_folder(folder: Path) -> None:
    """Make a folder the user asked for.  Raises ScenarioError if that is not possible."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as exc:
        raise ScenarioError(f"this folder cannot be made ({exc.strerror})", file=str(folder),
                            remedy="Give another one") from exc


def build_halves(scenario: Scenario, folder: Path, fmi: int = 2) -> list[Path]:
    """Build the FMUs of a scenario into a folder: thermal.fmu, mechanical.fmu, ours with its times in them.

    fmi : 2, or 3 in which arrays are variables.  A half that is the path of an FMU is copied as it is.

    Raises ScenarioError if the folder cannot be made, HalfError if a half cannot be built.
    """
    make_folder(folder)
    with scratch_folder() as scratch:
        fmus = _built(scenario, {name: scratch / name for name in scenario.halves}, fmi)
        return [_with_experiment(fmu, folder / f"{name}.fmu", scenario) for name, fmu in fmus.items()]


def _with_experiment(fmu: Path, out: Path, scenario: Scenario) -> Path:
    """A copy of an FMU whose description says from when to when the scenario runs, and its first window.

    An FMU in the cache serves scenarios of any time; one of another tool is copied as it is.
    """
    if is_foreign(fmu):
        return Path(shutil.copyfile(fmu, out))
    c = scenario.coupling
    step = c.adaptive.first if c.adaptive is not None else min(c.windows[0].first, c.end)
    experiment = f'<DefaultExperiment startTime="0" stopTime="{c.end!r}" stepSize="{step!r}"/>'
    return with_description(fmu, lambda xml: xml.replace(b"</LogCategories>",
                                                          b"</LogCategories>" + experiment.encode(), 1), out)
