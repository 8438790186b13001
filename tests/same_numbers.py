"""Proof that a change of the code changed no number: every scene before and after it, bit by bit.

    python tests/same_numbers.py store FOLDER [--only SCENE ...] [--quick] [--scenarios DIR] [--docs DIR] [--jobs N]
    python tests/same_numbers.py BEFORE AFTER [--all] [--except SCENE ...] [--expected FILE]

`store` runs the scenes of same_scenes.py by the code that is installed for the Python it is called with, which may be
another checkout's, each embedded and with --processes.  Of each it keeps what the halves are told (interface.h5,
model.json) and what the run left (run.h5, .vtkhdf).  Where the two ways differ in windows both have, it says so, and
whether they are the same on one thread: processes have one, an embedded run as many as there are cores, and sums then
round in another order.  Exit code 0 done, 1 a scene failed or its two ways differ.

The comparison takes every value of these files but those of EXCLUDED; names that were changed stand in RENAMED.
FILE is TOML: a line `scene = "reason"` for each that is meant to differ.  Exit code 0 equal, 1 not, 2 cannot be told.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import importlib.util
import json
import os
import platform
import re
import shutil
import sys
import tempfile
import time
import tomllib
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from ruamel.yaml import YAML
from same_scenes import Scene, UsageError, scenes

# What may differ between two runs of the same code, by name and with the reason.
EXCLUDED = {
    "*/run.h5/windows/*seconds": "wall-clock time",
    "*/run.h5/timings*": "wall-clock time",
    "*/run.h5/calls*": "wall-clock time",
    "*/run.h5/@totals/*seconds": "wall-clock time",
    "*/run.h5/@totals/contact/*/total": "wall-clock time of the contact service",
    "*/run.h5/@totals/contact/*/typical": "wall-clock time of the contact service",
    "*/run.h5/@totals/contact/*/most": "wall-clock time of the contact service",
    "*/run.h5/@header/started": "the time of day",
    "*/run.h5/@header/machine": "the host",
    "*/run.h5/@header/versions/*": "versions of packages",
    "*/run.h5/@header/scenario/hash": "a hash",
    "*/run.h5/@version": "version of the file's layout",
    "*/run.h5/@texts": "a digest of all texts, the time of day among them",
    "*/interface.h5/@version": "version of the file's layout",
}
# Path before -> path after, of groups, datasets, columns and keys; * stands for one name:
# "*/run.h5/@header/pairs": "*/run.h5/@header/contact".
RENAMED: dict[str, str] = {}
# Scenes that take long: with --processes they stop at this time [s].
CUT = {"aluminium_can": 200.0}
# What --quick runs, embedded alone: each kind of half, of scheme, of windows, of contact; a rule, a half of one's own.
QUICK = ("casting_1d", "hot_upsetting", "lumped_gap", "sliding_blocks", "superplastic_bulge", "template.heated_blocks",
         "contact.friction", "thermal.adaptive", "thermal.near", "write_a_half.run")
# The tables of a run.h5 that have a row a window or an iterate: of a run that was stopped, their first rows.
ROWS = re.compile(r"run\.h5/(t|(windows|iterates|estimates|errors|probes|ledger|monitors|contact)/.*|words/\d+/.*)")
# What only one of the two ways has.
OF_THE_WAY = ("run.h5/@header/processes", "run.h5/@totals/contact", "ended.json")
PARTS = ("halves", "embedded", "processes")
THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")

Leaf = Any  # an array, or a text, truth value or None
Leaves = dict[str, Leaf]


@dataclass(frozen=True)
class Difference:
    """path : of the value.  words : how it differs.  size : relative to the largest value of its array."""

    path: str
    words: str
    size: float = np.inf


def keep(scene: Scene, target: Path, quick: bool) -> tuple[bool, str]:
    """Build and run a scene: whether all is well, and what to say of it."""
    cut, seconds = CUT.get(scene.name), []
    for part in PARTS[:2] if quick else PARTS:
        out, started = target / part, time.perf_counter()
        out.mkdir(parents=True)
        way = ["--processes", *(["--until", cut] if cut else [])] if part == "processes" else []
        done = scene.do("build" if part == "halves" else "run", out, *way)
        (out / "ended.json").write_text(json.dumps({"code": done.returncode}), encoding="utf-8")
        if done.returncode:
            (out / "said.txt").write_text(done.stderr, encoding="utf-8")
            return False, f"FAILED: {part} ended with {done.returncode}: {done.stderr.strip()[-500:]}"
        seconds.append(f"{part} {time.perf_counter() - started:.1f} s")
    said = ", ".join(seconds) + (f" (to t = {cut:g} s)" if cut and not quick else "")
    if quick or not (apart := modes_apart(target / "embedded", target / "processes")):
        return True, said
    with tempfile.TemporaryDirectory(dir=target.parent) as scratch:
        scene.do("run", Path(scratch), **dict.fromkeys(THREADS, "1"))
        still = modes_apart(Path(scratch), target / "processes")
    return not still, (f"{said}; WITH --processes OTHER NUMBERS: {told(still)}" if still else
                       f"{said}; with --processes the same on one thread, on more: {told(apart)}")


def store(args: argparse.Namespace) -> int:
    """Fill a folder; 1 where a scene failed or its two ways differ."""
    folder: Path = args.folder.absolute()
    if folder.exists() and any(folder.iterdir()):
        raise UsageError(f"{folder} is not empty; give another folder")
    spec = importlib.util.find_spec("coupler")
    if spec is None or spec.origin is None:
        raise UsageError(f"no coupler is installed for {sys.executable}")
    root = Path(spec.origin).parents[1]
    scenarios, docs = (args.scenarios or root / "scenarios").absolute(), (args.docs or root / "docs").absolute()
    for place in (scenarios, docs):
        if not place.is_dir():
            raise UsageError(f"{place}: no such folder; give --scenarios and --docs")
    (folder / "inputs").mkdir(parents=True)
    started, failed = time.perf_counter(), 0
    wanted = args.only or (QUICK if args.quick else ())
    known = {scene.name: scene for scene in scenes(folder / "inputs", scenarios, docs, wanted)}
    if unknown := set(args.only or ()) - set(known):
        shutil.rmtree(folder / "inputs")
        raise UsageError(f"no scene {', '.join(sorted(unknown))}; there are demo, {', '.join(known)}")
    chosen = [scene for name, scene in known.items() if not wanted or name in wanted]
    print(f"{len(chosen)} scenes by the code of {root}", flush=True)
    with ThreadPoolExecutor(args.jobs) as pool:
        ends = pool.map(lambda scene: keep(scene, folder / "scenes" / scene.name, args.quick), chosen)
        for scene, (well, said) in zip(chosen, ends, strict=True):
            failed += not well
            print(f"{scene.name}: {said}", flush=True)
    packages = {name: importlib.metadata.version(name) for name in ("numpy", "scipy", "numba", "h5py")}
    made = {"folder": str(folder), "partial": bool(wanted), "on": {
        "python": platform.python_version(), "machine": platform.machine(), "cpus": os.cpu_count(), **packages,
        **{name: os.environ.get(name, "") for name in (*THREADS, "SLIDELINE_SOLVER")}}}
    (folder / "made.json").write_text(json.dumps(made, indent=1), encoding="utf-8")
    print(f"{len(chosen)} scenes, {failed} not well, {time.perf_counter() - started:.0f} s: {folder}")
    return int(failed > 0)


def leaves_of(folder: Path, stored_at: str = "") -> Leaves:
    """path -> value of all that lies in a folder.  stored_at : what stands for a place in texts and is taken out."""
    found: Leaves = {}
    for path in sorted(p for p in folder.rglob("*") if p.is_file() and p.suffix != ".txt"):
        name = path.relative_to(folder).as_posix()
        if path.suffix == ".json":
            put(found, name, json.loads(path.read_text(encoding="utf-8")))
            continue
        with h5py.File(path) as f:
            put_attrs(found, name, f)
            f.visititems(lambda inner, item, name=name: put_item(found, f"{name}/{inner}", item))
    if stored_at:
        found = {p: v.replace(stored_at, "FOLDER") if isinstance(v, str) else v for p, v in found.items()}
    return {p: v for p, v in found.items() if not any(fnmatch(f"/{p}", pattern) for pattern in EXCLUDED)}


def put_item(found: Leaves, name: str, item: h5py.Group | h5py.Dataset) -> None:
    put_attrs(found, name, item)
    put(found, name, item[()] if isinstance(item, h5py.Dataset) else "a group")


def put_attrs(found: Leaves, name: str, item: h5py.Group | h5py.Dataset) -> None:
    for key, value in item.attrs.items():
        put(found, f"{name}/@{key}", value)


def put(found: Leaves, name: str, value: Any) -> None:
    """A value by its leaves: JSON and YAML in texts as what they say, tables by their columns, numbers as arrays."""
    if isinstance(value, bytes):
        value = value.decode()
    if isinstance(value, str) and value[:1] in ("{", "["):
        with suppress(ValueError):
            value = json.loads(value)
    elif isinstance(value, str) and name.endswith(("run.h5/scenario", "/@header/scenario/text")):
        value = YAML(typ="safe").load(value)  # comments may change
    if isinstance(value, np.ndarray) and value.dtype.names:
        value = {column: value[column] for column in value.dtype.names}
    if isinstance(value, np.ndarray | np.generic):
        found[name] = value.astype(str) if value.dtype.kind in "SO" else value
    elif isinstance(value, Mapping):
        found[name] = "a group"
        for key, inner in value.items():
            put(found, f"{name}/{key}", inner)
    elif isinstance(value, list) and shape_of(value) is None:
        found[name] = f"a list of {len(value)}"
        for k, inner in enumerate(value):
            put(found, f"{name}/{k}", inner)
    else:
        found[name] = value if shape_of(value) is None else np.array(value, dtype=float)


def shape_of(value: Any) -> tuple[int, ...] | None:
    """Of a number, or of lists of them that make an array; None for anything else."""
    if isinstance(value, list):
        inner = {shape_of(v) for v in value}
        shape = inner.pop() if len(inner) == 1 else None
        return None if shape is None else (len(value), *shape)
    return () if isinstance(value, int | float) and not isinstance(value, bool) else None


def renamed(path: str, names: Mapping[str, str]) -> str:
    """The path after of a path before; what one renaming leaves is given to the next."""
    for old, new in names.items():
        pattern = re.sub(r"^\\\*/", "(.*/)?", re.escape(old)).replace(r"\*", "([^/]+)")
        if match := re.fullmatch(f"{pattern}(?P<rest>/.*)?", path):
            stars = [star or "" for star in match.groups()]
            path = re.sub(r"^\*/", "{}", new).replace("*", "{}").format(*stars[:-1]) + stars[-1]
    return path


def differences(before: Leaves, after: Leaves) -> list[Difference]:
    """All there are, the largest first."""
    found = []
    for path in {**before, **after}:
        if path not in before or path not in after:
            found.append(Difference(path, "only " + ("before" if path in before else "after")))
        elif difference := compared(path, before[path], after[path]):
            found.append(difference)
    return sorted(found, key=lambda d: -d.size)


def compared(path: str, a: Leaf, b: Leaf) -> Difference | None:
    """The largest difference of two values; None where they have the same bits, any nan being like any other."""
    if not (isinstance(a, np.ndarray | np.generic) and isinstance(b, np.ndarray | np.generic)):
        same = type(a) is type(b) and a == b
        return None if same else Difference(path, f"{shown(a)} before, {shown(b)} after")
    for what in ("shape", "dtype"):
        if (x := getattr(a, what)) != (y := getattr(b, what)) and {a.dtype.kind, b.dtype.kind} != {"U"}:
            return Difference(path, f"{what} {x} before, {y} after")
    a, b = np.atleast_1d(a), np.atleast_1d(b)
    if a.dtype.kind != "f":
        unlike = a != b
    else:
        x, y = (np.ascontiguousarray(v).view(f"u{v.dtype.itemsize}") for v in (a, b))
        unlike = (x != y) & ~(np.isnan(a) & np.isnan(b))
    if not unlike.any():
        return None
    if a.dtype.kind not in "fiu":
        at = tuple(map(int, np.argwhere(unlike)[0]))
        return Difference(path, f"{list(at)}: {shown(a[at])} before, {shown(b[at])} after")
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.where(unlike, np.abs(a.astype(float) - b.astype(float)), -1.0)
    apart[unlike & np.isnan(apart)] = np.inf
    at = tuple(map(int, np.unravel_index(apart.argmax(), apart.shape)))
    scale = float(np.abs(a[np.isfinite(a)]).max(initial=0.0))
    size = float(apart[at]) / scale if scale else np.inf if apart[at] else 0.0
    return Difference(path, f"{list(at)}: {a[at]!s} before, {b[at]!s} after, by {apart[at]:.3g} "
                            f"({size:.2g} of its largest; {int(unlike.sum())} of {a.size} values)", size)


def shown(value: Leaf) -> str:
    text = repr(value)
    return text if len(text) < 80 else f"{text[:77]}..."


def told(found: Sequence[Difference]) -> str:
    return f"{len(found)} values, the largest {found[0].path} {found[0].words}"


def modes_apart(embedded: Path, processes: Path) -> list[Difference]:
    """Where a run with --processes is not the one without, in the windows both have."""
    one, other = leaves_of(embedded), leaves_of(processes)
    if one.get("run.h5/@outcome") == other.get("run.h5/@outcome"):
        return differences(*({p: v for p, v in run.items() if not p.startswith(OF_THE_WAY)} for run in (one, other)))
    short = {p: v for p, v in other.items() if ROWS.fullmatch(p)}
    long = {p: v[:len(short[p])] if np.ndim(v) else v for p, v in one.items() if p in short}
    return differences(long, short)


@dataclass(frozen=True)
class Stored:
    """A folder that was stored.  partial : with --only or --quick.  on : what it was made with."""

    folder: Path
    at: str
    partial: bool
    on: Mapping[str, Any]

    def parts(self, scene: str) -> set[str]:
        return {path.name for path in (self.folder / "scenes" / scene).glob("*")}

    def leaves(self, scene: str, part: str) -> Leaves:
        return leaves_of(self.folder / "scenes" / scene / part, self.at)


def stored(folder: Path) -> Stored:
    """Raises UsageError where there is none."""
    if not (folder / "made.json").is_file():
        why = "nothing was stored here, or not to its end" if folder.is_dir() else "no such folder"
        raise UsageError(f"{folder}: {why}")
    made = json.loads((folder / "made.json").read_text("utf-8"))
    return Stored(folder, made["folder"], made["partial"], made["on"])


def scene_differences(scene: str, before: Stored, after: Stored) -> list[Difference] | None:
    """All there are, the largest first; None where no part was stored on both sides, and was not meant to be."""
    old, new = before.parts(scene), after.parts(scene)
    found = [Difference(part, "was not stored after") for part in sorted(old - new) if not after.partial]
    found += [Difference(part, "was not stored before") for part in sorted(new - old) if not before.partial]
    for part in sorted(old & new):
        found += differences({f"{part}/{renamed(p, RENAMED)}": v for p, v in before.leaves(scene, part).items()},
                             {f"{part}/{p}": v for p, v in after.leaves(scene, part).items()})
    return sorted(found, key=lambda d: -d.size) if found or old & new else None


def compare(args: argparse.Namespace) -> int:
    """Say of every scene whether it is equal; 1 where one is not and is not meant to differ."""
    before, after = stored(args.before), stored(args.after)
    meant = dict.fromkeys(args.but or (), "--except")
    if args.expected:
        meant |= {name: str(reason) for name, reason in tomllib.loads(args.expected.read_text("utf-8")).items()}
    names = sorted({path.name for side in (before, after) for path in (side.folder / "scenes").glob("*")})
    if unknown := set(meant) - set(names):
        raise UsageError(f"no scene {', '.join(sorted(unknown))} was stored")
    for key, value in before.on.items():
        if value != after.on.get(key):
            print(f"note: {key} was {value!r} before, {after.on.get(key)!r} after: bits may differ by that")
    counts = {"equal": 0, "differ": 0, "meant to differ": 0, "not compared": 0}
    for name in names:
        found = scene_differences(name, before, after)
        verdict = "differ" if found else "not compared" if found is None else "equal"
        said = f"differs: {told(found)}" if found else verdict
        if name in meant:
            said = f"{said} (meant to differ: {meant[name]})"
            verdict = "meant to differ" if found else verdict
        counts[verdict] += 1
        print(f"{name}: {said}", flush=True)
        for difference in found or () if args.all else ():
            print(f"  {difference.path} {difference.words}")
    print(f"{len(names)} scenes: " + ", ".join(f"{n} {what}" for what, n in counts.items() if n))
    if counts["not compared"] == len(names):
        raise UsageError("nothing was compared")
    return int(counts["differ"] > 0)


def main(argv: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    if argv[:1] == ["store"]:
        parser.add_argument("store")
        parser.add_argument("folder", type=Path)
        parser.add_argument("--only", nargs="+", metavar="SCENE")
        parser.add_argument("--quick", action="store_true", help="some scenes, embedded alone")
        parser.add_argument("--scenarios", type=Path, metavar="DIR", help="default: of the installed checkout")
        parser.add_argument("--docs", type=Path, metavar="DIR", help="default: of the installed checkout")
        parser.add_argument("--jobs", type=int, default=1, help="scenes at a time")
    else:
        parser.add_argument("before", type=Path)
        parser.add_argument("after", type=Path)
        parser.add_argument("--all", action="store_true", help="every difference, not the largest of each scene alone")
        parser.add_argument("--except", dest="but", nargs="+", metavar="SCENE", help="may differ")
        parser.add_argument("--expected", type=Path, metavar="FILE", help="TOML: scene = \"why it may differ\"")
    args = parser.parse_args(argv)
    try:
        return store(args) if argv[:1] == ["store"] else compare(args)
    except (UsageError, OSError, tomllib.TOMLDecodeError) as exc:
        print(f"error: {exc}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
