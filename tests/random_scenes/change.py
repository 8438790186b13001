"""The same scene seen otherwise: elsewhere, turned, mirrored, numbered otherwise, in other units, later.

Each function returns a Changed: the new scene, and how its answer is carried back (random_scenes.compare).
What cannot be said of the new scene raises NotApplicable with the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise
from math import comb, cos, radians, sin
from typing import Any

import numpy as np

from contact.problem.laws import LEAST_LAYER
from random_scenes.declared import OLD_UNITS, NotApplicable, Units, restated, value_at
from random_scenes.scene import Scene
from random_scenes.shapes import Floats, Shape

KELVIN = {"degC": 273.15, "K": 0.0}  # what makes kelvin of a temperature
VECTORS = (("u_x", "u_y"), ("t_x", "t_y"), ("f_x", "f_y"), ("b_x", "b_y"))
FREE_IF_MISSING = ("u_x", "u_y")  # a component that is not given is free; of the others it is 0
UNITS = {"T": "K", "u_x": "m", "u_y": "m", "gap": "m", "p": "Pa"}  # of what probes look at
PSEUDOSCALARS = ("angle", "moment")
FRAMELESS = {"t", "window", "number", "failures", "iterations", "contraction", "error", "max_T", "max_p", "touching",
             "slipping", "imbalance", "max_dT", "heat_stored"}
"""Monitors of rules that are the same however a scene is turned."""


@dataclass(frozen=True, eq=False)
class Changed:
    """scene : the new one.  what : in words.  x_new = units.m (turn @ x + shift): (2, 2) [1], (2,) [m].

    units : in which its numbers are.  lead : quiet [s] before all, in new seconds.
    probes : name -> sign of those that mean the same; the others were left out, or are no more to be compared.
    """

    scene: Scene
    what: str
    turn: Floats = field(default_factory=lambda: np.eye(2))
    shift: Floats = field(default_factory=lambda: np.zeros(2))
    units: Units = OLD_UNITS
    lead: float = 0.0
    probes: Mapping[str, float] = field(default_factory=dict)


def monitors(doc: Mapping[str, Any]) -> set[str]:
    """What the rules of a document look at and what they set."""
    found: set[str] = set()
    for rule in doc.get("rules", ()):
        for when in (rule.get("when", {}), *rule.get("when", {}).get("any", ())):
            found |= when.keys() - {"any"}
        found |= {*rule.get("drive", {}).get("so_that", {})}.union(*(do.get("set", ()) for do in rule.get("do", ())))
    return found


def _shapes(scene: Scene) -> dict[str, Shape]:
    """The meshes, with the points that rectangles have and meshes from files have not."""
    return {body: corner_points(shape) for body, shape in scene.shapes.items()}


def corner_points(shape: Shape) -> Shape:
    """A mesh with the names that a rectangle's corners have too, such as top.left and left.top."""
    if "top_left" not in shape.points:
        return shape
    corners = {f"{a}.{b}": shape.points[f"{a}_{b}"] for a in ("top", "bottom") for b in ("left", "right")}
    turned = {".".join(reversed(name.split("."))): k for name, k in corners.items()}
    return replace(shape, points={**corners, **turned, **shape.points})


# In space


def shifted(scene: Scene, dx: float, dy: float) -> Changed:
    """The scene moved by (dx, dy) [m]; an axisymmetric one only along z."""
    if scene.axisymmetric and dx:
        raise NotApplicable("an axisymmetric scene has its axis at r = 0")
    return _placed(scene, np.eye(2), np.array([dx, dy]), f"moved by ({dx:g}, {dy:g}) m")


def turned(scene: Scene, degrees: float) -> Changed:
    """The scene turned anticlockwise about the origin; an angle that is no multiple of 90 is not always possible."""
    if scene.axisymmetric:
        raise NotApplicable("an axisymmetric scene has its axis along z")
    c, s = cos(radians(degrees)), sin(radians(degrees))
    if degrees % 90.0 == 0.0:
        c, s = float(round(c)), float(round(s))
    return _placed(scene, np.array([[c, -s], [s, c]]), np.zeros(2), f"turned by {degrees:g} degrees")


def mirrored(scene: Scene) -> Changed:
    """The scene mirrored, x to -x; an axisymmetric one z to -z."""
    axis = "z" if scene.axisymmetric else "x"
    return _placed(scene, np.diag([1.0, -1.0] if scene.axisymmetric else [-1.0, 1.0]), np.zeros(2),
                   f"mirrored, {axis} to -{axis}")


def _demand_meshes(scene: Scene) -> None:
    if scene.wants_rectangles:
        raise NotApplicable("a rod is a rectangle along x, and stays one")


def _placed(scene: Scene, turn: Floats, shift: Floats, what: str) -> Changed:
    """The scene at turn @ x + shift."""
    _demand_meshes(scene)
    doc = restated(scene)
    move = _Move(turn, shift)
    if not move.only_shifts and (seen := monitors(doc) - FRAMELESS):
        raise NotApplicable(f"rules look at {', '.join(sorted(seen))}")
    for b in doc["thermal"]["boundary"]:
        move.fields(b, ("temperature", "flux"))
        for part in ("convection", "radiation"):
            if part in b:
                move.fields(b[part], ("h", "T"))
    for body in doc["bodies"].values():
        if body.get("regions"):
            raise NotApplicable("regions by rectangles are not moved")
        move.fields(body, ("Q_T", "T0"))
    for material in doc["materials"].values():
        if isinstance(k := material.get("k"), dict) and "k_1" in k:
            k["angle"] = move.det * k["angle"] + move.degrees
    mechanical = doc["mechanical"]
    if "elastic" in mechanical:
        _place_elastic(mechanical["elastic"], move)
    for motion in mechanical.get("rigid", {}).get("motion", {}).values():
        move.vector(motion, ("u_x", "u_y"))
    probes = {}
    for name, probe in list(doc.get("probes", {}).items()):
        moved = move.probe(probe)
        if moved is None:
            del doc["probes"][name]
        else:
            doc["probes"][name], probes[name] = moved
    shapes = {b: shape.at(shape.nodes @ turn.T + shift, flip=move.det < 0.0) for b, shape in _shapes(scene).items()}
    return Changed(replace(scene, doc=doc, moved=shapes), what, turn, shift, probes=probes)


def _place_elastic(elastic: dict[str, Any], move: _Move) -> None:
    elastic["boundary"] = move.merged(elastic["boundary"])
    for b in elastic["boundary"]:
        for names in VECTORS:
            if any(isinstance(b.get(n), dict) and "terms" in b[n] for n in names):
                raise NotApplicable("displacements as fields are not moved")
            if any(n in b for n in names):
                move.vector(b, names)
        for n in PSEUDOSCALARS:
            if n in b:
                b[n] = combined([(move.det, b[n])])
        if "rotation" in b:
            b["rotation"] = {"about": move.point(b["rotation"]["about"]),
                             "angle": combined([(move.det, b["rotation"]["angle"])])}
    if "gravity" in elastic:
        move.vector(elastic["gravity"], ("x", "y"))
    for body in elastic["bodies"].values():
        if "reference" in body:
            body["reference"] = move.point(body["reference"])
        body["v0"] = [float(v) for v in move.turn @ np.array(body["v0"])]
        body["omega0"] *= move.det


@dataclass(frozen=True)
class _Move:
    """x_new = turn @ x + shift."""

    turn: Floats
    shift: Floats

    @property
    def det(self) -> float:
        return float(np.sign(np.linalg.det(self.turn)))

    @property
    def degrees(self) -> float:
        """Where the x axis goes: det * angle + degrees is the new angle of an axis that stood at `angle`."""
        return float(np.degrees(np.arctan2(self.turn[1, 0], self.turn[0, 0])))

    @property
    def only_shifts(self) -> bool:
        return bool((self.turn == np.eye(2)).all())

    @property
    def square(self) -> bool:
        """Whether each new axis is an old one."""
        return bool((np.abs(self.turn).max(axis=1) == 1.0).all())

    def axis(self, new: int) -> tuple[int, float]:
        """The old axis that a new one is, and its sign."""
        old = int(np.abs(self.turn[new]).argmax())
        return old, float(self.turn[new, old])

    def point(self, x: Any) -> list[float]:
        return [float(v) for v in self.turn @ np.array(x, dtype=float) + self.shift]

    def fields(self, at: dict[str, Any], keys: tuple[str, ...]) -> None:
        """Move the profiles of FIELDs."""
        for key in keys:
            if isinstance(value := at.get(key), dict) and "terms" in value:
                at[key] = {"terms": [self.term(term) for term in value["terms"]]}

    def term(self, term: Mapping[str, Any]) -> dict[str, Any]:
        if not {"x", "y"} & term.keys():
            return dict(term)
        if not self.square:
            raise NotApplicable("a profile over x or y does not lie along an axis when turned")
        made = {"t": term["t"]}
        for new, name in enumerate("xy"):
            old, sign = self.axis(new)
            if (profile := term.get("xy"[old])) is not None:
                made[name] = moved_profile(profile, sign, float(self.shift[new]))
        return made

    def merged(self, boundary: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Entries for u_x and u_y of one place that follow each other become one."""
        made: list[dict[str, Any]] = []
        for b in boundary:
            last = made[-1] if made else {}
            held = {n for n in ("u_x", "u_y", "angle") if n in last}
            also = {n for n in ("u_x", "u_y", "angle") if n in b}
            if held and also and not held & also and "name" not in {**last, **b} and all(
                    last.get(n) == b.get(n) for n in ("on", "at", "body")):
                made[-1] = {**last, **b}
            else:
                made.append(b)
        return made

    def vector(self, at: dict[str, Any], names: tuple[str, ...]) -> None:
        """Turn the components of a vector."""
        given = [at.pop(n, None) for n in names]
        if self.square:
            for new in range(2):
                old, sign = self.axis(new)
                if given[old] is not None:
                    at[names[new]] = combined([(sign, given[old])])
            return
        if names[0] in FREE_IF_MISSING and None in given:
            raise NotApplicable("one component is held and the other free: it turns by right angles only")
        if "name" in at:
            raise NotApplicable("a named condition has one component: it turns by right angles only")
        for new in range(2):
            at[names[new]] = combined([(float(self.turn[new, old]), g) for old, g in enumerate(given) if g is not None])

    def probe(self, probe: Mapping[str, Any]) -> tuple[dict[str, Any], float] | None:
        """A probe of the same quantity and its sign; None where it means nothing any more."""
        (quantity, place), = probe.items()
        if isinstance(place, dict) and "at" in place:
            place = {**place, "at": self.point(place["at"])}
        name = self.component(quantity)
        if name is None:
            return None
        quantity, sign = name
        if sign < 0 and isinstance(place, dict):
            other = {"max": "min", "min": "max"}
            place = {other.get(key, key): value for key, value in place.items()}
        return {quantity: place}, sign

    def component(self, quantity: str) -> tuple[str, float] | None:
        """The component that a component becomes, and its sign."""
        head, dot, tail = quantity.rpartition(".")
        if head == "mechanical.x":
            return None  # a place, no displacement
        if self.only_shifts:
            return quantity, 1.0
        if quantity in ("u_x", "u_y"):
            head, dot, tail = "u", "_", quantity[-1]
        if quantity.endswith("contact.t_T"):
            return quantity, self.det
        if "[" in quantity:
            return None
        letters = [a for a in tail if a in "xyz"] if tail in ("x", "y", "xx", "yy", "xy", "zz") else []
        if not letters or tail == "zz":
            return quantity, 1.0
        if not self.square:
            return None
        sign, new = 1.0, []
        for a in letters:
            there = int(np.abs(self.turn[:, "xy".index(a)]).argmax())
            sign *= float(self.turn[there, "xy".index(a)])
            new.append("xy"[there])
        return head + dot + "".join(sorted(new)), sign


def moved_profile(profile: Mapping[str, Any], sign: float, shift: float) -> dict[str, Any]:
    """A profile over s as one over sign * s + shift [m]."""
    if "polynomial" in profile:
        # sum a_n (sign (z - shift))^n
        a = profile["polynomial"]
        return {"polynomial": [sum(a[n] * sign**n * comb(n, k) * (-shift)**(n - k) for n in range(k, len(a)))
                               for k in range(len(a))]}
    pairs = sorted(zip((sign * s + shift for s in profile["at"]), profile["value"], strict=True))
    return {"at": [p[0] for p in pairs], "value": [p[1] for p in pairs]}


def combined(parts: list[tuple[float, Any]]) -> Any:
    """A sum of factors times signals (numbers or plain tables), exact: with the jumps of all of them."""
    if len(parts) == 1 and parts[0][0] == 1.0:
        return parts[0][1]
    if not any(isinstance(signal, Mapping) for _, signal in parts):
        return float(sum(factor * signal for factor, signal in parts))
    tables = [signal for _, signal in parts if isinstance(signal, Mapping)]
    jumps = {a for table in tables for a, b in pairwise(table["t"]) if a == b}
    t, value = [], []
    for when in sorted({t for table in tables for t in table["t"]}):
        for side in (-1, 1) if when in jumps else (1,):
            t.append(when)
            value.append(float(sum(factor * value_at(signal, when, side) for factor, signal in parts)))
    return {"t": t, "value": value}


# In number


def renumbered(scene: Scene, rng: np.random.Generator) -> Changed:
    """Nodes, cells and edges in another order; boundary conditions too, but for those of which the later one holds."""
    _demand_meshes(scene)
    doc = restated(scene)
    shapes = {body: shape.renumbered(rng)[0] for body, shape in _shapes(scene).items()}
    boundary = doc["thermal"]["boundary"]
    doc["thermal"]["boundary"] = _shuffled(boundary, lambda b: "temperature" in b, rng)
    if "elastic" in doc["mechanical"]:
        elastic = doc["mechanical"]["elastic"]
        elastic["boundary"] = _shuffled(elastic["boundary"], lambda b: any(n in b for n in ("u_x", "u_y", "angle")),
                                        rng)
    return Changed(replace(scene, doc=doc, moved=shapes), "numbered otherwise", probes=_all_probes(doc))


def _shuffled(entries: list[Any], ordered: Callable[[Any], bool], rng: np.random.Generator) -> list[Any]:
    """The entries in another order; those that are ordered keep theirs among themselves."""
    mixed = [entries[int(k)] for k in rng.permutation(len(entries))]
    kept = iter([e for e in entries if ordered(e)])
    return [next(kept) if ordered(e) else e for e in mixed]


def bodies_reversed(scene: Scene) -> Changed:
    """The bodies, and so the nodes of all, in reverse order."""
    doc = restated(scene)
    doc["bodies"] = dict(reversed(doc["bodies"].items()))
    return Changed(replace(scene, doc=doc), "with its bodies in reverse order", probes=_all_probes(doc))


def pairs_reversed(scene: Scene) -> Changed:
    """The pairs in reverse order."""
    doc = restated(scene)
    if len(doc.get("contact", {})) < 2:
        raise NotApplicable("one pair has no order")
    doc["contact"] = dict(reversed(doc["contact"].items()))
    return Changed(replace(scene, doc=doc), "with its pairs in reverse order", probes=_all_probes(doc))


def sides_swapped(scene: Scene) -> Changed:
    """Slave and master of every pair changed over; what is said of either side goes with it."""
    doc = restated(scene)
    if not any(pair["slave"] != pair["master"] for pair in doc.get("contact", {}).values()):
        raise NotApplicable("no pair has two sides")
    for pair in doc["contact"].values():
        pair["slave"], pair["master"] = pair["master"], pair["slave"]
        if "share" in (friction := pair.get("friction") or {}):
            friction["share"] = 1.0 - friction["share"]
        if radiation := pair.get("radiation"):
            a, b = "emissivity_slave", "emissivity_master"
            radiation[a], radiation[b] = radiation[b], radiation[a]
    return Changed(replace(scene, doc=doc), "with slave and master changed over", probes=_all_probes(doc))


def _all_probes(doc: Mapping[str, Any]) -> dict[str, float]:
    return dict.fromkeys(doc.get("probes", {}), 1.0)


# In units and time


def in_other_unit(scene: Scene) -> Changed:
    """Temperatures in degC where they were in K, and the other way round."""
    old = scene.doc["units"]["temperature"]
    new = "K" if old == "degC" else "degC"
    doc = restated(scene, offset=KELVIN[old] - KELVIN[new])
    doc["units"] = {"temperature": new}
    return Changed(replace(scene, doc=doc), f"with temperatures in {new}", probes=_all_probes(doc))


def in_other_units(scene: Scene, units: Units) -> Changed:
    """The scene in other units of length, mass, time and temperature: a physically similar one.

    Probes of a half's own outputs are left out: their unit is not in the document.
    """
    doc = restated(scene, units=units)
    coupling = doc["coupling"]
    if not coupling.get("windows") and not coupling.get("adaptive"):
        raise NotApplicable("the document does not state the tolerances of its windows")
    laws = (pair.get("conduction") for pair in doc.get("contact", {}).values())
    if any(layer < LEAST_LAYER for law in laws for layer in _layers(law)):
        raise NotApplicable("a layer of gas is thinner than molecules are apart, and no law of conductance knows it")
    doc["probes"] = {n: p for n, p in doc.get("probes", {}).items() if not any("." in quantity for quantity in p)}
    if scene.wants_rectangles:
        recipes = {b: {**recipe, "patch": [[units.m * v for v in corner] for corner in recipe["patch"]]}
                   for b, recipe in scene.recipes.items()}
        made = replace(scene, doc=doc, recipes=recipes)
    else:
        shapes = {b: shape.at(units.m * shape.nodes) for b, shape in _shapes(scene).items()}
        made = replace(scene, doc=doc, moved=shapes)
    probes = {n: 1.0 / units.of(UNITS.get(next(iter(p)), "1")) for n, p in doc["probes"].items()}
    words = ", ".join(f"1/{n:g} {unit}" for unit, n in asdict(units).items() if n != 1.0)
    return Changed(made, f"in units of {words}", units=units, probes=probes)


def _layers(law: Any) -> Iterator[float]:
    """The layers g_m of gas [m] in a law of conductance, or in what holds laws."""
    for part in law.values() if isinstance(law, dict) else law if isinstance(law, list) else ():
        yield from _layers(part)
    if isinstance(law, dict) and "g_m" in law:
        yield float(law["g_m"])


def later(scene: Scene, lead: float) -> Changed:
    """The scene after `lead` [s] of rest.  Whether it is at rest is for who asks: run `resting(scene, lead)`."""
    if scene.doc.get("rules"):
        raise NotApplicable("rules would see the lead")
    doc = restated(scene, lead=lead)
    coupling = doc["coupling"]
    if coupling.get("stop"):
        raise NotApplicable("it ends when nothing happens")
    if any(any(b["v0"]) or b["omega0"] for b in doc["mechanical"].get("elastic", {}).get("bodies", {}).values()):
        raise NotApplicable("a body moves at the start")
    coupling["end"] += lead
    coupling["kinks"] = [lead, *(t + lead for t in coupling["kinks"])]
    if "windows" in coupling:
        coupling["windows"] = [{"until": lead, "size": lead},
                               *({**w, "until": w["until"] + lead} for w in coupling["windows"])]
    doc.pop("output", None)
    return Changed(replace(scene, doc=doc), f"begun after {lead:g} s of rest", lead=lead, probes=_all_probes(doc))


def resting(scene: Scene, lead: float) -> Scene:
    """The lead alone: the scene for `lead` [s] with all data as they are at the start."""
    doc = later(scene, lead).scene.copied_doc()
    coupling = doc["coupling"]
    coupling["end"], coupling["kinks"] = lead, []
    if "windows" in coupling:
        coupling["windows"] = coupling["windows"][:1]
    return replace(scene, doc=doc)
