"""A scene before it runs, as a picture: bodies with their meshes, sides of pairs, where what acts, and probes.

What acts at a place is told beside the picture in the scenario's own words, in SI, under the number that stands at the
place, so that a slip in a name or a unit is seen before anything is computed.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.errors import ScenarioError
from coupler.report.figures import COLOURS, INK, counted
from coupler.scenario import Scenario
from coupler.scenario.kinds import word_of

Array = NDArray[np.float64]
Ints = NDArray[np.integer]

PICTURE, WORDS = 6.4, 4.6  # inches of width
BELOW = 0.06  # of the scene: the number of what acts on a body, below its name
LEAST_TALL, MOST_TALL = 3.0, 9.0
LINE = 0.165  # inches of a line of words
COLUMN = 62  # letters of such a line
FINE = 6000  # cells: more leave no room between their lines
NUMBER = {"boxstyle": "circle,pad=0.22", "facecolor": "white", "edgecolor": INK, "linewidth": 0.8}
SUFFIXES = (".png", ".svg", ".pdf")
MECHANICS = ("elastic", "rigid", "rod")  # keys of `mechanical` that say what acts


@dataclass(frozen=True)
class Acting:
    """What acts at one place: `where` as the scenario names it, `at` : (2,) [m] of its number, None: on a whole body.

    edges : (n, 2) nodes of the surface, (0, 2) of a point.  words : one line an entry.
    """

    where: str
    at: Array | None
    edges: Ints
    words: tuple[str, ...]


def acting(scenario: Scenario) -> list[Acting]:
    """Return what the thermal and the mechanical half are told to do at each place, in the order of the scenario."""
    said: dict[str, list[str]] = {}
    for where, words in _entries(scenario.resolved, _told_mechanics(scenario)):
        said.setdefault(where, []).append(words)
    return [_placed(scenario.interface, where, tuple(words)) for where, words in said.items()]


def _told_mechanics(scenario: Scenario) -> Mapping[str, Any]:
    """Return the mapping of the scenario that its mechanical half is told.

    A half of another package, and one that plays a record, is told those of `elastic`, or of what there is instead.
    """
    parts, kind = scenario.resolved.get("mechanical") or {}, scenario.mechanical_half.removeprefix("mechanical_")
    own = (kind,) if kind in MECHANICS else MECHANICS
    # fault: what a foreign half is told is left out of the picture -> return parts.get(kind) or {} |
    #   coupler/test_scene_picture
    return next((parts[name] for name in own if parts.get(name)), {})


def _entries(resolved: Mapping[str, Any], own: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield (place, words) of every entry.  own : what the mechanical half is told."""
    for entry in [*((resolved.get("thermal") or {}).get("boundary") or ()), *(own.get("boundary") or ())]:
        where = entry.get("on", entry.get("at", entry.get("body", "all bodies")))
        keys = {key: value for key, value in entry.items() if key not in ("on", "at", "body", "name")}
        name = f"{entry['name']}: " if "name" in entry else ""
        yield _words(where), name + "; ".join(f"{key} {_words(value)}" for key, value in keys.items())
    for body, motion in (own.get("motion") or {}).items():
        yield body, "moves by " + (", ".join(f"{key} {_words(value)}" for key, value in motion.items()) or "nothing")
    # fault: the picture hides the pressure that rigid bodies are given -> for pair, p in (): |
    #   coupler/test_scene_picture
    for pair, p in (own.get("pressure") or {}).items():
        yield str(resolved["contact"][pair]["slave"]), f"pressure of {pair} {_words(p)}"
    for body, ends in (own.get("held") or {}).items():
        yield body, "held: " + ", ".join(f"{end} at {_words(value)}" for end, value in ends.items())
    for body, spec in (resolved.get("bodies") or {}).items():
        if spec.get("Q_T"):
            yield body, f"source {_words(spec['Q_T'])}"
    if own.get("gravity"):
        yield "all bodies", f"gravity {_words(own['gravity'])}"


def _words(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{k} {_words(v)}" for k, v in value.items())
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "(" + ", ".join(_words(v) for v in value) + ")"
    return f"{value:g}" if isinstance(value, (int, float)) and not isinstance(value, bool) else str(value)


def _placed(interface: Interface, where: str, words: tuple[str, ...]) -> Acting:
    none = np.empty((0, 2), np.int32)
    if where in interface.surfaces:
        edges = interface.surfaces[where]
        return Acting(where, _middle(interface.nodes, edges), edges, words)
    for name in (where, f"{where}.nearest"):
        if name in interface.node_sets:
            return Acting(where, interface.nodes[interface.node_sets[name]].mean(axis=0), none, words)
    if where in interface.bodies:
        mine = interface.nodes[interface.node_body == interface.bodies.index(where)]
        return Acting(where, (mine.min(axis=0) + mine.max(axis=0)) / 2.0, none, words)
    return Acting(where, None, none, words)


def _middle(x: Array, edges: Ints) -> Array:
    """Return the place (2,) [m] half along edges (n, 2)."""
    lengths = np.linalg.norm(x[edges[:, 1]] - x[edges[:, 0]], axis=1)
    k = int(np.searchsorted(lengths.cumsum(), 0.5 * lengths.sum()))
    return np.asarray(x[edges[min(k, len(edges) - 1)]].mean(axis=0))


def scene_figure(scenario: Scenario) -> Figure:
    """Draw the scene as it starts."""
    interface, places = scenario.interface, acting(scenario)
    low, high = interface.nodes.min(axis=0), interface.nodes.max(axis=0)
    span = np.maximum(high - low, 1e-12)
    lines = _told(scenario, places)
    tall = float(np.clip(PICTURE * span[1] / span[0] * 0.9, LEAST_TALL, MOST_TALL))
    figure = Figure(figsize=(PICTURE + WORDS, max(tall, 0.7 + LINE * len(lines))), facecolor="white")
    width, height = (float(v) for v in figure.get_size_inches())
    ax = figure.add_axes((0.7 / width, 0.55 / height, (PICTURE - 0.9) / width, (height - 1.0) / height))
    _draw_bodies(ax, interface)
    _draw_pairs(ax, interface)
    _draw_probes(ax, scenario)
    _draw_numbers(ax, interface, places, float(span.max()))
    ax.set_aspect("equal")
    ax.margins(0.08)
    ax.set_xlabel("r [m]" if interface.axisymmetric else "x [m]", color=INK)
    ax.set_ylabel("z [m]" if interface.axisymmetric else "y [m]", color=INK)
    ax.tick_params(colors=INK, labelsize=8)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    figure.text(0.12 / width, 1.0 - 0.22 / height, scenario.title, fontsize=12, color=INK, va="center",
                fontweight="bold", parse_math=False)
    for k, (text, colour, bold) in enumerate(lines):
        figure.text((PICTURE + 0.05) / width, 1.0 - (0.45 + LINE * k) / height, text, fontsize=7.6, color=colour,
                    va="top", fontweight="bold" if bold else "normal", parse_math=False)
    return figure


def _told(scenario: Scenario, places: Sequence[Acting]) -> list[tuple[str, str, bool]]:
    """Return the lines beside the picture: text, colour, bold."""
    interface = scenario.interface
    out: list[tuple[str, str, bool]] = []

    def add(text: str, colour: str = INK, *, bold: bool = False, indent: str = "   ") -> None:
        out.extend((line, colour, bold) for line in wrap(text, COLUMN, subsequent_indent=indent))

    kind = "about an axis (x = r)" if interface.axisymmetric else "plane"
    add(f"{kind}; lengths in m, temperatures in {scenario.temperature_unit.replace('degC', '°C')}", indent="")
    if scenario.units is not None:
        # fault: the picture hides the units of the file -> pass |
        #   coupler/test_scenario_file_units::test_check_and_show_tell_the_units
        add(f"the file is in {scenario.units.symbols}; all numbers here are SI (m, Pa, W/m2, ...)", indent="")
    add("Bodies", bold=True)
    for b, name in enumerate(interface.bodies):
        spec = scenario.resolved["bodies"][name]
        cells = int((interface.quad_body == b).sum() + (interface.triangle_body == b).sum())
        mine = np.ptp(interface.nodes[interface.node_body == b], axis=0)
        add(f"{name}: {spec.get('material', '')}, T0 {_words(spec.get('T0', ''))}, {mine[0]:.4g} x {mine[1]:.4g} m, "
            f"{counted(cells, 'cell')}", COLOURS[b % len(COLOURS)])
    if interface.pairs:
        add("Contact (slave drawn whole, master dashed)", bold=True)
    for p in interface.pairs:
        add(f"{p.name}: {p.slave} on {p.master}" + (", tied" if p.tied else "")
            + (f", mu {p.mu:g}" if p.mu else "") + f", gap_max {p.gap_max:.3g} m", "#a01010")
    if places:
        add("What acts, in SI; temperatures as in the file", bold=True)
    for k, place in enumerate(places, 1):
        for j, words in enumerate(place.words):
            add(f"{k}  {place.where}: {words}" if j == 0 else f"    {words}", indent="      ")
    if scenario.probes:
        add("Probes (dots): " + ", ".join(scenario.probes), bold=False)
    halves = ", ".join(f"{role} {word_of(role, kind)}" for role, kind in (
        ("thermal", scenario.thermal_half), ("mechanical", scenario.mechanical_half)))
    add(f"Halves: {halves}; to t = {scenario.coupling.end:g} s")
    return out


def _draw_bodies(ax: Axes, interface: Interface) -> None:
    x = interface.nodes
    thin = 0.35 if len(interface.quads) + len(interface.triangles) <= FINE else 0.0
    for cells, owner in ((interface.quads, interface.quad_body), (interface.triangles, interface.triangle_body)):
        for b in range(len(interface.bodies)):
            if (owner == b).any():
                colour = COLOURS[b % len(COLOURS)]
                ax.add_collection(PolyCollection(list(x[cells[owner == b]]), facecolors=[to_rgba(colour, 0.16)],
                                                 edgecolors=[to_rgba(colour, 0.45)], linewidths=thin))
    for b, name in enumerate(interface.bodies):
        ax.update_datalim(x[interface.node_body == b])
        inside = np.concatenate([x[interface.quads[interface.quad_body == b]].mean(axis=1),
                                 x[interface.triangles[interface.triangle_body == b]].mean(axis=1)])
        # A body may be hollow: its name stands on the cell nearest to its middle.
        middle = inside[np.linalg.norm(inside - inside.mean(axis=0), axis=1).argmin()]
        ax.text(float(middle[0]), float(middle[1]), name, ha="center", va="center", fontsize=10,
                color=COLOURS[b % len(COLOURS)], fontweight="bold", zorder=6, parse_math=False)


def _draw_pairs(ax: Axes, interface: Interface) -> None:
    for p in interface.pairs:
        for surface, style in ((p.slave, "solid"), (p.master, (0, (2.2, 1.4)))):
            edges = list(interface.nodes[interface.surfaces[surface]])
            ax.add_collection(LineCollection(edges, colors="#a01010", linewidths=1.8, linestyles=style, zorder=3))


def _draw_probes(ax: Axes, scenario: Scenario) -> None:
    x = scenario.interface.nodes
    points = [probe.weights @ x[probe.nodes] for probe in scenario.probes.values()
              if probe.reduction == "point" and len(probe.nodes)]
    if points:
        ax.plot(*np.array(points).T, "o", markersize=4.0, color=INK, zorder=5)


def _draw_numbers(ax: Axes, interface: Interface, places: Sequence[Acting], size: float) -> None:
    """Put the number of each place beside it: outside its surface, where there is room for it."""
    taken: list[Array] = []
    for k, place in enumerate(places, 1):
        if place.at is None:
            continue
        out = np.zeros(2)
        if len(place.edges):
            t = np.diff(interface.nodes[place.edges], axis=1)[:, 0].sum(axis=0)
            # fault: numbers stand inside their bodies -> out = np.array([-t[1], t[0]]) / float(np.hypot(*t)) |
            #   coupler/test_scene_picture
            out = np.array([t[1], -t[0]]) / max(float(np.hypot(*t)), 1e-300)  # the body is on the left of its edges
            ax.add_collection(LineCollection(list(interface.nodes[place.edges]), colors=INK, linewidths=0.9, zorder=4))
        along = np.array([-out[1], out[0]]) if out.any() else np.array([1.0, 0.0])
        at = place.at + 0.045 * size * out
        on_body = place.where in interface.bodies
        # fault: the number of what acts on a body covers its name -> if False: | coupler/test_scene_picture
        if on_body:
            at = at - np.array([0.0, BELOW * size])
        for _ in range(12):
            if all(np.linalg.norm(at - other) > 0.05 * size for other in taken):
                break
            at = at + 0.055 * size * along
        taken.append(at)
        ax.annotate(str(k), tuple(at if on_body else place.at), tuple(at), fontsize=7.5, color=INK, ha="center",
                    va="center", zorder=7, bbox=NUMBER,
                    arrowprops={"arrowstyle": "-", "color": INK, "linewidth": 0.6, "shrinkB": 0.0})
        ax.update_datalim(at[None])


def write_scene(scenario: Scenario, out: Path) -> Path:
    """Write the picture of a scene; its kind follows from the name.  Raises ScenarioError."""
    if out.suffix not in SUFFIXES:
        raise ScenarioError("a picture's name ends in .png, .svg or .pdf", key="--out", value=str(out),
                            remedy="For example -o scene.png")
    data = io.BytesIO()
    scene_figure(scenario).savefig(data, format=out.suffix[1:], dpi=140)
    try:
        out.write_bytes(data.getvalue())
    except OSError as exc:
        raise ScenarioError(f"the picture cannot be written ({exc.strerror})", file=str(out)) from exc
    return out
