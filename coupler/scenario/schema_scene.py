"""The part of the schema that says what there is: bodies and their meshes."""

from __future__ import annotations

from pathlib import PurePath
from typing import Literal

from pydantic import StrictBool, model_validator

from coupler.scenario.base import Part, PropertySpec, exactly_one
from coupler.scenario.quantity import Name, Number, Positive, Text, Whole, problem
from coupler.scenario.schema_field import FieldSpec

MAX_CELLS = 4_000_000


class Rectangle(Part):
    """origin, size [m]; cells along x and y; grading: last cell's size over the first's, along x and y."""

    origin: tuple[Number, Number]
    size: tuple[Positive, Positive]
    cells: tuple[Whole, Whole]
    grading: tuple[Positive, Positive] = (1.0, 1.0)
    triangles: StrictBool = False

    @model_validator(mode="after")
    def _not_too_many(self) -> Rectangle:
        if self.cells[0] * self.cells[1] > MAX_CELLS:
            raise problem(f"more than {MAX_CELLS} cells in one body", at=("cells",))
        return self


class MeshFile(Part):
    """A mesh file; path relative to the scenario; unit of its coordinates; region: a group of cells."""

    path: Text
    unit: Literal["m", "cm", "mm", "um"] = "m"
    region: Text | None = None

    @model_validator(mode="after")
    def _has_a_path(self) -> MeshFile:
        if not PurePath(self.path).name or "\0" in self.path:
            raise problem("not the path of a file", at=("path",))
        return self


class Mesh(Part):
    """Exactly one way to mesh a body."""

    rectangle: Rectangle | None = None
    file: MeshFile | None = None

    @model_validator(mode="after")
    def _one_way(self) -> Mesh:
        exactly_one(self, ("rectangle", "file"))
        return self


class Body(Part):
    """T0 in the scenario's unit of temperature; Q_T [W/m3] of current volume, times its factor over temperature."""

    mesh: Mesh
    material: Name
    T0: Number
    Q_T: FieldSpec = 0.0
    Q_T_factor: PropertySpec | None = None

    @model_validator(mode="after")
    def _factor_has_a_source(self) -> Body:
        if self.Q_T_factor is not None and "Q_T" not in self.model_fields_set:
            raise problem("a factor without its source: Q_T is missing", at=("Q_T_factor",))
        return self
