"""The scheme `auto`: the cheapest that is safe, window by window.

First version, for the border: it always iterates, which is safe and never cheap.
"""

from __future__ import annotations

from dataclasses import dataclass

from coupler.level import Scheme
from coupler.window import CoupledState, Solved


@dataclass(frozen=True)
class Memory:
    """What was measured of the exchange."""


@dataclass(frozen=True)
class Choice:
    """scheme : of the next window.  reason : in words."""

    scheme: Scheme
    reason: str


def choose(memory: Memory, state: CoupledState, H: float) -> Choice:
    """The scheme of a window of H seconds."""
    return Choice(Scheme.ITERATED, "iterated is always safe")


def learn(memory: Memory, start: CoupledState, solved: Solved, H: float) -> Memory:
    """The memory after a window was taken.  solved.scheme, solved.course : how it was solved."""
    return memory


def forgotten(memory: Memory) -> Memory:
    """The memory past a kink or an event."""
    return Memory()
