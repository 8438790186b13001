"""T rises by 1 K/s; every other field is a plain function of place and time, so that a test knows it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.model import Done, Link, Values, Variable


@dataclass(frozen=True)
class Age:
    """t [s]."""

    t: float


class FluxHalf:
    """The half.  Of `q_node`, `damage`, `contact.wear` it does not say what they are on."""

    def __init__(self, interface: Interface) -> None:
        self.interface = interface
        n, n_q = len(interface.nodes), len(interface.pair_nodes)
        self.n_cells = len(interface.quads) + len(interface.triangles)
        self.variables = (
            Variable("x", (n, 2), "input", "m", start=interface.nodes),
            Variable("contact.t_N", (n_q,), "input", "Pa"),
            Variable("T", (n,), "output", "K"),
            Variable("q_node", (n, 2), "output", "W/m2", description="heat flux at nodes"),
            Variable("damage", (self.n_cells,), "output", "1", description="damage of cells"),
            Variable("contact.wear", (n_q,), "output", "m", description="depth worn off"),
            Variable("stretch", (n, 4), "output", "1", description="a tensor", on="nodes"),
            Variable("lost", (len(interface.bodies),), "output", "J", on="bodies"),
            Variable("thrust", (2,), "output", "N", on="none"),
            Variable("clock", (), "output", "s"),
        )

    def start(self, inputs: Values, t: float, link: Link) -> tuple[Age, Mapping[str, Any]]:
        return Age(0.0), self._outputs(0.0)

    def step(self, state: Age, inputs: Values, t: float, h: float, link: Link) -> Done:
        return Done(Age(t + h), self._outputs(t + h))

    def _outputs(self, t: float) -> dict[str, Any]:
        X = self.interface.nodes
        return {"T": np.full(len(X), 300.0 + t), "q_node": flux(X, t), "damage": t * np.arange(self.n_cells),
                "contact.wear": wear(X[self.interface.pair_nodes], t), "stretch": stretch(X, t),
                "lost": t * (1.0 + np.arange(len(self.interface.bodies))), "thrust": np.array([t, -2.0 * t]),
                "clock": t}


def flux(X: NDArray[np.float64], t: float) -> NDArray[np.float64]:
    return (1.0 + t) * np.column_stack([X[:, 1], 10.0 * X[:, 0]])


def wear(X: NDArray[np.float64], t: float) -> NDArray[np.float64]:
    return 1e-6 * t * (1.0 + X[:, 0])


def stretch(X: NDArray[np.float64], t: float) -> NDArray[np.float64]:
    return np.column_stack([11.0 + X[:, 0], 22.0 + t + 0.0 * X[:, 0], 12.0 + X[:, 1], 33.0 + 0.0 * X[:, 0]])


def load(interface: Interface, model: Mapping[str, Any]) -> FluxHalf:
    """The half of a directory."""
    return FluxHalf(interface)
