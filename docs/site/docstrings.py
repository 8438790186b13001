"""Docstrings as the site's pages of names show them: examples as code, and what stands as `name : text` as a list."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from griffe import Extension, Module, Object

# `name : text` at the start of a line or, behind a full stop and two blanks, within one.
_ENTRY = re.compile(r"(?:^|(?<=\.  ))(\w[\w.]*(?:, \w[\w.]*)*(?: \[[^\]]+\])?) : ", re.M)
_RAISES = re.compile(r"(?:^|(?<=\.  ))Raises (?=\w)", re.M)


class Docstrings(Extension):
    """Rewrites the docstring of every object that is shown."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        rewrite(obj)

    def on_module_members(self, *, mod: Module, **_: Any) -> None:
        rewrite(mod)


def rewrite(obj: Object) -> None:
    """Make the docstring of an object Markdown; one that is so stays as it is."""
    if obj.docstring:
        obj.docstring.value = as_markdown(obj.docstring.value)


def as_markdown(text: str) -> str:
    """A docstring's paragraphs, each as Markdown."""
    return "\n\n".join(_paragraph(part) for part in re.split(r"\n\s*\n", text))


def _paragraph(part: str) -> str:
    if part.startswith(">>> "):
        return "\n".join(["```python", *(line[4:] for line in part.splitlines()), "```"])
    return "\n".join(_entries(_RAISES.sub("\n\nRaises ", part)))


def _entries(part: str) -> Iterator[str]:
    """The text before the first entry, then the entries as a list."""
    begun = [match.start() for match in _ENTRY.finditer(part)]
    if not begun:
        yield part
        return
    yield part[:begun[0]].rstrip() + "\n"
    for start, end in zip(begun, [*begun[1:], len(part)], strict=True):
        entry, break_, rest = part[start:end].partition("\n\nRaises ")
        match = _ENTRY.match(entry)
        assert match
        yield f"- `{match[1]}`: " + " ".join(entry[match.end():].split())
        if break_:
            yield f"\nRaises {rest.strip()}"
