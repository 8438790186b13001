"""The scenario file, key by key (docs/scenario.md is its reference)."""

from __future__ import annotations

from enum import StrEnum

from pydantic import Field, model_validator

from coupler.scenario.base import Part, SignalSpec, exactly_one
from coupler.scenario.options import OnCycle, Scheme
from coupler.scenario.quantity import DottedName, Name, NotNegative, Number, Positive, Text, Whole, problem
from coupler.scenario.schema_contact import ContactPair
from coupler.scenario.schema_control import Adaptive, Events, Stop
from coupler.scenario.schema_iteration import Iteration
from coupler.scenario.schema_material import Material
from coupler.scenario.schema_mechanical import Mechanical
from coupler.scenario.schema_rules import RuleSpec
from coupler.scenario.schema_scene import Body
from coupler.scenario.schema_study import Study
from coupler.scenario.schema_thermal import Thermal

FORMAT_VERSION = 1


class Geometry(StrEnum):
    """plane: per metre of depth.  axisymmetric: x = r, y = z."""

    PLANE = "plane"
    AXISYMMETRIC = "axisymmetric"


class TemperatureUnit(StrEnum):
    """The unit of every temperature in the file.  Inside all is kelvin."""

    DEGC = "degC"
    K = "K"


class Units(Part):
    """Only temperature has a choice; all else is SI."""

    temperature: TemperatureUnit


class Windows(Part):
    """Windows up to `until` [s]: all of one size, or growing (shrinking) geometrically, first to last [s]."""

    until: Positive
    size: Positive | None = None
    first: Positive | None = None
    last: Positive | None = None

    @model_validator(mode="after")
    def _one_form(self) -> Windows:
        if (self.size is None) == (self.first is None) or (self.first is None) != (self.last is None):
            raise problem("a range of windows has either `size`, or both `first` and `last`")
        return self

    @property
    def sizes(self) -> tuple[float, float]:
        """First and last size [s]."""
        if self.size is not None:
            return self.size, self.size
        assert self.first is not None
        assert self.last is not None
        return self.first, self.last


class Substeps(Part):
    """Substeps of each half in a window."""

    thermal: Whole = 1
    mechanical: Whole = 1


class Coupling(Part):
    """end [s], runs begin at 0; kinks [s] besides those of the signals; link to the contact service."""

    scheme: Scheme = Scheme.STAGGERED
    iteration: Iteration = Iteration()
    end: Positive
    kinks: tuple[Number, ...] = ()
    windows: tuple[Windows, ...] | None = None
    adaptive: Adaptive | None = None
    events: Events = Events()
    on_cycle: OnCycle | None = None
    stop: Stop = Stop()
    substeps: Substeps = Substeps()
    link: Text = "direct"

    @model_validator(mode="after")
    def _one_way_to_size(self) -> Coupling:
        exactly_one(self, ("windows", "adaptive"))
        return self

    @model_validator(mode="after")
    def _link_known(self) -> Coupling:
        if self.link not in ("direct", "codec") and not self.link.startswith("zenoh:"):
            raise problem("unknown link", "Known here: direct, codec, zenoh:ENDPOINT.", at=("link",))
        return self


class Place(Part):
    """A point of a body's reference mesh (at [m], body), or the max, min or mean over a surface."""

    at: tuple[Number, Number] | None = None
    body: Name | None = None
    max: Text | None = None
    min: Text | None = None
    mean: Text | None = None

    @model_validator(mode="after")
    def _one_form(self) -> Place:
        form = exactly_one(self, ("at", "max", "min", "mean"))
        if (form == "at") != (self.body is not None):
            raise problem("`at` and `body` go together")
        return self


ProbeTarget = Text | Place


class Probe(Part):
    """One quantity, and where."""

    T: ProbeTarget | None = None
    u_x: ProbeTarget | None = None
    u_y: ProbeTarget | None = None
    gap: ProbeTarget | None = None
    p: ProbeTarget | None = None
    f_s: ProbeTarget | None = None

    @model_validator(mode="after")
    def _one_quantity(self) -> Probe:
        exactly_one(self, type(self).model_fields)
        return self


class Fields(Part):
    """When fields are kept: every so many windows, and at the first window end at or after times [s]."""

    every: Whole | None = None
    at: tuple[NotNegative, ...] = ()


class Output(Part):
    """What is recorded besides the probes, which are kept at every window.

    checkpoint : least wall time between two checkpoints [s]; 0: after every window; null: none, and no resume.
    """

    fields: Fields = Fields()
    checkpoint: NotNegative | None = 30.0


class ScenarioFile(Part):
    """The whole file."""

    slideline: Whole
    title: Text = ""
    units: Units
    geometry: Geometry
    signals: dict[Name, SignalSpec] = Field(default_factory=dict)
    materials: dict[Name, Material] = Field(min_length=1)
    bodies: dict[Name, Body] = Field(min_length=1)
    contact: dict[Name, ContactPair] = Field(default_factory=dict)
    thermal: Thermal
    mechanical: Mechanical
    coupling: Coupling
    rules: tuple[RuleSpec, ...] = ()
    probes: dict[DottedName, Probe] = Field(default_factory=dict)
    output: Output = Output()
    study: Study | None = None

    @model_validator(mode="after")
    def _version_known(self) -> ScenarioFile:
        if self.slideline != FORMAT_VERSION:
            raise problem("a version of the scenario form this program does not know",
                          f"It reads version {FORMAT_VERSION}.", at=("slideline",))
        return self
