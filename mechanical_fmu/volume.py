"""Internal forces, tangent entries and stress of whole meshes: the compiled loops over every kind of cell."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mechanical_fmu.cells import Cells
from mechanical_fmu.elastic_loop import cell_forces, cell_stress, cell_stress_sizes
from mechanical_fmu.laws.law import has_skew_tangent
from mechanical_fmu.material import Moduli
from mechanical_fmu.point import CODES
from mechanical_fmu.point_loop import INVERTED, NO_MODES, Out, cell_points
from mechanical_fmu.strain import NO_THICKNESS, CellMaterials

Floats = NDArray[np.float64]

REASONS = {**CODES, NO_THICKNESS: "no thickness makes the stress through it vanish",
           NO_MODES: "the modes of enhanced strain do not settle"}


class CellError(ArithmeticError):
    """A cell that cannot be computed.  cell : number in interface order, 0-based.  body : index.  why : in words."""

    def __init__(self, cell: int, body: int, why: str) -> None:
        super().__init__(f"cell {cell + 1}: {why}")
        self.cell, self.body, self.why = cell, body, why


class CellInversionError(CellError):
    """A cell has been turned inside out."""

    def __init__(self, cell: int, body: int) -> None:
        super().__init__(cell, body, "turned inside out")


@dataclass(frozen=True)
class PointStep:
    """What points remember.  dt : [s] since history : (n_history,), that of an Internal; empty for virgin points."""

    dt: float = 0.0
    history: Floats = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True)
class Internal:
    """What the cells do at a trial displacement.

    f : (n_nodes, 2) [N].  entries : of its derivative, flat, blocks in the order of kinds, or None.
    history : (n_history,) at the end of the step.  heat : (n_cells,) [J] made in it, in interface order; empty where
    nothing can make any.
    """

    f: Floats
    entries: Floats | None
    history: Floats
    heat: Floats


@dataclass(frozen=True)
class DeformableMesh:
    """The deformable mesh.  n_nodes : nodes of the interface."""

    kinds: tuple[Cells, ...]
    n_nodes: int
    all_cells: int = 0

    @property
    def n_cells(self) -> int:
        """Count the cells of the mesh, those of rigid bodies (in no kind) too."""
        return self.all_cells or sum(len(cells.nodes) for cells in self.kinds)

    @property
    def elastic(self) -> bool:
        """Say whether forces follow from u and the temperature alone, without history."""
        return all(cells.fast for cells in self.kinds)

    @property
    def makes_heat(self) -> bool:
        """Say whether some point is inelastic."""
        return any(cells.treatment.kind for cells in self.kinds)

    @property
    def skew(self) -> bool:
        """Say whether the tangent of some point is not symmetric."""
        return any(has_skew_tangent(cells.treatment.kind) for cells in self.kinds)

    @property
    def tells_stress(self) -> bool:
        """Say whether stress is known beside forces."""
        return True

    def start_history(self) -> Floats:
        """Return (n_history,) of virgin points."""
        return np.zeros(sum(len(cells.nodes) * cells.n_row for cells in self.kinds))

    def _history(self, step: PointStep) -> Floats:
        return step.history if step.history.size else self.start_history()

    def means(self, nodal: Floats) -> tuple[Floats, ...]:
        """Compute the volume mean of nodal : (n_nodes,), any unit, in every cell: (n_e,) for each kind, same unit."""
        return tuple(np.einsum("ea,ea->e", cells.mean, nodal[cells.nodes]) for cells in self.kinds)

    def evaluate(self, u: Floats, moduli: tuple[Moduli, ...], step: PointStep, tangent: bool = False) -> Internal:
        """Compute the forces at u : (n_nodes, 2) [m] and what goes with them.  step.history is read, never written.

        Raises CellInversionError, CellError.
        """
        f, start, at = np.zeros((self.n_nodes, 2)), 0, 0
        before = self._history(step)
        size = sum(len(c.nodes) * (2 * c.nodes.shape[1]) ** 2 for c in self.kinds) if tangent else 0
        entries, history = np.empty(size), np.empty_like(before)
        heat = np.zeros(self.n_cells if self.makes_heat else 0)
        for cells, m in zip(self.kinds, moduli, strict=True):
            n = 2 * cells.nodes.shape[1]
            stop = start + len(cells.nodes) * n * n if tangent else 0
            K = entries[start:stop].reshape(-1, n, n)
            start = stop
            if cells.fast:
                _loop(cells, m, u, tangent, f, K)
                continue
            rows = slice(at, at + len(cells.nodes) * cells.n_row)
            at = rows.stop
            now = history[rows].reshape(len(cells.nodes), -1)
            made = np.zeros(len(cells.nodes))
            nothing = np.empty((0, 0, 0))
            _points(cells, m, u, step.dt, before[rows], Out(f, K, now, made, nothing, nothing))
            if heat.size:
                # fault: heat of mixed bodies out of order -> heat[: len(made)] = made |
                #   mechanical_fmu/test_elements_points
                heat[cells.number] = made
        return Internal(f, entries if tangent else None, history, heat)

    def forces(self, u: Floats, moduli: tuple[Moduli, ...]) -> Floats:
        """Compute f_int : (n_nodes, 2) [N] of bodies without a past.

        u : (n_nodes, 2) [m].  Raises CellInversionError.
        """
        return self.evaluate(u, moduli, PointStep()).f

    def tangent(self, u: Floats, moduli: tuple[Moduli, ...]) -> tuple[Floats, Floats]:
        """Compute f_int of bodies without a past and the entries of its derivative.

        u : (n_nodes, 2) [m].  f_int : (n_nodes, 2) [N].  entries : (n_entries,) [N/m], flat, in the order of kinds.
        Raises CellInversionError, CellError.
        """
        found = self.evaluate(u, moduli, PointStep(), tangent=True)
        assert found.entries is not None
        return found.f, found.entries

    def stress(self, u: Floats, moduli: tuple[Moduli, ...], step: PointStep = PointStep()
               ) -> tuple[tuple[Floats, Floats], ...]:
        """Compute (stress, strain) of every kind at u : (n_nodes, 2) [m].

        Each is (n_e, nq, 4), components (11, 22, 12, 33): Cauchy stress [Pa] and Green-Lagrange strain [1].
        step : the one that ended at u.
        """
        out, at = [], 0
        before = self._history(step)
        for cells, m in zip(self.kinds, moduli, strict=True):
            stress, strain = np.empty((*cells.weight.shape, 4)), np.empty((*cells.weight.shape, 4))
            if cells.fast:
                cell_stress(cells.nodes, cells.B, cells.N_over_R, cells.weight, cells.volume, m.mu, m.kappa,
                            m.e_th[:, 0], u, stress, strain)
            else:
                rows = slice(at, at + len(cells.nodes) * cells.n_row)
                at = rows.stop
                unused = np.empty((len(cells.nodes), cells.n_row))
                _points(cells, m, u, step.dt, before[rows],
                        Out(np.zeros_like(u), np.empty((0, 0, 0)), unused, np.empty(len(unused)), stress, strain))
            out.append((stress, strain))
        return tuple(out)

    def stress_sizes(self, u: Floats, moduli: tuple[Moduli, ...]) -> tuple[Floats, Floats]:
        """Compute cell means of the von Mises stress and of the stress 33, (n_cells,) [Pa], of bodies without a past.

        u : (n_nodes, 2) [m].  0 in rigid bodies.  As `stress` says, in less than half of its time.
        """
        sigma_v, hoop = np.zeros(self.n_cells), np.zeros(self.n_cells)
        for cells, m in zip(self.kinds, moduli, strict=True):
            of, around = np.empty(len(cells.nodes)), np.empty(len(cells.nodes))
            cell_stress_sizes(cells.nodes, cells.B, cells.N_over_R, cells.weight, cells.volume, m.mu, m.kappa,
                              m.e_th[:, 0], u, of, around)
            sigma_v[cells.number], hoop[cells.number] = of, around
        return sigma_v, hoop


def _loop(cells: Cells, m: Moduli, u: Floats, tangent: bool, f: Floats, K: Floats) -> None:
    bad = cell_forces(cells.nodes, cells.B, cells.N_over_R, cells.weight, cells.volume, m.mu, m.kappa, m.e_th[:, 0], u,
                      tangent, f, K, tuple(range(cells.nodes.shape[1])))
    if bad >= 0:
        raise CellInversionError(int(cells.number[bad]), int(cells.body[bad]))


def _points(cells: Cells, m: Moduli, u: Floats, dt: float, before: Floats, out: Out) -> None:
    how = cells.treatment
    e_th = np.ascontiguousarray(np.broadcast_to(m.e_th, cells.weight.shape))
    law = CellMaterials(how.kind, how.plane_stress, not (how.plane_stress or how.enhanced), m.mu, m.kappa, e_th, m.p,
                        m.tables, dt)
    # A private copy: a history from a saved state is read-only, and the loop is compiled for arrays that are not.
    history_n = np.array(before, dtype=np.float64).reshape(len(cells.nodes), -1)
    bad, code = cell_points(cells.shape, law, u, history_n, out)
    if bad >= 0:
        where = int(cells.number[bad]), int(cells.body[bad])
        raise CellInversionError(*where) if code == INVERTED else CellError(*where, REASONS[code])


def von_mises(stress: Floats) -> Floats:
    """Compute the von Mises stress [Pa] of stress : (..., 4) [Pa] = (11, 22, 12, 33); the result is (...,)."""
    s11, s22, s12, s33 = np.moveaxis(stress, -1, 0)
    squares = (s11 - s22) ** 2 + (s22 - s33) ** 2 + (s33 - s11) ** 2
    return np.sqrt(0.5 * squares + 3.0 * s12**2)
