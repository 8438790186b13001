"""The part of the schema that says what there is: bodies, meshes, contact pairs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePath
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, StrictBool, model_validator

from contact.laws import parse_law
from coupler.scenario.base import Part, PropertySpec, SignalSpec, exactly_one
from coupler.scenario.quantity import Name, NotNegative, Number, Positive, Text, Whole, number, problem
from coupler.scenario.schema_field import FieldSpec
from coupler.scenario.schema_thermal import NearRadiation

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


ABOVE_ZERO = 1e4  # more than any temperature of a file is below 0
LAW_WORDS = ("law", "variable")  # the keys of a law that hold a word; all others hold numbers


def _law(value: Any) -> Mapping[str, Any] | None:
    """A contact law, checked by the one who evaluates it.  None: no heat crosses."""
    if value is None:
        return None
    if not isinstance(value, Mapping):
        raise problem("a contact law is needed here, or null where no heat crosses",
                      "For example {law: constant, h: 2000}.")
    _numbers_only(value, ())
    try:
        parse_law(_in_kelvin(value))
    except ValueError as exc:
        raise problem(str(exc)) from exc
    return dict(value)


def _in_kelvin(law: Mapping[str, Any]) -> dict[str, Any]:
    """A law as it may look in kelvin: below zero degC is no error; what is below 0 K is found at conversion."""
    inner = {key: [_in_kelvin(v) if isinstance(v, Mapping) else v for v in value] if key == "of"
             and isinstance(value, list) else value for key, value in law.items()}
    if inner.get("variable") == "T" and isinstance(inner.get("x"), list):
        inner["x"] = [T + ABOVE_ZERO if isinstance(T, int | float) else T for T in inner["x"]]
    return inner


def _numbers_only(value: Any, at: tuple[str | int, ...]) -> None:
    """Refuse text and NaN in a law before its own check, with the same help as everywhere."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            if key not in LAW_WORDS:
                _numbers_only(inner, (*at, key))
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            _numbers_only(inner, (*at, i))
    else:
        try:
            number(value)
        except problem_type as exc:
            context = exc.context or {}
            raise problem(context["text"], context["remedy"], at=at) from None


problem_type = type(problem(""))
Law = Annotated[dict[str, Any] | None, BeforeValidator(_law)]


class Conduction(Part):
    """h_CI touching and apart [W/m2K]; both must be said, null where no heat crosses; factors are signals."""

    closed: Law
    open: Law
    closed_factor: SignalSpec = 1.0
    open_factor: SignalSpec = 1.0

    @model_validator(mode="after")
    def _factors_have_laws(self) -> Conduction:
        for key in ("closed", "open"):
            if getattr(self, key) is None and f"{key}_factor" in self.model_fields_set:
                raise problem(f"a factor without its law: {key} is null", at=(f"{key}_factor",))
        return self


class ContactPair(Part):
    """slave, master: surfaces "body.surface"; gap_max [m]; penalty [Pa/m] or auto (E/h).

    friction_share : of the friction heat that enters the slave; by effusivity where it is not stated.
    """

    slave: Text
    master: Text
    gap_max: Positive
    penalty: Positive | Literal["auto"] = "auto"
    conduction: Conduction | None = None
    radiation: NearRadiation | None = None
    friction_share: NotNegative | None = None

    @model_validator(mode="after")
    def _share_of_a_whole(self) -> ContactPair:
        if self.friction_share is not None and self.friction_share > 1.0:
            raise problem("a share lies between 0 and 1", at=("friction_share",))
        return self
