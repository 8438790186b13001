"""What `{from: ...}` of a body means: which body of which run, and at what time; in a sentence, what taking it did."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from contact.problem.start import FromFrames
from contact.problem.values import did_you_mean
from coupler.scenario.bodies import FromRun
from coupler.scenario.document import Document, Key
from coupler.scenario.earlier_run import EarlierRun, earlier_run
from coupler.scenario.transfer import Moved, frames_around


@dataclass(frozen=True)
class EarlierBody:
    """A body of another run.  stated : the path as the scenario has it.  here, there : its name in either."""

    run: EarlierRun
    stated: str
    here: str
    there: str

    @property
    def named(self) -> str:
        """The file, and the body where it is called otherwise there."""
        return self.stated + (f", body {self.there}," if self.there != self.here else "")

    def record(self, t: float | str, result: Moved) -> dict[str, str | float]:
        """Return what a results file keeps of it.  t [s] : when in that run.  result : of taking it over."""
        return {"body": self.here, "from": self.stated, "of": self.there, "t": t, "sha256": self.run.sha256,
                "outcome": self.run.outcome, "worst": result.worst}

    def begins(self, what: str, t: float) -> str:
        """Begin a sentence: what the body takes from that run at t [s].  what : "starts from"."""
        text = f"body {self.here} {what} {self.named} at {t:.9g} s"
        if self.run.outcome != "completed":
            text += f" (that run ended early: {self.run.outcome})"
        between = [f"{self.run.times[k]:.9g}" for k, _ in frames_around(self.run.times, t)]
        return text + (f", between its frames at {between[0]} and {between[1]} s" if len(between) == 2 else "")


class EarlierRuns:
    """The runs that the bodies of a scenario start from: the file of each is read once."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._runs: dict[Path, EarlierRun] = {}

    def body(self, name: str, spec: FromRun | FromFrames, key: Key) -> EarlierBody:
        """Find what a body is to take over.  name : of the body here.  Raises ScenarioError."""
        path, there = (self._document.path.parent / spec.path).resolve(), spec.body or name
        with self.refused((*key, "from")):
            run = self._runs[path] if path in self._runs else self._runs.setdefault(path, earlier_run(path))
        if there not in run.bodies:
            raise self._document.error(
                (*key, "body") if spec.body else key, f"{path.name} has no body {there!r}",
                did_you_mean(there, run.bodies) + ("" if spec.body else " Say which one: body: NAME."))
        return EarlierBody(run, spec.path, name, there)

    def time(self, body: EarlierBody, spec: FromRun, key: Key) -> float:
        """Return the time [s] in that run.  Raises ScenarioError."""
        with self.refused((*key, "t")):
            return body.run.time(spec.t)

    @contextmanager
    def refused(self, key: Key, body: EarlierBody | None = None) -> Iterator[None]:
        """Raise ScenarioError for what cannot be used of a run in the block.  body : which one was to be taken."""
        try:
            yield
        except ValueError as exc:
            lead = "" if body is None else f"body {body.there!r} of {body.run.path.name} cannot be taken over: "
            raise self._document.error(key, f"{lead}{exc}", getattr(exc, "remedy", "")) from exc


def meshes_sentence(result: Moved, what: str, unit: str) -> str:
    """End a sentence: what another mesh did to the values.  what : "its temperatures"."""
    if result.same:
        return ": the mesh is the same, every value as it was"
    text = (f", on another mesh: interpolated there and back, {what} change by up to {result.worst:.3g} {unit} "
            f"({result.rms:.3g} {unit} rms)")
    if result.outside:
        text += (f"; {result.outside} node{'s' * (result.outside > 1)} lie{'s' * (result.outside == 1)} up to "
                 f"{result.farthest:.3g} m outside the mesh there and take the value of its edge")
    return text
