"""What a body has at time 0: one temperature, a function of place, or what another run left; and over time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePath
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from contact.problem.curves import ANumber, ASignalName, ASignalTable, FieldSum, field_form
from contact.problem.part import Entry, Part
from contact.problem.values import Name, Number, Text, problem


class FromFrames(Part):
    """The temperatures of a body in all frames of another run, on straight lines between them."""

    path: Annotated[Text, Entry("results file of another run, relative to the scenario file", kind="path")] = Field(
        alias="from")
    body: Annotated[Name | None, Entry(
        "name of the body in that run",
        kind="name", default="of the same name")] = None

    @model_validator(mode="after")
    def _has_a_path(self) -> FromFrames:
        return path_given(self)


class Replay(Part):
    """What the half `replay` plays."""

    path: Annotated[Text, Entry(
        "results file of a run of this scene, relative to the scenario file: the half "
        "returns the values of its frames, linear in between", kind="path")] = Field(
        alias="from")

    @model_validator(mode="after")
    def _has_a_path(self) -> Replay:
        return path_given(self)


def path_given(part: Any) -> Any:
    """Refuse a `from` that names no file.  Raises PydanticCustomError."""
    if not PurePath(part.path).name or "\0" in part.path:
        raise problem("not the path of a file", at=("from",))
    return part


class Course(Part):
    """Temperatures of a body over time, in interface.h5: `t.BODY` (n_t,) and `T.BODY` (n_t, n), its nodes ascending."""

    dataset: Annotated[Text, Entry("of interface.h5, a row a time")]
    least: Annotated[Number, Entry("the lowest of them", "K")]
    most: Annotated[Number, Entry("the highest of them", "K")]


class AtNodes(Part):
    """Values of every node, in interface.h5: what another run left there."""

    dataset: Annotated[Literal["start/T"], Entry("of interface.h5, a row a node")]


def without_time(value: FieldSum) -> FieldSum:
    """Refuse a sum that follows a signal: at the start there is no time.  Raises PydanticCustomError."""
    for i, term in enumerate(value.terms):
        # fault: the course of a start is taken at time 0 in silence -> if False: |
        #   coupler/test_starts::test_what_cannot_begin_is_told_all_at_once
        if not isinstance(term.t, float):
            raise problem("a start has no course in time", "Write a number for t.", at=("terms", i, "t"))
    return value


def _form(value: Any) -> str:
    if isinstance(value, AtNodes) or (isinstance(value, Mapping) and "dataset" in value):
        return "<nodes>"
    return "<terms>" if isinstance(value, Mapping | FieldSum) else "<number>"


ASum = Annotated[FieldSum, AfterValidator(without_time), Tag("<terms>")]
StartSpec = Annotated[ANumber | ASum | Annotated[AtNodes, Tag("<nodes>")], Discriminator(_form)]


def _given_form(value: Any) -> str:
    if isinstance(value, FromFrames) or (isinstance(value, Mapping) and "from" in value):
        return "<run>"
    if isinstance(value, Course) or (isinstance(value, Mapping) and "dataset" in value):
        return "<course>"
    return field_form(value)


GivenSpec = Annotated[
    ANumber | ASignalName | ASignalTable | Annotated[FieldSum, Tag("<terms>")] | Annotated[FromFrames, Tag("<run>")]
    | Annotated[Course, Tag("<course>")], Discriminator(_given_form)]
