"""Checks whether a half computes what Slideline's own half computes of the same scene, from the same inputs.

Every wrong law shows here that matters in the scene: a property, a load, a law of contact, the geometry.  Both halves
take the same substeps, each longer than the one before, as the scene begins and with all changed that comes from
outside.  Each takes them once more in two halves, which says how well its substeps resolve them.  Both answers may
differ by that, by what so coarse a mesh leaves open as the own half estimates it, and by a share for other elements.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.start import start_coordinates
from coupler.errors import HalfError
from coupler.fmu.half import Array, Half, Status
from coupler.verify.bench import END, Bench
from coupler.verify.border import Finding, failed, not_applicable, passed
from coupler.verify.matter import KnownScene

SHARE = 0.04  # of what a body changes: other elements and other quadrature
FACTOR = 2.0  # of what halves of the substeps change: of a first order that is the error
ROUGH = 0.75  # of what varies from node to node: there other elements have other answers
MISSED = 2.0  # of the share of strain energy that a mesh misses
OF_HEAT = 0.1  # of the heat of a mechanism: it follows the temperatures of surfaces, and may enter here and leave there
FAINT, FAINT_HEAT = 0.01, 0.05  # of the largest change of all bodies, of all mechanisms: less is held against that
SUBSTEPS = {"T": (9, 2.0), "x": (4, 4.0)}  # how many, and how much longer each is than the one before
WARMED = 30.0  # K by which cells are heated, or bodies are warmer, in the second course
STRETCHED = 1.25  # x in the second course; y by as much less as leaves volumes
PRESSED = 1e7  # Pa
LOADED = 0.8  # of every named load
SECOND_ORDER = 2  # control.method of the own thermal half: sdirk2, which rings at no length of a substep
LEAST_K = 1e-3  # K: who changes less says nothing
LEAST_STRAIN = 1e-7  # of the span of the mesh, and of the stiffness, as LEAST_K
HEAT = "heat"  # by mechanism since the start

Given = Callable[[float], Mapping[str, Array]]  # share of the whole course that a substep is -> its inputs


def agrees(bench: Bench, check: str) -> Finding:
    """Check that the half says what Slideline's own half says, within what substeps and mesh allow."""
    assert bench.reference is not None, "needs.REFERENCE"
    main, growth = _main(bench), SUBSTEPS[_main(bench)][1]
    looked = False
    for name, given in _courses(bench, main):
        try:
            terms = _terms(bench)
            own = [_taken(bench, bench.reference, given, terms, parts) for parts in (1, 2)]
        except HalfError as exc:
            return not_applicable(check, f"Slideline's own half fails in this scene: {str(exc).splitlines()[0]}")
        its = [_taken(bench, bench.make, given, terms, parts) for parts in (1, 2)]
        found = _worst(_quantities(bench, main, terms, own, its), bench.h, growth, own, its)
        looked = looked or found is not None
        # fault: verify-half: a half that computes another scene passes -> if False: | coupler/test_agreement
        if found is not None and found.off > found.allowed:
            return failed(check, f"{name}, after {found.t:.4g} s, {found.what} differs by {found.off:.3g} {found.unit} "
                          "from that of Slideline's own half; their substeps and elements allow "
                          f"{found.allowed:.3g} {found.unit}", "A property, a load, a law of contact or the geometry "
                          "is not that of the scenario; slideline run --no-verify --swap ... --compare shows where "
                          "and from when on both differ")
    return passed(check) if looked else not_applicable(
        check, "next to nothing changes in the substeps that both halves take")


def _main(bench: Bench) -> str:
    return "T" if "T" in bench.blocks and bench.blocks["T"].causality == "output" else "x"


def _terms(bench: Bench) -> tuple[str, ...]:
    """Heat by mechanism, as far as both halves state a heat balance.

    Through prescribed temperatures as much flows at first as the elements at them hold.
    """
    assert bench.reference is not None, "needs.REFERENCE"
    half = bench.reference()
    try:
        names = [n for n in half.blocks if n.startswith("heat.") and not n.startswith(("heat.stored.", "heat.temp"))]
    finally:
        half.close()
    return tuple(names) if any(n.startswith("heat.stored.") for n in bench.blocks) else ()


# What both halves are given.

def _courses(bench: Bench, main: str) -> Iterator[tuple[str, Given]]:
    """The scene as it begins, and with all changed that comes from outside."""
    yield "as the scene begins", lambda share: {"T": _at_start(bench)} if main == "x" else {}
    changed = _heated(bench) if main == "T" else _warmer(bench)
    loads = {n: LOADED * v for n, v in bench.starts.items() if n.startswith("load.")}
    yield ("stretched, pressed and heated" if main == "T" else "warmer from one end to the other"), lambda share: {
        **loads, **changed(share)}


def _heated(bench: Bench) -> Given:
    X, starts, scene = bench.starts["x"], bench.starts, bench.scene
    assert isinstance(scene, KnownScene), "needs.MATTER"
    # The whole turn has the volume r^2 z, a metre of depth x y.
    stretch = np.array([STRETCHED, STRETCHED ** (-2 if scene.interface.axisymmetric else -1)])
    heat = np.nan_to_num(scene.rho_c * scene.volumes) * (1.0 + 0.5 * np.cos(np.arange(len(scene.volumes)))) * WARMED
    more: dict[str, Array] = {"x": X * stretch}
    if "contact.t_N" in starts:
        more["contact.t_N"] = np.full(starts["contact.t_N"].shape, -PRESSED)
    energies = {"E_M": heat} if "E_M" in starts and starts["E_M"].shape == heat.shape else {}
    if "contact.E_friction" in starts and starts["contact.E_friction"].size:
        n = starts["contact.E_friction"].size
        energies["contact.E_friction"] = np.full(n, 0.1 * float(heat.sum()) / n)
    return lambda share: {**more, **{name: share * whole for name, whole in energies.items()}}


def _at_start(bench: Bench) -> Array:
    """The temperatures [K] that bodies start at; where they are not known those the half takes itself."""
    assert bench.scene is not None, "needs.SCENE"
    low = bench.scene.T_low
    return np.where(np.isfinite(low), low, bench.starts["T"])


def _warmer(bench: Bench) -> Given:
    X, T = bench.scene.interface.nodes if bench.scene is not None else np.zeros((0, 2)), _at_start(bench)
    along = (X - X.min(axis=0)) / np.maximum(np.ptp(X, axis=0), 1e-300)
    return lambda share: {"T": T + WARMED * (1.0 + along[:, 0] - 0.5 * along[:, 1])}


# What both halves say.

@dataclass(frozen=True)
class _Said:
    """What a half said.  first : at the start.  then : at the end of each substep, until one was rejected."""

    first: Mapping[str, Array]
    then: list[Mapping[str, Array]]


def _taken(bench: Bench, make: Callable[[], Half], given: Given, terms: tuple[str, ...], parts: int) -> _Said:
    """Take the course, each substep in so many parts."""
    main = _main(bench)
    n, growth = SUBSTEPS[main]
    then: list[Mapping[str, Array]] = []
    half, t, heat = make(), 0.0, np.zeros(len(terms))
    try:
        blocks = half.blocks
        names = [name for name, b in blocks.items() if b.causality == "output" and (
            name in (main, "contact.t_N", *terms) or name.startswith(("mesh.missed.", "mesh.energy.", "mesh.uneven.")))]
        starts = {name: v for name, v in bench.starts.items() if name in blocks and blocks[name].shape == v.shape}
        if "control.method" in blocks and make is bench.reference and main == "T":
            starts["control.method"] = np.array(SECOND_ORDER)
        first = half.initialise(0.0, END, {}, starts, names)
        for k in range(n):
            h = bench.h * growth**k / parts
            share = (growth - 1.0) * growth**k / (growth**n - 1.0) / parts
            inputs = {name: v for name, v in {**starts, **given(share)}.items() if name in blocks}
            for _ in range(parts):
                done = half.advance(t, h, inputs, names)
                if done.status is not Status.OK:
                    return _Said(first, then)
                t += h
                # A mechanism that a half does not name is one that it does not have.
                heat = heat + [float(np.sum(done.outputs.get(name, 0.0))) for name in terms]
            then.append({**done.outputs, HEAT: heat})
        return _Said(first, then)
    finally:
        half.close()


@dataclass(frozen=True)
class _Off:
    """A difference.  allowed : in its unit, too.  t : when [s]."""

    off: float
    allowed: float
    unit: str
    what: str
    t: float


@dataclass(frozen=True)
class _Quantity:
    """What is compared.  start : from where a change counts.  least : a smaller change says nothing.

    places : in words -> its rows.  size : of a difference at a place.  change : how far a place came from the start.
    smooth : an answer without what varies from node to node.  share, faint : as SHARE and FAINT.
    """

    name: str
    words: str
    unit: str
    start: Array
    least: float
    places: Mapping[str, NDArray[np.bool_]]
    size: Callable[[Array], float]
    change: Callable[[Array], float]
    smooth: Callable[[Array], Array] = lambda values: values
    share: float = SHARE
    faint: float = FAINT


def _worst(quantities: Iterable[_Quantity], h: float, growth: float, own: list[_Said],
           its: list[_Said]) -> _Off | None:
    """The difference that is most beyond what is allowed; None where nothing changes.

    h [s], growth : of the first substep, and from one to the next.
    """
    n = min(len(said.then) for said in (*own, *its))
    found: list[_Off] = []
    for quantity in quantities:
        moved = np.zeros(len(quantity.places))
        for k in range(n):
            (a, b), (c, d) = ([said.then[k][quantity.name] for said in both] for both in (own, its))
            moved = np.maximum(moved, [quantity.change((b - quantity.start)[at])
                                       for at in quantity.places.values()])
            scale = np.maximum(moved, quantity.faint * moved.max(initial=0.0))
            if moved.max(initial=0.0) <= quantity.least:
                continue
            share = quantity.share + MISSED * _missed(own[1].then[k])
            t = h * (growth ** (k + 1) - 1.0) / (growth - 1.0)
            for one, (place, at) in enumerate(quantity.places.items()):
                off, its_own, ours = (quantity.size(v[at]) for v in (d - b, d - c, b - a))
                rough = ROUGH * quantity.size((b - quantity.smooth(b))[at])
                found.append(_Off(off, FACTOR * (its_own + ours) + share * scale[one] + rough, quantity.unit,
                                  f"{quantity.words} of {place}", t))
    return max(found, key=lambda one: one.off / one.allowed, default=None)


def _quantities(bench: Bench, main: str, terms: tuple[str, ...], own: list[_Said],
                its: list[_Said]) -> Iterator[_Quantity]:
    scene = bench.scene
    assert isinstance(scene, KnownScene), "needs.MATTER"
    i = scene.interface
    bodies = {f"body {name!r}": i.node_body == b for b, name in enumerate(i.bodies)}
    if main == "T":
        yield _Quantity("T", "the temperature", "K", own[0].first["T"], LEAST_K, bodies, _rms, _largest,
                        _smoothing(scene))
        each = {f"{name!r}": np.arange(len(terms)) == k for k, name in enumerate(terms)}
        yield _Quantity(HEAT, "the heat", "J", np.zeros(len(terms)),
                        LEAST_K * float(np.nansum(scene.rho_c * scene.volumes)), each, _mean, _mean,
                        share=OF_HEAT, faint=FAINT_HEAT)
        return
    yield _Quantity("x", "the place", "m", start_coordinates(i), LEAST_STRAIN * scene.span, bodies, _rms, _largest)
    if all("contact.t_N" in said.first for said in (*own, *its)) and np.isfinite(scene.modulus).any():
        rows = np.arange(len(i.pair_nodes))
        sides = {f"surface {side.surface}, pair {side.pair}": np.isin(rows, rows[side.at]) for side in i.pair_sides}
        # Where single nodes press is another's choice: the pressure of a side as a whole is not.
        yield _Quantity("contact.t_N", "the pressure", "Pa", np.zeros(len(rows)),
                        LEAST_STRAIN * float(np.nanmin(scene.modulus)), sides, _mean, _mean)


def _smoothing(scene: KnownScene) -> Callable[[Array], Array]:
    """Return what averages a nodal field over the cells around each node."""
    node = np.concatenate([*(cell for cell in scene.cells)])
    cell = np.repeat(np.arange(len(scene.cells)), [len(one) for one in scene.cells])
    corners, around = np.bincount(cell), np.maximum(np.bincount(node, minlength=len(scene.interface.nodes)), 1)

    def smooth(T: Array) -> Array:
        mean = np.bincount(cell, weights=T[node]) / corners
        return np.asarray(np.bincount(node, weights=mean[cell], minlength=len(T)) / around)

    return smooth


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(values.reshape(len(values), -1) ** 2, axis=1)))) if len(values) else 0.0


def _mean(values: Array) -> float:
    return abs(float(np.mean(values))) if len(values) else 0.0


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))


def _missed(said: Mapping[str, Array]) -> float:
    """The share of strain energy that the mesh misses, the largest of all bodies; 0 where the half does not say it."""
    shares = [0.0]
    for name, energy in said.items():
        if name.startswith("mesh.energy.") and energy > 0.0:
            missed, uneven = (float(said.get(name.replace("energy", what, 1), np.array(0.0)))
                              for what in ("missed", "uneven"))
            shares.append(min(missed / (float(energy) + uneven), 1.0))
    return max(shares)
