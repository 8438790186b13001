"""How far and how fast bodies have flown: the equivalent inelastic strain, as means over their reference volumes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.half.model import Value, Variable
from mechanical_fmu.elements import Cells
from mechanical_fmu.point_layout import CREEP, H_CREEP, H_PLASTIC, PLASTIC, history_size
from mechanical_fmu.system import System
from mechanical_fmu.volume import Step

Floats = NDArray[np.float64]


def flowing_bodies(system: System) -> tuple[int, ...]:
    """Bodies, by index, that can flow plastically or creep."""
    flows = [cells.body for cells in system.volume.kinds if _flows(cells)]
    return tuple(int(b) for b in np.unique(np.concatenate(flows))) if flows else ()


def flow_variables(system: System) -> tuple[Variable, ...]:
    """Outputs `flow.<body>` [1] and `flow_rate.<body>` [1/s] of bodies that can flow."""
    names = [system.interface.bodies[b] for b in flowing_bodies(system)]
    return (*(Variable(f"flow.{n}", description="equivalent inelastic strain, mean over the body") for n in names),
            *(Variable(f"flow_rate.{n}", unit="1/s", description="its mean rate in the substep") for n in names))


def flow_outputs(system: System, before: Step, history: Floats) -> dict[str, Value]:
    """The outputs of flow_variables.  before : the step's length and the history it began with; history : at its end.

    flow = int e dV / int dV with e = int sqrt(2/3 de_in:de_in), plastic and creep.  What solidifies begins at 0 again.
    Where no time passed the rate is 0.
    """
    out: dict[str, Value] = {}
    bodies = flowing_bodies(system)
    if not bodies:
        return out
    now, then = _of_bodies(system, history), _of_bodies(system, before.history)
    for b in bodies:
        name = system.interface.bodies[b]
        out[f"flow.{name}"] = float(now[b])
        # fault: the flow of bodies is taken for its rate -> out[f"flow_rate.{name}"] = float(now[b]) / before.dt if
        #   before.dt > 0.0 else 0.0 | mechanical_fmu/test_flow_strain
        out[f"flow_rate.{name}"] = float(now[b] - then[b]) / before.dt if before.dt > 0.0 else 0.0
    return out


def _of_bodies(system: System, history: Floats) -> Floats:
    """(n_bodies,) means; 0 for bodies that cannot flow."""
    strain, volume = np.zeros(len(system.interface.bodies)), np.zeros(len(system.interface.bodies))
    at = 0
    for cells in system.volume.kinds:
        size = len(cells.nodes) * cells.n_row
        if _flows(cells) and history.size:
            rows = history[at : at + size].reshape(len(cells.nodes), cells.n_row)[:, cells.n_modes :]
            width = history_size(cells.treatment.kind) + cells.treatment.plane_stress
            points = rows.reshape(*cells.weight.shape, width)
            # fault: the flow of bodies leaves creep out -> e = points[..., H_PLASTIC] | mechanical_fmu/test_flow_strain
            e = points[..., H_PLASTIC] + points[..., H_CREEP]
            np.add.at(strain, cells.body, (e * cells.weight).sum(axis=1))
            np.add.at(volume, cells.body, cells.volume)
        at += size
    return strain / np.where(volume > 0.0, volume, 1.0)


def _flows(cells: Cells) -> bool:
    return bool(cells.treatment.kind & (PLASTIC | CREEP))
