"""Shows a run: one live line on a terminal, a line every tenth of the run elsewhere, and a summary at its end."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Collection
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.spinner import Spinner
from rich.text import Text

from coupler.cli.codes import exit_code
from coupler.record.conditions import condition_lines
from coupler.record.paths import can_resume
from coupler.record.results import Results, iteration_words
from coupler.running.progress import Progress
from coupler.schemes.state import Verdict
from coupler.trust.checks import TrustVerdict

ZERO_CELSIUS = 273.15
# The first windows load compiled code and solve from cold: an estimate from them is ten times too long.
GUESS_AFTER = 0.05
FAILURES = {Verdict.THERMAL_DISCARD.value: "the thermal solver failed",
            Verdict.MECHANICAL_DISCARD.value: "the mechanical solver failed"}
NUMBER = re.compile(r"(?<![\w.])\d[\d.]*(e[-+]?\d+)?")  # not that of a name: b1
# Adaptive windows are often rejected for their error: so many are printed one by one.
LISTED = 10
SETTING_UP = "building and loading the halves; the first run on a machine compiles them too, a minute or more"


class ProgressLine:
    """Shows Progress values; temperatures in the scenario's unit.  printed : the notes so far.

    quiet : nothing is shown.  verbose : a line each window, on a terminal too.
    """

    def __init__(self, temperature_unit: str, console: Console | None = None, *, quiet: bool = False,
                 verbose: bool = False) -> None:
        self._unit, self._quiet, self._verbose = temperature_unit, quiet, verbose
        self._solves = 0
        self._console = console or Console(file=sys.stderr, highlight=False)
        self._live = Live(console=self._console, refresh_per_second=8, transient=True)
        self._next_line = 0.0
        self._rejected = 0
        self._tries: list[Progress] = []  # rejected ones of the current window
        self._too_large = 0
        self._anyway = 0
        self.printed: set[str] = set()

    def __enter__(self) -> ProgressLine:
        if self._quiet:
            return self
        if self._console.is_terminal:
            self._live.update(Spinner("dots", SETTING_UP))
            self._live.start()
        else:
            print(SETTING_UP, file=self._console.file, flush=True)
        return self

    def __call__(self, p: Progress) -> None:
        self.printed.update(p.notes)
        self._solves += p.solves
        if self._quiet:
            return
        for text in (*(f"note: {note}" for note in p.notes), *p.fired):
            self._print(text)
        if not p.taken:
            self._rejected += 1
            self._tries.append(p)
            if self._console.is_terminal:
                self._live.update(Text(f"window {p.number}, {p.H:.3g} s: {FAILURES.get(p.verdict, p.verdict)}; again"))
            return
        self._anyway += p.anyway
        self._print_tries(f"accepted with {p.H:.3g} s {p.scheme}".rstrip())
        if p.verdict != Verdict.ACCEPTED.value:
            self._print(f"window {p.number} to t = {p.t:.6g} s: {p.verdict} ({p.message}); accepted all the same")
        elif p.event:
            self._print(f"t = {p.t:.9g} s: {p.event}")
        if self._verbose:
            self._print(self.line(p))
        elif self._console.is_terminal:
            self._live.update(Text(f"{bar(p.fraction)} {self.line(p)}"))
        elif p.fraction >= self._next_line:
            self._next_line = p.fraction + 0.1
            print(self.line(p), file=self._console.file, flush=True)

    def say(self, text: str, asked: bool = False) -> None:
        """Print a line between others.  asked : even where nothing else is shown."""
        if asked or not self._quiet:
            self._print(text)

    def _print_tries(self, outcome: str) -> None:
        """Print one line on all rejected steps of a window: halving it ten times is no ten lines."""
        tries, self._tries = self._tries, []
        # A search for an event ends with a line on the event.
        rejected = [p for p in tries if p.verdict != Verdict.EVENT.value]
        if not rejected:
            return
        if all(p.verdict == Verdict.ERROR.value for p in rejected):
            self._too_large += 1
            if self._too_large > LISTED:
                return
        first = rejected[0]
        # Reasons that differ in their numbers alone are one: a step cut ten times would tell ten shares of it.
        # fault: each try is a reason of its own -> told = [(p, p.message) for p in rejected] |
        #   coupler/test_console::test_tries_of_one_window_are_one_line
        told = [(p, NUMBER.sub("#", p.message)) for p in rejected]
        kinds = {p.verdict if p.verdict == Verdict.ERROR.value else (p.verdict, text): p for p, text in reversed(told)}
        reasons = "; ".join(f"{FAILURES.get(p.verdict, p.verdict)} ({p.message})" for p in reversed(kinds.values()))
        times = f"; the step was rejected {len(rejected)} times" if len(rejected) > 1 else "; the step was rejected"
        more = "; further ones are only counted" if self._too_large == LISTED else ""
        self._print(f"window {first.number} at t = {first.t:.6g} s, {first.H:.3g} s {first.scheme}".rstrip()
                    + f": {reasons}{times}; {outcome}{more}")

    def _print(self, text: str) -> None:
        self._console.print(text, soft_wrap=True, markup=False)

    def line(self, p: Progress) -> str:
        """Return t, window and its size, solver calls, contact, max T, max p, energy-balance error, and time to go.

        The time to go is there once it is estimated.
        """
        T = p.max_T - (ZERO_CELSIUS if self._unit == "degC" else 0.0)
        estimated = p.fraction >= GUESS_AFTER and math.isfinite(p.remaining)
        to_go = f" | {clock_text(p.remaining)} to go" if estimated else ""
        # After a rejection there are more windows than were planned.
        # fault: a run does more windows than it has -> planned = p.total | coupler/test_console
        planned = p.total if not self._rejected and p.number <= p.total else 0
        number = f"{p.number}/{planned} of {p.H:.3g} s" if planned else f"{p.number} of {p.H:.3g} s"
        calls = f"{self._solves} solver calls | " if self._solves else ""
        # fault: what a window broke is forgotten by the next -> n = int(p.anyway) | coupler/test_console
        n = self._anyway
        trust = f" | trust so far: {n} window{'s' if n > 1 else ''} not converged or of too large an error" if n else ""
        rejected = f" ({self._rejected} rejected)" if self._rejected else ""
        iterations = f"{p.iterations} iterations | " if p.iterations else ""
        return (f"t {p.t:.6g} of {p.t_end:.6g} s | window {number}{rejected} | {calls}{iterations}"
                f"{p.touching} points touch | max T {T:.1f} {self._unit} | max p {p.max_p / 1e6 + 0.0:.3g} MPa | "
                f"energy-balance error {p.imbalance:.1g}{trust}{to_go}")

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if self._quiet:
            return
        self._print_tries("stopped")
        if self._console.is_terminal:
            self._live.stop()


BAR = 16  # letters


def bar(fraction: float) -> str:
    """Draw how much of a run is done, 0 to 1."""
    done = round(BAR * min(max(fraction, 0.0), 1.0))
    return f"[{'=' * done}{' ' * (BAR - done)}] {100 * fraction:3.0f} %"


def facts(results: Results) -> dict[str, Any]:
    """What a script reads of a run: plain values in SI."""
    w = results.windows
    return {"outcome": results.outcome, "exit_code": exit_code(results), "message": results.message,
            "file": str(results.path),
            "field_files": {half: str(path) for half, path in results.field_files.items()},
            "t": float(results.t[-1]) if len(results.t) else 0.0, "end": float(results.header["coupling"]["end"]),
            "windows": int(w.taken.sum()), "rejected": int((~w.taken).sum()),
            "solver_calls": int(w.solves.sum() + results.rewound.get("solves", 0)),
            "seconds": results.seconds_by_part, "energy_balance_error": results.heat_imbalance,
            "trusted": not results.broken, "notes": list(results.notes),
            "checks": [{k: _finite(v) for k, v in c.as_dict().items()} for c in results.trust],
            "probes": {n: {"last": _finite(float(results.probe(n)[1][-1])), "unit": results.unit(n)}
                       for n in results.probe_names if len(results.t)}}


def _finite(value: Any) -> Any:
    """A value of JSON, which knows neither inf nor nan."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def clock_text(seconds: float) -> str:
    """Format a duration: 5 s, 2:05 min, 1:02:05 h."""
    s = round(seconds)
    if s < 60:
        return f"{s} s"
    if s < 3600:
        return f"{s // 60}:{s % 60:02d} min"
    return f"{s // 3600}:{s % 3600 // 60:02d}:{s % 60:02d} h"


def summary(results: Results, printed: Collection[str] = ()) -> str:
    """Return a few lines on a run and its files, and its notes but those that were printed already."""
    w = results.windows
    accepted = int(w.taken.sum())
    parts = results.seconds_by_part
    set_up, both = parts.pop("set-up"), results.overlap_seconds
    lines = [
        f"{results.outcome}: {results.t[-1]:.6g} s in {accepted} windows"
        + (f" ({len(w) - accepted} rejected)" if len(w) > accepted else "")
        + f", {int(w.solves.sum() + results.rewound.get('solves', 0))} solver calls, "
        # fault: seconds in which both halves worked are told twice -> + f"{sum(parts.values()):.1f} s after " |
        #   coupler/test_console
        + f"{sum(parts.values()) - both:.1f} s after "
        + f"{set_up:.1f} s of set-up",
        "  " + ", ".join(f"{name} {seconds:.1f} s" for name, seconds in parts.items())
        + (f" (both halves at the same time: {both:.1f} s)" if both >= 0.05 else ""),
        f"  relative energy-balance error {results.heat_imbalance:.2g}",
        *condition_lines(results),
        f"  {results.path}, " + ", ".join(str(p) for p in results.field_files.values()),
    ]
    if iterations := iteration_words(results):
        lines.insert(1, f"  {iterations}")
    if results.message:
        lines.insert(1, f"  {results.message}")
    if can_resume(results.path):
        lines.append(f"  to resume: slideline resume {results.path}")
    # fault: notes printed at the start are printed at the end again -> return "\n".join(lines + [f"  note: {n}" for n
    #   in results.notes]) | coupler/test_console
    return "\n".join(lines + [f"  note: {n}" for n in results.notes if n not in printed] + _trust(results))


def _trust(results: Results) -> list[str]:
    """Return the last lines of a run: what its checks found."""
    checks = results.trust
    if not checks:
        return []
    noted = [f"  note: {c.sentence}" for c in checks if c.verdict is TrustVerdict.NOTED]
    if wrong := results.broken:
        return [*noted, f"do not trust this run: {len(wrong)} of {len(checks)} checks failed",
                *(f"  {c.sentence}" for c in wrong)]
    held = sum(c.verdict is TrustVerdict.HOLDS for c in checks)
    rest = [f"{len(noted)} noted"] * bool(noted) + [
        f"not checked: {c.name} ({c.what})" for c in checks if c.verdict is TrustVerdict.UNCHECKED]
    return [*noted, f"  trust: {held} of {len(checks)} checks hold" + "".join(f"; {text}" for text in rest)]
