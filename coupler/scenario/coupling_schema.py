"""The scenario file's `coupling`, key by key: windows, their sizes, events, and what ends a run."""

from __future__ import annotations

from typing import Annotated

from pydantic import StrictBool, model_validator

from contact.problem.part import Entry, Part
from contact.problem.values import Count, NotNegative, Number, Positive, Text, Whole, problem
from coupler.scenario.options import Adaptive, ErrorTolerances, Iteration, OnCycle, OnUnstable, Scheme

# Windows shorter than this share of the first are a sign that something else is wrong.
LEAST = 1e-6
# Of the run, a first window that nobody stated.  One a thousand times too long is put back four times, one a thousand
# times too short is ten windows on the way to the right one.
FIRST = 1e-3


class AdaptiveSpec(Part):
    """Adaptive windows [s]: their size follows the error they make."""

    first: Annotated[Positive | None, Entry(
        "the first window, and the first after a breakpoint or an event; a shorter one follows if its error is too "
        "large",
        unit="s",
        default="a thousandth of `end`")] = None
    least: Annotated[Positive | None, Entry(
        "the smallest window, apart from those that end at a breakpoint or an event; a window of this size is "
        "accepted even if its error is too large, and is reported",
        unit="s",
        default="1e-6 of `first`")] = None
    most: Annotated[Positive | None, Entry("the largest window", unit="s", default="`end`")] = None
    tolerance: Annotated[ErrorTolerances, Entry("of the error of one window")] = ErrorTolerances()

    @model_validator(mode="after")
    def _in_order(self) -> AdaptiveSpec:
        if self.first is not None and self.least is not None and self.least > self.first:
            raise problem("the first window is shorter than the least", at=("least",))
        if self.first is not None and self.most is not None and self.most < self.first:
            raise problem("the first window is longer than the most", at=("most",))
        if self.least is not None and self.most is not None and self.most < self.least:
            raise problem("the longest window is shorter than the least", at=("most",))
        return self

    def sizes(self, end: float) -> Adaptive:
        """The checked values for a run of `end` seconds."""
        most = min(self.most if self.most is not None else end, end)
        # fault: windows without a first one begin with the longest -> first = most | coupler/test_defaults
        first = min(self.first if self.first is not None else max(FIRST * end, self.least or 0.0), most)
        least = self.least if self.least is not None else LEAST * first
        return Adaptive(first, min(least, first), most, self.tolerance)


class Events(Part):
    """locate : end windows where contact opens, closes, sticks or slips, or a rule acts.  tolerance [s]: how nearly.

    branches : and where a gap or a pressure passes a bend of a law.
    """

    locate: Annotated[bool | None, Entry(
        "windows end where contact opens, closes, sticks or slips, and where a rule changes a load or ends the run",
        kind="true, false",
        default="true where windows are adaptive, else false")] = None
    tolerance: Annotated[Positive | None, Entry(
        "how accurately that time is found",
        unit="s",
        default="1e-6 of the window")] = None
    branches: Annotated[StrictBool, Entry(
        "windows end, too, where the least gap or the largest pressure of a pair passes a breakpoint of a"
        " law: `p_max`, `d_cut`, `d_full`, `d_near`, `d_far`; sets `events.locate`")] = False

    @model_validator(mode="after")
    def _are_located(self) -> Events:
        if self.branches and self.locate is False:
            raise problem("branches are events, and events are not located", "Leave locate out.", at=("branches",))
        return self


class StopSpec(Part):
    """steady [K/s]: stop once the temperature of no node, latent heat counted, changes faster for two windows."""

    steady: Annotated[NotNegative | None, Entry(
        "the run ends, as completed, once no temperature has changed faster than this for two windows and no "
        "breakpoint is left. What melts or freezes counts as warmed or cooled by its latent heat",
        unit="K/s",
        default="none")] = None


class Windows(Part):
    """Windows up to `until` [s]: all of one size, or growing (shrinking) geometrically, first to last [s]."""

    until: Annotated[Positive, Entry("end of the range", unit="s")]
    size: Annotated[Positive | None, Entry(
        "of its windows, no longer than the range; or",
        unit="s",
        default="this or the two below")] = None
    first: Annotated[Positive | None, Entry(
        "the first, growing or shrinking geometrically",
        unit="s")] = None
    last: Annotated[Positive | None, Entry("to the last", unit="s")] = None

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


class SubstepCounts(Part):
    """Substeps of each half in a window."""

    thermal: Annotated[Whole, Entry("substeps of the thermal half in a window")] = 1
    mechanical: Annotated[Whole, Entry("of the mechanical half")] = 1


class Deadlines(Part):
    """Seconds that one step of each half may take in a process of its own."""

    thermal: Annotated[Positive | None, Entry(
        "seconds that one step of the thermal half may take under `--processes`", unit="s",
        default="20 times the median of its steps, at least 60",
        why="One second after that the run ends; the error names the half.")] = None
    mechanical: Annotated[Positive | None, Entry(
        "of the mechanical half", unit="s", default="the same")] = None


class CouplingSpec(Part):
    """end [s], runs begin at 0; kinks [s] besides those of the signals; link to the contact service."""

    scheme: Annotated[Scheme, Entry(
        "`staggered`: thermal half first (as in the paper); `mechanical_first`: mechanical half first; `parallel`:"
        " both at once; `extrapolated`: thermal half first, on extrapolated geometry; `along_heat`: the same, "
        "extrapolated over the heat stored, for windows with many thermal substeps; `iterated`: both until they "
        "agree, two solves or more; `adiabatic`: mechanics at frozen entropy, for `elastic` with `adiabatic: "
        "true`; `auto`: in each window the cheapest of these that is safe ([coupling.md](coupling.md)). "
        "[theory.md](theory.md) gives the order and what each half receives",
        kind="`staggered`, `mechanical_first`, `parallel`, `extrapolated`, `along_heat`, `iterated`, `adiabatic`, "
             "`auto`",
        default="`auto`, which is `iterated` with `thermal.method: steady`; `staggered` in files of version 1")
        ] = Scheme.AUTO
    iteration: Annotated[Iteration, Entry(
        "how `iterated` goes to agreement; other schemes do not read it",
        default="")] = Iteration()
    end: Annotated[Positive, Entry("runs begin at 0", unit="s")]
    kinks: Annotated[tuple[Number, ...], Entry(
        "additional breakpoints: a window ends there and the prediction starts anew, as at the breakpoints of all "
        "signals that the chosen halves use. At the times given here, at jumps, and at breakpoints of motion and "
        "load the thermal half also restarts damped",
        unit="s",
        kind="[s, ...]",
        default="none")] = ()
    windows: Annotated[tuple[Windows, ...] | None, Entry(
        "ranges of time, in order, at least up to `end` (the rest is cut off): `{until, size}` or `{until, first, "
        "last}`",
        kind="list",
        default="adaptive windows")] = None
    adaptive: Annotated[AdaptiveSpec | None, Entry(
        "adaptive windows: their size follows the error they make",
        default="`{}` without `windows`, else none")] = None
    events: Annotated[Events, Entry("where windows end because of contact")] = Events()
    on_cycle: Annotated[OnCycle | None, Entry(
        "what the run does when a quantity alternates from window to window. `note`: reports it; `iterate`: "
        "iterates the next windows; `cut`: rejects the window and halves it",
        default="`iterate`; `note` if `windows` and a scheme other than `auto` are given")] = None
    on_unstable: Annotated[OnUnstable, Entry(
        "what the run does when a measurement shows that windows amplify an alternating disturbance, or that the "
        "exchange rings ([trust.md](trust.md)). `cut`: makes windows shorter than the limit; `iterate`: iterates "
        "them; `auto`: whichever of the two takes fewer solver calls; `warn`: only reports it; `stop`: ends the "
        "run",
        why="Windows that are stable are not changed.")] = (
            OnUnstable.AUTO)
    stop: Annotated[StopSpec, Entry("when a run ends early")] = StopSpec()
    substeps: Annotated[SubstepCounts, Entry("in a window")] = SubstepCounts()
    deadlines: Annotated[Deadlines, Entry("for a step of a half in a process of its own")] = Deadlines()
    restart: Annotated[Count, Entry(
        "how often in a run a process that died (a half or the contact service) is restarted under `--processes`",
        why="The windows since its last saved state are repeated and give the same bits. A process that "
            "fails, hangs or is stopped is not restarted: the run ends, and the error names it.")] = 0
    link: Annotated[Text, Entry(
        "how the halves reach the contact service",
        kind="`direct`, `codec`, `zenoh:ENDPOINT`")] = "direct"

    @model_validator(mode="after")
    def _one_way_to_size(self) -> CouplingSpec:
        if self.windows is not None and self.adaptive is not None:
            raise problem("windows are listed or adaptive: `windows` or `adaptive`, not both",
                          "Leave one of the two out.")
        return self

    @property
    def sized(self) -> AdaptiveSpec | None:
        """The options of adaptive windows; None where they are listed."""
        return self.adaptive or (AdaptiveSpec() if self.windows is None else None)

    @model_validator(mode="after")
    def _link_known(self) -> CouplingSpec:
        if self.link not in ("direct", "codec") and not self.link.startswith("zenoh:"):
            raise problem("unknown link", "Known here: direct, codec, zenoh:ENDPOINT.", at=("link",))
        return self
