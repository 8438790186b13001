"""The scenario file's `study`: a grid of runs, and what their errors are measured against (docs/study.md)."""

from __future__ import annotations

from typing import Any

from pydantic import Field, field_validator, model_validator

from coupler.scenario.base import Part
from coupler.scenario.options import Scheme
from coupler.scenario.quantity import DottedName, NotNegative, Number, Text, Whole, problem

Values = tuple[Any, ...]


class StudyReference(Part):
    """scheme, with windows `finer` times as fine as the finest of the grid, after `set`; or the answer in `file`.

    error : what the author of a file says of it, as the errors of the study are measured.
    """

    scheme: Scheme = Scheme.ITERATED
    finer: Whole = 4
    set: dict[Text, Any] = Field(default_factory=dict)
    file: Text | None = None
    error: NotNegative | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> StudyReference:
        if self.file is None and self.error is not None:
            raise problem("the error of a reference that is computed is measured", "Leave it out.", at=("error",))
        if self.file is not None and self.set:
            raise problem("a reference is either a file or computed, so there is nothing to set", at=("set",))
        return self


class Study(Part):
    """grid : axis -> values, every combination is run; several grids are put on one chart.

    measure : probes (default: all that change).  span : [from, until], s (default: all of the run).
    """

    grid: tuple[dict[Text, Values], ...] = ()
    measure: tuple[DottedName, ...] = ()
    span: tuple[Number, Number] | None = None
    reference: StudyReference = StudyReference()

    @field_validator("grid", mode="before")
    @classmethod
    def _one_or_several(cls, value: Any) -> Any:
        grids = [value] if isinstance(value, dict) else value
        if not isinstance(grids, list | tuple) or not all(isinstance(g, dict) for g in grids):
            raise problem("a grid is a mapping of axes, or a list of such",
                          "For example {scheme: [staggered, iterated]}.")
        for k, grid in enumerate(grids):
            for axis, values in grid.items():
                place = (axis,) if isinstance(value, dict) else (k, axis)
                if not isinstance(values, list | tuple) or not values:
                    raise problem("an axis is a list of values", "Write [a, b, ...].", at=place)
        return tuple(grids)

    @model_validator(mode="after")
    def _in_order(self) -> Study:
        if self.span is not None and self.span[1] <= self.span[0]:
            raise problem("the span ends before it begins", at=("span",))
        return self
