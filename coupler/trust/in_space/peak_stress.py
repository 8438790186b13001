"""How far the highest stress of each body, and each probe of a stress, is off because cells are too large.

A half tells the mean stress of its cells (output sigma).  At a surface, where stress is highest most times, that is the
stress half a cell away, and what few cells of a mesh are off by at one place is nothing of the energy of a body.  So
what is told is held against the stress at nodes that a field fitted to the cells around has there (nodal_stress.py), of
the second order and of the first.  What they differ by says how well the fit itself is known, and the larger of both
differences is the error.  At curves that go into a body fits are of depth as it counts there, and where cells are too
large for those too, the stress of quads is taken to fall as at a round hole, if that makes the error larger.

Of a body the largest von Mises and the largest principal stress are held so, unless they are where stress has no bound
(stress_corners.py): most scenes have such a place.  Where nobody asks for them that is told and breaks no run; a probe
that is off by more than the second limit does.  Errors are held against the largest that the probe told over the run,
but no less than LITTLE of the highest stress of its body: a shear stress that is 0 by symmetry is off by many times
itself.  Left out are bodies that flow or creep (stress is bounded by what they bear, and not by a smooth field), but
for probes of a component, which is smooth on either side of where they begin to; melts, rigid bodies and ones that bear
nothing (mesh.py).  Along a single row of cells the fit tells the least that a stress is off by: it is told only where
that is too much, for nothing is known across.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.nodal_stress import LINEAR, QUADRATIC, NodalStress, nodal_stress, von_mises
from coupler.fmu.half import Block
from coupler.fmu.outputs import On, component_of, place_of
from coupler.scenario.probes import Probe
from coupler.trust.checks import Check, TrustVerdict, amount, measured
from coupler.trust.in_space.stress_corners import curve_centres, curves, places_without_bound

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

LIMITS = (0.05, 0.2)  # of the stress: noted, broken where a probe asks
LITTLE = 0.1  # of the highest stress of the body
NAME = "cells fine enough for the highest stress"
STRESS = "sigma"
VON_MISES, PRINCIPAL = "von Mises stress", "principal stress"
COLUMNS = {STRESS: 4, "sigma_v": 1, "sigma_hoop": 1}
FLOWS, MELTS = ("plastic", "creep", "liquid"), ("liquid",)


def stress_outputs(blocks: Mapping[str, Block], interface: Interface, own_meshes: Collection[str]) -> list[str]:
    """Return the outputs of a mechanical half that tell its stress, none where it has a mesh of its own."""
    n = len(interface.quads) + len(interface.triangles)
    if "mechanical" in own_meshes or STRESS not in blocks or place_of(blocks[STRESS], interface) is not On.CELLS:
        return []
    return [name for name, of in COLUMNS.items() if name in blocks and blocks[name].shape in ((n,), (n, of))]


@dataclass(frozen=True)
class Found:
    """A stress that is told.  told, at_nodes : by the cells and at nodes, off : by how much it may be off [Pa].

    t [s]: when.  node : where; -1: at more than one.  curved : told by the curve of the surface there.
    """

    told: float = 0.0
    at_nodes: float = 0.0
    off: float = 0.0
    t: float = 0.0
    node: int = -1
    curved: bool = False
    along: bool = False


@dataclass(frozen=True)
class PeakLog:
    """Of each body and kind of stress, "BODY KIND", and of each probe: when it was off most, and the largest told [Pa].

    highest : body -> the largest von Mises stress told so far [Pa].  looks : so many.
    """

    worst: Mapping[str, Found] = field(default_factory=dict)
    largest: Mapping[str, float] = field(default_factory=dict)
    highest: Mapping[str, float] = field(default_factory=dict)
    looks: int = 0


class PeakStress:
    """Holds the stress that is told against that at nodes.  It remembers what follows from the scene alone."""

    def __init__(self, interface: Interface, model: Mapping[str, Any], probes: Mapping[str, Probe]) -> None:
        """model : model.json of the mechanical half.  probes : of the scenario, by name."""
        self._interface, self._model = interface, model
        about = model.get("bodies", {})
        # fault: a body that yields is held to a smooth stress -> flows = set() | coupler/test_trust_peak_stress
        flows = self._with(FLOWS)
        melts = self._with(MELTS)
        solid = {name: b for b, name in enumerate(interface.bodies)
                 if not (about.get(name, {}).get("rigid") or melts & set(materials_of(about.get(name, {}))))}
        self._solid = frozenset(solid)
        self._bodies = {name: b for name, b in solid.items() if not flows & set(materials_of(about.get(name, {})))}
        asked = {name: (probe, *found) for name, probe in probes.items()
                 if probe.half == "mechanical" and (found := component_of(probe.output, COLUMNS)) and probe.nodes.size}
        # fault: nobody holds the probes of a body that yields -> of = self._bodies | coupler/test_trust_peak_stress
        of = solid
        # What a body bears is bounded where it flows, so that no fit tells its von Mises stress.
        self._probes = {name: row for name, row in asked.items() if (body := self._body(row[0])) in of
                        and (body in self._bodies or row[1] != "sigma_v")}
        self._yielding = {body: b for body, b in solid.items() if body not in self._bodies and body in {
            self._body(probe) for probe, *_ in self._probes.values()}}

    def _with(self, kinds: Collection[str]) -> set[str]:
        """Return the materials that have one of these laws."""
        return {name for name, m in self._model.get("materials", {}).items() if any(m.get(key) for key in kinds)}

    def watched(self, log: PeakLog, told: Mapping[str, Floats], t: float) -> PeakLog:
        """Return the log after a look at t [s].  told : sigma (n_cells, 4), and more of COLUMNS if there is [Pa]."""
        stress = told[STRESS]
        if not (self._bodies or self._probes) or not np.isfinite(stress).all():
            return log
        of_cells = {VON_MISES: told.get("sigma_v", von_mises(stress)), PRINCIPAL: _principal(stress)}
        rows = [fit.of(stress) for fit in self._fits]
        of_rows = [{VON_MISES: von_mises(row), PRINCIPAL: _principal(row)} for row in rows]
        found, highest = {}, dict(log.highest)
        for body, b in self._bodies.items():
            cells, own = self._cells[b]
            if not own.size:
                continue
            for kind, values in of_cells.items():
                smooth, straight = (of[kind][own] for of in of_rows)
                row = int(own[np.argmax(smooth)])
                of = replace(found_of(values[cells].max(), smooth.max(), straight.max(), t,
                                    int(self._fits[0].node[row])), along=bool(self._fits[0].along[row]))
                found[f"{body} {kind}"] = self._curved(of, int(cells[np.argmax(values[cells])]),
                                                       of_cells[VON_MISES])
            highest[body] = max(highest.get(body, 0.0), found[f"{body} {VON_MISES}"].told)
        for body, b in self._yielding.items():
            highest[body] = max(highest.get(body, 0.0), float(of_cells[VON_MISES][self._cells[b][0]].max()))
        known, along = self._known
        for name, (probe, quantity, column) in self._probes.items():
            if known[probe.nodes].all():
                of = self._of_probe(probe, quantity, column, told, of_cells[VON_MISES], rows, t)
                found[name] = replace(of, along=bool(along[probe.nodes].any()))
        # fault: what was off before is forgotten -> worst = found | coupler/test_trust_peak_stress
        worst = {**log.worst, **{n: f for n, f in found.items() if n not in log.worst or f.off >= log.worst[n].off}}
        largest = {n: max(log.largest.get(n, 0.0), abs(f.told), abs(f.at_nodes)) for n, f in found.items()}
        return PeakLog(worst, {**log.largest, **largest}, highest, log.looks + 1)

    def at_nodes(self, stress: Floats) -> tuple[Floats, Floats]:
        """Return (n_nodes, 4) [Pa] the fields of the second order and of the first, fitted to stress : (n_cells, 4)."""
        smooth, straight = (fit.of(stress)[self._row_of] for fit in self._fits)
        return smooth, straight

    def fits_all(self, nodes: NDArray[np.integer], bears: bool = True) -> bool:
        """Whether fields can be fitted at these nodes.  bears : all of a body that holds its shape by its stress."""
        known, along = self._known
        return (not bears or self._body_of(nodes) in self._solid) and bool((known & ~along)[nodes].all())

    def checks(self, log: PeakLog, bearing: Mapping[str, bool], nothing: float) -> tuple[Check, ...]:
        """Return the check at the end, none where no half tells its stress.

        bearing : body -> whether it bears enough for its highest stress to count; without those that bear nothing.
        nothing [Pa]: a stress that is none.
        """
        if not log.looks or not (self._bodies or self._probes):
            return ()
        rows, unbound = [], False
        for key, found in log.worst.items():
            asked = key in self._probes
            body = self._body(self._probes[key][0]) if asked else key.rpartition(f" {_kind(key)}")[0]
            if body not in bearing or not (asked or bearing[body]):
                continue
            # fault: a corner that nobody asks for is told in every scene -> if False: | coupler/test_trust_peak_stress
            if not asked and self.without_bound(found.node):
                unbound = True
                continue
            highest = log.highest.get(body, 0.0)
            least = max(LITTLE * highest if asked else max(log.largest[f"{body} {k}"] for k in (VON_MISES, PRINCIPAL)),
                        nothing)
            # fault: a probe that is off counts no more than what nobody asks -> asked = False |
            #   coupler/test_trust_peak_stress
            share = found.off / max(log.largest[key], least) if found.off > 0.0 else 0.0
            # fault: what is known along a row alone is said to hold -> if False: | coupler/test_trust_peak_stress
            if found.along and share <= LIMITS[0]:
                continue
            rows.append((asked and share > LIMITS[1], share, key, found, asked, body))
        if not rows:
            why = ("stress is highest where it has no bound: at corners, ends of what is held, or contact"
                   if unbound else "no elastic body bears anything, or all are of a single row of cells")
            return (Check(NAME, TrustVerdict.UNCHECKED, what=why),)
        _, share, key, found, asked, body = max(rows, key=lambda row: row[:2])
        limits = LIMITS if asked else (LIMITS[0], np.inf)
        check = measured(NAME, share, limits, t=found.t, what=self._what(key, found, share, asked, body),
                         remedy=self._remedy(found, share))
        return (check,)

    def _what(self, key: str, found: Found, share: float, asked: bool, body: str) -> str:
        where, to = self._place(found.node), " and to the curve" if found.curved else ""
        which = f"the probe {key} tells" if asked else f"the highest {_kind(key)} of {body} is told as"
        more = ("which is wrong by as much as" if self.without_bound(found.node) else "which is wrong by "
                f"{'at least' if found.along else 'about'}")
        return (f"{which} {amount(found.told, 'Pa')}, as cells have it, {more} {amount(found.off, 'Pa')}, "
                f"{100.0 * share:.3g} % of the largest of the run, because they are too large: a field fitted to them"
                f"{to} has {amount(found.at_nodes, 'Pa')}{where}, at t = {found.t:.6g} s")

    def _remedy(self, found: Found, share: float) -> str:
        if why := self.without_bound(found.node):
            return (f"Stress has no bound there ({why}): smaller cells only make it larger. Read it elsewhere, or draw "
                    "the radius that the corner has")
        if found.node < 0:
            return f"Use cells {share / LIMITS[0]:.2g} times as small there for {100.0 * LIMITS[0]:.3g} %"
        h = self._sizes[found.node]
        # fault: the size of cells told does not lead to the limit -> enough = h | coupler/test_trust_peak_stress
        enough = h * LIMITS[0] / max(share, LIMITS[0])
        return (f"Use cells of {amount(enough, 'm')} there for {100.0 * LIMITS[0]:.3g} %; they are of "
                f"{amount(h, 'm')}, and half as large ones halve the error")

    def _of_probe(self, probe: Probe, quantity: str, column: int, told: Mapping[str, Floats], sigma_v: Floats,
                  rows: list[Floats], t: float) -> Found:
        if quantity == "sigma_v":
            values, at = sigma_v, [von_mises(row) for row in rows]
        else:
            column = 3 if quantity == "sigma_hoop" else column
            values, at = told[STRESS][:, column], [row[:, column] for row in rows]
        smooth, straight = (of[self._row_of] for of in at)
        found = held(probe, values, smooth, straight, t)
        of_cells = values[probe.cells]
        most = {"max": of_cells, "min": -of_cells, "point": probe.cell_weights}.get(probe.reduction)
        return found if most is None else self._curved(found, int(probe.cells[np.argmax(most)]), sigma_v)

    def _curved(self, found: Found, cell: int, sigma_v: Floats) -> Found:
        """What is told by a cell at a curve that goes into its body, too large for the radius of that.

        No fit knows what cells have nothing of.  At the side of a round hole (Kirsch) stress is highest and falls at a
        depth d to (1 + 1/(2 s2) + 3/(2 s4))/3 of that, s = 1 + d/radius; in a thick tube it falls alike.  Elsewhere
        along a curve it falls less where it is less: by the share that the cell has of the highest there.
        """
        depth, node = self._depths.get(cell, (0.0, -1))
        s = 1.0 + depth
        # fault: cells as large as a notch are trusted -> more = 0.0 | coupler/test_trust_peak_stress
        more = 3.0 / (1.0 + 0.5 / s**2 + 1.5 / s**4) - 1.0
        if node >= 0:
            body = self._interface.quad_body
            along = [k for k in self._depths if body[k] == body[cell]]
            # fault: all of a hole is told as its highest place -> pass | coupler/test_trust_peak_stress
            more *= float(sigma_v[cell] / max(sigma_v[along].max(), np.finfo(float).tiny))
        if more * abs(found.told) <= found.off:
            return found
        return Found(found.told, (1.0 + more) * found.told, more * abs(found.told), found.t, node, True)

    def _body(self, probe: Probe) -> str:
        return self._body_of(probe.nodes)

    def _body_of(self, nodes: NDArray[np.integer]) -> str:
        return self._interface.bodies[self._interface.node_body[nodes[0]]]

    @cached_property
    def _fits(self) -> tuple[NodalStress, NodalStress]:
        centres = curve_centres(self._interface)
        # fault: stress along a single row is not looked at -> orders = (0, 0) | coupler/test_trust_peak_stress
        orders = (2, 1)
        return (nodal_stress(self._interface, QUADRATIC, centres, orders[0]),
                nodal_stress(self._interface, LINEAR, centres, orders[1]))

    @cached_property
    def _cells(self) -> dict[int, tuple[Ints, Ints]]:
        """Body -> its cells, and its rows of the fits that are known."""
        of = np.concatenate([self._interface.quad_body, self._interface.triangle_body])
        fit = self._fits[0]
        rows = np.where(fit.known | fit.along, self._interface.part_body[fit.part], -1)
        return {b: (np.flatnonzero(of == b), np.flatnonzero(rows == b))
                for b in (*self._bodies.values(), *self._yielding.values())}

    @cached_property
    def _row_of(self) -> Ints:
        """(n_nodes,) a row of the fits for each node: of parts that meet there the first."""
        rows = np.zeros(len(self._interface.nodes), dtype=np.intp)
        node = self._fits[0].node[::-1]
        rows[node] = np.arange(node.size)[::-1]
        return rows

    @cached_property
    def _known(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """(n_nodes,) whether all rows of the fits there are known, and whether one is along a row of cells alone."""
        fit = self._fits[0]
        known, along = np.ones(len(self._interface.nodes), dtype=bool), np.zeros(len(self._interface.nodes), dtype=bool)
        np.logical_and.at(known, fit.node, fit.known | fit.along)
        along[fit.node[fit.along]] = True
        return known, along

    @cached_property
    def _sizes(self) -> Floats:
        """(n_nodes,) [m] the root of the mean area of the cells around a node, as that of a square."""
        area, count = np.zeros(len(self._interface.nodes)), np.zeros(len(self._interface.nodes))
        for cells, squares in ((self._interface.quads, 1.0), (self._interface.triangles, 2.0)):
            x, y = np.moveaxis(self._interface.nodes[cells], 2, 0)
            of = 0.5 * squares * (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)
            np.add.at(area, cells, of[:, None])
            np.add.at(count, cells, 1.0)
        return np.asarray(np.sqrt(area / np.maximum(count, 1.0)))

    @cached_property
    def _depths(self) -> dict[int, tuple[float, int]]:
        """Quad at a curve that goes in -> how deep its middle lies, in radii of the curve, and a node of that.

        None where a body is tied in: stress may go on through that as if there were no hole.
        """
        nodes, quads, found = self._interface.nodes, self._interface.quads, {}
        # fault: what is tied into a hole is not there -> sides: list[str] = [] | coupler/test_trust_peak_stress
        sides = [side for pair in self._interface.pairs if pair.tied for side in (pair.slave, pair.master)]
        tied = {int(k) for side in sides for k in self._interface.surfaces[side].ravel()}
        curved = {k: of for k, of in curves(self._interface).items() if k not in tied}
        for cell in np.flatnonzero(np.isin(quads, list(curved)).any(axis=1)).tolist():
            middle = nodes[quads[cell]].mean(axis=0)
            for one, other in zip(quads[cell].tolist(), np.roll(quads[cell], -1).tolist(), strict=True):
                turn, at = max((curved[k][0], k) if k in curved else (0.0, k) for k in (one, other))
                if not turn or (one, other) not in ((at, curved[at][1]), (curved[at][2], at)):
                    continue
                (x, y), (u, v) = nodes[other] - nodes[one], middle - nodes[one]
                found[cell] = float(abs(x * v - y * u) / np.hypot(x, y) * turn / np.hypot(x, y)), at
        return found

    @cached_property
    def _no_bound(self) -> dict[int, str]:
        """As places_without_bound, for the nodes next to such a place too."""
        at = places_without_bound(self._interface, self._model)
        near: dict[int, str] = {}
        for cells in (self._interface.quads, self._interface.triangles):
            for corners in cells[np.isin(cells, list(at)).any(axis=1)].tolist():
                near |= dict.fromkeys(corners, next(at[k] for k in corners if k in at))
        return near | at

    def without_bound(self, node: int) -> str:
        """Why stress has no bound at a node, or at one next to it; "" where it has."""
        return self._no_bound.get(node, "")

    def _place(self, node: int) -> str:
        if node < 0:
            return ""
        x, y = self._interface.nodes[node]
        return f" at ({x:.4g}, {y:.4g}) m"


def held(probe: Probe, values: Floats, smooth: Floats, straight: Floats, t: float) -> Found:
    """What a probe tells of values : (n_cells,), against fields smooth, straight : (n_nodes,) at t [s]."""
    node = -1
    if probe.reduction in ("max", "min"):
        order = smooth[probe.nodes]
        node = int(probe.nodes[np.argmax(order) if probe.reduction == "max" else np.argmin(order)])
    elif probe.reduction == "point":
        node = int(probe.nodes[np.argmax(probe.weights)])
    return found_of(probe.of_cells(values), probe.of(smooth), probe.of(straight), t, node)


def found_of(told: float, smooth: float, straight: float, t: float, node: int) -> Found:
    # fault: how well the fit is known does not count -> off = abs(smooth - told) | coupler/test_trust_peak_stress
    off = max(abs(smooth - told), abs(smooth - straight))
    return Found(float(told), float(smooth), float(off), t, node)


def _kind(key: str) -> str:
    return VON_MISES if key.endswith(VON_MISES) else PRINCIPAL


def _principal(stress: Floats) -> Floats:
    """(n,) [Pa] the largest principal stress of (n, 4)."""
    a, b, shear, c = stress.T
    return np.asarray(np.maximum(0.5 * (a + b) + np.hypot(0.5 * (a - b), shear), c))


def materials_of(body: Mapping[str, Any]) -> list[str]:
    """The materials of a body of a model.json and of its regions."""
    return [str(part.get("material")) for part in (body, *(body.get("regions") or {}).values())]
