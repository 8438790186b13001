"""Phrases that the project has given up stand nowhere a user reads: pages, commands, report, messages, public names.

Each was replaced by the word of the field: the second column.  Measured tables of benchmarks/ are pages too.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md")),
         ROOT / "benchmarks/README.md"]
SOURCES = [path for name in ("contact", "thermal_fmu", "mechanical_fmu", "coupler")
           for path in sorted((ROOT / name).rglob("*.py"))]
GIVEN_UP = {
    r"half-solve": "solver call", r"heat ledger": "heat balance",
    r"heat misfit|misfit of": "relative energy-balance error",
    r"came in by|why so\b": "source, reason",
    r"facing points?\b": "contact quadrature point",
    r"held against the border|how to mend it": "checked against the interface specification",
    r"lies? ready": "prebuilt", r"(?:tries|windows?) put back|put back (?:above|and halved)": "rejected",
    r"finds? (?:its|their) own size": "adaptive", r"told, and left out": "reported and ignored",
    r"how little of the model": "the cheapest model within your tolerance", r"without crumbs": "without tiny steps",
    r"not beaten by any other": "Pareto optimal", r"named breaks?\b": "seeded faults",
    r"zigzag": "alternating error", r"stands twice": "duplicated", r"not dearer": "no more expensive",
    r"after a kink|at a kink or|the next kink": "breakpoint", r"who is let in": "security",
    r"disturbances? turns? round": "alternates", r"in the ledger\b": "in the heat balance",
    r"nobody states\b": "not given", r"told as work": "an output", r"drives it out": "removes it",
    r"that no physics makes": "not physical", r"by hand, for use": "for use",
    r"is in no account": "not in the heat balance",
    r"companion has no answer": "comparison run", r"out of sight": "unreachable", r"as ever\b": "as usual",
    r"(?:is|goes?) told by name": "the error names it", r"what it breaks, and how": "violations and remedies",
    r"told, for|is told, too": "reported", r"what nobody stated": "defaults", r"with its joules": "in joules",
    r"says nothing there": "has no meaning there", r"said in words": "sentence", r"on in silence": "without a message",
}
FENCE = re.compile(r"^```.*?^```$", re.M | re.S)
CODE = re.compile(r"`[^`\n]*`")
# 0.1 %, not .1 % (ISO 80000-1); not a file's ending, a range (1..9) or a factor that a rule reads (`x.5`, code).
BARE_POINT = re.compile(r"(?<![\w.)\]*/])\.\d")
# A case is named, not coded: E3b, D13.  A colour, an axis title or a material (C45) has another form.
CASE_CODE = re.compile(r"\bcases? [A-F]\d{1,2}[a-d]?\b")


def texts_of(path: Path) -> Iterator[tuple[int, str]]:
    """What a source file may show: its string constants, but docstrings of what is not public."""
    private: set[int] = set()
    # A docstring is met after what it is of: the walk goes from the outside in.
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if (isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and node.body
                and isinstance(node.body[0], ast.Expr) and getattr(node, "name", "_").startswith("_")):
            private.add(id(node.body[0].value))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in private:
            yield node.lineno, node.value


@cache
def all_texts() -> tuple[tuple[str, str], ...]:
    """Place and text of all that is read: pages, and what sources may show."""
    return (*((str(page.relative_to(ROOT)), page.read_text(encoding="utf-8")) for page in PAGES),
            *((f"{path.relative_to(ROOT)}:{line}", text) for path in SOURCES for line, text in texts_of(path)))


@pytest.mark.parametrize("phrase", GIVEN_UP)
def test_a_phrase_that_was_given_up_is_gone(phrase: str) -> None:
    found = re.compile(phrase, re.I)
    places = [f"{place}: {hit[0]}" for place, text in all_texts() for hit in found.finditer(text)]
    assert not places, f"write {GIVEN_UP[phrase]!r}: {places}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_numbers_of_pages_have_a_leading_zero(page: Path) -> None:
    prose = CODE.sub("", FENCE.sub("", page.read_text(encoding="utf-8")))
    assert not [prose[max(hit.start() - 20, 0):hit.end() + 20] for hit in BARE_POINT.finditer(prose)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pages_name_cases_and_code_none(page: Path) -> None:
    prose = CODE.sub("", FENCE.sub("", page.read_text(encoding="utf-8")))
    assert not CASE_CODE.findall(prose)
