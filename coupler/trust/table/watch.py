"""Watches a run window by window, and judges it at its end: the trust table."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.scenario.probes import Probe
from coupler.scenario.rule_model import Rule
from coupler.scenario.scales import left_of_nothing
from coupler.scenario.thermal_data import TemperatureData
from coupler.schemes.ledger import NO_TERMS, imbalance
from coupler.schemes.levels import Level
from coupler.schemes.state import ACROSS, OFF_MESH, SHAPE_OFF
from coupler.trust.checks import Check, measured
from coupler.trust.in_space import (
    across,
    at_nodes,
    carried,
    cell_probes,
    contact_ends,
    contact_pressure,
    displaced,
    extremes,
    fronts,
    heat_mesh,
    mesh,
    moved,
    peak_stress,
    probed,
)
from coupler.trust.in_time import drives, errors, instants, motion, rhythm, stability, steady
from coupler.trust.in_time.errors import Looked
from coupler.trust.in_time.phases import Mask
from coupler.trust.laws import delivered, energy, equilibrium, solved, stored, tables, temperatures
from coupler.trust.surfaces import (
    askew,
    facets,
    gap_tables,
    passing,
    penetration,
    pressures,
    round_gaps,
    skipped,
    stated,
    unpaired,
    ways,
)
from coupler.trust.table.bodies import Bodies
from coupler.trust.table.log import TrustLog, check_of_windows, taken

Array = NDArray[np.float64]

BALANCE = (1e-9, 1e-6)  # of the heat moved: noted, broken

NOTHING: Mapping[str, float] = MappingProxyType({})


class TrustWatch:
    """Measures what can be wrong.  It remembers nothing between windows but what its log holds."""

    def __init__(self, interface: Interface, models: Mapping[str, Mapping[str, Any]],
                 probes: Mapping[str, str] | None = None, adaptive: bool = False,
                 own_meshes: Collection[str] = (), ignored: Collection[str] = (), substeps: int = 1,
                 iterated: bool = False, fits: Mapping[str, Any] | None = None, looks: int = 1,
                 slight: Mapping[str, float] = NOTHING, moving: Mask | None = None,
                 probed: Mapping[str, Probe] | None = None, rules: Sequence[Rule] = ()) -> None:
        """models : of the halves (model.json).  probes : name -> unit; none: mean temperatures of bodies stand for
        them (`means`).  adaptive : whether windows find their own size.  own_meshes : the roles of halves on one.
        ignored : paths of the scene that the thermal half may leave out.  substeps : of the mechanical half in a
        window.  iterated : whether every window is.  fits : pair -> its clearance or interference, as stated.  looks :
        substeps of the thermal half in a window.  slight : unit -> an error that harms nobody [SI].
        moving : (n,) which of the probes the mechanical half makes.  probed : the probes themselves, by name, those
        that read a stress among them.  rules : of the scenario.
        """
        self._driving = drives.always_on(rules)
        self._slight = slight
        self._iterated = iterated
        self._own_meshes = frozenset(own_meshes)
        self._interface = interface
        self._adaptive = adaptive
        # fault: what iterations leave of a scene at rest is an error of its windows -> least = {} |
        #   coupler/test_trust
        least = {unit: off / errors.LIMIT for unit, off in slight.items()}
        left = left_of_nothing(interface, models)
        self._nothing = {unit: max(left.get(unit, 0.0), least.get(unit, 0.0)) for unit in {*left, *least}}
        self._probes = dict(probes) if probes else {f"the mean temperature of {b}": "K" for b in interface.bodies}
        self._data = TemperatureData(models["thermal"])
        self._sides, self._unpaired = passing.Sides(interface), unpaired.Unpaired(interface)
        pairs = models["mechanical"].get("pairs", {})
        self._yields = penetration.Yields(interface, {n for n, p in pairs.items() if p.get("augmented")})
        self._facets = facets.Facets(interface, self._yields)
        self._stated_pressures = stated.Stated(interface, models["mechanical"])
        self._askew = askew.Askew(interface, models["mechanical"])
        self._round_gaps = round_gaps.RoundGaps(interface, models["thermal"])
        of_heat = models["thermal"].get("pairs", {})
        self._meeting = [(pair.slave.partition(".")[0], pair.master.partition(".")[0]) for pair in interface.pairs
                         if of_heat.get(pair.name)]
        self._peak_stress = peak_stress.PeakStress(interface, models["mechanical"], probed or {})
        self._probed = dict(probed or {})
        self._strains = cell_probes.CellProbes(cell_probes.STRAIN, interface, self._probed, self._peak_stress)
        self._fluxes = cell_probes.CellProbes(cell_probes.FLUX, interface, self._probed, self._peak_stress,
                                              cell_probes.melting(models["thermal"]))
        self.displaced = displaced.Displaced(interface, self._probed)
        self._pressed = contact_pressure.ContactPressure(interface, self._probed, self._peak_stress)
        self._ends = contact_ends.ContactEnds(interface, models["mechanical"])
        self._tables = tables.MaterialTables(interface, models)
        self._pressures = pressures.PressureTables(interface, models["thermal"])
        self._gap_tables = gap_tables.GapTables(interface, models["thermal"])
        self._stored = stored.StoredHeat(interface, models["thermal"], "thermal" in self._own_meshes,
                                         ignored)
        self._placed = skipped.PlacedData(interface, models["thermal"])
        self._ways = ways.Ways(interface, models["mechanical"], looks)
        self._at_nodes = at_nodes.checks(interface, models["thermal"], models["mechanical"], fits)
        self._motion = motion.Motion(models["mechanical"], interface, substeps)
        # fault: errors of vibrations are told as if they died out -> self._lasts = None |
        #   coupler/test_trust_phases
        self._lasts = moving if probes and self._motion.has_inertia else None
        # Heat that strain makes goes with the motion.
        # fault: temperatures of a wave forget their errors -> if False: | coupler/test_trust_phases
        if self._lasts is not None and any(models["mechanical"].get(n) for n in ("thermoelastic_heat", "adiabatic")):
            self._lasts = np.ones_like(self._lasts)
        self._prescribed = models["mechanical"].get("half") == "rigid"
        self._bodies = Bodies(interface)

    def means(self, now: Level) -> Array:
        """Return the mean temperature of each body, (n_bodies,) [K]."""
        return self._bodies.mean_temperatures(now)

    def begun(self, now: Level, values: Array | None = None) -> TrustLog:
        """Return the log before the first window.  values : (n,) of the probes in SI; None: they are not followed."""
        log = TrustLog(temperatures.begun(now), passing=self._sides.begun(now),
                       tables=self._tables.watched(tables.TableLog(), now), stored=self._stored.begun(now))
        return log if values is None else replace(log, errors=errors.begun(values, now.t, self._lasts))

    def after(self, log: TrustLog, levels: tuple[Level, Level], terms: Mapping[str, float], *, fresh: bool,
              forced: float = 0.0, looked: Looked | None = None, inputs: Mapping[str, float] = NOTHING,
              monitors: Mapping[str, float] = NOTHING, reads: Sequence[float] = skipped.MIDDLE) -> TrustLog:
        """Return the log after a window that was taken.

        levels : at its start and its end.  terms : its heat, and what nodes took up (Ledger.everything) [J].
        fresh : it begins at a kink of the data.  forced : its error in tolerances, where it was taken although that is
        too large; inf: although it did not converge; else 0.  looked : what was seen of the probes; None: they are not
        followed.  inputs : of the thermal half in this window, besides what is exchanged.  monitors : what the halves
        tell of it, `thermal.NAME` and `mechanical.NAME`.  reads : the parts of it at which the
        thermal half read places and gaps.
        """
        before, now = levels
        if looked is not None:
            log = replace(log, errors=errors.watched(log.errors, looked, now.t, fresh=fresh),
                          stability=stability.watched(log.stability, looked, now.t, now.t - before.t),
                          steady=steady.watched(log.steady, looked, now.t))
        heats = {name: heat for name, heat in terms.items() if name not in NO_TERMS}
        warmth = temperatures.watched(log.temperatures, self._data, levels, heats, inputs)
        shape_off = monitors.get(f"mechanical.{SHAPE_OFF}")
        return replace(
            taken(log, forced, now.t), temperatures=warmth,
            rhythm=rhythm.watched(log.rhythm, levels, warmth.own_span, self.means(now), fresh),
            passing=self._sides.watched(log.passing, before, now),
            unpaired=self._unpaired.watched(log.unpaired, now),
            penetration=self._yields.watched(log.penetration, now),
            facets=log.facets if self._prescribed else self._facets.watched(log.facets, now),
            askew=self._askew.watched(log.askew, now),
            stated=self._stated_pressures.watched(log.stated, now),
            round_gaps=self._round_gaps.watched(log.round_gaps, now, now.t - before.t),
            skipped=self._placed.watched(log.skipped, before, now, reads),
            ways=self._ways.watched(log.ways, before, now),
            carried=carried.watched(log.carried, monitors.get(f"thermal.{OFF_MESH}"), now.t),
            shapes=carried.watched(log.shapes, shape_off, now.t,
                                   0.0 if shape_off is None else self._bodies.deformed(now)),
            across=across.watched(log.across, monitors.get(f"thermal.{ACROSS}"), now.t),
            solved=solved.watched(log.solved, monitors, terms, now.t),
            energy=energy.watched(log.energy, monitors, now.t),
            motion=log.motion if not self._motion.has_inertia else self._motion.watched(
                log.motion, (self._bodies.moved(before), self._bodies.moved(now)), now.t - before.t, fresh),
            tables=self._tables.watched(log.tables, now), pressures=self._pressures.watched(log.pressures, now),
            gap_tables=self._gap_tables.watched(log.gap_tables, now),
            stored=self._stored.watched(log.stored, now, heats))

    def wants_equilibrium(self, log: TrustLog, t: float, end: float, at_end: bool = False) -> bool:
        """Whether to ask the mechanical half for `equilibrium.OUTPUT` at t [s] of a run to `end` [s]."""
        return equilibrium.due(log.equilibrium, t, end, at_end)

    def with_equilibrium(self, log: TrustLog, directions: float, t: float) -> TrustLog:
        """Return the log after the mechanical half told at t [s] in how many directions its equilibrium is unstable."""
        return replace(log, equilibrium=equilibrium.watched(log.equilibrium, directions, t))

    def with_softness(self, log: TrustLog, share: float, t: float) -> TrustLog:
        """Return the log after the mechanical half told at t [s] of the softest motion of its bodies [1]."""
        return replace(log, equilibrium=equilibrium.softened(log.equilibrium, share, t))

    def with_displaced(self, log: TrustLog, du: Array, now: Level) -> TrustLog:
        """Return the log after the mechanical half told how much farther nodes would be on a finer mesh.

        du : (n_nodes, 2) [m]; nan: not known.
        """
        return replace(log, displaced=self.displaced.watched(log.displaced, du, now))

    def looked_at_mesh(self, log: TrustLog, told: Mapping[str, float], of_heat: Mapping[str, float],
                       t: float) -> TrustLog:
        """Return the log after a look at what meshes miss at t [s].

        told : outputs of the mechanical half by name (mesh.py) [J].  of_heat : of the thermal half (heat_mesh.py) [K].
        """
        return replace(log, mesh=mesh.watched(log.mesh, told, t),
                       heat_mesh=heat_mesh.watched(log.heat_mesh, of_heat, t))

    def looked_at_stress(self, log: TrustLog, told: Mapping[str, Array], now: Level) -> TrustLog:
        """Return the log after a look at the stress.

        told : outputs of the mechanical half by name, of peak_stress.py [Pa], cell_probes.py and contact_ends.py [1].
        """
        return replace(log, peak_stress=self._peak_stress.watched(log.peak_stress, told, now.t),
                       strains=self._strains.watched(log.strains, told, now.t),
                       contact_pressure=self._pressed.watched(log.contact_pressure, told[peak_stress.STRESS], now),
                       contact_ends=self._ends.watched(log.contact_ends, told, now))

    def looked_at_fluxes(self, log: TrustLog, told: Mapping[str, Array], t: float) -> TrustLog:
        """Return the log after a look at t [s].  told : outputs of the thermal half, of cell_probes.py [W/m2]."""
        return replace(log, fluxes=self._fluxes.watched(log.fluxes, told, t))

    def wants_extremes(self, log: TrustLog, at_end: bool, t: float, event: float, end: float) -> bool:
        """Whether to ask the thermal half for what its mesh does to extremes.  The rest is as of `extremes.due`."""
        return extremes.due(log.extremes, log.windows, log.temperatures.own_span, at_end, t, event, end)

    def with_extremes(self, log: TrustLog, told: Mapping[str, float], now: Level) -> TrustLog:
        """Return the log after the thermal half told how far its extremes are off now [K], by name."""
        reached = {name: self._bodies.extremes(now, body)[int(high)] for name in told
                   for high, body in (extremes.which(name),)}
        return replace(log, extremes=extremes.watched(log.extremes, told, reached, log.windows,
                                                      log.temperatures.own_span, now.t))

    def with_fronts(self, log: TrustLog, off: Array | None, now: Level) -> TrustLog:
        """Return the log after the thermal half told what fronts put its nodes off by now : (n,) [K].

        None: at the start.
        """
        return replace(log, fronts=fronts.watched(log.fronts, self._probed, now.T, off, now.t))

    def acted(self, log: TrustLog, acted: instants.Acted) -> TrustLog:
        """Return the log after rules were asked at the end of a window that was taken."""
        return replace(log, instants=instants.watched(log.instants, acted),
                       drives=drives.watched(log.drives, acted, self._driving))

    def mended(self, log: TrustLog, found: stability.Mended, t: float, H: float) -> TrustLog:
        """Return the log after a window of H to t [s] was put back because the exchange rings in it."""
        return replace(log, stability=stability.mended(log.stability, found, t, H),
                       errors=replace(log.errors, solves=log.errors.solves + found.solves))

    def probe_errors(self, log: TrustLog) -> dict[str, dict[str, Any]]:
        """Return probe -> estimated error, range and unit, SI, as plain values; empty: no window was looked at."""
        off = {n: found.off for worst in (log.contact_pressure.worst, log.peak_stress.worst)
               for n, found in worst.items()}
        # fault: what cells put gaps and displacements off by is not told of the probe -> by_heat = {} |
        #   coupler/test_trust_moved
        by_heat = probed.off_of(log.moved.probed)
        for told in (fronts.off_of(log.fronts), probed.off_of(log.probed), by_heat, displaced.off_of(log.displaced),
                     self._strains.off_of(log.strains), self._fluxes.off_of(log.fluxes)):
            off |= {n: max(by, off.get(n, 0.0)) for n, by in told.items()}
        return {n: asdict(row) | {"mesh": off.get(n, 0.0)} for n, row in errors.table(log.errors, self._probes).items()}

    def judged(self, log: TrustLog, totals: Mapping[str, float],
               handed: Mapping[str, float] = NOTHING, left: Mapping[str, float] = NOTHING, *,
               rules: bool = False) -> tuple[Check, ...]:
        """Return the table.

        totals : all of the ledger over the run [J].  handed : heat delivered to the thermal half, block -> [J].
        left : heat made and not delivered, block -> [J].
        rules : whether rules act on the scene.
        """
        off, place = imbalance(totals), self._bodies.place
        ranges = {n: row.range for n, row in errors.table(log.errors, self._probes).items()}
        return (
            errors.check(log.errors, self._probes, self._adaptive, self._iterated, self._nothing),
            stability.check(log.stability, log.errors.looked, self._adaptive),
            *steady.checks(log.steady),
            temperatures.check(log.temperatures, place(log.temperatures.node)),
            *self._tables.checks(log.tables),
            *self._pressures.checks(log.pressures),
            *self._gap_tables.checks(log.gap_tables),
            *carried.checks(log.carried, log.temperatures.most - log.temperatures.least,
                            "thermal" in self._own_meshes),
            *carried.shape_checks(log.shapes, "mechanical" in self._own_meshes),
            *heat_mesh.checks(log.heat_mesh, log.temperatures.heat_span, self._meeting, self._slight.get("K", 0.0)),
            *extremes.checks(log.extremes, log.temperatures.own_span, self._slight.get("K", 0.0)),
            *fronts.checks(log.fronts, self._slight.get("K", 0.0)),
            *probed.checks(log.probed, self._probes, {"K": self._slight.get("K", 0.0)}),
            *self._fluxes.checks(log.fluxes),
            *moved.checks(log.moved, self._probes, self._nothing),
            *displaced.checks(log.displaced, ranges, self._nothing.get("m", 0.0)),
            *mesh.checks(log.mesh),
            *self._peak_stress.checks(log.peak_stress, mesh.bears(log.mesh) if log.mesh.energy else
                                      dict.fromkeys(self._interface.bodies, True), self._nothing.get("Pa", 0.0)),
            *self._strains.checks(log.strains),
            *self._pressed.checks(log.contact_pressure, self._nothing.get("Pa", 0.0)),
            *self._ends.checks(log.contact_ends),
            *across.checks(log.across, log.temperatures.span),
            *rhythm.checks(log.rhythm, place(log.rhythm.node), self._interface.bodies),
            *passing.checks(log.passing, place(log.passing.node, log.passing.end), bool(self._interface.pairs),
                            self._prescribed, self._yields.remedy(log.passing.soft_pair)),
            *self._unpaired.checks(log.unpaired, place(log.unpaired.node, log.unpaired.end), self._prescribed),
            penetration.check(log.penetration, self._yields, self._prescribed),
            *(() if self._prescribed else facets.checks(log.facets, self._facets)),
            *self._askew.checks(log.askew),
            *self._stated_pressures.checks(log.stated),
            *self._round_gaps.checks(log.round_gaps),
            *equilibrium.checks(log.equilibrium),
            *self._motion.checks(log.motion),
            *energy.checks(log.energy),
            *self._placed.checks(log.skipped),
            *self._ways.checks(log.ways),
            *self._at_nodes,
            measured("heat balance", off, BALANCE,
                     what=f"a fraction of {off:.2g} of the heat moved is not accounted for",
                     remedy="Use a smaller thermal.tolerance"),
            *self._stored.checks(log.stored, log.temperatures.span),
            *delivered.checks(handed, totals),
            *delivered.left_checks(handed, left, totals),
            *solved.checks(log.solved),
            *instants.checks(log.instants, rules),
            *drives.checks(log.drives, self._driving),
            check_of_windows(log))
