"""The ladder: which simpler variants a scenario has, as edits; only those that change something."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from coupler.advise.bodies import mechanics
from coupler.advise.edit import Edit, Tree, at
from coupler.advise.rung import Kind, Rung
from coupler.scenario.document import Key

# Schemes that solve each half once a window: the lower end of the ladder.
ONCE = ("staggered", "extrapolated")
DEAR = ("iterated", "auto", "adiabatic")
LONGER = (2.0, 4.0)
HEATS = {"plastic": ("chi", "plastic heat"), "creep": ("heat", "heat of creep"),
         "liquid": ("heat", "viscous heat of the melt")}
PATHS = {"convection": "convection", "radiation": "far radiation", "flux": "the heat flux"}


def ladder(tree: Tree) -> tuple[Rung, ...]:
    """Every rung of a scenario, coarse ones first.  tree : its values with overrides applied."""
    return (*mechanics(tree), *heat(tree), *schemes(tree), *paths(tree), *pairs(tree), *materials(tree), *forces(tree),
            *windows(tree))


def iterated(tree: Tree) -> Edit:
    """The top of the ladder: both halves agree in every window."""
    return Edit({("coupling", "scheme"): "iterated"})


def schemes(tree: Tree) -> Iterator[Rung]:
    """Exchanges once a window."""
    own = at(tree, ("coupling", "scheme")) or "staggered"
    for scheme in ONCE if own in DEAR else ONCE[:1]:
        if scheme != own:
            yield Rung(f"scheme {scheme}", Kind.SCHEME, Edit({("coupling", "scheme"): scheme}))


def heat(tree: Tree) -> Iterator[Rung]:
    """Smaller thermal halves."""
    half = at(tree, ("thermal", "half")) or "thermal"
    small = (("thermal", "adaptive"),)
    if half == "thermal" and _in_a_row(tree):
        yield Rung("heat along x only", Kind.HEAT, Edit({("thermal", "half"): "rod"}, small),
                   misses="differences of temperature across x")
    if half in ("thermal", "rod"):
        yield Rung("one temperature a body", Kind.HEAT, Edit({("thermal", "half"): "lumped"}, small),
                   misses="differences of temperature within a body")


def _in_a_row(tree: Tree) -> bool:
    """Whether every body is a rectangle and all that meet meet at their left and right ends."""
    sides = {str(pair.get(side, "")).rpartition(".")[2] for pair in tree.get("contact", {}).values()
             for side in ("slave", "master")}
    return bool(sides) and sides <= {"left", "right"} and all(
        at(body, ("mesh", "rectangle")) is not None for body in tree["bodies"].values())


def paths(tree: Tree) -> Iterator[Rung]:
    """Heat paths to the surroundings, and sources; prescribed temperatures are the scene itself."""
    for i, entry in enumerate(at(tree, ("thermal", "boundary")) or ()):
        for kind, words in PATHS.items():
            if entry.get(kind) is not None:
                yield Rung(f"{words} on {entry.get('on', 'its place')}", Kind.EFFECT,
                           Edit(drop=(("thermal", "boundary", i),)))
    for name, body in tree["bodies"].items():
        if body.get("Q_T"):
            yield Rung(f"the heat source in {name}", Kind.EFFECT,
                       Edit(drop=(("bodies", name, "Q_T"), ("bodies", name, "Q_T_factor"))))


def pairs(tree: Tree) -> Iterator[Rung]:
    """What happens between two sides."""
    for name, pair in tree.get("contact", {}).items():
        key = ("contact", name)
        for branch, words in (("open", "conduction across the gap"), ("closed", "conduction where they touch")):
            if at(pair, ("conduction", branch)) is not None:
                yield Rung(f"{words} ({name})", Kind.EFFECT, Edit({(*key, "conduction", branch): None},
                                                                  ((*key, "conduction", f"{branch}_factor"),)))
        if pair.get("radiation") is not None:
            yield Rung(f"near radiation ({name})", Kind.EFFECT, Edit(drop=((*key, "radiation"),)))
        if at(pair, ("friction", "mu")):
            yield Rung(f"friction ({name})", Kind.EFFECT, Edit(drop=((*key, "friction"),)), deforms=True)


def materials(tree: Tree) -> Iterator[Rung]:
    """What bodies are made of."""
    used = {body["material"] for body in tree["bodies"].values()}
    for name in (n for n in tree["materials"] if n in used):
        material, key = tree["materials"][name], ("materials", name)
        if material.get("latent") is not None:
            yield Rung(f"latent heat of {name}", Kind.EFFECT, _no_latent(tree, name))
        for made, (share, words) in HEATS.items():
            if _computed(tree) and (flows := material.get(made)) is not None and flows.get(share, 1.0) > 0.0:
                yield Rung(f"{words} of {name}", Kind.EFFECT, Edit({(*key, made, share): 0}), deforms=True)
        for flow, words in (("plastic", "plasticity"), ("creep", "creep")):
            if _computed(tree) and material.get(flow) is not None:
                yield Rung(f"{words} of {name}", Kind.EFFECT, Edit(drop=((*key, flow),)), deforms=True,
                           misses="strain that stays")
        yield from _grows(name, material)


def _grows(name: str, material: Tree) -> Iterator[Rung]:
    if moves(material.get("alpha")):
        yield Rung(f"thermal expansion of {name}", Kind.EFFECT, Edit({("materials", name, "alpha"): 0}), deforms=True)
    if at(material, ("liquid", "shrinkage")):
        yield Rung(f"shrinkage of {name}", Kind.EFFECT, Edit({("materials", name, "liquid", "shrinkage"): 0}),
                   deforms=True)


def moves(alpha: Any) -> bool:
    """Whether an expansion is other than zero."""
    return bool(alpha) and alpha != 0.0


def _computed(tree: Tree) -> bool:
    """Whether the mechanical half has materials that flow."""
    return bool(at(tree, ("mechanical", "half")) == "elastic")


def _no_latent(tree: Tree, name: str) -> Edit:
    """Phases need to know when it melts: without latent heat there is the solid only.  Where nothing melts any more
    there is no solid fraction to look at."""
    material, key = tree["materials"][name], ("materials", name)
    solid: dict[Key, Any] = {(*key, k): material[k]["solid"] for k in ("k", "c")
                             if isinstance(material.get(k), dict) and "solid" in material[k]}
    others = any(m.get("latent") for n, m in tree["materials"].items() if n != name)
    gone = () if others else tuple(("probes", n) for n, probe in tree.get("probes", {}).items() if "f_s" in probe)
    return Edit(solid, ((*key, "latent"), *gone))


def forces(tree: Tree) -> Iterator[Rung]:
    """What the elastic half may do without."""
    key, own = ("mechanical", "elastic"), at(tree, ("mechanical", "elastic"))
    if not _computed(tree) or own is None:
        return
    if own.get("gravity") is not None:
        yield Rung("gravity", Kind.EFFECT, Edit(drop=((*key, "gravity"),)), deforms=True)
    if own.get("thermoelastic_heat"):
        yield Rung("thermoelastic heat", Kind.EFFECT, Edit({(*key, "thermoelastic_heat"): False}), deforms=True)
    if own.get("dynamics") is not None or own.get("method") == "explicit":
        speeds = tuple((*key, "bodies", body, speed) for body in own.get("bodies", {}) for speed in ("v0", "omega0"))
        method: dict[Key, Any] = {(*key, "method"): "newton"} if own.get("method") == "explicit" else {}
        yield Rung("inertia", Kind.EFFECT, Edit(method, ((*key, "dynamics"), *speeds)), deforms=True,
                   misses="waves and swinging")


def windows(tree: Tree) -> Iterator[Rung]:
    """Fewer exchanges."""
    if at(tree, ("coupling", "windows")) is not None:
        for factor in LONGER:
            yield Rung(f"windows {factor:g} times as long", Kind.WINDOWS, windows=factor)
