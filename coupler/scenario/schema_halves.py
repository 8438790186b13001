"""The part of the schema that says what the mechanical half solves, and where conditions of either half stand."""

from __future__ import annotations

from typing import Any

from pydantic import Field, model_validator

from coupler.scenario.base import Part, SignalSpec, exactly_one
from coupler.scenario.quantity import Name, Positive, Text, problem


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


class ElasticBoundary(Supported):
    """u_x, u_y [m] (one or both), or pressure [Pa], positive pushes on the body and follows it."""

    u_x: SignalSpec | None = None
    u_y: SignalSpec | None = None
    pressure: SignalSpec | None = None

    @model_validator(mode="after")
    def _one_condition(self) -> ElasticBoundary:
        exactly_one(self, ("on", "at"))
        held = [key for key in ("u_x", "u_y") if getattr(self, key) is not None]
        if bool(held) == (self.pressure is not None):
            raise problem("either displacements (u_x, u_y) or a pressure is needed")
        if self.pressure is not None:
            self.only_on("pressure")
        if len(held) == 2 and self.name is not None:
            raise problem("a name stands for one factor, but both u_x and u_y are given",
                          "Write two entries with a name each.", at=("name",))
        return self


class Motion(Part):
    """Displacement of a rigid body [m]."""

    u_x: SignalSpec = 0.0
    u_y: SignalSpec = 0.0


class Elastic(Part):
    """The half `elastic`.  tolerance: of the force balance, relative."""

    tolerance: Positive = 1e-8
    boundary: tuple[ElasticBoundary, ...] = ()


class Rigid(Part):
    """The half `rigid`: bodies not named stay; pressure [Pa] of a pair where it touches."""

    motion: dict[Name, Motion] = Field(default_factory=dict)
    pressure: dict[Name, SignalSpec] = Field(default_factory=dict)


class Mechanical(Part):
    """half: kind; the settings of the kinds not chosen stay in the file, so that a swap is one word."""

    half: Text
    elastic: Elastic | None = None
    rigid: Rigid | None = None
    options: dict[str, Any] = Field(default_factory=dict)
