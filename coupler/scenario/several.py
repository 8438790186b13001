"""Several halves in one role: which bodies each solves for, and what it is told of its share of the scene.

A half has its bodies whole and, of bodies that it meets in a pair but another half solves for, the layer of cells
at the surface that it meets.  So it has both surfaces of every pair it is in, asks contact for them as ever, and
no more of the rest of the scene than that.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half import checks
from contact.half.interface import Interface
from contact.half.start import START_T
from contact.problem.errors import Wrong, read
from contact.problem.thermal import ForeignThermal, ThermalProblem
from contact.problem.values import did_you_mean
from coupler.scenario.kinds import OWN, REPLAY, entry_of
from coupler.scenario.schema import Across, Thermal

Indices = NDArray[np.intp]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Member:
    """One of several halves in a role.

    name : ROLE.NAME.  bodies : that it solves for.  interface : its share of the scene, in the order of the scene.
    model : its model.json.  nodes, cells : number in the scene of each of its own, ascending within quads and
    triangles.
    """

    name: str
    bodies: tuple[str, ...]
    interface: Interface
    model: Mapping[str, Any]
    nodes: Indices
    cells: Indices

    @property
    def kind(self) -> str:
        """The kind of the half, an entry point's name."""
        return str(self.model["half"])

    @cached_property
    def solved(self) -> NDArray[np.bool_]:
        """(n,) whether it solves for a node of its interface."""
        return ~np.isin(self.interface.node_body, self._elsewhere)

    @cached_property
    def solved_cells(self) -> NDArray[np.bool_]:
        """(n_cells,) whether it solves for a cell of its interface."""
        return ~np.isin(np.concatenate([self.interface.quad_body, self.interface.triangle_body]), self._elsewhere)

    @property
    def _elsewhere(self) -> list[int]:
        bodies = self.interface.bodies
        return [i for i, body in enumerate(bodies) if body not in self.bodies]


@dataclass(frozen=True)
class Several:
    """The halves of a role, and how they go to agreement."""

    members: tuple[Member, ...]
    across: Across


def several_wrongs(thermal: Thermal, interface: Interface, problem: ThermalProblem) -> Iterator[Wrong]:
    """Tell what is wrong with thermal.halves, keys from `thermal` on."""
    owner: dict[str, str] = {}
    if not thermal.halves:
        return
    for name, one in thermal.halves.items():
        at = ("thermal", "halves", name)
        for i, body in enumerate(one.bodies):
            if body not in interface.bodies:
                yield Wrong((*at, "bodies", i), f"there is no body {body!r}", did_you_mean(body, interface.bodies))
            # fault: two halves may solve for one body -> elif owner.setdefault(body, name) and False: |
            #   coupler/test_several_stated
            elif owner.setdefault(body, name) != name or body in one.bodies[:i]:
                yield Wrong((*at, "bodies", i), f"body {body!r} is solved for by {owner[body]} already",
                            "Keep it in one of the two.")
        word = one.half or thermal.half
        if word == REPLAY or word.endswith(".fmu"):
            yield Wrong((*at, "half") if one.half else ("thermal", "half"),
                        f"{word} plays, or was built for, all of a scene, and cannot be one of several halves",
                        "Leave thermal.halves out, or name a kind of half.")
        elif word in ("lumped", "rod"):
            own = problem.model_copy(update={"bodies": {n: b for n, b in problem.bodies.items() if n in one.bodies}})
            yield from checks.station_wrongs(own, OWN["thermal"][word])
    # fault: a body may be in no half -> if missing := [body for body in interface.bodies if False]: |
    #   coupler/test_several_stated
    if missing := [body for body in interface.bodies if body not in owner]:
        yield Wrong(("thermal", "halves"), f"no half solves for {' and '.join(missing)}",
                    "Every body is in one of them.")
    for pair in interface.pairs:
        sides = [owner.get(side.split(".")[0]) for side in (pair.slave, pair.master)]
        names = [name for name in dict.fromkeys(sides) if name is not None]
        kinds = [thermal.halves[name].half or thermal.half for name in names]
        # fault: two kinds of half may meet in a pair -> if False: | coupler/test_several_stated
        if None not in sides and len(set(kinds)) > 1:
            yield Wrong(("contact", pair.name), f"heat crosses it from {names[0]} ({kinds[0]}) to {names[1]} "
                        f"({kinds[1]}): two kinds of half see other temperatures along one face",
                        "Give both the same kind.")
        # fault: inner steps of their own go with pairs across halves -> if False: | coupler/test_several_stated
        if None not in sides and len(names) > 1 and thermal.adaptive is not None:
            yield Wrong(("thermal", "adaptive"), f"{names[0]} and {names[1]} exchange heat across pair {pair.name!r}: "
                        "each would choose inner steps of its own",
                        "Leave adaptive out, or take more thermal substeps (coupling.substeps.thermal).")


def several_of(thermal: Thermal, interface: Interface, model: Mapping[str, Any]) -> Several | None:
    """Divide a checked scene among the thermal halves; None where there is one.  model : that of one half of all."""
    if not thermal.halves:
        return None
    members = []
    for i, (name, one) in enumerate(thermal.halves.items()):
        kind = str(model["half"]) if one.half is None else entry_of("thermal", one.half)
        share, nodes, cells = share_of(interface, one.bodies, with_loose=i == 0)
        members.append(Member(f"thermal.{name}", one.bodies, share, _model(model, kind, share, one.bodies), nodes,
                              cells))
    return Several(tuple(members), thermal.across)


def share_of(interface: Interface, bodies: Sequence[str], with_loose: bool = False) -> tuple[Interface, Indices,
                                                                                            Indices]:
    """Return the share of a half that solves for `bodies`, and the numbers in the scene of its nodes and of its cells.

    with_loose : with the nodes that no cell uses.
    """
    pairs = tuple(p for p in interface.pairs if _body(p.slave) in bodies or _body(p.master) in bodies)
    met = {side for p in pairs for side in (p.slave, p.master) if _body(side) not in bodies}
    shown = [b for b in interface.bodies if b in bodies or b in {_body(side) for side in met}]
    own = np.array([interface.bodies.index(b) for b in bodies])
    surface = np.concatenate([np.empty(0, np.int32), *(interface.surfaces[side].ravel() for side in sorted(met))])
    # All at a node of it: what contact may conduct at most follows from them (thermal_fmu/scene.py).
    quads, triangles = (np.flatnonzero(np.isin(body, own) | np.isin(cells, surface).any(axis=1))
                        for cells, body in ((interface.quads, interface.quad_body),
                                            (interface.triangles, interface.triangle_body)))
    loose = np.flatnonzero(interface.node_body < 0) if with_loose else np.empty(0, np.intp)
    nodes = np.unique(np.concatenate([interface.quads[quads].ravel(), interface.triangles[triangles].ravel(), loose])
                      ).astype(np.intp)
    new = np.full(len(interface.nodes), -1, dtype=np.int32)
    new[nodes] = np.arange(nodes.size)
    body = np.array([shown.index(b) if b in shown else -1 for b in interface.bodies], dtype=np.int32)
    regions = [r for r in interface.regions if _body(r) in shown]
    region = np.array([*(regions.index(r) if r in regions else -1 for r in interface.regions), -1], dtype=np.int32)
    surfaces = {n: new[e] for n, e in interface.surfaces.items() if _body(n) in bodies or n in met}
    start = {n: v[nodes] for n, v in interface.start.items() if n == START_T}
    start |= {n: v for n, v in interface.start.items() if n.partition(".")[2] in bodies}
    share = replace(
        interface, nodes=interface.nodes[nodes], quads=new[interface.quads[quads]],
        triangles=new[interface.triangles[triangles]], quad_body=body[interface.quad_body[quads]],
        triangle_body=body[interface.triangle_body[triangles]], bodies=tuple(shown),
        materials=tuple(m for m, part in zip(interface.materials, interface.parts, strict=True)
                        if _body(part) in shown),
        surfaces=surfaces, node_sets={n: new[s] for n, s in interface.node_sets.items() if _body(n) in bodies},
        pairs=pairs, regions=tuple(regions),
        quad_region=None if interface.quad_region is None else region[interface.quad_region[quads]],
        triangle_region=None if interface.triangle_region is None else region[interface.triangle_region[triangles]],
        start=start, stiffness={n: k for n, k in interface.stiffness.items() if n in surfaces},
        offset={p.name: interface.offset[p.name] for p in pairs if p.name in interface.offset})
    return share, nodes, np.concatenate([quads, triangles + len(interface.quads)])


def _body(name: str) -> str:
    return name.partition(".")[0]


def _model(model: Mapping[str, Any], kind: str, share: Interface, bodies: Sequence[str]) -> dict[str, Any]:
    """The model.json of a half that solves for `bodies`: nothing drives what is elsewhere but the half that has it."""
    def driven(name: str, body: Mapping[str, Any]) -> dict[str, Any]:
        if name in bodies:
            return dict(body)
        still = {key: value for key, value in body.items() if key not in ("Q_T", "Q_T_factor")}
        if "regions" in still:
            still["regions"] = {n: driven("", one) for n, one in still["regions"].items()}
        return still

    elsewhere = [b for b in share.bodies if b not in bodies]
    used = {*share.materials}
    told = dict(model) | {
        "half": kind,
        "materials": {n: m for n, m in model["materials"].items() if n in used},
        "bodies": {n: driven(n, model["bodies"][n]) for n in share.bodies},
        "boundary": [b for b in model.get("boundary", ())
                     if _body(next(b[key] for key in ("on", "at", "body") if b.get(key) is not None)) in bodies],
        "pairs": {p.name: model["pairs"][p.name] for p in share.pairs if p.name in model.get("pairs", {})},
    } | ({"elsewhere": elsewhere} if elsewhere else {})
    return read(ForeignThermal if "options" in model else ThermalProblem, told, kind).plain()
