"""The error of one window, from what is known without solving it again.

First version, for the border: nothing is known yet, so no window is rejected for its error.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from coupler.tolerance import ErrorTolerances
from coupler.window import CoupledState, Solved, Span


@dataclass(frozen=True)
class Memory:
    """What past windows told."""


@dataclass(frozen=True)
class Estimate:
    """shares : quantity (temperature, gap, heat, displacement) -> error in tolerances; splitting, own : its two parts,
    from the exchange and from the halves' own steps.  order : the power of H with which the local error goes down,
    less one."""

    shares: Mapping[str, float]
    splitting: Mapping[str, float]
    own: Mapping[str, float]
    order: int = 2

    @property
    def error(self) -> float:
        """The largest share: the window is good where this is at most 1."""
        return max(self.shares.values(), default=0.0)

    @property
    def words(self) -> str:
        """The quantity that is worst, and by how much."""
        worst = max(self.shares, key=lambda n: self.shares[n])
        return f"error of {worst} is {self.shares[worst]:.3g} tolerances"


def estimate(memory: Memory, start: CoupledState, solved: Solved, span: Span,
             tolerance: ErrorTolerances) -> Estimate | None:
    """The error of a window from its start and outcome; None where nothing is known yet."""
    return None


def after(memory: Memory, start: CoupledState, solved: Solved, span: Span, found: Estimate | None) -> Memory:
    """The memory after a window that was taken."""
    return memory


def forgotten(memory: Memory) -> Memory:
    """The memory past a kink or an event."""
    return Memory()
