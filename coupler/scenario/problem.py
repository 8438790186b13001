"""From what pydantic found wrong to the one ScenarioError that is raised."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from coupler.errors import ScenarioError
from coupler.scenario.document import Document, Key
from coupler.scenario.quantity import did_you_mean


@dataclass(frozen=True)
class Problem:
    """A wrong value: where, what, and what to write instead."""

    key: Key
    message: str
    remedy: str


def scenario_error(document: Document, error: ValidationError) -> ScenarioError:
    """The problem to show: unknown keys first (a misspelt key is also a missing one), then by line."""
    problems = [_problem(details, document) for details in error.errors(include_url=False)]
    first = min(problems, key=lambda p: (p.message != "unknown key", document.line(p.key), len(p.key)))
    return document.error(first.key, first.message, first.remedy)


def _problem(details: ErrorDetails, document: Document) -> Problem:
    # Tags of unions stand in angle brackets, "[key]" marks a name that is itself wrong: not in the file.
    key: Key = tuple(p for p in details["loc"] if not (isinstance(p, str) and (p[:1] == "<" or p == "[key]")))
    context = details.get("ctx", {})
    kind = details["type"]
    if kind == "slideline":
        return Problem((*key, *context["at"]), context["text"], context["remedy"])
    if kind == "missing" and isinstance(key[-1], int):
        return Problem(key[:-1], "the list is too short", "")
    if kind == "missing":
        return Problem(key, "a required key is missing", "See docs/scenario.md.")
    if kind in ("enum", "literal_error"):
        known = [word.strip(" '") for word in str(context["expected"]).replace(" or ", ",").split(",")]
        return Problem(key, "not known here", did_you_mean(str(details["input"]), known))
    if kind in ("tuple_type", "list_type"):
        return Problem(key, "a list is needed here", "Write [a, b, ...].")
    if kind == "dict_type":
        return Problem(key, "a mapping of names is needed here", "Write {name: ...}.")
    if kind in ("too_short", "too_long"):
        wanted = context.get("min_length", context.get("max_length"))
        return Problem(key, f"a list of {wanted} is needed here, not of {context['actual_length']}", "")
    if kind == "bool_type":
        return Problem(key, "true or false is needed here", "")
    return Problem(key, details["msg"][:1].lower() + details["msg"][1:], "")
