"""The part of the schema that says what boundary conditions of both halves stand on."""

from __future__ import annotations

from coupler.scenario.base import Part
from coupler.scenario.quantity import Name, Text, problem


class Supported(Part):
    """What a boundary condition stands on: a surface (on) or named points (at)."""

    on: Text | None = None
    at: Text | None = None
    name: Name | None = None

    @property
    def where(self) -> str:
        """The surface or node set."""
        return self.on if self.on is not None else str(self.at)

    def only_on(self, kind: str) -> None:
        """A flux through a point is not a number."""
        if self.on is None:
            raise problem(f"{kind} acts on a surface, not at points", "Use `on: body.surface`.", at=("at",))
