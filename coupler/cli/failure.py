"""What a script reads of a command that failed: one JSON object on standard output, beside the text for people."""

from __future__ import annotations

from typing import Any

from contact.rpc.calls import LinkError
from coupler.errors import CouplingError, HalfError, ResultsError, ScenarioError, SlidelineError

KINDS = {ScenarioError: "input", HalfError: "half", CouplingError: "window", ResultsError: "results",
         LinkError: "contact link"}


def failure(error: SlidelineError | LinkError, code: int) -> dict[str, Any]:
    """Return the facts of an error.

    code : exit code of the process.  An error has a kind, a message, a remedy and `where`: the file, line, key and
    value of an input, the half, or the time and number of a window.  What `check --json` prints begins with the same.
    """
    errors = (error, *error.others) if isinstance(error, ScenarioError) else (error,)
    return {"outcome": "failed", "exit_code": code, "errors": [_facts(one) for one in errors],
            # fault: notes of a run that failed have another form than those of one that did not -> "notes": [*getattr(
            #   error, "__notes__", ())]} | coupler/test_cli
            "notes": [note.removeprefix("note: ") for note in getattr(error, "__notes__", ())]}


def misused(message: str, code: int) -> dict[str, Any]:
    """Return the facts of a command, an option or an argument that there is not, as of `failure`."""
    fact = {"kind": "usage", "message": message, "where": {}, "remedy": "`slideline COMMAND --help` names its options."}
    return {"outcome": "failed", "exit_code": code, "errors": [fact], "notes": []}


def _facts(error: SlidelineError | LinkError) -> dict[str, Any]:
    return {"kind": next((kind for of, kind in KINDS.items() if isinstance(error, of)), "other"),
            "message": getattr(error, "message", str(error)), "where": _where(error),
            "remedy": getattr(error, "remedy", "")}


def _where(error: SlidelineError | LinkError) -> dict[str, Any]:
    match error:
        case ScenarioError():
            value = None if error.value is None else str(error.value)
            return {"file": error.file, "line": error.line, "key": error.key, "value": value}
        case HalfError():
            return {"half": error.half}
        case CouplingError():
            return {"t": error.t, "window": error.window, "iteration": error.iteration}
    return {}
