"""What a results file says of its run before the first window: the scenario, the halves, the plan, the machine."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from coupler.control.plan import Plan
from coupler.record.keeper import versions
from coupler.scenario import Scenario

# Fields of the exchange that stand in every frame.
EXCHANGED = {"thermal": ["T"], "mechanical": ["u", "p", "gap"]}


def header_of(scenario: Scenario, plan: Plan, pictures: Mapping[str, Mapping[str, Sequence[str]]]) -> dict[str, Any]:
    """Plain values that travel as JSON.  pictures : half -> "point", "cell" -> its fields for pictures alone."""
    s, schedule = scenario, plan.schedule
    return {
        "title": s.title, "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "scenario": {"text": s.text, "hash": s.hash, "resolved": dict(s.resolved), "file": Path(s.file).name,
                     "overrides": {key: str(value) for key, value in s.overrides.items()}},
        "temperature_unit": s.temperature_unit, "geometry": s.geometry,
        "halves": {"thermal": s.thermal_half, "mechanical": s.mechanical_half},
        "coupling": {"scheme": plan.scheme.value, "end": s.coupling.end, "windows": len(schedule.bounds) - 1,
                     "kinks": [schedule.clock.seconds(k) for k in sorted(schedule.kinks)],
                     "substeps": dict(plan.substeps)},
        "bodies": list(s.interface.bodies), "pairs": [vars(p) for p in s.interface.pairs],
        "probes": {n: {"quantity": p.quantity, "unit": p.unit} for n, p in s.probes.items()},
        "fields": {role: {"point": [*EXCHANGED[role], *fields["point"]], "cell": list(fields["cell"])}
                   for role, fields in pictures.items()},
        "machine": platform.platform(), "versions": versions(),
    }
