"""What a scenario says of a body: its mesh, what it is made of, what it starts with and what heats it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from contact.problem.curves import ANumber, FieldSpec, FieldSum, PropertySpec
from contact.problem.part import Entry, Part, exactly_one
from contact.problem.start import ASum, path_given
from contact.problem.thermal import BodyHeat
from contact.problem.values import Name, NotNegative, Number, Positive, Text, looks_like_number
from coupler.scenario.mesh import Mesh


def _time_form(value: Any) -> str:
    return "<word>" if isinstance(value, str) and not looks_like_number(value) else "<number>"


class FromRun(Part):
    """What another run left, at a time."""

    path: Annotated[Text, Entry("results file of another run, relative to the scenario file", kind="path")] = Field(
        alias="from")
    t: Annotated[Annotated[NotNegative, Tag("<number>")] | Annotated[Literal["end"], Tag("<word>")],
                 Discriminator(_time_form),
                 Entry("time in that run, linear between its frames; `end`: its last frame", "s",
                       kind="number >= 0 or `end`")] = "end"
    body: Annotated[Name | None, Entry(
        "name of the body in that run",
        kind="name", default="of the same name")] = None

    @model_validator(mode="after")
    def _has_a_path(self) -> FromRun:
        return path_given(self)


def _start_form(value: Any) -> str:
    if isinstance(value, FromRun) or (isinstance(value, Mapping) and {"from", "path"} & value.keys()):
        return "<run>"
    return "<terms>" if isinstance(value, Mapping | FieldSum) else "<number>"


StatedStart = Annotated[ANumber | ASum | Annotated[FromRun, Tag("<run>")], Discriminator(_start_form)]


class Block(Part):
    """A rectangle of the cells of a rectangle; its sides lie on lines of the mesh."""

    origin: Annotated[tuple[Number, Number], Entry("lower left corner", unit="m")]
    size: Annotated[tuple[Positive, Positive], Entry(
        "lengths of its sides; they must lie on lines of the mesh", unit="m")]


class Region(Part):
    """Cells of a body that differ from the rest of it; what is left out is the body's."""

    group: Annotated[Text | None, Entry("named group of cells of a mesh file (gmsh: physical surface); or",
                                        default="one of the two")] = None
    rectangle: Annotated[Block | None, Entry("cells of a rectangle", default="one of the two", kind="mapping")] = None
    material: Annotated[Name | None, Entry("what it is made of", kind="name", default="the body's")] = None
    T0: Annotated[StatedStart | None, Entry("at time 0", "K", temperature=True, kind="number, terms or run",
                                            default="the body's")] = None
    Q_T: Annotated[FieldSpec | None, Entry("heat source per current volume", "W/m3", default="the body's")] = None
    Q_T_factor: Annotated[PropertySpec | None, Entry("multiplies `Q_T`, at the local temperature",
                                                     default="the body's")] = None

    @model_validator(mode="after")
    def _one_place(self) -> Region:
        exactly_one(self, ("group", "rectangle"))
        return self


class MeshedBody(BodyHeat):
    """A body: its mesh, what it is made of, its temperature at the start and the heat made in it."""

    mesh: Annotated[Mesh, Entry("one of `rectangle`, `file`")]
    T0: Annotated[StatedStart, Entry(  # type: ignore[assignment]
        "at time 0: a number, a sum of terms of x and y, or what another run left",
        "K", temperature=True, kind="number, terms or run")]
    u0: Annotated[FromRun | None, Entry(
        "state of another run at time 0: displacements, plastic and creep strain, history of contact "
        "(half `elastic`)", kind="run",
        default="as drawn")] = None
    regions: Annotated[dict[Name, Region] | None, Entry(
        "cells with a material, a start or a source of their own; entries below", kind="name -> region",
        default="none")] = None  # type: ignore[assignment]

    @property
    def parts(self) -> dict[str, MeshedBody]:
        """What has a material, a start and a source: "" the body itself, then each region, in full, as if a body."""
        found = {"": self}
        for name, region in (self.regions or {}).items():
            given = {key: value for key in ("material", "T0", "Q_T", "Q_T_factor")
                     if (value := getattr(region, key)) is not None}
            found[name] = self.changed(**given)
        return found
