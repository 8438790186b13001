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

from mechanical_fmu.elements import Cells
from mechanical_fmu.material import Moduli, thermoelastic_heat
from mechanical_fmu.system import System

Floats = NDArray[np.float64]


def log_dilatation(system: System, u: Floats) -> tuple[Floats, ...]:
    """ln theta of every cell at u : (n, 2) [m], (n_e,) for each kind."""
    return tuple(np.log(_volumes(cells, u) / cells.volume) for cells in system.volume.kinds)


def moved_heat(system: System, at: tuple[Floats, Floats], u_n: Floats, u: Floats) -> Floats:
    """(n_cells,) [J] -rate T V (ln theta - ln theta_n) of a step from u_n to u.  at : nodal T [K] and f_s (Drive)."""
    out = np.zeros(system.volume.n_cells)
    before, after = log_dilatation(system, u_n), log_dilatation(system, u)
    moduli, means = system.moduli(*at), system.volume.means(at[0])
    for i, (cells, m, mean) in enumerate(zip(system.volume.kinds, moduli, means, strict=True)):
        per_volume = thermoelastic_heat(system.spec.materials, system.spec.body_material[cells.body], mean, m.kappa,
                                        # fault: compression cools -> before[i] - after[i]) |
                                        #   mechanical_fmu/test_solution_methods
                                        after[i] - before[i])
        out[cells.number] = per_volume * cells.volume
    return out


def at_frozen_entropy(system: System, moduli: tuple[Moduli, ...], T: Floats, u_n: Floats) -> tuple[Moduli, ...]:
    """The moduli of a step in which no heat flows, from u_n : (n, 2) [m], at nodal temperatures T : (n_nodes,) [K]."""
    out, spec = [], system.spec
    means, before = system.volume.means(T), log_dilatation(system, u_n)
    for cells, m, mean, start in zip(system.volume.kinds, moduli, means, before, strict=True):
        material = spec.body_material[cells.body]
        heat = -thermoelastic_heat(spec.materials, material, mean, m.kappa, np.ones_like(mean))
        rho_c = np.empty_like(mean)
        for i in np.unique(material):
            c = spec.c[i]
            assert c is not None
            rho_c[material == i] = spec.rho[i] * c(mean[material == i])
        g = heat / rho_c
        slope = heat / (m.kappa * mean)  # de_th/dT
        # fault: frozen entropy no stiffer -> out.append(replace(m, kappa=m.kappa, e_th=(m.e_th + slope * g * start) /
        #   (1.0 + slope * g))) | mechanical_fmu/test_solution_methods
        out.append(replace(m, kappa=m.kappa * (1.0 + slope * g), e_th=(m.e_th + slope * g * start) / (1.0 + slope * g)))
    return tuple(out)


def _volumes(cells: Cells, u: Floats) -> Floats:
    """v : (n_e,) [m3], the sum of weight det F over the points of each cell."""
    ue = u[cells.nodes]
    F = np.einsum("eai,eqaj->eqij", ue, cells.B) + np.eye(2)
    hoop = 1.0 + np.einsum("ea,eqa->eq", ue[:, :, 0], cells.N_over_R)
    J = (F[..., 0, 0] * F[..., 1, 1] - F[..., 0, 1] * F[..., 1, 0]) * hoop
    return np.asarray((cells.weight * J).sum(axis=1))
