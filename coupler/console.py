"""What a run shows while it runs: one live line on a terminal, a line every tenth of the way elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Collection
from types import TracebackType

from rich.console import Console
from rich.live import Live
from rich.spinner import Spinner
from rich.text import Text

from coupler.results import Results, iteration_words
from coupler.runner import Progress
from coupler.window import Verdict

ZERO_CELSIUS = 273.15
# The first windows load compiled code and solve from cold: an estimate from them is ten times too long.
GUESS_AFTER = 0.05
SETTING_UP = "building and loading the halves; the first run on a machine compiles them too, up to a minute"


class ProgressLine:
    """Shows Progress values; temperatures in the scenario's unit."""

    def __init__(self, temperature_unit: str, console: Console | None = None) -> None:
        self._unit = temperature_unit
        self._console = console or Console(file=sys.stderr, highlight=False)
        self._live = Live(console=self._console, refresh_per_second=8, transient=True)
        self._next_share = 0.0
        self._rejected = 0
        self.told: set[str] = set()
        self._reason = ""

    def __enter__(self) -> ProgressLine:
        if self._console.is_terminal:
            self._live.update(Spinner("dots", SETTING_UP))
            self._live.start()
        else:
            print(SETTING_UP, file=self._console.file, flush=True)
        return self

    def __call__(self, p: Progress) -> None:
        self.told.update(p.notes)
        for note in p.notes:
            self._console.print(f"note: {note}", soft_wrap=True, markup=False)
        if p.verdict != Verdict.ACCEPTED.value:
            self._rejected += not p.taken
            # The reason once: halving a window ten times repeats it ten times.
            reason = "the same" if p.message == self._reason else p.message
            self._reason = p.message
            what = "taken all the same" if p.taken else "trying half of it"
            self._console.print(f"window {p.number} at t = {p.t:.6g} s: {p.verdict} ({reason}); {what}",
                                soft_wrap=True, markup=False)
        if not p.taken:
            return
        if self._console.is_terminal:
            self._live.update(Text(self.line(p)))
        elif p.number / p.total >= self._next_share:
            # By windows, not by time: most of the work lies where windows are small.
            self._next_share = p.number / p.total + 0.1
            print(self.line(p), file=self._console.file, flush=True)

    def line(self, p: Progress) -> str:
        """t, windows, contact count, max T, max p, heat imbalance, time left once it can be told."""
        T = p.max_T - (ZERO_CELSIUS if self._unit == "degC" else 0.0)
        left = f" | {clock_text(p.left)} left" if p.number >= GUESS_AFTER * p.total else ""
        rejected = f" ({self._rejected} rejected)" if self._rejected else ""
        iterations = f"{p.iterations} iterations | " if p.iterations else ""
        return (f"t {p.t:.6g} of {p.t_end:.6g} s | window {p.number}/{p.total}{rejected} | {iterations}"
                f"{p.touching} points touch | max T {T:.1f} {self._unit} | max p {p.max_p / 1e6 + 0.0:.3g} MPa | "
                f"heat imbalance {p.imbalance:.0e}{left}")

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if self._console.is_terminal:
            self._live.stop()


def clock_text(seconds: float) -> str:
    """5 s, 2:05 min, 1:02:05 h."""
    s = round(seconds)
    if s < 60:
        return f"{s} s"
    if s < 3600:
        return f"{s // 60}:{s % 60:02d} min"
    return f"{s // 3600}:{s % 3600 // 60:02d}:{s % 60:02d} h"


def summary(results: Results, told: Collection[str] = ()) -> str:
    """A few lines on what a run did and where it left its files, and its notes but those told already."""
    w = results.windows
    accepted = int(w.taken.sum())
    parts = results.seconds_by_part
    set_up = parts.pop("set-up")
    lines = [
        f"{results.outcome}: {results.t[-1]:.6g} s in {accepted} windows"
        + (f" ({len(w) - accepted} rejected)" if len(w) > accepted else "")
        + f", {int(w.solves.sum())} half-solves, {sum(parts.values()):.1f} s after {set_up:.1f} s of set-up",
        "  " + ", ".join(f"{name} {seconds:.1f} s" for name, seconds in parts.items()),
        f"  heat imbalance {results.heat_imbalance:.1e}",
        f"  {results.path}, " + ", ".join(str(p) for p in results.field_files.values()),
    ]
    if words := iteration_words(results):
        lines.insert(1, f"  {words}")
    if results.message:
        lines.insert(1, f"  {results.message}")
    return "\n".join(lines + [f"  note: {n}" for n in results.notes if n not in told])
