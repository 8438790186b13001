"""What any half must keep to at the border, whoever made it: its blocks, its first values, its values in every step.

One law for runs (coupler.fmu.held) and for `slideline verify-half`.  Each breach is told with block, row, value and
remedy.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import field_from, signal_from
from contact.half.interface import Interface
from contact.half.start import start_coordinates, start_temperature
from contact.problem.errors import read
from contact.problem.start import Course, FromFrames
from contact.problem.thermal import ForeignThermal, ThermalBoundary, ThermalProblem
from coupler.fmu.half import Array, Block
from coupler.fmu.names import MECHANICAL, NEEDED, OUT, THERMAL, face_of

if TYPE_CHECKING:  # a process that checks a half reads no scenario, and its import takes 0.6 s
    from coupler.scenario import Scenario

MOST_T = 1e5  # K, beyond any heat that bodies in contact survive
MOST_TIMES = 10.0  # of the hottest T0, where that is beyond it
MOST_SPANS = 100.0  # of the scene, beyond which no coordinate is one
SAME_PLACE = 1e-6  # of the span: so well the first x is the mesh
SAME_T = 1e-6  # of the largest T0: so well the first T is T0
STRETCH = 2.0  # a cell is not stretched by more at the start, nor pressed to less than its inverse
ROUND = 1e-6  # of the size of a block: so far a sign or a bound may be missed


@dataclass(frozen=True)
class Breach:
    """A number that cannot be.  text : block, row, value.  remedy : a sentence.  mends : whether a shorter step might.
    """

    text: str
    remedy: str
    mends: bool = False

    def __str__(self) -> str:
        return f"{self.text}. {self.remedy}"


@dataclass(frozen=True)
class BorderScene:
    """What of a scene a half is held against.

    interface : its mesh and pairs.  T_low, T_high : (n_nodes,) [K] between which a node's first temperature lies.
    least_T : above which every temperature lies at all times [K]; -inf of a scene that states 0 K or less itself, whose
    temperatures have a scale of their own.  turns : (n_bodies,) by how much each is stated to begin turned [rad].
    """

    interface: Interface
    T_low: Array
    T_high: Array
    least_T: float = 0.0
    turns: Array = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def span(self) -> float:
        """The longer side of the box around the mesh [m]."""
        return float(np.ptp(self.interface.nodes, axis=0).max())

    @cached_property
    def most_T(self) -> float:
        """Below which every temperature lies at all times [K]; a scene that starts hotter has its own scale."""
        starts = self.T_high[np.isfinite(self.T_high)]
        return max(MOST_T, MOST_TIMES * float(starts.max(initial=0.0)))

    @cached_property
    def box(self) -> tuple[float, float]:
        """Between which every coordinate lies at all times [m]."""
        X, far = self.interface.nodes, MOST_SPANS * self.span
        return float(X.min()) - far, float(X.max()) + far

    @cached_property
    def gap_max(self) -> Array:
        """Return the largest gap (n_q,) [m] that a pair node may tell."""
        found = np.empty(len(self.interface.pair_nodes))
        limit = {pair.name: pair.gap_max for pair in self.interface.pairs}
        for side in self.interface.pair_sides:
            found[side.at] = limit[side.pair]
        return (1.0 + ROUND) * found + np.maximum(self.interface.gap_offset, 0.0)

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """Return of which pair nodes (n_q,) the pair is not tied: these are never pulled."""
        tied = {pair.name for pair in self.interface.pairs if pair.tied}
        found = np.ones(len(self.interface.pair_nodes), dtype=bool)
        for side in self.interface.pair_sides:
            found[side.at] = side.pair not in tied
        return found

    @property
    def rows(self) -> Mapping[str, int]:
        """How many rows the blocks of the exchange have."""
        i = self.interface
        cells, n_q = len(i.quads) + len(i.triangles), len(i.pair_nodes)
        return {"T": len(i.nodes), "x": len(i.nodes), "f_s": len(i.nodes), "contact.t_N": n_q, "contact.gap": n_q,
                "contact.covered": n_q, "contact.E_friction": n_q, "E_M": cells, "E_S": cells}


def border_scene(interface: Interface, thermal: Mapping[str, Any],
                 stated: Iterable[ThermalBoundary] = (), mechanical: Mapping[str, Any] = MappingProxyType({}),
                 ) -> BorderScene:
    """Return the scene of an interface and a thermal model.json (contact.problem.thermal), all in SI.

    Where a temperature is prescribed a half may begin with it or with T0, so there the first T is not looked at.
    stated : the scenario's conditions, of which the model.json of a prebuilt FMU has none.  mechanical : the other
    model.json, whose motions may begin turned.
    """
    kind = str(thermal["half"])
    problem = read(ForeignThermal if "options" in thermal else ThermalProblem, thermal, kind)
    low, high = np.full(len(interface.nodes), np.inf), np.full(len(interface.nodes), -np.inf)
    for part, name in enumerate(interface.parts):
        nodes = interface.part_nodes(part)
        T0 = start_temperature(problem.parts[name].T0, interface, nodes)
        low[nodes], high[nodes] = np.minimum(low[nodes], T0), np.maximum(high[nodes], T0)
    unknown, lowest = np.isinf(low), float(low.min(initial=np.inf))
    for b in (*problem.boundary, *stated):
        if b.temperature is not None:
            unknown[_nodes_of(b.where, interface)] = True
            if not isinstance(b.temperature, FromFrames | Course) and (
                    least := field_from(b.temperature).least) is not None:
                lowest = min(lowest, least)
    low[unknown], high[unknown] = -np.inf, np.inf
    # fault: a scene of its own scale is refused -> return BorderScene(interface, low, high) |
    #   coupler/test_broken_halves
    return BorderScene(interface, low, high, 0.0 if lowest > 0.0 else -np.inf, start_turns(interface, mechanical))


def scenario_border(scenario: Scenario, role: str = "") -> BorderScene:
    """Return the scene as a half sees it.  role : of one that may have a mesh of its own; "": on the scene's mesh."""
    interface = scenario.interface_of(role)
    stated = () if scenario.stated is None else scenario.stated.thermal.boundary
    # fault: a body that is stated to begin turned is refused -> return border_scene(interface,
    #   scenario.models["thermal"], stated) | coupler/test_broken_halves
    return border_scene(interface, scenario.models["thermal"], stated, scenario.models["mechanical"])


def start_turns(interface: Interface, mechanical: Mapping[str, Any]) -> Array:
    """Return by how much each body is stated to begin turned, (n_bodies,) [rad].  mechanical : its model.json."""
    found = {name: m["rotation"]["angle"] for name, m in (mechanical.get("motion") or {}).items() if m.get("rotation")}
    for b in mechanical.get("boundary", ()):
        angle = b["rotation"]["angle"] if b.get("rotation") else b.get("angle")
        if angle is not None:
            found[b.get("body") or str(b.get("on") or b.get("at")).partition(".")[0]] = angle
    # What jumps at the start acts just after it.
    return np.array([signal_from(found.get(name, 0.0)).at(0.0, -1) for name in interface.bodies])


def _nodes_of(place: str, interface: Interface) -> NDArray[np.integer]:
    if place in interface.bodies:
        return np.flatnonzero(interface.node_body == interface.bodies.index(place))
    # A point beside all nodes is the nearest one, under another name in the model.json.
    sets = interface.surfaces if place in interface.surfaces else interface.node_sets
    return np.unique(sets.get(place, np.empty(0, np.int32)))


# Blocks: before a half is asked for anything.

def other_scene(strings: Mapping[str, str], interface: Interface) -> str:
    """Tell of which other scene a half is, by its constant strings; "" where it is of this one, or does not say."""
    expected = {"mesh.hash": interface.mesh_hash, "surfaces.hash": interface.surfaces_hash,
                "geometry": interface.geometry}
    return next((f"was built for another scene ({name} is {strings[name]}, the scenario's is {value})"
                 for name, value in expected.items() if strings.get(name, value) != value), "")


def wrong_blocks(role: str, blocks: Mapping[str, Block], scene: BorderScene | None) -> Iterator[Breach]:
    """Tell what of a half's description no run can use.  role : that in which it stands.  scene : None where unknown.
    """
    for name in NEEDED[role]:
        face = face_of(name)
        assert face is not None, "the specification names all that a run needs"
        want = face.causality(role)
        # fault: a half without what a run needs is let in -> if False: | coupler/test_broken_halves
        if name not in blocks:
            yield Breach(f"it has no {name}, which a {role} half must have as {want}; it has {_some(blocks)}",
                         "Give the variable that name (T[1], T[2], ...; x[1,1], x[1,2], ...: docs/design.md)")
        elif blocks[name].causality != want:
            yield Breach(f"its {name} is {blocks[name].causality}, not {want}",
                         f"Declare it causality=\"{want}\"; docs/design.md lists the names of either role")
    for name, block in blocks.items():
        face = face_of(name)
        if face is None or face.kind != "Real":
            continue
        # fault: an array of whole or of short numbers is let in -> if False: | coupler/test_c_halves
        if block.kind != "Real":
            yield Breach(f"its {name} is of type {block.kind}, not Real",
                         "Declare it Real (FMI 2.0) or Float64 (FMI 3.0)")
            continue
        # A block that states no unit is taken for SI: its values are looked at, and verify-half tells it.
        # fault: a unit nobody knows is taken for SI -> if False: | coupler/test_border_units
        if block.unit not in (face.unit, "1"):
            yield Breach(f"its {name} is in {block.unit}, which cannot be made {face.unit}",
                         f"Declare {face.unit}, or define {block.unit} in the XML: <Unit name=\"{block.unit}\">"
                         "<BaseUnit ... factor=\"...\" offset=\"...\"/></Unit>, as its name says")
        rows = scene.rows.get(name) if scene is not None else None
        # fault: a half of other rows is let in -> if False: | coupler/test_broken_halves
        if rows is not None and (len(block.shape) != face.rank or block.shape[0] != rows):
            yield Breach(f"its {name} has shape {block.shape}, but the scene has {rows} rows of it",
                         "It was built for another mesh: build it for this scene")


def _some(blocks: Mapping[str, Block]) -> str:
    of_all = ("status.", "control.")
    names = [n for n, b in blocks.items() if b.causality in ("input", OUT) and not n.startswith(of_all)]
    return ", ".join(sorted(names)[:8]) + (", ..." if len(names) > 8 else "") if names else "nothing"


# Values: the first ones against the scene, all of them against what numbers can be.

def wrong_start(role: str, first: Mapping[str, Array], scene: BorderScene) -> Breach | None:
    """Tell where the first values of a half are not the scene's.  first : its outputs at the start [SI]."""
    if role == THERMAL and "T" in first:
        return _wrong_T0(first["T"], scene)
    return _wrong_mesh(first["x"], scene) if role == MECHANICAL and "x" in first else None


def _wrong_T0(T: Array, scene: BorderScene) -> Breach | None:
    ends = np.concatenate([scene.T_low[np.isfinite(scene.T_low)], [0.0]])
    slack = SAME_T * max(float(ends.max()), 1.0)
    # fault: the first T is not looked at -> off = np.zeros(len(T)) | coupler/test_broken_halves
    off = np.maximum(scene.T_low - T, T - scene.T_high)
    i = int(np.argmax(off))
    if off[i] <= slack:
        return None
    body = scene.interface.bodies[scene.interface.node_body[i]]
    celsius = abs(T[i] + 273.15 - scene.T_low[i]) <= 1e-3 * scene.T_low[i]
    return Breach(f"its first T[{i + 1}] is {T[i]:.9g} K, but body {body!r} starts there at {_range(scene, i)} K",
                  "It is degrees Celsius: give out kelvin, or declare the unit degC" if celsius else
                  "Start at T0 of the scene (bodies.NAME.T0), nodes in the order of interface.h5")


def _range(scene: BorderScene, i: int) -> str:
    low, high = scene.T_low[i], scene.T_high[i]
    return f"{low:.9g}" if low == high else f"{low:.9g} to {high:.9g}"


def _wrong_mesh(x: Array, scene: BorderScene) -> Breach | None:
    """Tell where the first x is no deformation of the mesh.

    Loads, motions and temperatures at the start move and strain bodies, so a small strain is right, and any place.  A
    cell that is turned inside out or stretched beyond STRETCH is not: other units, displacements, or nodes in another
    order are found by it in any frame.
    """
    interface = scene.interface
    X = start_coordinates(interface)
    of = {"quad": interface.quad_body, "triangle": interface.triangle_body}
    turns = scene.turns if scene.turns.size else np.zeros(len(interface.bodies))
    for name, cells in (("quad", interface.quads), ("triangle", interface.triangles)):
        if not len(cells):
            continue
        a, b, d = cells[:, 0], cells[:, 1], cells[:, -1]
        E, e = _edges(X, a, b, d), _edges(x, a, b, d)
        F = e @ np.linalg.inv(E)
        size = np.linalg.svd(F, compute_uv=False)
        strained = (size[:, 0] > STRETCH) | (size[:, -1] < 1.0 / STRETCH)
        # fault: the first x is not looked at -> bad = strained & False | coupler/test_broken_halves
        bad = strained | (np.linalg.det(F) <= 0.0) | (_along(F, turns[of[name]]) <= 0.0)
        if not bad.any():
            continue
        k = int(np.argmax(bad))
        i = int(a[k])
        return Breach(f"its first x[{i + 1},1..2] is ({x[i, 0]:.6g}, {x[i, 1]:.6g}) m, where the mesh has "
                      f"({X[i, 0]:.6g}, {X[i, 1]:.6g}) m: {name} {k + 1} there is {_how(F[k], size[k])}",
                      _meant(x, X, float(np.median(size))))
    return None


def _along(F: Array, turn: Array) -> Array:
    """Return (n,) trace of F : (n, 2, 2) turned back by `turn` : (n,) [rad], above 0 up to a right angle."""
    return np.asarray(np.cos(turn) * (F[:, 0, 0] + F[:, 1, 1]) + np.sin(turn) * (F[:, 1, 0] - F[:, 0, 1]))


def _edges(x: Array, a: Any, b: Any, d: Any) -> Array:
    return np.stack([x[b] - x[a], x[d] - x[a]], axis=-1)


def _how(F: Array, size: Array) -> str:
    if np.linalg.det(F) <= 0.0:
        return "turned inside out"
    if size[0] <= STRETCH and size[1] >= 1.0 / STRETCH:
        return "turned by more than a right angle"
    return f"stretched to {size[0]:.3g} and {size[1]:.3g} of its size"


def _meant(x: Array, X: Array, size: float) -> str:
    for unit, factor in (("mm", 1e3), ("cm", 1e2), ("um", 1e6)):
        if abs(size / factor - 1.0) < 0.01:
            return f"It is {unit}: give out m, or declare the unit {unit}"
    if np.ptp(x, axis=0).max() < 1e-2 * np.ptp(X, axis=0).max():
        return "x is where nodes are, not how far they moved: add the coordinates of interface.h5"
    return "Nodes are in the order of interface.h5, and so are its coordinates"


def off_the_mesh(x: Array, scene: BorderScene) -> str:
    """Return how far the first x is from the mesh in words, "" where it is the mesh."""
    far = np.abs(x - start_coordinates(scene.interface)).max(axis=1)
    i = int(np.argmax(far))
    if far[i] <= SAME_PLACE * scene.span:
        return ""
    return (f"its first x is up to {far[i]:.3g} m off the mesh ({far[i] / scene.span:.2g} of the span, at node "
            f"{i + 1}): loads, motions and temperatures at the start must account for it")


def wrong_values(role: str, got: Mapping[str, Array], scene: BorderScene | None) -> Breach | None:
    """Tell the first number of a half's outputs that cannot be, in SI; None where all can.

    got : outputs by name, of those that stand at the border.  Asked after every substep, so it looks at minima and
    maxima alone until one is wrong.
    """
    if role == THERMAL:
        T, least, most = got.get("T"), 0.0, MOST_T
        if scene is not None:
            least, most = scene.least_T, scene.most_T
        # fault: temperatures below absolute zero go on -> if T is None or T.max() < most: |
        #   coupler/test_broken_halves
        if T is None or (T.min() > least and T.max() < most):
            return None
        i = int(np.argmin(T)) if T.min() <= least else int(np.argmax(T))
        return Breach(f"T[{i + 1}] is {T[i]:.6g} K; it must be above {least:g} and below {most:g} K",
                      "Give out kelvin; if it is, the step is too long for its method, the exchange unstable, or heat "
                      "is made faster than it can leave", True)
    return next(filter(None, (check(got[name], scene) for name, check in _MECHANICAL.items() if name in got)), None)


def _wrong_x(x: Array, scene: BorderScene | None) -> Breach | None:
    if scene is None or (x.min() >= scene.box[0] and x.max() <= scene.box[1]):
        return None
    i = int(np.argmax(np.abs(x - scene.interface.nodes).max(axis=1)))
    return Breach(f"x[{i + 1},1..2] is ({x[i, 0]:.6g}, {x[i, 1]:.6g}) m, more than {MOST_SPANS:g} spans "
                  f"({scene.span:.3g} m) from the mesh", "Give out m; if it is, something lets the body fly away", True)


def _wrong_t_N(t_N: Array, scene: BorderScene | None) -> Breach | None:
    if not t_N.size:
        return None
    slack = ROUND * float(-t_N.min()) if t_N.min() < 0.0 else 0.0
    if t_N.max() <= slack:
        return None
    free = scene.free if scene is not None else np.ones(len(t_N), dtype=bool)
    # fault: pressures of the wrong sign go on -> pulled = free & False | coupler/test_broken_halves
    pulled = free & (t_N > slack)
    if not pulled.any():
        return None
    q = int(np.argmax(np.where(pulled, t_N, -np.inf)))
    return Breach(f"contact.t_N[{q + 1}]{_whose(scene, q)} is {t_N[q]:.6g} Pa, a pull; only tied pairs are pulled",
                  "A pressure p is given out as t_N = -p")


def _wrong_covered(covered: Array, scene: BorderScene | None) -> Breach | None:
    if not covered.size or (covered.min() >= -ROUND and covered.max() <= 1.0 + ROUND):
        return None
    q = int(np.argmax(np.abs(covered - 0.5)))
    return Breach(f"contact.covered[{q + 1}]{_whose(scene, q)} is {covered[q]:.6g}, but it is a share, 0 to 1",
                  "Give out the share of the node's part of its side that faces the other, not percent")


def _wrong_gap(gap: Array, scene: BorderScene | None) -> Breach | None:
    if scene is None or not gap.size or not (gap > scene.gap_max).any():
        return None
    q = int(np.argmax(gap - scene.gap_max))
    return Breach(f"contact.gap[{q + 1}]{_whose(scene, q)} is {gap[q]:.6g} m, more than the pair's gap_max "
                  f"({scene.gap_max[q]:.6g} m)", "Give out m, and gap_max where a node faces nothing")


_MECHANICAL = {"x": _wrong_x, "contact.t_N": _wrong_t_N, "contact.covered": _wrong_covered, "contact.gap": _wrong_gap}


def _whose(scene: BorderScene | None, q: int) -> str:
    if scene is None:
        return ""
    pair = next(side.pair for side in scene.interface.pair_sides if side.at.start <= q < side.at.stop)
    return f" (pair {pair}, node {int(scene.interface.pair_nodes[q]) + 1})"
