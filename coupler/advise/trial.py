"""The trials of a climb: variants of the scenario, each run once while there is time."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from coupler.advise.edit import Edit, edited
from coupler.errors import ScenarioError
from coupler.scenario import Scenario
from coupler.scenario.document import Document
from coupler.trials.store import Store, key_of, sources
from coupler.trials.trial import Job, StoppedError, Trial, scenario_of, tried


class LateError(Exception):
    """A trial was not begun, because it would hardly end in time."""


def variant(document: Document, edits: Sequence[Edit]) -> Scenario:
    """The scenario with edits, as a trial runs it.  Raises ScenarioError for what cannot be."""
    return scenario_of(Job(document.text, str(document.path), edited(document.tree, edits)))


class Trials:
    """Runs trials and keeps them in a folder.

    deadline : of time.monotonic(); a trial that is not done by then is stopped.
    """

    def __init__(self, document: Document, folder: Path, deadline: float = float("inf")) -> None:
        self.document = document
        self.deadline = deadline
        self._store = Store(folder)
        self._sources = sources()

    def run(self, edits: Sequence[Edit], begin: Callable[[], Callable[[float], object]], need: float = 0.0) -> Trial:
        """The trial of these edits, run or remembered.

        begin : called before it runs, gives what is told the share that is done.  need : time it will take [s].
        What cannot be run, or fails, is a trial too.  Raises LateError where there is not so much time, StoppedError,
        ResultsError where it cannot be kept.
        """
        try:
            scenario = variant(self.document, edits)
        except ScenarioError as exc:
            return Trial(f"{exc.key}: {exc.message}" if exc.key else exc.message)
        key = key_of(scenario, self._sources)
        if (kept := self._store.get(key)) is not None:
            return kept
        if (left := self.deadline - time.monotonic()) <= 0.0:
            raise StoppedError("time is up")
        if need > left:
            raise LateError
        done = tried(scenario, self.deadline, begin())
        # fault: advice: trials are not kept -> pass | scenarios/test_advise
        self._store.put(key, done)
        return done
