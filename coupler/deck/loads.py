"""Reads loads on faces and volumes: *DFLUX, *FILM, *RADIATE, *DLOAD and their forms on surfaces."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from coupler.deck.bodies import DeckBody
from coupler.deck.conditions import Tree, times
from coupler.deck.keywords import Log
from coupler.deck.lexer import NUMBER, DeckLine, KeywordBlock, number
from coupler.deck.mesh import DeckMesh
from coupler.deck.steps import Amplitude, DeckStep, LoadHistory, Signal, after, amplitude_at
from coupler.deck.surfaces import DeckSurfaces, Edge


@dataclass(frozen=True)
class _LoadForm:
    """letter : before the number of its face.  on_surface : it names surfaces, not elements."""

    kind: str
    letter: str
    on_surface: bool


FORMS = {"DFLUX": _LoadForm("flux", "S", False), "DSFLUX": _LoadForm("flux", "S", True),
         "FILM": _LoadForm("film", "F", False), "SFILM": _LoadForm("film", "F", True),
         "RADIATE": _LoadForm("radiation", "R", False), "SRADIATE": _LoadForm("radiation", "R", True),
         "DLOAD": _LoadForm("pressure", "P", False), "DSLOAD": _LoadForm("pressure", "P", True)}
VOLUME = {"DFLUX": ("BF",), "DLOAD": ("GRAV", "BX", "BY")}
Key = tuple[str, str, str]  # keyword, place and label in capitals


@dataclass(frozen=True)
class Load:
    """One load with its history.

    kind : flux, film, radiation, pressure, BF, BX, BY, GRAV.  size : flux, h, emissivity, pressure ...
    T : of the surroundings.  surface : of the deck; where it is empty, edges.  cells : of loads on volumes.
    direction : of gravity.  label : of the surface that is made for it.
    """

    kind: str
    size: LoadHistory
    T: LoadHistory | None
    surface: str
    edges: tuple[Edge, ...]
    cells: tuple[int, ...]
    direction: tuple[float, float]
    label: str
    row: DeckLine


@dataclass
class BoundaryEntries:
    """The loads as the scenario has them.

    thermal, mechanical : entries of boundary lists.  Q_T : body -> heat source.  gravity : x, y, of all bodies.
    """

    thermal: list[Tree] = field(default_factory=list)
    mechanical: list[Tree] = field(default_factory=list)
    Q_T: dict[str, Signal] = field(default_factory=dict)
    gravity: tuple[Signal, Signal] | None = None


def loads_of(steps: Sequence[DeckStep], model: Sequence[KeywordBlock], surfaces: DeckSurfaces,
             amplitudes: Mapping[str, Amplitude], log: Log) -> list[Load]:
    """Read every load with its history over all steps.

    Raises ScenarioError for unknown surfaces, sets, faces and amplitudes.
    """
    reader = _LoadReader(surfaces, amplitudes, log)
    loads: dict[Key, Load] = {}
    for block in model:
        if block.word in FORMS:
            log.miss(block, "a load stands in a step")
    for step in steps:
        fresh: set[Key] = set()
        for block in (b for b in step.blocks if b.word in FORMS):
            for row in block.data:
                key: Key = (block.word, row.field(0).upper(), row.field(1).upper())
                load = reader.read(block, row, step, loads.get(key))
                if load is not None:
                    loads[key] = load
                    fresh.add(key)
        renewed = {b.word: b for b in step.blocks if b.word in FORMS and b.option("OP") == "NEW"}
        for key in [k for k in loads if k[0] in renewed and k not in fresh]:
            if loads[key].kind == "radiation":
                log.miss(renewed[key[0]], "OP=NEW: radiation that is not given again stays")
            else:
                loads[key] = replace(loads[key], size=after(loads[key].size, step, 0.0, None, 0.0))
    return list(loads.values())


@dataclass(frozen=True)
class _LoadReader:
    surfaces: DeckSurfaces
    amplitudes: Mapping[str, Amplitude]
    log: Log

    def read(self, block: KeywordBlock, row: DeckLine, step: DeckStep, before: Load | None) -> Load | None:
        """Read one line of a load; None where it is not understood.  before : the load in the steps before."""
        surfaces, log = self.surfaces, self.log
        form = FORMS[block.word]
        kind, letter, on_surface = form.kind, form.letter, form.on_surface
        label = row.field(1).upper()
        amplitude = amplitude_at(block, "AMPLITUDE", self.amplitudes)
        place = f"{row.field(0)}_{label}"
        if label in VOLUME.get(block.word, ()):
            mesh: DeckMesh = surfaces.mesh
            cells = mesh.cells_at(row.field(0), row) if row.field(0) else tuple(range(len(mesh.cells)))
            x, y, z = (number(row, i, "the direction", 0.0) if label == "GRAV" else 0.0 for i in (3, 4, 5))
            if z:
                log.miss(row, "gravity out of the plane is left out")
            size = after(before.size if before else None, step, number(row, 2, "the load"), amplitude, 0.0)
            return Load(label, size, None, "", (), cells, (x, y), place, row)
        fits = label == letter if on_surface else re.fullmatch(f"{letter}[1-4]", label)
        film = kind in ("film", "radiation")
        text = row.field(3 if film else 2)
        if not fits or (film and not NUMBER.fullmatch(text)):
            log.miss(row, f"understood is {letter}{'' if on_surface else '1 to ' + letter + '4'} with numbers")
            return None
        name = surfaces.named(row.field(0), row) if on_surface else ""
        edges = surfaces.edges[name] if name else tuple(
            surfaces.face(surfaces.mesh.cells_at(row.field(0), row), label, row))
        if not edges:
            log.miss(row, "the place has no faces")
            return None
        if not film:
            size = after(before.size if before else None, step, number(row, 2, "the load"), amplitude, 0.0)
            return Load(kind, size, None, name, edges, (), (0.0, 0.0), place, row)
        at_once = replace(step, ramp=False)  # surroundings are there at once; only an amplitude changes them
        T_e = number(row, 2, "the temperature of the surroundings")
        T = after(before.T if before else None, at_once, T_e, amplitude, T_e)
        grown = amplitude_at(block, "FILM AMPLITUDE", self.amplitudes) if kind == "film" else None
        size = after(before.size if before else None, at_once, number(row, 3, "the coefficient"), grown, 0.0)
        if kind == "radiation" and len(set(v for _, v in size.points)) > 1:
            log.miss(row, "an emissivity is the same at all times; the last one holds")
        return Load(kind, size, T, name, edges, (), (0.0, 0.0), place, row)


def conditions_of(loads: Sequence[Load], bodies: Sequence[DeckBody], surfaces: DeckSurfaces, rho: Mapping[str, float],
                  log: Log) -> BoundaryEntries:
    """Build the entries of the scenario; faces with the same load become one surface.

    rho : body -> density, in the deck's unit.
    """
    out = BoundaryEntries()
    groups: dict[tuple[str, LoadHistory, LoadHistory | None, str], list[Load]] = {}
    for load in loads:
        if load.cells:
            _volume(load, bodies, rho, out, log)
        else:
            groups.setdefault((load.kind, load.size, load.T, load.surface), []).append(load)
    for (kind, size, T, surface), same in groups.items():
        edges = {edge for load in same for edge in load.edges}
        name = surface or surfaces.made(same[0].label if len(same) == 1 else f"{kind}_faces", edges)
        for place in surfaces.on(name, bodies):
            entry = _entry(kind, size, T)
            (out.mechanical if kind == "pressure" else out.thermal).append({"on": place, **entry})
    return out


def _entry(kind: str, size: LoadHistory, T: LoadHistory | None) -> Tree:
    if T is None:
        return {kind: size.signal}
    if kind == "film":
        return {"convection": {"h": size.signal, "T": T.signal}}
    return {"radiation": {"emissivity": size.last, "T": T.signal}}


def _volume(load: Load, bodies: Sequence[DeckBody], rho: Mapping[str, float], out: BoundaryEntries, log: Log) -> None:
    """Add sources, body forces and gravity, which act on whole bodies."""
    cells = set(load.cells)
    whole = [body for body in bodies if cells.issuperset(body.cells)]
    if sum(len(body.cells) for body in whole) < len(cells):
        log.miss(load.row, "a load on a volume acts on whole bodies; on parts of one it is left out")
    size = load.size.signal
    if load.kind == "GRAV" and len(whole) == len(bodies) and out.gravity is None:
        out.gravity = (times(size, load.direction[0]), times(size, load.direction[1]))
        return
    for body in whole:
        if load.kind == "BF":
            if body.name in out.Q_T:
                log.miss(load.row, f"body {body.name} has a source already")
            out.Q_T.setdefault(body.name, size)
        elif load.kind == "GRAV":
            if body.name not in rho:
                log.miss(load.row, f"body {body.name} has no *DENSITY")
                continue
            for key, part in zip(("b_x", "b_y"), load.direction, strict=True):
                if part:
                    out.mechanical.append({"body": body.name, key: times(size, part * rho[body.name])})
        else:
            out.mechanical.append({"body": body.name, f"b_{load.kind[1].lower()}": size})
