"""What is wrong with a scenario or a model.json: where, what, and what to write instead."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from contact.problem.boundary import FORMAT, UNEVEN
from contact.problem.part import Part
from contact.problem.values import NO_TEXT, At, did_you_mean

P = TypeVar("P", bound=Part)
SHOWN = 60  # longer values are not repeated in a message
UNKNOWN, MISSING = "unknown key", "a required key is missing"


@dataclass(frozen=True)
class Wrong:
    """A wrong value.  key : its place.  remedy : what to write instead, a sentence, or ""."""

    key: At
    text: str
    remedy: str = ""

    def sentence(self, model: Any = None, at: At = ("model.json:",)) -> str:
        """Write `at.key: what, not value. remedy`.  model : where the value is looked up.  at : its own place."""
        where = ".".join(map(str, (*at, *self.key))).replace(":.", ": ")
        said = f"{where.removesuffix(':')}: {self.text}"
        value = _value_at(model, self.key)
        got = "" if value is None or isinstance(value, Mapping) or len(repr(value)) > SHOWN else f", not {value!r}"
        return f"{said}{got}. {self.remedy}" if self.remedy else f"{said}{got}"


def _value_at(node: Any, key: At) -> Any:
    """What stands at a key, None where nothing does."""
    for part in key:
        if isinstance(node, Mapping):
            node = node.get(part)
        elif isinstance(node, Sequence) and isinstance(part, int) and part < len(node):
            node = node[part]
        else:
            return None
    return node


def wrongs(error: ValidationError) -> list[Wrong]:
    """List all that is wrong, in the order it was found; a key that is missing because it is misspelt is told once."""
    told = error.errors(include_url=False)
    found = [_wrong(details) for details in told]
    # Where a value may have one of several forms, the form of which more is there is meant, and text last.
    forms = [w for w, details in zip(found, told, strict=True) if any(_is_form(p) for p in details["loc"])]
    found = [w for w in found if not (w in forms and any(
        w.key == f.key[: len(w.key)] and (w.key != f.key or w.text == NO_TEXT != f.text) for f in forms))]
    misspelt = {(w.key[:-1], meant(w)) for w in found if w.text == UNKNOWN}
    return [w for w in found if not (w.text == MISSING and (w.key[:-1], w.key[-1]) in misspelt)]


def meant(wrong: Wrong) -> str:
    """Return the key that an unknown one was meant to be, "" if none is near."""
    head, _, rest = wrong.remedy.partition("'")
    return rest.partition("'")[0] if head.startswith("Did you mean") else ""


def _is_form(part: int | str) -> bool:
    """Whether a part of a place names one of the forms of a value, and is no key of a file."""
    return isinstance(part, str) and part.startswith("function-")


def _wrong(details: ErrorDetails) -> Wrong:
    # Tags of unions stand in angle brackets, "[key]" marks a name that is itself wrong: not in the file.
    key: At = tuple(p for p in details["loc"]
                    if not (isinstance(p, str) and (p[:1] == "<" or p == "[key]" or _is_form(p))))
    context = details.get("ctx", {})
    kind = details["type"]
    if kind == "slideline":
        return Wrong((*key, *context["at"]), context["text"], context["remedy"])
    if kind == "missing" and key and isinstance(key[-1], int):
        return Wrong(key[:-1], "the list is too short")
    if kind == "missing":
        return Wrong(key, MISSING, "See docs/scenario.md.")
    if kind in ("enum", "literal_error"):
        known = [word.strip(" '") for word in str(context["expected"]).replace(" or ", ",").split(",")]
        return Wrong(key, "not known here", did_you_mean(str(details["input"]), known))
    if kind in ("tuple_type", "list_type"):
        return Wrong(key, "a list is needed here", "Write [a, b, ...].")
    if kind == "dict_type":
        return Wrong(key, "a mapping of names is needed here", "Write {name: ...}.")
    if kind in ("too_short", "too_long"):
        wanted = context.get("min_length", context.get("max_length"))
        return Wrong(key, f"a list of {wanted} is needed here, not of {context['actual_length']}")
    if kind == "bool_type":
        return Wrong(key, "true or false is needed here")
    return Wrong(key, details["msg"][:1].lower() + details["msg"][1:])


def read(cls: type[P], model: Mapping[str, Any], *kinds: str) -> P:
    """Return the problem that a model.json states.  kinds : which `half` it may be of.

    Raises ValueError that names every key that is wrong and what would do.
    """
    half, form = model.get("half"), model.get("format")
    if half not in kinds or form not in (FORMAT, UNEVEN):
        raise ValueError(f"model.json: half {half!r}, format {form!r} is not {' or '.join(kinds)}, {FORMAT} or "
                         f"{UNEVEN}")
    try:
        return cls.model_validate(model)
    except ValidationError as exc:
        raise ValueError("\n".join(w.sentence(model) for w in wrongs(exc))) from None


def made(cls: type[P], spec: Mapping[str, Any], at: At = ("model.json:",)) -> P:
    """Return the part that a mapping states.  at : where it stands in a model.json.

    Raises ValueError that tells all that is wrong with it.
    """
    try:
        return cls.model_validate(spec)
    except ValidationError as exc:
        raise ValueError("\n".join(w.sentence(spec, at) for w in wrongs(exc))) from None


def demand(found: Iterable[Wrong]) -> None:
    """Raise ValueError that tells all that is wrong, if anything is."""
    if sentences := [wrong.sentence() for wrong in found]:
        raise ValueError("\n".join(sentences))
