"""Simplifications of a scenario as edits of its values: which there are, and what trials are run with."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from coupler.control.auto import schemes_under
from coupler.scenario.document import Key
from coupler.scenario.edits import cells_as, windows_times
from coupler.scenario.options import Scheme
from coupler.scenario.timing import has_inertia

# Edits of a scenario: values put in and keys taken out, on plain values and on a commented file alike.

Tree = Mapping[str, Any]  # a scenario's values, as the file has them


@dataclass(frozen=True)
class Edit:
    """An edit of a scenario.  put : key -> value.  drop : keys taken out, items of lists too."""

    put: Mapping[Key, Any] = field(default_factory=dict)
    drop: tuple[Key, ...] = ()

    def plus(self, other: Edit) -> Edit:
        """Join two edits; where they put the same key, the other's value."""
        return Edit({**self.put, **other.put}, (*self.drop, *other.drop))


def edited(tree: Any, edits: Iterable[Edit]) -> Any:
    """Copy the tree with all puts done, then all drops.

    So an edit that takes a block out wins over one that changes something inside it, and numbers of list items are
    those of the tree as it came.
    """
    tree, gone = copy.deepcopy(tree), set()
    for edit in edits:
        for key, value in edit.put.items():
            _put(tree, key, copy.deepcopy(value))
        gone |= set(edit.drop)
    # Later items of a list first: the numbers of the others then stay right.
    # fault: advice: numbers of list items move when one is taken out -> for key in sorted(gone, key=_order): |
    #   coupler/test_advise
    for key in sorted(gone, key=_order, reverse=True):
        _drop(tree, key)
    return tree


def at(tree: Any, key: Key) -> Any:
    """Return the value at a key; None where there is none."""
    for part in key:
        if part not in _inside(tree):
            return None
        tree = tree[part]
    return tree


def _order(key: Key) -> tuple[tuple[str, int], ...]:
    return tuple(("", part) if isinstance(part, int) else (part, 0) for part in key)


def _put(tree: Any, key: Key, value: Any) -> None:
    for part in key[:-1]:
        if isinstance(tree, dict) and tree.get(part) is None:
            tree[part] = {}
        tree = tree[part]
    tree[key[-1]] = value


def _drop(tree: Any, key: Key) -> None:
    if key[-1] in _inside(holder := at(tree, key[:-1])):
        del holder[key[-1]]


def _inside(tree: Any) -> Any:
    """Return what a next part of a key may be."""
    return tree.keys() if isinstance(tree, Mapping) else range(len(tree)) if isinstance(tree, list) else ()


# A simplification: one thing that a scenario could do without.

class Aspect(Enum):
    """What a simplification changes; at most one of MECHANICS, HEAT, SCHEME, WINDOWS and MESH is accepted."""

    SCHEME = "coupling"
    MECHANICS = "mechanics"
    HEAT = "heat"
    EFFECT = "effect"
    WINDOWS = "windows"
    MESH = "mesh"


@dataclass(frozen=True, eq=False)
class Simplification:
    """One thing that a scenario could do without.

    name : of what is dropped or made simpler.  edit : of the scenario.
    needs_deformation : it has an effect only where deformation is computed.
    misses : what such a model cannot show at all.
    windows, mesh : factors on the windows and on the cells along an edge of the trials.
    """

    name: str
    aspect: Aspect
    edit: Edit = field(default_factory=Edit)
    needs_deformation: bool = False
    misses: str = ""
    windows: float = 1.0
    mesh: float = 1.0

    @property
    def rigid(self) -> bool:
        """Whether bodies keep their shape with it."""
        return self.edit.put.get(("mechanical", "half")) == "rigid"

    @property
    def removes_physics(self) -> bool:
        """Whether it takes physics out: accepted though it saves nothing; all else must save something."""
        return self.aspect in (Aspect.EFFECT, Aspect.MECHANICS, Aspect.HEAT)


# Simplifications of mechanics: rigid bodies, bodies at rest, bodies that heat does not move.

RIGID_MISSES = ("bodies keep their shape: no spring-back, no gap that opens by expansion or shrinkage, no stress, no "
                "slip; pressures are those prescribed, the same along a surface, so nothing of corners")
REST_MISSES = "bodies stay where they are meshed; contact is that of the start, without pressure"
ONE_WAY_MISSES = "heat moves nothing: no expansion, no shrinkage"
REST, RIGID_REST = "bodies at rest (uncoupled)", "rigid bodies, at rest as nothing drives them (uncoupled)"
AXES = ("u_x", "u_y")


def mechanics(tree: Tree) -> Iterator[Simplification]:
    """Yield the simplifications of mechanics: uncoupled first, then one-way, then cheaper mechanics."""
    half, own = at(tree, ("mechanical", "half")), at(tree, ("mechanical", "rigid"))
    motion = own if own is not None else motion_of(tree)
    if half != "rigid" or motion:
        yield Simplification(REST if motion else RIGID_REST, Aspect.MECHANICS, _rigid(tree, {}), misses=REST_MISSES)
    if half != "rigid" and motion:
        edit = _rigid(tree, None if own is not None else motion)
        yield Simplification("rigid bodies (one-way)", Aspect.MECHANICS, edit, misses=RIGID_MISSES)
    if half == "elastic" and at(tree, ("mechanical", "rod")) is not None:
        yield Simplification("deformation along x only", Aspect.MECHANICS, Edit({("mechanical", "half"): "rod"}),
                             misses="bending and shear")
    if half != "rigid" and (still := _still(tree)):
        yield Simplification("all expansion and shrinkage (one-way)", Aspect.EFFECT, Edit(still),
                             needs_deformation=True, misses=ONE_WAY_MISSES)


def _rigid(tree: Tree, motion: dict[str, Any] | None) -> Edit:
    """Switch to the half `rigid`, with this motion, or the scenario's own where it is None.

    Friction and augmentation are dropped: the half has no forces and refuses them.
    """
    put: dict[Key, Any] = {("mechanical", "half"): "rigid"}
    if motion is not None:
        put["mechanical", "rigid"] = motion
    return Edit(put, tuple(("contact", name, key) for name in tree.get("contact", {}) for key in
                           ("friction", "augmented")))


def motion_of(tree: Tree) -> dict[str, Any]:
    """Make the part `mechanical.rigid` of a scenario without one: each body moves as it is driven; {} where none is.

    The first drive of a body along an axis that is not zero counts.
    """
    motion: dict[str, dict[str, Any]] = {}
    for entry in at(tree, ("mechanical", "elastic", "boundary")) or ():
        body = entry.get("body") or str(entry.get("on") or entry.get("at")).partition(".")[0]
        for axis in AXES:
            if entry.get(axis) not in (None, 0, 0.0):
                motion.setdefault(body, {}).setdefault(axis, entry[axis])
    for body, held in (at(tree, ("mechanical", "rod", "held")) or {}).items():
        for end in ("left", "right"):
            if held.get(end) not in (None, 0, 0.0):
                motion.setdefault(body, {}).setdefault("u_x", held[end])
    return {"motion": motion} if motion else {}


def _still(tree: Tree) -> dict[Key, Any]:
    """Stop expansion and shrinkage of all materials; {} for one material with one of them, a simplification of its
    own."""
    still: dict[Key, Any] = {}
    for name, material in tree["materials"].items():
        if material.get("alpha"):
            still["materials", name, "alpha"] = 0
        if at(material, ("liquid", "shrinkage")):
            still["materials", name, "liquid", "shrinkage"] = 0
    return still if len(still) > 1 else {}


LONGER_WINDOWS = (2.0, 4.0)
HEATS = {"plastic": ("chi", "plastic heat"), "creep": ("heat", "heat of creep"),
         "liquid": ("heat", "viscous heat of the melt")}
PATHS = {"convection": "convection", "radiation": "far radiation", "flux": "the heat flux"}


def simplifications_of(tree: Tree) -> tuple[Simplification, ...]:
    """Return every simplification of a scenario, coarse ones first.  tree : its values with overrides applied."""
    return (*mechanics(tree), *heat(tree), *schemes(tree), *paths(tree), *pairs(tree), *materials(tree), *forces(tree),
            *windows(tree))


def iterated(tree: Tree) -> Edit:
    """Return the edit to the reference: both halves agree in every window."""
    return Edit({("coupling", "scheme"): "iterated"})


def schemes(tree: Tree) -> Iterator[Simplification]:
    """Yield simpler schemes than the scenario's own."""
    own = Scheme(at(tree, ("coupling", "scheme")) or "staggered")
    for name in dict.fromkeys(simpler.value for scheme in schemes_under(own) for simpler in scheme.simpler):
        yield Simplification(f"scheme {name}", Aspect.SCHEME, Edit({("coupling", "scheme"): name}))


def heat(tree: Tree) -> Iterator[Simplification]:
    """Yield smaller thermal halves."""
    half = at(tree, ("thermal", "half")) or "thermal"
    small = (("thermal", "adaptive"),)
    if half == "thermal" and _in_a_row(tree):
        yield Simplification("heat along x only", Aspect.HEAT, Edit({("thermal", "half"): "rod"}, small),
                   misses="differences of temperature across x")
    if half in ("thermal", "rod"):
        yield Simplification("one temperature a body", Aspect.HEAT, Edit({("thermal", "half"): "lumped"}, small),
                   misses="differences of temperature within a body")


def _in_a_row(tree: Tree) -> bool:
    """Return whether every body is a rectangle and all pairs are of left and right ends."""
    sides = {str(pair.get(side, "")).rpartition(".")[2] for pair in tree.get("contact", {}).values()
             for side in ("slave", "master")}
    return bool(sides) and sides <= {"left", "right"} and all(
        at(body, ("mesh", "rectangle")) is not None for body in tree["bodies"].values())


def paths(tree: Tree) -> Iterator[Simplification]:
    """Yield heat paths to the surroundings, and sources; prescribed temperatures are the scene itself."""
    for i, entry in enumerate(at(tree, ("thermal", "boundary")) or ()):
        for kind, what in PATHS.items():
            if entry.get(kind) is not None:
                yield Simplification(f"{what} on {entry.get('on', 'its place')}", Aspect.EFFECT,
                           Edit(drop=(("thermal", "boundary", i),)))
    for name, body in tree["bodies"].items():
        if body.get("Q_T"):
            yield Simplification(f"the heat source in {name}", Aspect.EFFECT,
                       Edit(drop=(("bodies", name, "Q_T"), ("bodies", name, "Q_T_factor"))))


def pairs(tree: Tree) -> Iterator[Simplification]:
    """Yield what happens between two sides: conduction, radiation, friction."""
    for name, pair in tree.get("contact", {}).items():
        key = ("contact", name)
        for branch, what in (("open", "conduction across the gap"), ("closed", "conduction where they touch")):
            if at(pair, ("conduction", branch)) is not None:
                yield Simplification(f"{what} ({name})", Aspect.EFFECT, Edit({(*key, "conduction", branch): None},
                                                                  ((*key, "conduction", f"{branch}_factor"),)))
        if pair.get("radiation") is not None:
            yield Simplification(f"near radiation ({name})", Aspect.EFFECT, Edit(drop=((*key, "radiation"),)))
        if at(pair, ("friction", "mu")):
            yield Simplification(f"friction ({name})", Aspect.EFFECT, Edit(drop=((*key, "friction"),)),
                                 needs_deformation=True)


def materials(tree: Tree) -> Iterator[Simplification]:
    """Yield what materials do: latent heat, flow and its heat, expansion, shrinkage."""
    used = {body["material"] for body in tree["bodies"].values()}
    for name in (n for n in tree["materials"] if n in used):
        material, key = tree["materials"][name], ("materials", name)
        if material.get("latent") is not None:
            yield Simplification(f"latent heat of {name}", Aspect.EFFECT, _no_latent(tree, name))
        for made, (key_of_heat, what) in HEATS.items():
            if _computed(tree) and (flows := material.get(made)) is not None and flows.get(key_of_heat, 1.0) > 0.0:
                yield Simplification(f"{what} of {name}", Aspect.EFFECT, Edit({(*key, made, key_of_heat): 0}),
                                     needs_deformation=True)
        for flow, what in (("plastic", "plasticity"), ("creep", "creep")):
            if _computed(tree) and material.get(flow) is not None:
                yield Simplification(f"{what} of {name}", Aspect.EFFECT, Edit(drop=((*key, flow),)),
                                     needs_deformation=True, misses="permanent strain")
        yield from _grows(name, material)


def _grows(name: str, material: Tree) -> Iterator[Simplification]:
    if expands(material.get("alpha")):
        yield Simplification(f"thermal expansion of {name}", Aspect.EFFECT, Edit({("materials", name, "alpha"): 0}),
                             needs_deformation=True)
    if at(material, ("liquid", "shrinkage")):
        edit = Edit({("materials", name, "liquid", "shrinkage"): 0})
        yield Simplification(f"shrinkage of {name}", Aspect.EFFECT, edit, needs_deformation=True)


def expands(alpha: Any) -> bool:
    """Return whether an expansion is other than zero."""
    return bool(alpha) and alpha != 0.0


def _computed(tree: Tree) -> bool:
    """Return whether the mechanical half computes deformation."""
    return bool(at(tree, ("mechanical", "half")) == "elastic")


def _no_latent(tree: Tree, name: str) -> Edit:
    """Drop a material's latent heat: only its solid remains, and no probe of f_s where nothing melts."""
    material, key = tree["materials"][name], ("materials", name)
    solid: dict[Key, Any] = {(*key, k): material[k]["solid"] for k in ("k", "c")
                             if isinstance(material.get(k), dict) and "solid" in material[k]}
    others = any(m.get("latent") for n, m in tree["materials"].items() if n != name)
    gone = () if others else tuple(("probes", n) for n, probe in tree.get("probes", {}).items() if "f_s" in probe)
    return Edit(solid, ((*key, "latent"), *gone))


def forces(tree: Tree) -> Iterator[Simplification]:
    """Yield what the elastic half may do without: gravity, thermoelastic heat, inertia."""
    key, own = ("mechanical", "elastic"), at(tree, ("mechanical", "elastic"))
    if not _computed(tree) or own is None:
        return
    if own.get("gravity") is not None:
        yield Simplification("gravity", Aspect.EFFECT, Edit(drop=((*key, "gravity"),)), needs_deformation=True)
    if own.get("thermoelastic_heat"):
        yield Simplification("thermoelastic heat", Aspect.EFFECT, Edit({(*key, "thermoelastic_heat"): False}),
                             needs_deformation=True)
    if has_inertia(own):
        speeds = tuple((*key, "bodies", body, speed) for body in own.get("bodies", {}) for speed in ("v0", "omega0"))
        method: dict[Key, Any] = {(*key, "method"): "newton"} if own.get("method") == "explicit" else {}
        yield Simplification("inertia", Aspect.EFFECT, Edit(method, ((*key, "dynamics"), *speeds)),
                             needs_deformation=True, misses="waves and vibration")


def windows(tree: Tree) -> Iterator[Simplification]:
    """Yield longer windows."""
    if at(tree, ("coupling", "windows")) is not None:
        for factor in LONGER_WINDOWS:
            yield Simplification(f"windows {factor:g} times as long", Aspect.WINDOWS, windows=factor)


# Trials: few cells, few windows, probes of what a simpler model would miss.

# A body of a trial has no more cells than this; shapes and layers stay as they are.
CELLS = 64
# Windows are made longer while there are more than this, but never by more than cells are: what bounds a window, heat
# crossing a cell or an edge passing it, grows with the cell.
WINDOWS = 400
OWN = "advise."  # probes that the advice adds begin so


def mesh_factor(tree: Tree, cells: int = CELLS) -> float:
    """Return the factor on cells along an edge with which no body has more cells; 1 where none can be coarsened."""
    factor = 1.0
    for body in tree["bodies"].values():
        if (n := at(body, ("mesh", "rectangle", "cells"))) is not None:
            power = 1.0 if min(n) == 1 else 0.5
            factor = min(factor, (cells / (n[0] * n[1])) ** power)
    return factor


def meshed(tree: Tree, factor: float) -> Edit:
    """Change the cells along every edge by a factor.  Even counts stay even, so that midpoints stay nodes."""
    return Edit(cells_as(tree, lambda n: _count(n, factor)) if factor != 1.0 else {})


def _count(n: int, factor: float) -> int:
    # fault: advice: even counts of cells turn odd -> step = 1 | coupler/test_advise
    step = 2 if n % 2 == 0 else 1
    return n if n <= 2 else max(round(n * factor / step) * step, 2)


def cells_of(tree: Tree) -> int:
    """Count the cells of all rectangles."""
    cells = (at(body, ("mesh", "rectangle", "cells")) for body in tree["bodies"].values())
    return sum(int(n[0]) * int(n[1]) for n in cells if n is not None)


def windows_factor(count: int, mesh: float) -> float:
    """Return the factor on windows for a scenario of `count` windows, meshed by `mesh`: a power of 2."""
    longer = 2.0 ** math.ceil(math.log2(max(count / WINDOWS, 1.0)))
    return min(longer, 2.0 ** math.floor(math.log2(1.0 / mesh)))


def timed(tree: Tree, factor: float) -> Edit:
    """Make fixed windows `factor` times as long, none longer than its range; adaptive ones stay."""
    return Edit(windows_times(tree, factor) if factor != 1.0 else {})


def contact_probes(tree: Tree) -> Edit:
    """Add probes of pressure and displacement at every pair."""
    put: dict[Key, Any] = {}
    for name, pair in tree.get("contact", {}).items():
        side = pair["slave"]
        for what, probe in (("p.max", {"p": {"max": side}}), ("p.mean", {"p": {"mean": side}}),
                            ("u_x", {"u_x": {"mean": side}}), ("u_y", {"u_y": {"mean": side}})):
            put["probes", f"{OWN}{name}.{what}"] = probe
    return Edit(put)
