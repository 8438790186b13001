"""The errors that the coupler raises.

    SlidelineError
    |-- ScenarioError    the input is wrong; raised before any solver starts
    |-- HalfError        a half died, is stuck, or refused a call
    |-- CouplingError    a window could not be solved
    `-- ResultsError     a results file cannot be read, or does not hold what was asked for

Errors of the link to the contact service are contact.link.LinkError: contact knows nothing of the coupler.
A bug is an assertion, never one of these.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

# Control characters but for tab and new line, marks that turn the direction of text, and halves of characters.
LEVEL = re.compile(r"^\[\w+\] ")  # of a line of a log
UNPRINTABLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def printable(text: str) -> str:
    """Return a text that does nothing to a terminal: what it quotes may come from anywhere."""
    # fault: what a message quotes steers the terminal -> return text | coupler/test_error_text
    return UNPRINTABLE.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def in_words(value: float) -> str:
    """Write a number as a sentence has it: 8980 and 0.0312, with an exponent only where that would be long."""
    # fault: messages say 8.98e+03 -> return f"{value:.3g}" | coupler/test_error_text
    return f"{float(f'{value:.3g}'):.7g}" if value == 0.0 or 1e-4 <= abs(value) < 1e7 else f"{value:.3g}"


class SlidelineError(Exception):
    """Base of all errors below; its text is meant for the user."""

    def __str__(self) -> str:
        return printable(super().__str__())


class ScenarioError(SlidelineError):
    """The input is wrong.

    file, line : of the error (line 0: unknown).  key : dotted path of the wrong key.  value : of that key.
    remedy : what to write instead, a sentence.  others : what else is wrong with the same input.
    """

    def __init__(self, message: str, *, file: str = "", line: int = 0, key: str = "", value: object = None,
                 remedy: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.file = file
        self.line = line
        self.key = key
        self.value = value
        self.remedy = remedy
        self.others: tuple[ScenarioError, ...] = ()

    def __str__(self) -> str:
        """Write `file:line: key: message (got value). remedy` without the parts that are not known, a line an error."""
        return "\n".join((printable(self._line()), *map(str, self.others)))

    def _line(self) -> str:
        where = f"{self.file}:{self.line}" if self.file and self.line else self.file
        if not self.file and self.line:
            where = f"line {self.line}"
        got = "" if self.value is None else f" (got {self.value!r})"
        text = ": ".join(part for part in (where, self.key, self.message.rstrip(".") + got) if part)
        return f"{text}. {self.remedy}" if self.remedy else text


def together(errors: Sequence[ScenarioError]) -> ScenarioError:
    """Join one error or more into the first, which then tells all of them."""
    first, *rest = errors
    first.others = tuple(rest)
    return first


class HalfError(SlidelineError):
    """A half died, is stuck, or refused a call.

    half : its name.  log : its tail, may be empty.  went_back : both halves are again where the window began that this
    ended, as far as they themselves say.
    """

    def __init__(self, message: str, *, half: str = "", log: str = "") -> None:
        super().__init__(message)
        self.went_back = False
        self.message = message
        self.half = half
        self.log = log

    def __str__(self) -> str:
        head = f"half {self.half!r}: {self.message}" if self.half else self.message
        # What a half logs of its failure is often what it answers.
        # fault: a failure of a half is told twice -> log = self.log | coupler/test_error_text
        log = "\n".join(line for line in self.log.splitlines() if LEVEL.sub("", line) not in self.message)
        return printable(f"{head}\n{indented(log)}" if log.strip() else head)


class CouplingError(SlidelineError):
    """A window could not be solved, and the run stops.

    t : time at the start of the window [s].  window : its number, from 1.  iteration : the last one tried.
    residuals : the last residuals, scaled by their tolerances.  remedy : how to resume or correct the run.
    """

    def __init__(self, message: str, *, t: float = 0.0, window: int = 0, iteration: int = 0,
                 residuals: Sequence[float] = (), remedy: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.t = t
        self.window = window
        self.iteration = iteration
        self.residuals = tuple(residuals)
        self.remedy = remedy

    def __str__(self) -> str:
        where = f"window {self.window} at t = {self.t:.9g} s"
        if self.iteration:
            where += f", iteration {self.iteration}"
        text = f"{where}: {self.message.rstrip('.')}"
        if self.residuals:
            text += f" (last residuals, in tolerances: {', '.join(map(in_words, self.residuals))})"
        return printable(f"{text}. {self.remedy}" if self.remedy else text)


class ResultsError(SlidelineError):
    """A results file cannot be read, or does not hold what was asked for."""


def indented(text: str) -> str:
    """Indent every line of a quoted log by four blanks."""
    return "\n".join(f"    {line}" for line in text.rstrip().splitlines())
