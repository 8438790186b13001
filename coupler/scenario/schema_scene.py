"""The part of the schema that says what there is: materials, bodies, meshes, contact pairs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePath
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, StrictBool, model_validator

from contact.laws import parse_law
from coupler.scenario.base import Part, PropertySpec, PropertyTable, SignalSpec, exactly_one
from coupler.scenario.quantity import Name, Number, Positive, Text, Whole, number, problem
from coupler.scenario.schema_material import Creep, Liquid, Plastic

MAX_CELLS = 4_000_000


class Material(Part):
    """Each half needs its own share: thermal rho, k, c; elastic E, nu, alpha, T_ref, and how it flows."""

    rho: Positive | None = None
    k: PropertySpec | None = None
    c: PropertySpec | None = None
    E: PropertySpec | None = None
    nu: PropertySpec | None = None
    alpha: PropertySpec | None = None
    T_ref: Number | None = None
    plastic: Plastic | None = None
    creep: Creep | None = None
    liquid: Liquid | None = None

    @model_validator(mode="after")
    def _physical(self) -> Material:
        for key in ("k", "c", "E"):
            _all_positive(getattr(self, key), key)
        table = isinstance(self.nu, PropertyTable)
        for i, nu in enumerate(self.nu.value if isinstance(self.nu, PropertyTable) else
                               (self.nu,) if isinstance(self.nu, float) else ()):
            if not -1.0 < nu < 0.5:
                raise problem("Poisson's ratio lies between -1 and 0.5, both excluded",
                              "For a nearly incompressible material write 0.4999.",
                              at=("nu", "value", i) if table else ("nu",))
        if self.creep is not None and self.plastic is not None and self.plastic.kinematic is not None:
            raise problem("creep does not go with a kinematic backstress, which would have to creep too",
                          "Give plastic.overstress instead of creep, or leave plastic.kinematic out.", at=("creep",))
        return self


def _all_positive(spec: Any, key: str) -> None:
    values = spec.value if isinstance(spec, PropertyTable) else (spec,) if isinstance(spec, float) else ()
    for i, value in enumerate(values):
        if value <= 0:
            at = (key, "value", i) if isinstance(spec, PropertyTable) else (key,)
            raise problem("must be greater than zero", at=at)


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
    """T0 in the scenario's unit of temperature; Q_T [W/m3] of current volume."""

    mesh: Mesh
    material: Name
    T0: Number
    Q_T: SignalSpec = 0.0


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
    """slave, master: surfaces "body.surface"; gap_max [m]; penalty [Pa/m] or auto (E/h)."""

    slave: Text
    master: Text
    gap_max: Positive
    penalty: Positive | Literal["auto"] = "auto"
    conduction: Conduction | None = None
