"""How far each probe of a strain is off because cells are too large.

A half tells the mean strains of its cells: the strain, its elastic part, and what has flowed (peeq) and crept (ceeq) so
far.  As stress is, they are held against fields of the second order and of the first, fitted to the cells around each
node (peak_stress.py): what cells are off the better one, and what both differ by, whichever is more.  What has flowed
is zero up to where a body begins to yield, which no polynomial is; so where a fit goes below zero it is cut.

A probe is held against the largest that it told over the run, but no less than LITTLE of the largest of its kind in its
body.  Where cells are a single row nothing is known across, and nothing is told.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.fmu.half import Block
from coupler.fmu.outputs import component_of
from coupler.scenario.probes import Probe
from coupler.trust.checks import Check, measured
from coupler.trust.in_space.peak_stress import Found, PeakStress, found_of

Floats = NDArray[np.float64]

LIMITS = (0.05, 0.2)  # of the strain: noted, broken
LITTLE = 0.1  # of the largest of its kind in its body
NOTHING = 1e-10  # what is no strain: round-off, and what iterations leave
NAME = "cells fine enough for probes of strain"
FLOWED = ("peeq", "ceeq")
COLUMNS = {"strain": 4, "elastic_strain": 4, "peeq": 1, "ceeq": 1}


@dataclass(frozen=True)
class StrainLog:
    """Of each probe when it was off most [1], the largest that it told, and the largest of its kind in its body [1]."""

    worst: Mapping[str, Found] = field(default_factory=dict)
    largest: Mapping[str, float] = field(default_factory=dict)
    highest: Mapping[str, float] = field(default_factory=dict)


def strain_outputs(blocks: Mapping[str, Block], known: Collection[str], probes: Mapping[str, Probe]) -> list[str]:
    """Return the outputs of a mechanical half that probes of strains read, none where it tells no stress of cells.

    known : what the stress of cells is read from.
    """
    asked = {found[0] for probe in probes.values()
             if probe.half == "mechanical" and (found := component_of(probe.output, COLUMNS))}
    return [name for name in COLUMNS if name in asked and name in blocks] if known else []


class PeakStrain:
    """Holds strains that are probed against those at nodes."""

    def __init__(self, interface: Interface, probes: Mapping[str, Probe], stress: PeakStress) -> None:
        """stress : of the same scene."""
        self._interface, self._stress = interface, stress
        self._probes = {name: (probe, *found) for name, probe in probes.items()
                        if probe.half == "mechanical" and (found := component_of(probe.output, COLUMNS))
                        and probe.nodes.size and stress.fits_all(probe.nodes)}
        self._body_of_cell = np.concatenate([interface.quad_body, interface.triangle_body])

    def watched(self, log: StrainLog, told: Mapping[str, Floats], t: float) -> StrainLog:
        """Return the log after a look at t [s].  told : outputs of COLUMNS (n_cells,) or (n_cells, 4) [1]."""
        found, largest, highest = dict(log.worst), dict(log.largest), dict(log.highest)
        fits: dict[str, tuple[Floats, Floats]] = {}
        for name, (probe, quantity, column) in self._probes.items():
            if quantity not in told or not np.isfinite(told[quantity]).all():
                continue
            cells = told[quantity]
            if quantity not in fits:
                fits[quantity] = self._at_nodes(quantity, cells)
            values = cells[:, column] if cells.ndim > 1 else cells
            smooth, straight = (fit[:, column] for fit in fits[quantity])
            node = -1
            if probe.reduction in ("max", "min"):
                order = smooth[probe.nodes]
                node = int(probe.nodes[np.argmax(order) if probe.reduction == "max" else np.argmin(order)])
            elif probe.reduction == "point":
                node = int(probe.nodes[np.argmax(probe.weights)])
            now = found_of(probe.of_cells(values), probe.of(smooth), probe.of(straight), t, node)
            # fault: what a strain was off by before is forgotten -> found[name] = now | coupler/test_trust_peak_strain
            found[name] = now if name not in found or now.off >= found[name].off else found[name]
            largest[name] = max(largest.get(name, 0.0), abs(now.told), abs(now.at_nodes))
            own = self._body_of_cell == self._interface.node_body[probe.nodes[0]]
            highest[name] = max(highest.get(name, 0.0), float(np.abs(cells[own]).max(initial=0.0)))
        return StrainLog(found, largest, highest)

    def _at_nodes(self, quantity: str, cells: Floats) -> tuple[Floats, Floats]:
        """(n_nodes, 4) or (n_nodes, 1), of the second order and of the first."""
        if quantity not in FLOWED:
            return self._stress.at_nodes(cells)
        # What turns with a curve are the first three of a tensor.
        alone = np.zeros((cells.size, 4))
        alone[:, 3] = cells
        smooth, straight = self._stress.at_nodes(alone)
        # fault: what has flowed is told to be less than nothing -> return smooth[:, 3:], straight[:, 3:] |
        #   coupler/test_trust_peak_strain
        return np.maximum(smooth[:, 3:], 0.0), np.maximum(straight[:, 3:], 0.0)

    def checks(self, log: StrainLog) -> tuple[Check, ...]:
        """Return the check at the end, none where nobody probes a strain."""
        # fault: a strain that is next to nothing is held against itself -> least = dict.fromkeys(log.highest, 1e-99) |
        #   coupler/test_trust_peak_strain
        least = {name: max(LITTLE * of, NOTHING) for name, of in log.highest.items()}
        shares = {name: of.off / max(log.largest[name], least[name]) for name, of in log.worst.items()}
        if not shares:
            return ()
        name = max(shares, key=lambda n: shares[n])
        of, share = log.worst[name], shares[name]
        x, y = self._interface.nodes[of.node] if of.node >= 0 else (0.0, 0.0)
        where = f" at ({x:.4g}, {y:.4g}) m" if of.node >= 0 else ""
        why = self._stress.without_bound(of.node)
        remedy = (f"It has no bound there ({why}): smaller cells only make it larger. Read it elsewhere, or draw the "
                  "radius that the corner has" if why else
                  f"Use cells {max(share / LIMITS[0], 1.0):.2g} times as small there for {100.0 * LIMITS[0]:.3g} %")
        return (measured(NAME, share, LIMITS, t=of.t, remedy=remedy,
                         what=f"the probe {name} tells {of.told:.4g}, as cells have it, which is wrong by "
                              f"{'as much as' if why else 'about'} {of.off:.3g}, {100.0 * share:.3g} % of the largest "
                              f"of the run, because they are too large: a field fitted to them has "
                              f"{of.at_nodes:.4g}{where}, at t = {of.t:.6g} s"),)
