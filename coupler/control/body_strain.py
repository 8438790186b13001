"""Elastic strain body by body: the root mean square over the volume of a body, by which errors of windows are measured.

Stress may change while nothing moves and no temperature changes: it relaxes by creep, or goes from one place of a body
to another.  No other quantity of a window shows that.  Strain and not stress, because it is of one size in stiff and
in soft bodies; a mean over the volume and not the largest, because at a sharp corner the largest has no bound, and
would ask for windows as short as that corner relaxes in.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.scenario.probes import cell_volumes
from coupler.schemes.state import ELASTIC_STRAIN

Array = NDArray[np.float64]
# Shear counts twice, as 12 and as 21.
COMPONENTS = np.sqrt([1.0, 1.0, 2.0, 1.0])


@dataclass(frozen=True)
class BodyCells:
    """rows : body -> its cells.  weights : body -> (n,) root of the share of its volume that each of them has [1]."""

    rows: dict[str, NDArray[np.intp]]
    weights: dict[str, Array]

    @property
    def names(self) -> tuple[str, ...]:
        """What the errors of elastic strain are called, a name a body."""
        return tuple(f"{ELASTIC_STRAIN}.{body}" for body in self.rows)

    def weighted(self, name: str, strain: Array) -> Array:
        """Return the strain of a body, (n, 4) [1], so that its norm is the root mean square over the body's volume.

        name : one of `names`.  strain : (n_cells, 4) 11, 22, 12, 33 [1] of all cells.
        """
        body = name.removeprefix(f"{ELASTIC_STRAIN}.")
        # fault: each cell counts as much, whatever its volume -> return np.asarray(strain[self.rows[body]] * COMPONENTS
        #   / np.sqrt(len(self.rows[body]))) | coupler/test_estimate_strain
        return np.asarray(strain[self.rows[body]] * COMPONENTS * self.weights[body][:, None])


def body_cells(interface: Interface) -> BodyCells:
    """Return the cells of each body of a mesh."""
    owner = np.concatenate([interface.quad_body, interface.triangle_body])
    volume = cell_volumes(interface)
    rows = {body: np.flatnonzero(owner == k) for k, body in enumerate(interface.bodies)}
    return BodyCells({b: r for b, r in rows.items() if r.size},
                     {b: np.sqrt(volume[r] / volume[r].sum()) for b, r in rows.items() if r.size})


NO_CELLS = BodyCells({}, {})
