"""How far each probe of a contact pressure is off because cells are too large.

A pressure at a surface is the stress across it.  So it is held against what fields fitted to the stress of the cells
behind have there, of the second order and of the first (nodal_stress.py): what they differ by, and what the pressure
and the better one differ by, whichever is more.  But where stress changes steeply into a body such fits are worse
than the pressure, which is in balance with the forces.  Cells that are too large for a pressure show in how it changes
along the surface too: by no more than that within two edges is it off.  So the lesser of both counts.  Nodes that press
nothing are right.  At the end of a contact with an edge the pressure has no bound, and the largest one is that of the
cells.  It is noted and breaks no run: a mean, and what the pressure does elsewhere, may be right all the same.

Of means nothing is told: they follow from the balance of forces.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.fmu.outputs import told_at
from coupler.scenario.probes import Probe
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, amount, measured
from coupler.trust.in_space.peak_stress import Found, PeakStress, found_of

Floats = NDArray[np.float64]

LIMITS = (0.05, np.inf)  # of the pressure: noted, broken
LITTLE = 0.1  # of the largest pressure of that surface
NAME = "cells fine enough for contact pressure"


@dataclass(frozen=True)
class PressureLog:
    """Of each probe when it was off most, and the largest that it told [Pa]; the largest of its surface [Pa]."""

    worst: Mapping[str, Found] = field(default_factory=dict)
    largest: Mapping[str, float] = field(default_factory=dict)
    highest: Mapping[str, float] = field(default_factory=dict)


class ContactPressure:
    """Holds pressures that are probed against the stress behind them.  It remembers what follows from the scene."""

    def __init__(self, interface: Interface, probes: Mapping[str, Probe], stress: PeakStress) -> None:
        """stress : of the same scene."""
        self._interface, self._stress = interface, stress
        self._probes: dict[str, tuple[Probe, NDArray[np.intp], NDArray[np.int32]]] = {}
        for name, probe in probes.items():
            if probe.quantity != "p" or probe.reduction == "mean" or not stress.fits_all(probe.nodes):
                continue
            surfaces = {s for pair in interface.pairs for s in (pair.slave, pair.master)
                        if np.isin(probe.nodes, interface.surfaces[s]).all()}
            if len(surfaces) == 1:
                self._probes[name] = probe, told_at(probe.nodes, interface), interface.surfaces[surfaces.pop()]

    def watched(self, log: PressureLog, sigma: Floats, now: Level) -> PressureLog:
        """Return the log after a look.  sigma : (n_cells, 4) [Pa] of cells."""
        if not self._probes or not np.isfinite(sigma).all():
            return log
        rows = self._stress.at_nodes(sigma)
        worst, largest, highest = dict(log.worst), dict(log.largest), dict(log.highest)
        for name, (probe, at, edges) in self._probes.items():
            p = np.zeros(len(self._interface.nodes))
            np.maximum.at(p, self._interface.pair_nodes[at], -now.t_N[at])
            normal = _normals(now.x, edges)
            # fault: what presses nothing is held to the stress behind it -> pressed = p >= 0.0 |
            #   coupler/test_trust_contact_pressure
            pressed = p > 0.0
            smooth, straight = (np.where(pressed, _across(row, normal), 0.0) for row in rows)
            told = probe.of(p)
            changes = _changes(p, edges)[probe.nodes]
            order = p[probe.nodes] if probe.reduction != "min" else -p[probe.nodes]
            node = int(probe.nodes[np.argmax(probe.weights if probe.reduction == "point" else order)])
            found = found_of(told, probe.of(smooth), probe.of(straight), now.t, node) if told > 0.0 else Found(t=now.t)
            # fault: a steep stress behind a surface is taken for a pressure that is off -> most = np.inf |
            #   coupler/test_trust_contact_pressure
            most = float(changes[probe.nodes == node].max() if probe.reduction != "point" else changes.max())
            found = replace(found, off=min(found.off, most))
            # fault: what a pressure was off by before is forgotten -> worst[name] = found |
            #   coupler/test_trust_contact_pressure
            worst[name] = found if name not in worst or found.off > worst[name].off else worst[name]
            largest[name] = max(largest.get(name, 0.0), told)
            highest[name] = max(highest.get(name, 0.0), float(p.max()))
        return PressureLog(worst, largest, highest)

    def checks(self, log: PressureLog, nothing: float) -> tuple[Check, ...]:
        """Return the check at the end, none where no pressure is probed that presses.  nothing [Pa]: a stress that is
        none.
        """
        shares = {name: found.off / max(log.largest[name], LITTLE * log.highest[name], nothing)
                  for name, found in log.worst.items() if log.highest[name] > nothing}
        if not shares:
            return ()
        name = max(shares, key=lambda n: shares[n])
        found, share = log.worst[name], shares[name]
        edge = self._is_edge(name, found.node)
        more = ("which is wrong by as much as" if edge else "which is wrong by about")
        remedy = ("Pressure has no bound where a contact ends at an edge: smaller cells only make it larger. Read it "
                  "elsewhere, as a mean, or draw the radius that the edge has" if edge else
                  f"Use cells {max(share / LIMITS[0], 1.0):.2g} times as small there for {100.0 * LIMITS[0]:.3g} %")
        return (measured(
            NAME, share, LIMITS, t=found.t,
            what=f"the probe {name} tells {amount(found.told, 'Pa')}, {more} {amount(found.off, 'Pa')}, "
                 f"{100.0 * share:.3g} % of its largest, because cells are too large: a field fitted to the stress of "
                 f"those behind has {amount(found.at_nodes, 'Pa')}, at t = {found.t:.6g} s", remedy=remedy),)

    def _is_edge(self, name: str, node: int) -> bool:
        """Whether a surface ends at a node or next to it."""
        edges = self._probes[name][2]
        nodes, count = np.unique(edges, return_counts=True)
        ends = nodes[count == 1]
        return bool(np.isin(edges[(edges == node).any(axis=1)], ends).any())


def _normals(x: Floats, edges: NDArray[np.int32]) -> Floats:
    """(n_nodes, 2) unit vectors across a surface at its nodes, the mean of its edges there; 0 elsewhere."""
    along = x[edges[:, 1]] - x[edges[:, 0]]
    normal = np.zeros_like(x)
    np.add.at(normal, edges, np.stack([along[:, 1], -along[:, 0]], axis=1)[:, None, :].repeat(2, axis=1))
    size = np.hypot(*normal.T)
    return np.asarray(normal / np.where(size > 0.0, size, 1.0)[:, None])


def _changes(p: Floats, edges: NDArray[np.int32]) -> Floats:
    """(n_nodes,) [Pa] by how much p : (n_nodes,) changes along a surface within two edges to either side."""
    least, most = p.copy(), p.copy()
    for _ in range(2):
        low, high = least[edges].min(axis=1), most[edges].max(axis=1)
        for end in edges.T:
            np.minimum.at(least, end, low)
            np.maximum.at(most, end, high)
    return most - least


def _across(stress: Floats, normal: Floats) -> Floats:
    """(n,) [Pa] pressure across, of stress : (n, 4) xx, yy, xy, zz."""
    a, b = normal.T
    return np.asarray(-(a * a * stress[:, 0] + b * b * stress[:, 1] + 2.0 * a * b * stress[:, 2]))
