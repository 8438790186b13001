"""What was measured so far of all checks, as one value; and of windows that were taken though they are not exact."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from coupler.trust.checks import Check, measured
from coupler.trust.in_space import (
    across,
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
from coupler.trust.laws import energy, equilibrium, solved, stored, tables, temperatures
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

# Errors of windows add up, and each may be one tolerance: what was taken above it may be this part of all of them.
OVER = 0.1


@dataclass(frozen=True)
class TrustLog:
    """What was measured so far.

    forced : windows taken though they did not converge or their error was too large, of `windows`; the last ended at
    forced_t [s].  over : the sum of those errors, in tolerances.  unconverged : those of them that did not converge.
    """

    temperatures: temperatures.TemperatureLog = field(default_factory=temperatures.TemperatureLog)
    rhythm: rhythm.RhythmLog = field(default_factory=rhythm.RhythmLog)
    passing: passing.PassingLog = field(default_factory=passing.PassingLog)
    unpaired: unpaired.UnpairedLog = field(default_factory=unpaired.UnpairedLog)
    penetration: penetration.PenetrationLog = field(default_factory=penetration.PenetrationLog)
    facets: facets.FacetLog = field(default_factory=facets.FacetLog)
    askew: askew.AskewLog = field(default_factory=askew.AskewLog)
    stated: stated.StatedLog = field(default_factory=stated.StatedLog)
    round_gaps: round_gaps.RoundGapLog = field(default_factory=round_gaps.RoundGapLog)
    errors: errors.ErrorLog = field(default_factory=errors.ErrorLog)
    stability: stability.StabilityLog = field(default_factory=stability.StabilityLog)
    steady: steady.SteadyLog = field(default_factory=steady.SteadyLog)
    shapes: carried.CarriedLog = field(default_factory=carried.CarriedLog)
    carried: carried.CarriedLog = field(default_factory=carried.CarriedLog)
    equilibrium: equilibrium.EquilibriumLog = field(default_factory=equilibrium.EquilibriumLog)
    tables: tables.TableLog = field(default_factory=tables.TableLog)
    pressures: pressures.PressureLog = field(default_factory=pressures.PressureLog)
    gap_tables: gap_tables.GapLog = field(default_factory=gap_tables.GapLog)
    across: across.AcrossLog = field(default_factory=across.AcrossLog)
    mesh: mesh.MeshLog = field(default_factory=mesh.MeshLog)
    peak_stress: peak_stress.PeakLog = field(default_factory=peak_stress.PeakLog)
    strains: cell_probes.CellLog = field(default_factory=cell_probes.CellLog)
    fluxes: cell_probes.CellLog = field(default_factory=cell_probes.CellLog)
    contact_pressure: contact_pressure.PressureLog = field(default_factory=contact_pressure.PressureLog)
    contact_ends: contact_ends.EndLog = field(default_factory=contact_ends.EndLog)
    heat_mesh: heat_mesh.HeatMeshLog = field(default_factory=heat_mesh.HeatMeshLog)
    extremes: extremes.ExtremesLog = field(default_factory=extremes.ExtremesLog)
    fronts: fronts.FrontLog = field(default_factory=fronts.FrontLog)
    probed: probed.ProbedLog = field(default_factory=probed.ProbedLog)
    moved: moved.MovedLog = field(default_factory=moved.MovedLog)
    displaced: displaced.DisplacedLog = field(default_factory=displaced.DisplacedLog)
    stored: stored.StoredLog = field(default_factory=stored.StoredLog)
    solved: solved.SolvedLog = field(default_factory=solved.SolvedLog)
    motion: motion.MotionLog = field(default_factory=motion.MotionLog)
    energy: energy.EnergyLog = field(default_factory=energy.EnergyLog)
    instants: instants.InstantLog = field(default_factory=instants.InstantLog)
    drives: drives.DriveLog = field(default_factory=drives.DriveLog)
    skipped: skipped.SkippedLog = field(default_factory=skipped.SkippedLog)
    ways: ways.WaysLog = field(default_factory=ways.WaysLog)
    windows: int = 0
    forced: int = 0
    forced_t: float = 0.0
    over: float = 0.0
    unconverged: int = 0


def taken(log: TrustLog, forced: float, t: float) -> TrustLog:
    """Return the log after one more window that ended at t [s].

    forced : its error in tolerances, where it was taken although that is too large; inf: although it did not
    converge; else 0.
    """
    log = replace(log, windows=log.windows + 1)
    if not forced:
        return log
    known = math.isfinite(forced)
    return replace(log, forced=log.forced + 1, forced_t=t, over=log.over + (forced if known else 0.0),
                   unconverged=log.unconverged + (not known))


def check_of_windows(log: TrustLog) -> Check:
    """Return the row on windows that were taken though their error is too large or they did not converge."""
    # fault: a window a hair above its tolerance makes a run one not to trust -> over = 0.0 | coupler/test_trust
    over = OVER * log.windows
    return measured("windows solved to their tolerance", log.over + log.unconverged * log.windows,
                    (0.0, over), unit="tolerances", t=log.forced_t,
                    what=f"{log.forced} of {log.windows} windows were accepted although they did not converge or "
                         f"their error was too large, the last at t = {log.forced_t:.6g} s",
                    remedy="Use smaller windows (a smaller coupling.adaptive.tolerance or coupling.adaptive.least), "
                           "or iteration.on_max: retry_smaller where it is accept")
