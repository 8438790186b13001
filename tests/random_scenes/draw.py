"""Random scenes as hypothesis strategies: bodies, what they touch, how they are driven, how they are solved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import hypothesis
import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn

from random_scenes.draw_parts import (
    Doc,
    conductions,
    courses,
    decades,
    flow_laws,
    held_warm,
    latent_heats,
    materials,
    one_in,
    one_of,
    over_place,
    rounded,
    thermal_conditions,
)
from random_scenes.scene import Scene

MOST_DEPTH = 0.02  # of a body's height: how far a motion presses bodies of their own stiffness


@dataclass
class Layout:
    """Where bodies lie, before physics.

    recipes : body -> mesh.  pairs : name -> (slave, master).  free : surfaces that no pair uses.
    hold : body that stays -> where it is held.  driven : the body that moves, its surface drive_on towards the others
    along `way`.  heights : body -> [m], across the contact.  gap [m] : between neighbours as drawn.
    """

    kind: str
    geometry: str
    recipes: dict[str, Doc]
    pairs: dict[str, tuple[str, str]]
    free: list[str]
    hold: dict[str, list[str]]
    driven: str
    drive_on: str
    way: tuple[float, float]
    heights: dict[str, float]
    gap: float


def _mesh_options(draw: DrawFn, triangles: bool = True) -> Doc:
    found: Doc = {}
    if triangles and (how := draw(one_of(False, False, True, "mixed"))):
        found["triangles"] = how
    if jitter := draw(one_of(0, 0, 0.2)):
        found |= {"jitter": jitter, "seed": draw(st.integers(0, 9))}
    if draw(one_in(3)):
        found["grading"] = [draw(one_of(1, 3, 0.3)), draw(one_of(1, 0.3, 3))]
    return found


@st.composite
def stacks(draw: DrawFn, size: float, gap: float, geometry: str, rectangles: bool = False) -> Layout:
    """One to three bodies one above the other, of different widths; interfaces may slope in the plane."""
    n = draw(one_of(2, 2, 2, 1, 3))
    names = ["lower", "upper", "third"][:n]
    flat = rectangles or geometry == "axisymmetric"
    slope = 0.0 if flat else draw(one_of(0, 0, 0.1, -0.1))
    left = draw(one_of(0, 1)) * size if geometry == "axisymmetric" else 0.0
    recipes: dict[str, Doc] = {}
    pairs: dict[str, tuple[str, str]] = {}
    heights, y = {}, 0.0
    for k, name in enumerate(names):
        height = rounded(size * draw(one_of(1, 0.5, 0.2)))
        width = size * (1.0 if k == 0 else draw(one_of(1, 0.6, 1.3)))
        x0 = left + (0.0 if k == 0 or geometry == "axisymmetric" else size * draw(one_of(0, 0.1, 0.2)))
        x0, x1 = rounded(x0), rounded(x0 + width)
        low, high = slope * (k > 0), slope * (k < n - 1)
        corners = [[x0, y + low * x0], [x1, y + low * x1], [x1, y + height + high * x1], [x0, y + height + high * x0]]
        cells = [draw(one_of(4, 2, 6)) if not rectangles else draw(one_of(1, 2)), draw(one_of(3, 2, 8))]
        recipes[name] = {"patch": [[rounded(a), float(f"{b:.9g}")] for a, b in corners], "cells": cells,
                         **({} if rectangles else _mesh_options(draw))}
        if k:
            pairs[f"{name}_{names[k - 1]}"] = draw(one_of((f"{name}.bottom", f"{names[k - 1]}.top"),
                                                          (f"{names[k - 1]}.top", f"{name}.bottom")))
        heights[name] = height
        y = y + height + gap
    free = [f"{b}.{s}" for b in names for s in ("bottom", "right", "top", "left")
            if f"{b}.{s}" not in {x for p in pairs.values() for x in p}
            and not (geometry == "axisymmetric" and s == "left" and left == 0)]
    hold = {names[0]: [f"{names[0]}.bottom"]} | {b: [f"{b}.left", f"{b}.right"] for b in names[1:-1]}
    return Layout("stack", geometry, recipes, pairs, free, hold, names[-1], f"{names[-1]}.top", (0.0, -1.0), heights,
                  gap)


@st.composite
def corners(draw: DrawFn, size: float, gap: float) -> Layout:
    """A block on a floor and beside a wall: its corner belongs to two pairs."""
    thick = rounded(0.4 * size)
    n = draw(one_of(4, 2, 8))
    free_wall = draw(one_of(0, gap, 1e-5 * size, 1e-3 * size))  # it touches the wall, or nearly
    recipes: dict[str, Doc] = {
        "floor": {"patch": [[0, -thick], [size, -thick], [size, 0], [0, 0]], "cells": [draw(one_of(n, n + 1)), 2]},
        "wall": {"patch": [[-thick, 0], [0, 0], [0, size], [-thick, size]], "cells": [2, draw(one_of(n, n + 1))]},
        "block": {"patch": [[free_wall, gap], [size, gap], [size, size], [free_wall, size]], "cells": [n, n],
                  **_mesh_options(draw)}}
    pairs = {"floor": ("block.bottom", "floor.top"), "wall": ("block.left", "wall.right")}
    if draw(one_in(2)):
        pairs = {"wall": pairs["wall"], "floor": pairs["floor"]}
    free = ["block.right", "block.top", "floor.bottom", "floor.right", "wall.left", "wall.top"]
    return Layout("corner", "plane", recipes, pairs, free, {"floor": ["floor.bottom"], "wall": ["wall.left"]}, "block",
                  "block.top", (0.0, -1.0), {"block": size, "floor": thick, "wall": thick}, gap)


@st.composite
def rings(draw: DrawFn, size: float, gap: float, geometry: str) -> Layout:
    """Two rings around each other, or a quarter of them; around an axis they are spherical shells."""
    ratio = draw(one_of(1, 1.05, 2))  # outer over inner side of the gap
    r = size
    gap = rounded(max(gap, (ratio - 1.0) * r))
    inner, outer = rounded(r * draw(one_of(0.5, 0.8))), rounded((r + gap) * draw(one_of(1.2, 1.5)))
    angles = [0, 90] if geometry == "axisymmetric" else draw(one_of([0, 90], [0, 360], [30, 120]))
    around = draw(one_of(8, 16)) * (2 if angles[1] == 360 else 1)
    more = _mesh_options(draw) if draw(one_in(2)) else {}
    recipes = {"inner": {"ring": [inner, r], "angles": angles, "cells": [draw(one_of(2, 4)), around], **more},
               "outer": {"ring": [float(f"{r + gap:.9g}"), outer], "angles": angles,
                         "cells": [draw(one_of(2, 4)), around + draw(one_of(0, 1, 3))]}}
    pair = ("inner.outer", "outer.inner")
    pairs = {"gap": draw(one_of(pair, pair[::-1]))}
    ends = [] if angles[1] == 360 else ["start", "end"]
    free = ["inner.inner", "outer.outer"] + [f"{b}.{s}" for b in recipes for s in ends if geometry == "plane"]
    return Layout("rings", geometry, recipes, pairs, free, {"outer": ["outer.outer"]}, "inner", "inner.inner",
                  (0.0, -1.0), {"inner": r - inner, "outer": outer - r - gap}, gap)


@st.composite
def rows(draw: DrawFn, size: float, gap: float, geometry: str) -> Layout:
    """Two bars in a row along x, the second no longer than the first, for halves of rods too."""
    n = draw(one_of(8, 4, 20))
    tall = rounded(0.2 * size)
    second, length = float(f"{size + gap:.12g}"), rounded(size * draw(one_of(1, 0.5, 0.2, 0.1)))
    end = float(f"{second + length:.12g}")
    recipes: dict[str, Doc] = {
        "one": {"patch": [[0, 0], [size, 0], [size, tall], [0, tall]], "cells": [n, 1]},
        "two": {"patch": [[second, 0], [end, 0], [end, tall], [second, tall]],
                "cells": [draw(one_of(n, n // 2)), 1]}}
    pair = ("one.right", "two.left")
    return Layout("row", geometry, recipes, {"face": draw(one_of(pair, pair[::-1]))}, ["one.left", "two.right"],
                  {"one": ["one.left"]}, "two", "two.right", (-1.0, 0.0), {"one": size, "two": length}, gap)


@st.composite
def layouts(draw: DrawFn, halves: tuple[str, str], reach: float, alone: bool = False) -> Layout:
    """A layout that suits the halves.  reach : what expansion closes, over the size of the scene.

    alone : bars with a gap that heat alone closes: less than a hot bar grows that gives no heat away, more than it
    grows where all crosses.
    """
    size = draw(one_of(0.1, 0.01, 1))
    if alone:
        return draw(rows(size, rounded(size * reach * draw(one_of(0.8, 0.5, 0.6, 0.7, 0.9, 1))), "plane"))
    gap = rounded(size * draw(one_of(0, reach, 0.1 * reach, 5 * reach, 1e-3, 0.5 * reach)))
    if "rod" in halves:
        return draw(rows(size, gap, "plane"))
    kind = draw(one_of("stack", "stack", "corner", "rings", "row", "rings"))
    geometry = "plane" if kind in ("corner", "row") else draw(one_of("plane", "plane", "axisymmetric"))
    if kind == "corner":
        return draw(corners(size, draw(one_of(0.0, gap))))
    if kind == "rings":
        return draw(rings(size, gap, geometry))
    if kind == "row":
        return draw(rows(size, gap, geometry))
    return draw(stacks(size, gap, geometry))


# Mechanics

def _motion(draw: DrawFn, layout: Layout, end: float) -> tuple[Any, Any]:
    """u_x and u_y of what is driven: nothing, touch, press, slide, part, or a leap."""
    height = layout.heights[layout.driven]
    kind = draw(one_of("still", "press", "press", "touch and part", "slide", "leap"))
    press = layout.gap + height * draw(one_of(1e-4, 1e-3, MOST_DEPTH))
    if kind == "still":
        return 0, 0
    if kind == "leap":
        press = layout.gap + height * draw(one_of(0.3, 1.2, 2.5))
    at = rounded(end * draw(one_of(0.5, 0.2, 0.05)))
    down: Doc = {"t": [0, at], "value": [0, rounded(press)]}
    if kind == "leap" and draw(one_of(True, False)):
        down = {"t": [at, at], "value": [0, rounded(press)]}
    if kind == "touch and part":
        down = {"t": [0, at, rounded(0.5 * (at + end)), end], "value": [0, rounded(press), rounded(press), 0]}
    aside: Any = 0
    if kind == "slide":
        aside = {"t": [at, end], "value": [0, rounded(height * draw(one_of(1e-3, 0.02, 0.3)))]}

    def scaled(signal: Doc, factor: float) -> Any:
        return {"t": signal["t"], "value": [v * factor for v in signal["value"]]} if factor else 0

    wx, wy = layout.way
    return (scaled(down, wx) if wx else aside), (scaled(down, wy) if wy else aside)


def _mechanical(draw: DrawFn, half: str, layout: Layout, stiff: float, end: float, alone: bool) -> Doc:
    if half == "rod":
        last = 0 if alone else draw(courses(end, 0.0, -layout.gap * draw(one_of(0, 1, 2))))
        return {"half": "rod", "rod": {"held": {"one": {"left": 0}, "two": {"right": last}}}}
    u_x, u_y = (0, 0) if alone else _motion(draw, layout, end)
    if half == "rigid":
        motion = {n: v for n, v in (("u_x", u_x), ("u_y", u_y)) if v != 0}
        return {"half": "rigid", "rigid": {"motion": {layout.driven: motion} if motion else {},
                                           "pressure": {p: rounded(stiff * 1e-4) for p in layout.pairs}}}
    boundary: list[Doc] = [{"on": on, "u_x": 0, "u_y": 0} for surfaces in layout.hold.values() for on in surfaces]
    if layout.geometry == "axisymmetric":
        boundary = [_axial(b) for b in boundary]
    rigid: Doc = {}
    if layout.driven not in layout.hold:
        how = "moved" if alone else draw(one_of("moved", "moved", "moved", "pressed"))
        if layout.kind == "rings":
            how = draw(one_of("still", "still", "moved", "pressure"))
            boundary.append({"on": layout.drive_on, "u_x": 0, "u_y": 0} if how == "still" else
                            {"on": layout.drive_on, "u_x": u_x, "u_y": u_y} if how == "moved" else
                            {"on": layout.drive_on, "pressure": draw(courses(end, 0.0, stiff * 1e-4))})
            if layout.geometry == "axisymmetric":
                boundary[-1] = boundary[-1] if how == "pressure" else _axial(boundary[-1])
                boundary += _symmetry(layout) if how == "still" else []
            if how == "pressure":
                boundary += _symmetry(layout)
        elif how == "moved" and layout.geometry == "plane" and draw(one_in(5)):
            turn = draw(one_of(0, 1e-3, 0.1, -0.5))
            rigid[layout.driven] = {"rigid": True}
            boundary.append({"body": layout.driven, "u_x": u_x, "u_y": u_y,
                             "angle": draw(courses(end, 0.0, turn)) if turn else 0})
        elif how == "moved":
            moved = {"on": layout.drive_on, "u_x": u_x, "u_y": u_y}
            boundary.append(_axial(moved) if layout.geometry == "axisymmetric" else moved)
        else:
            boundary += [{"on": layout.drive_on, "pressure": draw(courses(end, 0.0, stiff * 1e-4))},
                         {"on": f"{layout.driven}.right", "u_x": 0, "u_y": 0}]
            if layout.geometry == "axisymmetric":
                boundary[-1] = _axial(boundary[-1])
    elastic: Doc = {"boundary": boundary} | ({"bodies": rigid} if rigid else {})
    if draw(one_in(4)):
        elastic["element"] = "enhanced"
    if draw(one_in(5)):
        elastic["gravity"] = {"y": -9.81}
    if draw(one_in(5)):
        elastic["thermoelastic_heat"] = True
    if layout.geometry == "plane" and draw(one_in(8)):
        elastic["state"] = "plane_stress"
    if draw(one_in(8)):
        elastic["method"] = draw(one_of("bfgs", "modified_newton"))
    if draw(one_in(10)):
        elastic["dynamics"] = draw(one_of({}, {"rho_inf": 0.5}))
    return {"half": "elastic", "elastic": elastic}


def _axial(condition: Doc) -> Doc:
    """The same around an axis: r is free, but for what a hold needs."""
    return {k: v for k, v in condition.items() if k != "u_x"}


def _symmetry(layout: Layout) -> list[Doc]:
    if layout.geometry == "axisymmetric":
        return [{"on": "inner.start", "u_y": 0}]
    return [{"on": "inner.inner", "u_x": 0, "u_y": 0}]


# Coupling

def _coupling(draw: DrawFn, mechanical: Doc, windows: int, end: float, alone: bool) -> Doc:
    scheme = draw(one_of("staggered", "iterated", "extrapolated", "mechanical_first", "parallel", "auto", "along_heat",
                         *(("adiabatic",) if mechanical.get("elastic", {}).get("adiabatic") else ())))
    if alone and draw(one_in(2)):
        scheme = draw(one_of("staggered", "mechanical_first", "parallel", "extrapolated"))  # each half solved once
    found: Doc = {"scheme": scheme, "end": end}
    size = float(f"{end / windows:.12g}")
    control = draw(one_of("fixed", "fixed", "fixed", *(("fixed",) * 4 if alone else ()), "adaptive", "growing"))
    if control == "adaptive":
        found["adaptive"] = {"first": rounded(0.1 * size), "least": rounded(1e-3 * size)}
    elif control == "growing":
        found["windows"] = [{"until": end, "first": rounded(0.3 * size), "last": rounded(3 * size)}]
    else:
        found["windows"] = [{"until": end, "size": size}]
        if draw(one_in(4)):
            found["events"] = {"locate": True}
    if draw(one_in(3)):
        found["substeps"] = {"thermal": draw(one_of(2, 3, 1)), "mechanical": draw(one_of(1, 2))}
    if scheme == "iterated" and draw(one_in(2)):
        found["iteration"] = {"acceleration": draw(one_of("aitken", "iqn_ils", "none"))}
        if draw(one_in(3)):
            found["iteration"]["level"] = "end"
    if draw(one_in(5)):
        found["on_cycle"] = draw(one_of("cut", "iterate"))
    if draw(one_in(12)):
        found["stop"] = {"steady": 0}
    return found


def _rules(draw: DrawFn, span: float) -> list[Doc]:
    """Seldom a rule that puts windows back, or changes how the run goes on."""
    if not draw(one_in(8)):
        return []
    return [draw(one_of(
        {"name": "gently", "when": {"max_dT": {"above": rounded(0.2 * span)}}, "do": [{"retry": {"window": 0.5}}]},
        {"name": "together", "when": {"touching": {"above": 0}}, "do": [{"scheme": "iterated"}]},
        {"name": "finer", "when": {"max_dT": {"above": rounded(0.1 * span)}},
         "do": [{"substeps": {"thermal": "x2", "most": 4}}], "cooldown": 3}))]


@st.composite
def scenes(draw: DrawFn) -> Scene:
    """A whole scene."""
    mechanical_half = draw(one_of("elastic", "elastic", "elastic", "elastic", "rigid", "rod", "rod"))
    thermal_half = draw(one_of("thermal", "rod", "lumped")) if mechanical_half == "rod" else draw(
        one_of("thermal", "thermal", "thermal", "thermal", "lumped"))
    T_low, span = 300.0, draw(one_of(100.0, 500.0, 10.0))
    T_high = T_low + span
    temperatures = [T_low, T_high, T_low + 0.5 * span]
    # What conducts is then what heat has made of the gap: each field drives the other, and nothing else drives.
    often = {"elastic": one_in(3), "rod": one_of(True, True, False), "rigid": st.just(False)}
    alone = draw(often[mechanical_half])
    first = draw(materials(T_low, T_high, thermal_half == "thermal"))
    alpha = first["alpha"] or 1e-5
    if alone:
        first["alpha"] = alpha
    layout = draw(layouts((thermal_half, mechanical_half), alpha * span, alone))
    stiff = first["E"] if isinstance(first["E"], float) else first["E"]["value"][0]
    named = {"first": first}
    if draw(one_in(2)):
        named["second"] = draw(materials(T_low, T_high, thermal_half == "thermal"))
    if mechanical_half == "elastic":
        named = {n: m | draw(flow_laws(_number(m["E"]), T_low)) for n, m in named.items()}
        if layout.geometry == "plane" and "plastic" not in first and "creep" not in first and draw(one_in(3)):
            for m in named.values():
                m |= draw(latent_heats(_number(m["c"]), T_low, T_high))
    size = max(layout.heights.values())
    k = _number(first["k"])
    # The time in which heat crosses a body, times a number: what a run lasts.
    crossing = size**2 * first["rho"] * _number(first["c"]) / k
    if alone:
        end, windows = rounded(crossing * draw(decades(5, 100, 20))), draw(one_of(40, 80))  # it may settle, or not
    else:
        end, windows = rounded(crossing * draw(decades(1e-3, 50, 0.2))), draw(one_of(10, 20, 5, 40))
    h_body = k / size
    bodies: Doc = {b: {"material": draw(st.sampled_from(sorted(named))), "T0": draw(one_of(*temperatures))}
                   for b in layout.recipes}
    boundary = []
    if alone:
        bodies["one"]["material"] = "first"  # whose growth the gap is a part of
        boundary = [draw(held_warm(on, h_body, T, thermal_half != "lumped"))
                    for on, T in (("one.left", T_high), ("two.right", T_low))]
    else:
        for on in layout.free:
            boundary += draw(thermal_conditions(on, h_body, temperatures, end))
    if thermal_half == "thermal" and draw(one_in(8)):
        boundary = [draw(over_place(b, size, span)) for b in boundary]
    if thermal_half == "lumped":
        boundary = _one_temperature_a_body(boundary)
    if draw(one_in(6)):
        body = draw(st.sampled_from(sorted(bodies)))
        bodies[body]["Q_T"] = draw(courses(end, 0.0, k * span / size**2 * draw(one_of(1, -0.1))))
    mechanical = _mechanical(draw, mechanical_half, layout, stiff, end, alone)
    times = decades(1, 100, 10) if alone else decades(0.1, 1e4, 1)
    contact = {name: _pair(draw, mechanical_half, layout, sides, rounded(h_body * draw(times)), stiff)
               for name, sides in layout.pairs.items()}
    method = draw(one_of("midpoint", "sdirk2", "backward_euler", "midpoint", "theta"))
    thermal: Doc = {"half": thermal_half, "method": method, "boundary": boundary} | (
        {"theta": 0.7} if method == "theta" else {})
    if thermal_half == "thermal" and draw(one_in(8)):
        thermal["adaptive"] = {"tolerance": rounded(1e-3 * span)}
    doc: Doc = {"slideline": 2, "title": f"random: {layout.kind}", "units": {"temperature": "K"},
                "geometry": layout.geometry,
                "materials": {n: m for n, m in named.items() if any(b["material"] == n for b in bodies.values())},
                "bodies": bodies}
    if contact:
        doc["contact"] = contact
    doc |= {"thermal": thermal, "mechanical": mechanical, "coupling": _coupling(draw, mechanical, windows, end, alone),
            "probes": _probes(layout)}
    if rules := _rules(draw, span):
        doc["rules"] = rules
    # Drawn last, so that the scenes of all other seeds stay what they were.
    if contact and mechanical_half == "elastic" and draw(one_in(8)):
        name = draw(st.sampled_from(sorted(contact)))
        doc["contact"][name] = _tied(draw, contact[name], layout, k)
    return Scene(doc, layout.recipes)


def _number(prop: Any) -> float:
    if isinstance(prop, Mapping):
        return float(prop["k_1"] if "k_1" in prop else prop["value"][0])
    return float(prop)


def _one_temperature_a_body(boundary: list[Doc]) -> list[Doc]:
    seen, kept = set(), []
    for condition in boundary:
        body = condition["on"].partition(".")[0]
        if "temperature" not in condition or body not in seen:
            kept.append(condition)
        if "temperature" in condition:
            seen.add(body)
    return kept


def _pair(draw: DrawFn, half: str, layout: Layout, sides: tuple[str, str], h: float, stiff: float) -> Doc:
    size = max(layout.heights.values())
    pair: Doc = {"slave": sides[0], "master": sides[1], "gap_max": rounded(max(0.3 * size, 3 * layout.gap)),
                 "conduction": draw(conductions(h, stiff * 1e-4, max(layout.gap, 1e-5 * size)))}
    if half == "elastic":
        if draw(one_in(3)):
            pair["friction"] = {"mu": draw(one_of(0.3, 0.1, 0.8))}
        if draw(one_in(4)):
            pair["augmented"] = {"method": draw(one_of("semi_smooth", "uzawa"))}
        if draw(one_in(4)):
            pair["form"] = "nodes"
        elif draw(one_in(4)):
            pair["two_pass"] = True
        if draw(one_in(4)):
            pair["penalty"] = rounded(stiff / size * draw(decades(1, 1000, 10)))
    if draw(one_in(6)):
        pair["radiation"] = {"emissivity_slave": draw(one_of(0.8, 0.3)), "emissivity_master": draw(one_of(0.8, 1))}
    return pair


def _tied(draw: DrawFn, pair: Doc, layout: Layout, k: float) -> Doc:
    """The pair, bonded: what contradicts is left out."""
    tied = {key: pair[key] for key in ("slave", "master", "gap_max", "penalty") if key in pair}
    if draw(one_in(2)):
        tied["resistance"] = rounded(max(layout.heights.values()) / k * draw(decades(1e-3, 1, 0.1)))
    return tied | {"tied": True}


def _probes(layout: Layout) -> Doc:
    found: Doc = {}
    for body in layout.recipes:
        found |= {f"{body}.T.mean": {"T": {"mean": body}}, f"{body}.T.max": {"T": {"max": body}},
                  f"{body}.T.min": {"T": {"min": body}}, f"{body}.u_y": {"u_y": {"max": body}}}
    for name, (slave, _) in layout.pairs.items():
        found |= {f"{name}.p": {"p": {"max": slave}}, f"{name}.gap": {"gap": {"mean": slave}},
                  f"{name}.T": {"T": {"mean": slave}}}
    return found


# Scenes by number

def scene_of(seed: int) -> Scene:
    """The scene of a seed; the same for as long as the strategies stay as they are."""
    drawn: list[Scene] = []

    # hypothesis draws the plainest scene first, then one by the seed.
    @hypothesis.seed(seed)
    @hypothesis.settings(max_examples=2, phases=(hypothesis.Phase.generate,), database=None, deadline=None,
                         suppress_health_check=list(hypothesis.HealthCheck))
    @hypothesis.given(scenes())
    def draw(scene: Scene) -> None:
        drawn.append(scene)

    draw()
    return drawn[-1]


def generator(seed: int) -> np.random.Generator:
    """Random numbers of a seed, for what is done with its scene."""
    return np.random.default_rng([seed, 20011])
