"""What a scenario says of a body: its mesh, what it is made of, what it starts with and what heats it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePath
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from contact.problem.curves import ANumber, FieldSum
from contact.problem.part import Entry, Part
from contact.problem.start import ASum
from contact.problem.thermal import BodyHeat
from contact.problem.values import Name, NotNegative, Text, looks_like_number, problem
from coupler.scenario.mesh import Mesh


def _time_form(value: Any) -> str:
    return "<word>" if isinstance(value, str) and not looks_like_number(value) else "<number>"


class FromRun(Part):
    """What another run left, at a time."""

    path: Annotated[Text, Entry("results file of another run, relative to the scenario file", kind="path")] = Field(
        alias="from")
    t: Annotated[Annotated[NotNegative, Tag("<number>")] | Annotated[Literal["end"], Tag("<word>")],
                 Discriminator(_time_form),
                 Entry("when in that run, between its frames on a straight line; or its last frame", "s",
                       kind="number >= 0 or `end`")] = "end"
    body: Annotated[Name | None, Entry("the body there", kind="name", default="of the same name")] = None

    @model_validator(mode="after")
    def _has_a_path(self) -> FromRun:
        if not PurePath(self.path).name or "\0" in self.path:
            raise problem("not the path of a file", at=("from",))
        return self


def _start_form(value: Any) -> str:
    if isinstance(value, FromRun) or (isinstance(value, Mapping) and {"from", "path"} & value.keys()):
        return "<run>"
    return "<terms>" if isinstance(value, Mapping | FieldSum) else "<number>"


StatedStart = Annotated[ANumber | ASum | Annotated[FromRun, Tag("<run>")], Discriminator(_start_form)]


class MeshedBody(BodyHeat):
    """A body: its mesh, what it is made of, its temperature at the start and the heat made in it."""

    mesh: Annotated[Mesh, Entry("one of `rectangle`, `file`")]
    T0: Annotated[StatedStart, Entry("at time 0: a number, a sum of terms of x and y, or what another run left",  # type: ignore[assignment]
                                     "K", temperature=True, kind="number, terms or run")]
