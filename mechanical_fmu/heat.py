"""Heat the bodies make and heat they move by being squeezed.

ln theta is the dilatation of a cell, theta = v/V.  With rate = kappa de_th/dT (3 K alpha for small strain):
    thermoelastic heat of a step  E = -rate T V d(ln theta),   compression heats;
    at frozen entropy             T' = T - g (ln theta - ln theta_n),   g = rate T/(rho c),
so kappa (ln theta - e_th(T')) is linear in ln theta again: stiffer by 1 + g de_th/dT, and shifted.  Only the moduli of
the cells change.  What the thermal half must be told is E_S = -rate T V (ln theta_{n+1} - ln theta_n).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from contact.half.model import Value, Variable
from mechanical_fmu.cells import Cells
from mechanical_fmu.laws.law import CREEP, H_CREEP, H_PLASTIC, PLASTIC, history_size
from mechanical_fmu.material import Moduli, thermoelastic_heat
from mechanical_fmu.system import System
from mechanical_fmu.volume import PointStep

Floats = NDArray[np.float64]


def log_dilatation(system: System, u: Floats, history: Floats) -> tuple[Floats, ...]:
    """Compute ln theta [1] of every cell, (n_e,) for each kind.

    u : (n_nodes, 2) [m].  history : (n_history,) of points there, or (0,) of virgin ones.
    """
    rows, at, out = history if history.size else system.volume.start_history(), 0, []
    for cells in system.volume.kinds:
        size = len(cells.nodes) * cells.n_row
        out.append(np.log(_volumes(cells, u, rows[at : at + size]) / cells.volume))
        at += size
    return tuple(out)


def moved_heat(system: System, T: Floats, f_s: Floats, before: tuple[Floats, ...],
               after: tuple[Floats, ...]) -> Floats:
    """Compute (n_cells,) [J] -rate T V (ln theta - ln theta_n) of a step.

    T : (n_nodes,) [K], f_s : (n_nodes,) or (0,) as in a StepDrive.  before, after : ln theta as of log_dilatation.
    """
    out = np.zeros(system.volume.n_cells)
    moduli, means = system.moduli(T, f_s), system.volume.means(T)
    for i, (cells, m, mean) in enumerate(zip(system.volume.kinds, moduli, means, strict=True)):
        per_volume = thermoelastic_heat(system.spec.materials, system.spec.part_material[cells.part], mean, m.kappa,
                                        # fault: compression cools -> before[i] - after[i]) |
                                        #   mechanical_fmu/test_solution_methods
                                        after[i] - before[i])
        out[cells.number] = per_volume * cells.volume
    return out


def at_frozen_entropy(system: System, moduli: tuple[Moduli, ...], T: Floats,
                      before: tuple[Floats, ...]) -> tuple[Moduli, ...]:
    """Compute the moduli of a step in which no heat flows.

    T : (n_nodes,) [K] nodal temperatures.  before : ln theta at the start, as of log_dilatation.
    """
    out, spec = [], system.spec
    means = system.volume.means(T)
    for cells, m, mean, start in zip(system.volume.kinds, moduli, means, before, strict=True):
        material = spec.part_material[cells.part]
        heat = -thermoelastic_heat(spec.materials, material, mean, m.kappa, np.ones_like(mean))
        rho_c = np.empty_like(mean)
        for i in np.unique(material):
            c = spec.c[i]
            assert c is not None
            rho_c[material == i] = spec.rho[i] * c(mean[material == i])
        g = heat / rho_c
        slope = heat / (m.kappa * mean)  # de_th/dT
        stiffer, shifted = 1.0 + slope * g, (slope * g * start)[:, None]
        # fault: frozen entropy no stiffer -> out.append(replace(m, kappa=m.kappa, e_th=(m.e_th + shifted) /
        #   stiffer[:, None])) | mechanical_fmu/test_solution_methods
        out.append(replace(m, kappa=m.kappa * stiffer, e_th=(m.e_th + shifted) / stiffer[:, None]))
    return tuple(out)


def _volumes(cells: Cells, u: Floats, rows: Floats) -> Floats:
    """v : (n_e,) [m3], the sum of weight det F over the points of each cell.

    rows : (n_e n_row,) the part of the history that is theirs: in plane stress it ends in the ln F33 of each point.
    """
    ue = u[cells.nodes]
    F = np.einsum("eai,eqaj->eqij", ue, cells.B) + np.eye(2)
    hoop = 1.0 + np.einsum("ea,eqa->eq", ue[:, :, 0], cells.N_over_R)
    J = (F[..., 0, 0] * F[..., 1, 1] - F[..., 0, 1] * F[..., 1, 0]) * hoop
    if cells.treatment.plane_stress:
        # fault: a sheet in plane stress is as thick as it was -> pass | mechanical_fmu/test_solution_methods
        J *= np.exp(_points_of(cells, rows)[..., -1])
    return np.asarray((cells.weight * J).sum(axis=1))


# How far and how fast bodies have flown: the equivalent inelastic strain, as means over their reference volumes.

def flowing_bodies(system: System) -> tuple[int, ...]:
    """Find the bodies, by index, that can flow plastically or creep."""
    flows = [cells.body for cells in system.volume.kinds if _flows(cells)]
    return tuple(int(b) for b in np.unique(np.concatenate(flows))) if flows else ()


def flow_variables(system: System) -> tuple[Variable, ...]:
    """List the outputs `flow.<body>` [1] and `flow_rate.<body>` [1/s] of bodies that can flow, and those of cells."""
    names = [system.interface.bodies[b] for b in flowing_bodies(system)]
    of_cells = tuple(Variable(name, (system.volume.n_cells,), on="cells", description=f"{what}, cell mean")
                     for name, (law, _, what) in IN_CELLS.items() if _has(system, law))
    return (*of_cells,
            *(Variable(f"flow.{n}", description="equivalent inelastic strain, mean over the body") for n in names),
            *(Variable(f"flow_rate.{n}", unit="1/s", description="its mean rate in the substep") for n in names))


def flow_outputs(system: System, before: PointStep, history: Floats) -> dict[str, Value]:
    """Compute the outputs of flow_variables.

    before : the step's length and the history it began with.  history : (n_history,) at its end.
    flow = int e dV / int dV with e = int sqrt(2/3 de_in:de_in), plastic and creep.  What solidifies begins at 0 again.
    Where no time passed the rate is 0.
    """
    out: dict[str, Value] = {}
    bodies = flowing_bodies(system)
    if not bodies:
        return out
    out |= {name: _of_cells(system, history, number) for name, (law, number, _) in IN_CELLS.items()
            if _has(system, law)}
    now, then = _of_bodies(system, history), _of_bodies(system, before.history)
    for b in bodies:
        name = system.interface.bodies[b]
        out[f"flow.{name}"] = float(now[b])
        # fault: the flow of bodies is taken for its rate -> out[f"flow_rate.{name}"] = float(now[b]) / before.dt if
        #   before.dt > 0.0 else 0.0 | mechanical_fmu/test_flow_strain
        out[f"flow_rate.{name}"] = float(now[b] - then[b]) / before.dt if before.dt > 0.0 else 0.0
    return out


# Equivalent strains of cells: output -> law that makes it, its place in a point's history, in words.
IN_CELLS = {"peeq": (PLASTIC, H_PLASTIC, "equivalent plastic strain (PEEQ)"),
            "ceeq": (CREEP, H_CREEP, "equivalent creep strain (CEEQ)")}


def _has(system: System, law: int) -> bool:
    return any(cells.treatment.kind & law for cells in system.volume.kinds)


def _of_cells(system: System, history: Floats, number: int) -> Floats:
    """(n_cells,) means over the volume of what points have at a place of their history; 0 in cells that cannot flow."""
    out, at = np.zeros(system.volume.n_cells), 0
    for cells in system.volume.kinds:
        size = len(cells.nodes) * cells.n_row
        if _flows(cells):
            e = _points_of(cells, history[at : at + size])[..., number]
            out[cells.number] = (e * cells.weight).sum(axis=1) / cells.volume
        at += size
    return out


def _points_of(cells: Cells, rows: Floats) -> Floats:
    """(n_e, nq, width) what the points of cells remember, of their part of the history."""
    width = history_size(cells.treatment.kind) + cells.treatment.plane_stress
    return rows.reshape(len(cells.nodes), cells.n_row)[:, cells.n_modes :].reshape(*cells.weight.shape, width)


def _of_bodies(system: System, history: Floats) -> Floats:
    """(n_bodies,) means; 0 for bodies that cannot flow."""
    strain, volume = np.zeros(len(system.interface.bodies)), np.zeros(len(system.interface.bodies))
    at = 0
    for cells in system.volume.kinds:
        size = len(cells.nodes) * cells.n_row
        if _flows(cells) and history.size:
            points = _points_of(cells, history[at : at + size])
            # fault: the flow of bodies leaves creep out -> e = points[..., H_PLASTIC] | mechanical_fmu/test_flow_strain
            e = points[..., H_PLASTIC] + points[..., H_CREEP]
            np.add.at(strain, cells.body, (e * cells.weight).sum(axis=1))
            np.add.at(volume, cells.body, cells.volume)
        at += size
    return strain / np.where(volume > 0.0, volume, 1.0)


def _flows(cells: Cells) -> bool:
    return bool(cells.treatment.kind & (PLASTIC | CREEP))
