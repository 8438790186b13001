"""The scenario file, key by key (docs/scenario.md is its reference)."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, field_validator, model_validator

from contact.problem.curves import SignalSpec
from contact.problem.material import Material
from contact.problem.mechanical import Elastic, Rigid, Rod
from contact.problem.pairs import ContactPair
from contact.problem.part import Entry, Part, exactly_one
from contact.problem.start import Replay
from contact.problem.thermal import ThermalSettings
from contact.problem.values import Count, DottedName, Name, NotNegative, Number, Positive, Text, Whole, problem
from coupler.scenario.bodies import MeshedBody
from coupler.scenario.conditions import is_condition
from coupler.scenario.coupling_schema import CouplingSpec
from coupler.scenario.mesh import Mesh
from coupler.scenario.options import Scheme
from coupler.scenario.rule_schema import RuleSpec
from coupler.scenario.unit_system import WITH_MASS

VERSION = 2  # of the scenario form; older ones: coupler.scenario.versions


class Geometry(StrEnum):
    """plane: per metre of depth.  axisymmetric: x = r, y = z."""

    PLANE = "plane"
    AXISYMMETRIC = "axisymmetric"


class TemperatureUnit(StrEnum):
    """The unit of every temperature in the file.  Inside all is kelvin."""

    DEGC = "degC"
    K = "K"


class Units(Part):
    """Of all numbers of the file.  Temperature always has a unit of its own; all else is SI, or as `length` and one of
    `stress`, `force` and `mass` say (coupler.scenario.unit_system).
    """

    temperature: Annotated[TemperatureUnit, Entry(
        "unit of every temperature in the file; differences are not converted")]
    length: Annotated[Literal["m", "cm", "mm", "um"] | None, Entry(
        "unit of all lengths of the file, also inside compound units; needs one of the next three keys",
        default="all is SI")] = None
    stress: Annotated[Literal["Pa", "kPa", "MPa", "GPa"] | None, Entry(
        "unit of stresses and pressures; the units of mass, force and energy follow from it", default="none")] = None
    force: Annotated[Literal["N", "kN", "MN"] | None, Entry("in place of `units.stress`", default="none")] = None
    mass: Annotated[Literal["kg", "g", "t"] | None, Entry("in place of `units.stress`", default="none")] = None

    @model_validator(mode="after")
    def _all_follow(self) -> Units:
        given = [name for name in WITH_MASS if getattr(self, name) is not None]
        # fault: a file in mm may leave its stresses open -> if False: |
        #   coupler/test_scenario_file_units::test_units_that_leave_something_open_are_refused
        if self.length is not None and not given:
            raise problem("a unit of length alone leaves open what stresses and masses are in",
                          "Add one of stress, force, mass: {length: mm, stress: MPa}.", at=("length",))
        if given and self.length is None:
            raise problem(f"a unit of {given[0]} alone leaves open what lengths are in", "Add length: m.",
                          at=(given[0],))
        if len(given) > 1:
            raise problem(f"{' and '.join(given)} both fix the unit of mass", "Leave out one.", at=(given[1],))
        return self


class Binding(Part):
    """Which variables of an FMU are a block of the border, and how their numbers become SI.

    SI value = sign * (value in SI) + offset.
    """

    name: Annotated[Text, Entry(
        "pattern of the names of the FMU's variables: `{i}` is the row from 1, `{i0}` from 0, "
        "`{j}`, `{j0}` the column, `{xy}`, `{XY}` the column as a letter", kind="pattern")]
    unit: Annotated[Text | None, Entry("unit of the FMU's variables", default="what the FMU declares")] = None
    sign: Annotated[Literal[1, -1], Entry(
        "-1: the FMU uses the opposite sign, such as pressures for `contact.t_N`")] = 1
    offset: Annotated[Number, Entry("added, in SI")] = 0.0


# Keys of a half of either role.
Options = Annotated[dict[str, Any], Entry("for a half of another package; written unchanged to its model.json",
                                          kind="mapping", default="none")]
Ignored = Annotated[tuple[Text, ...], Entry(
    "conditions of the scene that a half of another package may leave out, as `check` names them "
    "([write_a_half.md](write_a_half.md))", default="none", kind="list of paths")]
Played = Annotated[Replay | None, Entry("of the half `replay`")]
Bindings = Annotated[dict[Text, Binding], Entry(
    "names of the variables of an FMU, if `half` is the path of an FMU ([halves.md](halves.md)): `T: {name: "
    "\"wall_{i}\", unit: degC}`", kind="name in the interface -> binding", default="none")]


class OneOfSeveral(Part):
    """One of several halves in a role."""

    bodies: Annotated[tuple[Name, ...], Entry("that it solves for; every body of the scene is in one half",
                                              kind="[body, ...]")] = Field(min_length=1)
    half: Annotated[Text | None, Entry("its kind", default="that of the role")] = None


class Across(Part):
    """How several halves agree on what crosses from bodies of one to bodies of another, in every substep."""

    tolerance: Annotated[Positive, Entry(
        "of the temperatures that the halves of `halves` exchange", "K",
        why="The heat that either side counts then differs by less than a run shows.")] = 1e-7
    iterations: Annotated[Whole, Entry(
        "most iterations in a substep; a window that needs more is repeated with a smaller size",
        why="Usually 12 are enough if each half has many nodes on the common surface.")] = 60


class Thermal(ThermalSettings):
    """Which half solves for heat, and how."""

    half: Annotated[Text, Entry(
        "`thermal`: conduction in the plane; `lumped`: one temperature for each body; `rod`: conduction along x in"
        " rectangles ([halves.md](halves.md)); `replay`: what another run recorded; or a kind that another package"
        " adds, or the path of an FMU ending in `.fmu` ([write_a_half.md](write_a_half.md))",
                              kind="`thermal`, `lumped`, `rod`, `replay`")] = (
        "thermal")
    options: Options = Field(default_factory=dict)
    ignore: Ignored = ()
    replay: Played = None
    bind: Bindings = Field(default_factory=dict)
    halves: Annotated[dict[Name, OneOfSeveral], Entry(
        "several thermal halves instead of one, each with its own bodies, process and, if you like, machine "
        "([several_halves.md](several_halves.md))",
        kind="name -> bodies", default="one half for all bodies")] = Field(
        default_factory=dict)
    across: Annotated[Across, Entry("how `halves` agree on the heat between them")] = Across()
    meshes: Annotated[dict[Name, Mesh], Entry(
        "meshes of the thermal half's own, of the same bodies with surfaces of the same "
        "names; what halves exchange is interpolated from one mesh to the other "
        "([halves.md](halves.md#a-mesh-of-its-own))", kind="body -> mesh",
        default="those of the bodies")] = Field(default_factory=dict)


class Mechanical(Part):
    """Which half solves for displacements; the settings of the kinds not chosen stay, so that a swap is one word."""

    half: Annotated[Text, Entry("`--swap mechanical=rigid` changes just this",
                                kind="`elastic`, `rigid`, `rod`, `replay`, or one that "
                              "another package adds, or the path of an FMU")]
    elastic: Annotated[Elastic | None, Entry("of the half `elastic`")] = None
    rigid: Annotated[Rigid | None, Entry("of the half `rigid`")] = None
    rod: Annotated[Rod | None, Entry("of the half `rod`")] = None
    options: Options = Field(default_factory=dict)
    ignore: Ignored = ()
    replay: Played = None
    bind: Bindings = Field(default_factory=dict)
    meshes: Annotated[dict[Name, Mesh], Entry(
        "meshes of the mechanical half's own, as `thermal.meshes` ([halves.md](halves.md#a-mesh-of-its-own))",
        kind="body -> mesh", default="those of the bodies")] = Field(default_factory=dict)


class Place(Part):
    """A point of a body's reference mesh (at [m], body), or the max, min or mean over a surface."""

    at: Annotated[tuple[Number, Number] | None, Entry(
        "a point in the reference configuration; it moves with the body",
        unit="m")] = None
    body: Annotated[Name | None, Entry("of which body the point is")] = None
    max: Annotated[Text | None, Entry("the largest over a surface or the nodes of a body")] = None
    min: Annotated[Text | None, Entry("the smallest")] = None
    mean: Annotated[Text | None, Entry("the mean by reference area or volume")] = None

    @model_validator(mode="after")
    def _one_form(self) -> Place:
        form = exactly_one(self, ("at", "max", "min", "mean"))
        if (form == "at") != (self.body is not None):
            raise problem("`at` and `body` go together")
        return self


ProbeTarget = Text | Place


HALVES = ("thermal.", "mechanical.")  # a probe of any output of a half is named HALF.OUTPUT


class ProbeSpec(Part):
    """One quantity of the exchange, heat or force of a condition, or one output of a half by its name, and where."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, ProbeTarget]

    T: Annotated[ProbeTarget | None, Entry("temperature", unit="K", kind="place")] = None
    u_x: Annotated[ProbeTarget | None, Entry("displacement", unit="m", kind="place")] = None
    u_y: Annotated[ProbeTarget | None, Entry("displacement", unit="m", kind="place")] = None
    gap: Annotated[ProbeTarget | None, Entry("on contact surfaces only", unit="m", kind="place")] = None
    p: Annotated[ProbeTarget | None, Entry(
        "contact pressure, on contact surfaces only",
        unit="Pa",
        kind="place")] = None
    f_s: Annotated[ProbeTarget | None, Entry(
        "solid fraction, where a material has `latent`",
        kind="place")] = None

    @classmethod
    def knows(cls, key: object) -> bool:
        return super().knows(key) or (isinstance(key, str) and (key.startswith(HALVES) or is_condition(key)))

    @classmethod
    def meant_by(cls, key: str) -> str:
        """Say how outputs of halves are written, too."""
        # fault: who forgets the half of an output is not told of it -> return super().meant_by(key) |
        #   coupler/test_scenario_probes::test_an_output_without_its_half_is_told_how_it_is_written
        return f"{super().meant_by(key)} Outputs of a half begin with the half: mechanical.{key} or thermal.{key}."

    @model_validator(mode="after")
    def _one_quantity(self) -> ProbeSpec:
        exactly_one(self, (*type(self).model_fields, *self.__pydantic_extra__))
        return self

    @property
    def quantity(self) -> str:
        """The key that is given."""
        return next(n for n in (*type(self).model_fields, *self.__pydantic_extra__) if getattr(self, n) is not None)


class Fields(Part):
    """When fields are kept: every so many windows, at the first window end at or after times [s], where much changes.
    """

    every: Annotated[Whole | None, Entry(
        "store fields once in this many windows",
        default="never by count")] = None
    at: Annotated[tuple[NotNegative, ...], Entry(
        "store them at the first window end at or after each of these times",
        unit="s",
        kind="[s, ...]",
        default="none")] = ()
    most: Annotated[Count | None, Entry(
        "store at most this many more, where most changes and at contact events; 0: none",
        kind="integer >= 0",
        default="50; 0 with `every`")] = None


class OutputSpec(Part):
    """What is recorded besides the probes, which are kept at every window.

    checkpoint : least wall time between two checkpoints [s]; 0: after every window; null: none, and no resume.
    """

    fields: Annotated[Fields, Entry("when fields are kept")] = Fields()
    checkpoint: Annotated[NotNegative | None, Entry(
        "least wall time between two checkpoints, from which `slideline resume` goes on; 0: after every "
        "window; null: none, and no resume",
        unit="s",
        kind="number >= 0, or null")] = 30.0


# The scenario file's `study`: a grid of runs, and what their errors are measured against (docs/study.md).

Values = tuple[Any, ...]


class StudyReference(Part):
    """scheme, with windows `finer` times as fine as the finest of the grid, after `set`; or the answer in `file`.

    error : what the author of a file says of it, as the errors of the study are measured.
    """

    scheme: Annotated[Scheme, Entry("how the reference is computed")] = Scheme.ITERATED
    finer: Annotated[Whole, Entry(
        "its windows are the smallest of the grid divided by this")] = 4
    set: Annotated[dict[Text, Any], Entry(
        "other settings of the reference, such as `{mesh: 2}`",
        kind="{axis: value}",
        default="none")] = Field(default_factory=dict)
    file: Annotated[Text | None, Entry(
        "instead: a stored answer, a results file or a table `.csv` (`t`, then probes by name, SI); relative "
        "to the scenario",
        kind="path",
        default="none")] = None
    error: Annotated[NotNegative | None, Entry(
        "the relative error of that file",
        default="not known")] = None

    @model_validator(mode="after")
    def _one_kind(self) -> StudyReference:
        if self.file is None and self.error is not None:
            raise problem("the error of a reference that is computed is measured", "Leave it out.", at=("error",))
        if self.file is not None and self.set:
            raise problem("a reference is either a file or computed, so there is nothing to set", at=("set",))
        return self


class StudySpec(Part):
    """grid : axis -> values, every combination is run; several grids are put on one chart.

    measure : probes (default: all that change).  span : [from, until], s (default: all of the run).
    """

    grid: Annotated[tuple[dict[Text, Values], ...], Entry(
        "every combination is run. Axes: `scheme`, `half`, `thermal`, `substeps`; the factors `windows`, "
        "`tolerance`, `mesh`; any dotted key",
        kind="{axis: [values]}, or a list of such",
        default="`--grid`")] = ()
    measure: Annotated[tuple[DottedName, ...], Entry(
        "probes whose error counts",
        kind="[probe, ...]",
        default="all that change")] = ()
    span: Annotated[tuple[Number, Number] | None, Entry(
        "start and end of the time in which errors count",
        unit="s",
        default="all of the run")] = None
    reference: Annotated[StudyReference, Entry("what the errors are measured against")] = StudyReference()

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
    def _in_order(self) -> StudySpec:
        if self.span is not None and self.span[1] <= self.span[0]:
            raise problem("the span ends before it begins", at=("span",))
        return self


class ScenarioFile(Part):
    """The whole file."""

    slideline: Annotated[Whole, Entry(
        "version of this form; `slideline migrate` writes the newest",
        kind="2")]
    title: Annotated[Text, Entry("shown in results", default="the file's name")] = ""
    units: Annotated[Units, Entry("of its numbers")]
    geometry: Annotated[Geometry, Entry(
        "plane strain, per metre of depth; or x = r, y = z, the whole turn of 2 pi")]
    signals: Annotated[dict[Name, SignalSpec], Entry(
        "data over time, used by name; an unused signal makes no breakpoint",
        kind="name -> SIGNAL",
        default="none")] = Field(default_factory=dict)
    materials: Annotated[dict[Name, Material], Entry(
        "properties of the materials",
        kind="name -> material")] = Field(min_length=1)
    bodies: Annotated[dict[Name, MeshedBody], Entry(
        "the bodies: mesh, material, start", kind="name -> body")] = Field(min_length=1)
    contact: Annotated[dict[Name, ContactPair], Entry(
        "pairs of surfaces that may touch, or exchange heat across a gap",
        kind="name -> pair",
        default="none")] = Field(default_factory=dict)
    thermal: Annotated[Thermal, Entry("settings and boundary conditions of the thermal half")]
    mechanical: Annotated[Mechanical, Entry("settings and boundary conditions of the mechanical half")]
    coupling: Annotated[CouplingSpec, Entry("how the two halves exchange data: scheme, windows, tolerances")]
    rules: Annotated[tuple[RuleSpec, ...], Entry(
        "changes that the run makes when a quantity passes a bound",
        kind="list",
        default="none")] = ()
    probes: Annotated[dict[DottedName, ProbeSpec], Entry(
        "values over time; names may have dots",
        kind="name -> probe",
        default="none")] = Field(default_factory=dict)
    output: Annotated[OutputSpec, Entry("which fields are stored, and how often")] = OutputSpec()
    study: Annotated[StudySpec | None, Entry(
        "a grid of runs, for `slideline study`",
        default="none")] = None

    @model_validator(mode="after")
    def _version_known(self) -> ScenarioFile:
        if self.slideline > VERSION:
            raise problem("a version of the scenario form this program does not know",
                          f"It reads versions 1 to {VERSION}.", at=("slideline",))
        return self
