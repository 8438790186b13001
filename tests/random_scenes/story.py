"""What happened in a run of a random scene: how it ended, what it said, and every window end."""

from __future__ import annotations

import io
from collections.abc import Mapping
from contextlib import redirect_stderr
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler import CouplingError, HalfError, Results, Run, ScenarioError
from coupler.record.tables import ERROR_FIELDS
from coupler.scenario import Scenario
from coupler.schemes.levels import Level
from coupler.trust.checks import TrustVerdict
from coupler.trust.in_time.errors import NAME as ESTIMATED
from random_scenes.direct_half import without_fmus
from random_scenes.scene import Scene

Floats = NDArray[np.float64]
REFUSED, FAILED, COMPLETED = "refused", "failed", "completed"
MOST_WINDOWS = 200  # tried ones; a scene that wants more is left: it is not small
# Solver calls and their iterations: a run has as many on a slow machine as on a fast one, so no verdict depends on it.
MOST_WORK = 4000
ERROR_BAR = "may be off by"  # the words of the error bar of a probe that is too large


class TooLongError(Exception):
    """A run wants more windows than a small scene may."""


@dataclass(frozen=True, eq=False)
class Story:
    """A run.

    outcome : refused (by the check of the scenario), failed (with a message), completed.  message : its words.
    words : all notes and warnings that a user is shown, before, during and after the run.
    levels : at the start and the end of every accepted window.  extra : output of a half -> its values then.
    errors : quantity (coupler.record.tables.ERROR_FIELDS) -> estimated error of every accepted window, nan if unknown.
    may_be_off : unit -> the largest error of a probe in it that the run says in its trust table, if it is too large.
    """

    scene: Scene
    outcome: str
    message: str = ""
    words: tuple[str, ...] = ()
    scenario: Scenario | None = None
    levels: tuple[Level, ...] = ()
    extra: Mapping[str, tuple[Floats, ...]] = field(default_factory=dict)
    probes: Mapping[str, Floats] = field(default_factory=dict)
    ledger: Mapping[str, Floats] = field(default_factory=dict)
    imbalance: float = 0.0
    errors: Mapping[str, Floats] = field(default_factory=dict)
    may_be_off: Mapping[str, float] = field(default_factory=dict)

    @property
    def interface(self) -> Interface:
        assert self.scenario is not None
        return self.scenario.interface

    @cached_property
    def t(self) -> Floats:
        """(n,) [s]"""
        return np.array([level.t for level in self.levels])

    @cached_property
    def T(self) -> Floats:
        """(n, n_nodes) [K]"""
        return np.array([level.T for level in self.levels])

    @cached_property
    def x(self) -> Floats:
        """(n, n_nodes, 2) [m]"""
        return np.array([level.x for level in self.levels])

    @cached_property
    def t_N(self) -> Floats:
        """(n, n_q) [Pa]"""
        return np.array([level.t_N for level in self.levels])

    def nodes_of(self, body: str) -> NDArray[np.intp]:
        """Numbers of the nodes of a body, in the order of its mesh."""
        return np.flatnonzero(self.interface.node_body == self.interface.bodies.index(body))

    def says(self, *words: str) -> bool:
        """Whether a warning has one of these words in it."""
        text = "\n".join(self.words).lower()
        return any(word in text for word in words)


def told(scene: Scene, *, most: int = MOST_WINDOWS, until: float | None = None) -> Story:
    """Run a scene in this process.  Never raises for what a user would be told: that is a story too."""
    with TemporaryDirectory(prefix="slideline-random-") as scratch:
        folder = Path(scratch)
        try:
            scenario = scene.checked(folder)
        except ScenarioError as error:
            return Story(scene, REFUSED, str(error))
        levels: list[Level] = []
        extra: dict[str, list[Floats]] = {}
        words: list[str] = list(scenario.notes)
        probes: dict[str, Floats] = {}
        ledger: dict[str, Floats] = {}
        imbalance = 0.0
        errors: dict[str, Floats] = {}
        may_be_off: dict[str, float] = {}
        outcome, message = COMPLETED, ""
        said = io.StringIO()
        try:
            with without_fmus(), redirect_stderr(said):
                with Run(scenario, folder / "run.h5") as run:
                    names = {h.name: [n for n, b in h.blocks.items() if b.causality == "output" and b.kind == "Real"]
                             for h in (run.halves.thermal, run.halves.mechanical)}

                    def keep() -> None:
                        levels.append(run.state.now)
                        for half in (run.halves.thermal, run.halves.mechanical):
                            for name, value in half.read(names[half.name], finite=False).items():
                                extra.setdefault(f"{half.name}.{name}", []).append(value)

                    keep()
                    for number, progress in enumerate(run.windows(until=until)):
                        words += progress.notes
                        if run.state.now.t > levels[-1].t:
                            keep()
                        # Timed, and held to the bounds of its role.
                        work = sum(timed.half.half.work for timed in (run.halves.thermal, run.halves.mechanical))
                        if number >= most or work > MOST_WORK:
                            raise TooLongError(f"{number + 1} windows tried, {work} solver calls and iterations, "
                                               f"at t = {run.state.now.t:.6g} s")
                results = Results(folder / "run.h5")
                words += results.notes
                words += [c.sentence for c in results.trust if c.verdict in (TrustVerdict.BROKEN, TrustVerdict.NOTED)]
                probes = {n: results.probe(n)[1] for n in results.probe_names}
                ledger = {k: np.asarray(v) for k, v in results.ledger_history()[1].items()}
                imbalance = results.heat_imbalance
                errors, may_be_off = _errors(results), _may_be_off(results)
        except (CouplingError, HalfError, ScenarioError) as error:
            outcome, message = FAILED, str(error)
        except TooLongError as error:
            outcome, message = FAILED, f"too long for a small scene: {error}"
        words += [line for line in said.getvalue().splitlines() if line]
        return Story(scene, outcome, message, tuple(dict.fromkeys(words)), scenario, tuple(levels),
                     {n: tuple(v) for n, v in extra.items()}, probes, ledger, imbalance, errors,
                     may_be_off)


def _may_be_off(results: Results) -> dict[str, float]:
    """Unit -> the largest error of a probe that a user reads: that of probes far off is in the table of trust."""
    said = [c.verdict for c in results.trust if c.name == ESTIMATED]
    if not said or said[0] not in (TrustVerdict.BROKEN, TrustVerdict.NOTED):
        return {}
    found: dict[str, float] = {}
    for row in results.probe_errors.values():
        found[row.unit] = max(found.get(row.unit, 0.0), row.error)
    return found


def _errors(results: Results) -> dict[str, Floats]:
    """Quantity -> estimated error of every accepted window (n,) [K, m, J, m], nan where it is not known."""
    found = {}
    for name, _ in ERROR_FIELDS[1:]:
        rows = np.full(len(results.windows), np.nan)
        rows[results.errors["window"]] = results.errors[name]
        found[name] = rows[results.windows.taken]
    return found
