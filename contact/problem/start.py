"""What a body has at time 0: one temperature, a function of place, or what another run left at its nodes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Tag

from contact.problem.curves import ANumber, FieldSum
from contact.problem.part import Entry, Part
from contact.problem.values import problem


class AtNodes(Part):
    """Values of every node, in interface.h5: what another run left there."""

    dataset: Annotated[Literal["start/T"], Entry("of interface.h5, a row a node")]


def without_time(value: FieldSum) -> FieldSum:
    """Refuse a sum that follows a signal: at the start there is no time.  Raises PydanticCustomError."""
    for i, term in enumerate(value.terms):
        # fault: the course of a start is taken at time 0 in silence -> if False: | coupler/test_starts
        if not isinstance(term.t, float):
            raise problem("a start has no course in time", "Write a number for t.", at=("terms", i, "t"))
    return value


def _form(value: Any) -> str:
    if isinstance(value, AtNodes) or (isinstance(value, Mapping) and "dataset" in value):
        return "<nodes>"
    return "<terms>" if isinstance(value, Mapping | FieldSum) else "<number>"


ASum = Annotated[FieldSum, AfterValidator(without_time), Tag("<terms>")]
StartSpec = Annotated[ANumber | ASum | Annotated[AtNodes, Tag("<nodes>")], Discriminator(_form)]
