"""How far each probe of a strain, or of a heat flux, is off because cells are too large.

A half tells them as means of its cells: strain, its elastic part, what has flowed (peeq) and crept (ceeq) so far, and
the flux of heat.  As stress is, they are held against fields of the second order and of the first, fitted to the cells
around each node (nodal_stress.py): what cells are off the better one, and what both differ by, whichever is more.  What
has flowed is zero up to where a body begins to yield, which no polynomial is; so where a fit goes below zero it is cut.

A strain that is probed is held against the largest that the probe told over the run, a flux against what it is at that
time, for that of a shock is of any size; but either against no less than LITTLE of the largest of its kind in its body.
What a flux is off by for a short time breaks no run: where a shock has just met a surface it is so on any mesh.  Nor
does a flux in a body that melts, for it bends at fronts, and fitted fields may tell too much there.  Where cells are a
single row nothing is known across, and nothing is told.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.fmu.half import Block
from coupler.fmu.outputs import component_of
from coupler.scenario.probes import Probe
from coupler.trust.checks import Check, amount, measured
from coupler.trust.in_space.extremes import BRIEF
from coupler.trust.in_space.peak_stress import Found, PeakStress, held, materials_of
from coupler.trust.in_space.probed import lasting

Floats = NDArray[np.float64]

LIMITS = (0.05, 0.2)  # of the strain, or of the flux: noted, broken
LITTLE = 0.1  # of the largest of its kind in its body
MOST_LOOKS = 256  # remembered; of more the worse of two neighbours
FLOWED = ("peeq", "ceeq")


@dataclass(frozen=True)
class Kind:
    """What is held.  half : that tells it.  columns : output -> how many it has.  nothing : in `unit`, what is none.

    bears : only bodies that hold their shape by stress are looked at, and a place may be one at which it has no bound.
    brief : it may be off for a short time, and is held against what it is then.
    """

    name: str
    half: str
    columns: Mapping[str, int]
    unit: str
    nothing: float
    bears: bool
    brief: bool

    def asked(self, probes: Mapping[str, Probe]) -> dict[str, tuple[Probe, str, int]]:
        """Return the probes of such a quantity, with its output and column."""
        return {name: (probe, *found) for name, probe in probes.items()
                if probe.half == self.half and (found := component_of(probe.output, self.columns))}

    def outputs(self, blocks: Mapping[str, Block], probes: Mapping[str, Probe]) -> list[str]:
        """Return the outputs of the half that probes of such quantities read."""
        asked = {output for _, output, _ in self.asked(probes).values()}
        return [name for name in self.columns if name in asked and name in blocks]


# A strain that is none is round-off, and what iterations leave.
STRAIN = Kind("cells fine enough for probes of strain", "mechanical",
              {"strain": 4, "elastic_strain": 4, "peeq": 1, "ceeq": 1}, "", 1e-10, True, False)
FLUX = Kind("cells fine enough for probes of heat flux", "thermal", {"q": 2}, "W/m2", 1e-9, False, True)


def melting(model: Mapping[str, Any]) -> set[str]:
    """Return the bodies of a thermal half's model.json in which something may melt."""
    melts = {name for name, material in model.get("materials", {}).items() if material.get("latent")}
    return {name for name, body in model.get("bodies", {}).items()
            if melts & set(materials_of(body))}


@dataclass(frozen=True)
class CellLog:
    """Of each probe what was found at looks, the largest that it told, and the largest of its kind in its body.

    t [s]: of the last look.
    """

    looks: Mapping[str, tuple[Found, ...]] = field(default_factory=dict)
    largest: Mapping[str, float] = field(default_factory=dict)
    highest: Mapping[str, float] = field(default_factory=dict)
    t: float = 0.0


class CellProbes:
    """Holds what is probed as a mean of cells against what it is at nodes."""

    def __init__(self, kind: Kind, interface: Interface, probes: Mapping[str, Probe], stress: PeakStress,
                 bends: Collection[str] = ()) -> None:
        """stress : of the same scene, whose fits serve.  bends : bodies in which what is held is no smooth field."""
        self._kind, self._interface, self._stress = kind, interface, stress
        self._probes = {name: of for name, of in kind.asked(probes).items()
                        if of[0].nodes.size and stress.fits_all(of[0].nodes, kind.bears)}
        self._bends = {name for name, (probe, *_) in self._probes.items()
                       if interface.bodies[interface.node_body[probe.nodes[0]]] in bends}
        self._body_of_cell = np.concatenate([interface.quad_body, interface.triangle_body])

    def watched(self, log: CellLog, told: Mapping[str, Floats], t: float) -> CellLog:
        """Return the log after a look at t [s].  told : outputs by name, (n_cells,) or (n_cells, columns)."""
        found, largest, highest = dict(log.looks), dict(log.largest), dict(log.highest)
        fits: dict[str, tuple[Floats, Floats]] = {}
        for name, (probe, quantity, column) in self._probes.items():
            if quantity not in told or not np.isfinite(told[quantity]).all():
                continue
            cells = told[quantity]
            if quantity not in fits:
                fits[quantity] = self._at_nodes(quantity, cells)
            values = cells[:, column] if cells.ndim > 1 else cells
            smooth, straight = (fit[:, column] for fit in fits[quantity])
            now = held(probe, values, smooth, straight, t)
            # fault: what was off before is forgotten -> found[name] = (now,) | coupler/test_trust_cell_probes
            found[name] = _thinned((*found.get(name, ()), now))
            largest[name] = max(largest.get(name, 0.0), abs(now.told), abs(now.at_nodes))
            own = self._body_of_cell == self._interface.node_body[probe.nodes[0]]
            highest[name] = max(highest.get(name, 0.0), float(np.abs(cells[own]).max(initial=0.0)))
        return CellLog(found, largest, highest, t)

    def _at_nodes(self, quantity: str, cells: Floats) -> tuple[Floats, Floats]:
        """(n_nodes, columns) of the second order and of the first."""
        if self._kind.columns[quantity] == 4:
            return self._stress.at_nodes(cells)
        # What turns with a curve are the first three columns of a tensor: here each stands alone.
        columns = cells.reshape(len(cells), -1).T
        both = [self._stress.at_nodes(np.column_stack([*np.zeros((3, column.size)), column])) for column in columns]
        smooth, straight = (np.column_stack([fits[order][:, 3] for fits in both]) for order in (0, 1))
        # fault: what has flowed is told to be less than nothing -> least = -np.inf | coupler/test_trust_cell_probes
        least = 0.0 if quantity in FLOWED else -np.inf
        return np.maximum(smooth, least), np.maximum(straight, least)

    def off_of(self, log: CellLog) -> dict[str, float]:
        """Return probe -> by how much it may be off, in SI: of what may be brief what lasts."""
        return {name: self._counts(log, looks, np.array([one.off for one in looks]))
                for name, looks in log.looks.items()}

    def _counts(self, log: CellLog, looks: Sequence[Found], off: Floats) -> float:
        """The largest of off : (n,) of looks, of what may be brief the largest that lasts."""
        if not self._kind.brief:
            return float(off.max())
        return lasting(np.array([one.t for one in looks]), off, BRIEF * log.t)

    def checks(self, log: CellLog) -> tuple[Check, ...]:
        """Return the check at the end, none where nobody probes such a quantity."""
        kind = self._kind
        # fault: a strain that is next to nothing is held against itself -> least = dict.fromkeys(log.highest, 1e-99) |
        #   coupler/test_trust_cell_probes
        least = {name: max(LITTLE * of, kind.nothing) for name, of in log.highest.items()}
        shares = {name: np.array([one.off / max(least[name], *((abs(one.told), abs(one.at_nodes)) if kind.brief else
                                                              (log.largest[name],))) for one in looks])
                  for name, looks in log.looks.items()}
        if not shares:
            return ()
        # fault: what a flux is off by for a moment breaks a run -> count = {n: float(s.max()) for n, s in
        #   shares.items()} | coupler/test_trust_cell_probes
        count = {n: self._counts(log, log.looks[n], s) for n, s in shares.items()}
        # fault: fields fitted across a front break a run -> pass | coupler/test_trust_cell_probes
        count |= dict.fromkeys(self._bends, 0.0)
        lasts = max(count.values()) > LIMITS[0]
        most = count if lasts else {n: float(s.max()) for n, s in shares.items()}
        name = max(most, key=lambda n: most[n])
        share = most[name]
        of = log.looks[name][int(np.flatnonzero(shares[name] >= share)[-1])]
        x, y = self._interface.nodes[of.node] if of.node >= 0 else (0.0, 0.0)
        where = f" at ({x:.4g}, {y:.4g}) m" if of.node >= 0 else ""
        why = self._stress.without_bound(of.node) if kind.bears else ""
        remedy = (f"It has no bound there ({why}): smaller cells only make it larger. Read it elsewhere, or draw the "
                  "radius that the corner has" if why else
                  f"Use cells {max(share / LIMITS[0], 1.0):.2g} times as small there for {100.0 * LIMITS[0]:.3g} %")
        told, off, at_nodes = (amount(v, kind.unit).strip() for v in (of.told, of.off, of.at_nodes))
        against = "that" if kind.brief else "the largest of the run"
        limits = LIMITS if lasts else (LIMITS[0], np.inf)
        return (measured(kind.name, share, limits, t=of.t, remedy=remedy,
                         what=f"the probe {name} tells {told}, as cells have it, which is wrong by "
                              f"{'as much as' if why else 'about'} {off}, {100.0 * share:.3g} % of {against}, "
                              f"because they are too large: a field fitted to them has {at_nodes}{where}, at "
                              f"t = {of.t:.6g} s"),)


def _thinned(looks: tuple[Found, ...]) -> tuple[Found, ...]:
    """Return looks, of too many the worse of two neighbours."""
    if len(looks) <= MOST_LOOKS:
        return looks
    return tuple(max(looks[k:k + 2], key=lambda one: one.off) for k in range(0, len(looks), 2))
