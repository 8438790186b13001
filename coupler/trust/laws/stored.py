"""Heat stored as the thermal half states it, against that of its temperatures: the integral of rho c dT over the mesh.

Whatever law a half has inside, the enthalpy of a body follows from its temperatures, the scene's materials and its
mesh.  So every window shows a half that stores by another density, heat capacity or latent heat, at whatever
temperature, and one whose heat and temperatures are not those of one solution.  It says nothing of conduction.

A half may integrate at points of its cells in place of nodes.  What that leaves open is the difference between the sum
over nodes and that over the middles of cells; where properties do not change with temperature it is 0.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Property, property_from
from contact.half.interface import Interface
from contact.problem.values import covers
from coupler.scenario.probes import quad_shares, triangle_shares
from coupler.schemes.ledger import STORED
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, TrustVerdict, measured

Array = NDArray[np.float64]

LIMITS = (0.01, 0.05)  # of the heat that the body took up or gave off at most: noted, broken
FAINT = 1e-3  # of the span of temperatures: a body that changes less stores next to nothing
RESTS = 1.0  # K from a melting point: whether that has melted only a solid fraction says
OF_STORAGE = ("materials.rho", "materials.c", "materials.latent")
NAME = "heat stored is that of the temperatures"
GAUSS = tuple(zip(*(v.tolist() for v in np.polynomial.legendre.leggauss(5)), strict=True))  # on [-1, 1]


@dataclass(frozen=True)
class _Enthalpy:
    """Of a material.  solid, liquid : heat capacity [J/kgK].  latent : L [J/kg], solidus and liquidus [K]; or None."""

    rho: float
    solid: Property
    liquid: Property
    latent: tuple[float, float, float] | None

    @staticmethod
    def of(spec: Mapping[str, Any]) -> _Enthalpy | None:
        """Return that of a material of a model.json; None where it states no density or heat capacity."""
        rho, c, latent = spec.get("rho"), spec.get("c"), spec.get("latent")
        if rho is None or c is None:
            return None
        phased = isinstance(c, Mapping) and "solid" in c
        solid, liquid = (property_from(c[phase] if phased else c) for phase in ("solid", "liquid"))
        if latent is None:
            return _Enthalpy(float(rho), solid, liquid, None)
        T_m = latent.get("T_m")
        ends = (latent["T_s"], latent["T_l"]) if T_m is None else (T_m, T_m)
        return _Enthalpy(float(rho), solid, liquid, (float(latent["L"]), float(ends[0]), float(ends[1])))

    def increase(self, T0: Array, T: Array, melted: Array) -> Array:
        """Return the enthalpy [J/m3] from T0 to T [K].  melted : by how much the solid fraction fell [1]."""
        if self.latent is None:
            return self.rho * self.solid.increase(T0, T)
        L, T_s, T_l = self.latent
        # fault: latent heat is no part of what is stored -> dh = 0.0 * melted | coupler/test_trust_stored
        dh = L * melted
        dh = dh + self.solid.increase(np.minimum(T0, T_s), np.minimum(T, T_s))
        dh = dh + self.liquid.increase(np.maximum(T0, T_l), np.maximum(T, T_l))
        if T_l > T_s:
            a, b = np.clip(T0, T_s, T_l), np.clip(T, T_s, T_l)
            for place, weight in GAUSS:
                at = 0.5 * (a + b) + 0.5 * (b - a) * place
                phi = (at - T_s) / (T_l - T_s)
                dh = dh + 0.5 * (b - a) * weight * ((1.0 - phi) * self.solid(at) + phi * self.liquid(at))
        return self.rho * dh

    def solid_fraction(self, T: Array) -> Array:
        """Return what is solid [1] at T [K] at rest; at a melting point half."""
        if self.latent is None:
            return np.ones(T.shape)
        _, T_s, T_l = self.latent
        return np.clip((T_l - T) / (T_l - T_s), 0.0, 1.0) if T_l > T_s else 0.5 - 0.5 * np.sign(T - T_s)

    def open_at(self, T: Array) -> Array:
        """Return the heat [J/m3] that no temperature states: the latent heat of what rests at its melting point."""
        if self.latent is None or self.latent[2] > self.latent[1]:
            return np.zeros(T.shape)
        return np.where(np.abs(T - self.latent[1]) < RESTS, self.rho * self.latent[0], 0.0)


@dataclass(frozen=True)
class _Part:
    """A part of a body: its material, and where it is.

    nodes : (n,) of the mesh, share : (n,) [m3] of each.  cells : (m, 4) or (m, 3) rows of `nodes`, per kind of cell,
    volume : (m,) [m3] of each.
    """

    body: int
    material: _Enthalpy
    nodes: NDArray[np.intp]
    share: Array
    cells: tuple[tuple[NDArray[np.intp], Array], ...]


@dataclass(frozen=True)
class StoredLog:
    """What was stored since the start.  All arrays are per body.

    start : the first level.  told [J]: by the half.  low, high [J]: the least and the most of what it told and of what
    temperatures say.  off [J]: the largest difference beyond what the mesh leaves open, at t [s].  why_not : why there
    is nothing to compare.
    """

    start: Level | None = None
    told: Array = field(default_factory=lambda: np.empty(0))
    low: Array = field(default_factory=lambda: np.empty(0))
    high: Array = field(default_factory=lambda: np.empty(0))
    off: Array = field(default_factory=lambda: np.empty(0))
    t: Array = field(default_factory=lambda: np.empty(0))
    why_not: str = ""


class StoredHeat:
    """What the bodies of a scene hold.  model : of the thermal half (model.json), SI and kelvin."""

    def __init__(self, interface: Interface, model: Mapping[str, Any], own_mesh: bool = False,
                 ignored: Collection[str] = ()) -> None:
        """ignored : paths of the scene that the scenario lets the half leave out."""
        self._interface = interface
        # Options may give a half physics that nobody here knows.
        self._limits = (LIMITS[0], math.inf) if model.get("options") else LIMITS
        self._parts: list[_Part] = []
        self._why_not = "the thermal half has a mesh of its own" if own_mesh else ""
        if model.get("method") == "steady":
            self._why_not = "a steady state stores nothing"
        if left_out := [path for path in OF_STORAGE if covers(ignored, path)]:
            self._why_not = f"the scenario lets the half leave out {', '.join(left_out)}"
        for number, part in enumerate(interface.parts if not self._why_not else ()):
            body, _, region = part.partition(".")
            stated = model.get("bodies", {}).get(body, {})
            name = str((stated | stated.get("regions", {}).get(region, {})).get("material", ""))
            found = _Enthalpy.of(model.get("materials", {}).get(name, {}))
            if found is None:
                self._why_not = f"the scenario states no density or heat capacity for {part}"
                break
            self._parts.append(_part(interface, number, found))

    def begun(self, now: Level) -> StoredLog:
        """Return the log at the start."""
        if self._why_not:
            return StoredLog(why_not=self._why_not)
        none = np.zeros(len(self._interface.bodies))
        return StoredLog(replace(now, elastic_strain=None), none, none, none, none, none)

    def watched(self, log: StoredLog, now: Level, terms: Mapping[str, float]) -> StoredLog:
        """Return the log after a window that ended at `now`.  terms : its heat, mechanism -> [J]."""
        if log.start is None:
            return log
        if not any(name.startswith(STORED) for name in terms):
            return StoredLog(why_not="the thermal half does not state the heat that it stores (heat.stored.BODY)")
        told = log.told + [terms.get(STORED + body, 0.0) for body in self._interface.bodies]
        holds, is_open = self._increase(log.start, now)
        off = np.maximum(np.abs(told - holds) - is_open, 0.0)
        return replace(log, told=told, low=np.minimum(np.minimum(told, holds), log.low),
                       high=np.maximum(np.maximum(told, holds), log.high), off=np.maximum(off, log.off),
                       t=np.where(off > log.off, now.t, log.t))

    def checks(self, log: StoredLog, span: float) -> tuple[Check, ...]:
        """Return the check at the end.  span [K]: of all temperatures."""
        if log.why_not or log.start is None:
            return (Check(NAME, TrustVerdict.UNCHECKED, what=log.why_not or "no window was solved"),)
        # fault: a body at rest is held against its round-off -> scale = np.maximum(log.high - log.low, 1e-300) |
        #   coupler/test_trust_stored
        scale = np.maximum(log.high - log.low, FAINT * self._capacities(log.start) * span)
        share = log.off / np.where(scale > 0.0, scale, 1.0)
        b = int(np.argmax(share))
        body = self._interface.bodies[b]
        # fault: heat of another material is trusted -> number = 0.0 | coupler/test_trust_stored
        number = float(share[b])
        return (measured(
            NAME, number, self._limits, t=float(log.t[b]),
            what=f"the heat that the thermal half states for {body} differs by {log.off[b]:.3g} J from rho c dT of its "
                 f"temperatures, {100 * number:.3g} % of the most that it held, at t = {log.t[b]:.6g} s",
            remedy="Mend the half: its density, heat capacity or latent heat is not the scenario's, or its "
                   "heat.stored.BODY is not that of its T"),)

    def _increase(self, start: Level, now: Level) -> tuple[Array, Array]:
        """Return (n_bodies,) [J] what bodies hold more than at the start, and how far the mesh leaves that open."""
        holds, is_open = np.zeros((2, len(self._interface.bodies)))
        for p in self._parts:
            T0, T = start.T[p.nodes], now.T[p.nodes]
            f0, f = (p.material.solid_fraction(at) if given is None else given[p.nodes]
                     for at, given in ((T0, start.f_s), (T, now.f_s)))
            at_nodes = float(p.share @ p.material.increase(T0, T, f0 - f))
            holds[p.body] += at_nodes
            if p.material.latent is None and p.material.solid.is_constant:
                continue
            in_cells = 0.0
            for cells, volumes in p.cells:
                a, b = T0[cells].mean(axis=1), T[cells].mean(axis=1)
                in_cells += float(volumes @ p.material.increase(
                    a, b, p.material.solid_fraction(a) - p.material.solid_fraction(b)))
            # fault: what quadrature leaves open is an error -> pass | coupler/test_trust_stored
            is_open[p.body] += abs(at_nodes - in_cells)
            if now.f_s is None:
                is_open[p.body] += float(p.share @ (p.material.open_at(T) + p.material.open_at(T0)))
        return holds, is_open

    def _capacities(self, start: Level) -> Array:
        """Return (n_bodies,) [J/K] at the start."""
        found = np.zeros(len(self._interface.bodies))
        for p in self._parts:
            found[p.body] += float(p.share @ (p.material.rho * p.material.solid(start.T[p.nodes])))
        return found


def _part(i: Interface, part: int, material: _Enthalpy) -> _Part:
    depth = 2.0 * np.pi if i.axisymmetric else 1.0
    # Densities are those of the mesh as drawn, wherever bodies are at the start.
    found = [(cells[of == part], depth * shares(i.nodes[cells[of == part]], i.axisymmetric))
             for cells, of, shares in ((i.quads, i.quad_part, quad_shares),
                                       (i.triangles, i.triangle_part, triangle_shares))]
    nodes = np.unique(np.concatenate([cells.ravel() for cells, _ in found])).astype(np.intp)
    share = np.zeros(len(nodes))
    for cells, volumes in found:
        np.add.at(share, np.searchsorted(nodes, cells), volumes)
    body = i.bodies.index(i.parts[part].partition(".")[0])
    return _Part(body, material, nodes, share, tuple(
        (np.searchsorted(nodes, cells), volumes.sum(axis=1)) for cells, volumes in found if len(cells)))
