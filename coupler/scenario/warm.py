"""What bodies start with of another run's mechanics: displacements, what points remember, contact.  `u0` of a body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from contact.half.interface import Interface, PairSide
from contact.half.memory import AS_LEFT, CELLS, ELASTIC, MOBILISED, MOBILISED_AT, MULTIPLIERS, SIDES, U
from contact.problem.mechanical import Elastic
from coupler.scenario.bodies import FromRun
from coupler.scenario.document import Document, DocumentErrors, Key
from coupler.scenario.earlier_bodies import EarlierRuns, meshes_sentence
from coupler.scenario.earlier_run import EarlierRun, EarlierRunError, dataset, opened
from coupler.scenario.mesh import BodyMesh, Floats
from coupler.scenario.schema import ScenarioFile
from coupler.scenario.transfer import moved

END, PAIR_NODES = "end", "pair_nodes"  # the group of a results file, and the node of each pair node in it


@dataclass(frozen=True)
class EndOfRun:
    """What a run left at its end.

    t : [s].  arrays : by name, as in contact.half.memory.  sides : pair and whether its slave -> its pair nodes, X :
    (n_q, 2) [m] where those were drawn.
    """

    t: float
    arrays: Mapping[str, Floats]
    sides: Mapping[tuple[str, bool], slice]
    X: Floats


@dataclass(frozen=True)
class TakenMechanics:
    """How a body starts from another run.

    u : (n, 2) [m] at its nodes.  cells : what its points remember, by the name in interface.h5.  run, there : where it
    is from.  is_end : whether at the end of that run, when it kept its contact too.  note : in a sentence, what was
    done.  source : what a results file keeps of it.
    """

    u: Floats
    cells: Mapping[str, Floats]
    run: EarlierRun
    end: EndOfRun
    there: str
    is_end: bool
    note: str
    source: Mapping[str, str | float]


def mechanics_of(document: Document, runs: EarlierRuns, file: ScenarioFile, meshes: Mapping[str, BodyMesh],
                 found: DocumentErrors) -> dict[str, TakenMechanics]:
    """Take over the mechanics that bodies start with, by body; what cannot be taken is noted, and its body left out."""
    ends: dict[Path, EndOfRun] = {}
    taken: dict[str, TakenMechanics] = {}
    for name, body in file.bodies.items():
        if body.u0 is not None:
            with found.each():
                _possible(document, file, name)
                taken[name] = _taken(document, runs, name, body.u0, meshes[name], ends)
    return taken


def _possible(document: Document, file: ScenarioFile, name: str) -> None:
    """Raises ScenarioError where a body here cannot start from displacements."""
    key: Key = ("bodies", name, "u0")
    if file.mechanical.half != "elastic":
        raise document.error(key, f"the mechanical half {file.mechanical.half!r} starts from no other run",
                             "Choose the half elastic, or leave u0 out.")
    elastic = file.mechanical.elastic or Elastic()
    if elastic.inert:
        raise document.error(key, "with inertia a body starts as it is drawn, with the velocity v0",
                             "Leave dynamics out, or u0.")
    if name in elastic.bodies and elastic.bodies[name].rigid:
        raise document.error(key, f"body {name!r} is rigid: it is where its prescribed motion says",
                             "Give the motion the value it had there, and leave u0 out.")
    for part in file.bodies[name].parts.values():
        material = file.materials.get(part.material)
        # fault: a poured body is poured anew where it goes on -> if False: | coupler/test_warm_starts
        if material is not None and material.liquid is not None:
            raise document.error(key, f"body {name!r} is of {part.material}, which can be liquid: no results file "
                                 "keeps the shape it was poured in", "Go on with that run itself (`slideline resume`).")


def _taken(document: Document, runs: EarlierRuns, name: str, spec: FromRun, mesh: BodyMesh,
           ends: dict[Path, EndOfRun]) -> TakenMechanics:
    key: Key = ("bodies", name, "u0")
    body = runs.body(name, spec, key)
    run, there = body.run, body.there
    with runs.refused((*key, "from")):
        end = ends[run.path] if run.path in ends else ends.setdefault(run.path, _end_of(run))
    t = runs.time(body, spec, key)
    is_end, source = t == end.t, run.mesh_of(there)
    cells = {_here(n, name): a for n, a in end.arrays.items()
             if n.startswith(CELLS) and n.removeprefix(CELLS).split(".")[0] == there}
    laws = sorted({n.rsplit(".", 1)[1] for n in cells if not n.rsplit(".", 1)[1].startswith(ELASTIC)})
    if laws and not is_end:
        raise document.error((*key, "t"), f"{run.path.name} keeps what the points of {there!r} remember "
                             f"({', '.join(laws)}) at its end alone, t = {end.t:.9g} s",
                             "Write `t: end`, or end that run there (--until).")
    if laws and not source.same_as(mesh.nodes_and_cells):
        raise document.error(key, f"what the points of {there!r} remember ({', '.join(laws)}) cannot be taken to "
                             "another mesh", "Give the body the mesh it had in that run, or an elastic material.")
    with runs.refused((*key, "from"), body):
        # The end is kept as it was; the field files have x, whose difference to X is rounded.
        u = end.arrays[U][run.nodes_of(there)] if is_end else run.displacements(there, t)
        result = moved(u, source, mesh.nodes_and_cells)
    note = body.begins("starts with the displacements of", t)
    if laws:
        note += f", and with what its points remember ({', '.join(laws)})"
    as_left = is_end and result.same
    return TakenMechanics(result.values, cells if as_left else {}, run, end, there, as_left,
                          note + meshes_sentence(result, "they", "m"),
                          body.record(t, result) | {"rms": result.rms, "what": U})


def _here(name: str, body: str) -> str:
    """The name of an array of a part, of a body that may be called otherwise here."""
    part, shape, laws = name.removeprefix(CELLS).rsplit(".", 2)
    return f"{CELLS}{'.'.join((body, *part.split('.')[1:]))}.{shape}.{laws}"


def _end_of(run: EarlierRun) -> EndOfRun:
    """Read what a run left at its end.  Raises EarlierRunError where it kept nothing, or what does not fit."""
    with opened(run.path) as f:
        if END not in f:
            raise EarlierRunError(f"{run.path.name} keeps no end of its mechanics: its half was not `elastic`, or "
                                  "had a mesh of its own, it ended by an error, or an earlier version wrote it",
                                  "Run it again with the half elastic, on the scene's mesh.")
        t = float(f[END].attrs["t"])
        arrays = {name: np.asarray(dataset(f, f"{END}/{name}", "f", 1 if name in (MULTIPLIERS, MOBILISED) else 2)[()],
                                   dtype=np.float64) for name in f[END] if name != PAIR_NODES}
        nodes = np.asarray(dataset(f, f"{END}/{PAIR_NODES}", "i", 1)[()], dtype=np.intp)
    n, n_q = len(run.nodes), arrays.get(MULTIPLIERS, np.empty(0)).size
    good = nodes.size == n_q and bool(((nodes >= 0) & (nodes < n)).all()) and U in arrays
    good = good and arrays[U].shape == (n, 2) and all(np.isfinite(a).all() for a in arrays.values())
    sides = {}
    if SIDES in arrays:
        good = good and arrays[SIDES].shape[1:] == (4,) and arrays.get(MOBILISED, np.empty(0)).size == n_q
        good = good and arrays.get(MOBILISED_AT, np.empty((0, 3))).shape[1:] == (3,)
        for pair, own, first, last in arrays[SIDES].astype(np.int64).tolist() if good else ():
            good = good and 0 <= pair < len(run.pairs) and 0 <= first <= last <= n_q
            if good:
                sides[run.pairs[pair], bool(own)] = slice(first, last)
    if not good:
        raise EarlierRunError(f"{run.path.name}: what it keeps of its end does not fit its mesh", "Run it again.")
    return EndOfRun(t, arrays, sides, run.nodes[nodes])


# What goes into interface.h5.

def start_arrays(taken: Mapping[str, TakenMechanics], interface: Interface) -> tuple[
        dict[str, Floats], dict[str, TakenMechanics]]:
    """Return Interface.start of bodies that take over mechanics, and those with what became of their contact noted."""
    if not taken:
        return {}, {}
    u = np.full((len(interface.nodes), 2), np.nan)
    for name, one in taken.items():
        u[interface.node_body == interface.bodies.index(name)] = one.u
    out: dict[str, Floats] = {U: u}
    for body in taken.values():
        out |= body.cells
    found = dict(taken)
    if interface.pairs:
        for name in (MULTIPLIERS, MOBILISED):
            out[name] = np.full(interface.pair_nodes.size, np.nan)
        out[MOBILISED_AT] = np.empty((0, 3))
    as_left = set(taken) == set(interface.bodies) and all(body.is_end for body in taken.values())
    for pair in interface.pairs:
        sides = [side for side in interface.pair_sides if side.pair == pair.name]
        owners = [_owner(side, interface) for side in sides]
        if not any(name in taken for name in owners):
            continue
        why = _contact_of(pair.name, sides, owners, taken, interface, out)
        as_left = as_left and not why
        first = next(name for name in owners if name in taken)
        if why and pair.mu > 0.0:
            note = f"{found[first].note}; pair {pair.name} begins without shear: {why}"
            found[first] = replace(found[first], note=note)
    return out | ({AS_LEFT: np.ones(1)} if as_left else {}), found


def _owner(side: PairSide, interface: Interface) -> str:
    return interface.bodies[int(interface.node_body[side.nodes[0]])]


def _contact_of(pair: str, sides: list[PairSide], owners: list[str], taken: Mapping[str, TakenMechanics],
                interface: Interface, out: dict[str, Floats]) -> str:
    """Put what a pair remembers into `out`; returns why it cannot be, or ""."""
    if not all(name in taken and taken[name].is_end for name in owners):
        return "not both of its bodies start from the end of a run, on the same mesh"
    run, end = taken[owners[0]].run, taken[owners[0]].end
    if any(taken[name].run is not run for name in owners):
        return "its bodies start from different runs"
    if any((pair, side.own) not in end.sides for side in sides):
        return f"{run.path.name} has no pair of this name"
    for side, owner in zip(sides, owners, strict=True):
        there = end.X[end.sides[pair, side.own]]
        # fault: contact of another pair of this name is taken over -> if False: | coupler/test_warm_starts
        if not np.array_equal(there, interface.nodes[side.nodes]):
            return f"its surface on {taken[owner].there} was another one"
    for side in sides:
        for name in (MULTIPLIERS, MOBILISED):
            out[name][side.at] = end.arrays[name][end.sides[pair, side.own]]
        points, those = end.arrays.get(MOBILISED_AT, np.empty((0, 3))), end.sides[pair, side.own]
        own = points[(points[:, 0] >= those.start) & (points[:, 0] < those.stop)]
        shift = float(side.at.start - those.start)
        out[MOBILISED_AT] = _ascending(np.concatenate([out[MOBILISED_AT], own + np.array([shift, 0.0, 0.0])]))
    return ""


def _ascending(points: Floats) -> Floats:
    """Sort what friction remembers of points, (n_h, 3), by pair node and place."""
    return np.ascontiguousarray(points[np.lexsort((points[:, 1], points[:, 0]))])
