"""What an error quotes does nothing to the terminal it is printed on."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from coupler.errors import (
    UNPRINTABLE,
    CouplingError,
    HalfError,
    ResultsError,
    ScenarioError,
    in_words,
    printable,
    together,
)

BAD = "a\x1b[31mb\x9bc\rd\u202ee\ud800f\x00g"
GOOD = r"a\u001b[31mb\u009bc\u000dd\u202ee\ud800f\u0000g"


@pytest.mark.parametrize("error", [
    ScenarioError(BAD), ScenarioError("m", file=BAD), ScenarioError("m", key=BAD), ScenarioError("m", remedy=BAD),
    together([ScenarioError("m"), ScenarioError(BAD)]), HalfError(BAD), HalfError("m", half="h", log=BAD),
    CouplingError(BAD), CouplingError("m", remedy=BAD), ResultsError(BAD)])
def test_no_error_steers_a_terminal(error):
    assert UNPRINTABLE.search(str(error)) is None
    assert "[31m" in str(error)
    str(error).encode()  # no half of a character is left


@pytest.mark.parametrize(("value", "words"), [
    (8983.4, "8980"), (0.99, "0.99"), (0.03124, "0.0312"), (0.0, "0"), (1234567.0, "1230000"), (1e-9, "1e-09"),
    (2.5e12, "2.5e+12"), (float("inf"), "inf")])
def test_numbers_in_sentences_have_no_exponent_where_they_need_none(value, words):
    assert in_words(value) == words
    assert f"tolerances: {words})" in str(CouplingError("m", residuals=[value]))


def test_what_is_taken_out_can_be_told():
    assert printable(BAD) == GOOD
    text = "line\n\ttab, \u00e4, \u8f6e, \U0001f600"
    assert printable(text) == text


# Folders whose errors a user of scenarios meets; `error` and `wrong` take (key, text, remedy).
INPUT = ("scenario", "cli", "init", "running")
ROOT = Path(__file__).resolve().parents[2]


def without_remedy(source: str) -> Iterator[int]:
    """The lines of a source that make an error of the input without saying what to write instead."""
    for call in ast.walk(ast.parse(source)):
        if not isinstance(call, ast.Call):
            continue
        name = call.func.id if isinstance(call.func, ast.Name) else getattr(call.func, "attr", "")
        told = {"ScenarioError": False, "error": len(call.args) > 2, "wrong": len(call.args) > 2}.get(name)
        starred = any(isinstance(arg, ast.Starred) for arg in call.args)
        if told is False and not starred and all(k.arg != "remedy" for k in call.keywords):
            yield call.lineno


def test_every_error_of_the_input_has_a_remedy() -> None:
    # fault marks change lines of the packages; this one is seen red on a source of its own.
    assert list(without_remedy("raise ScenarioError('no')\nd.error(k, 'no', 'Do.')\nd.wrong(k, 'no')")) == [1, 3]
    bare = {f"{path.name}:{line}" for folder in INPUT for path in sorted((ROOT / "coupler" / folder).glob("*.py"))
            for line in without_remedy(path.read_text(encoding="utf-8"))}
    assert not bare


@pytest.mark.parametrize(("log", "told"), [
    ("[error] no equilibrium", "half 'h': no equilibrium (t = 0 s)"),
    ("[info] 3 tries\n[error] no equilibrium", "half 'h': no equilibrium (t = 0 s)\n    [info] 3 tries"),
    ("no equilibrium of another", "half 'h': no equilibrium (t = 0 s)\n    no equilibrium of another"),
])
def test_what_a_half_logs_and_answers_is_told_once(log, told):
    assert str(HalfError("no equilibrium (t = 0 s)", half="h", log=log)) == told
