"""The size of the next window from the error of the last ones.  First version, for the border: it stays as it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Memory:
    """What the controller remembers."""


@dataclass(frozen=True)
class Limits:
    """No window is planned shorter than least or longer than most [s]."""

    least: float
    most: float


def proposed(memory: Memory, H: float, error: float | None, order: int, limits: Limits) -> tuple[float, Memory]:
    """The next size [s] after a window of H was taken.  error : in tolerances, None where it is not known."""
    return min(max(H, limits.least), limits.most), memory


def rejected(H: float, error: float, order: int) -> float:
    """The size [s] to try after one of H had too large an error, in tolerances: always smaller."""
    return H * max(0.1, min(0.7, 0.9 * error ** (-1.0 / (order + 1))))


def forgotten(memory: Memory) -> Memory:
    """The memory past a kink or an event."""
    return Memory()
