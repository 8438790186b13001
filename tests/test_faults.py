"""The faults marked in the sources can be planted; `python tests/faults.py` says which are noticed."""

from __future__ import annotations

import ast
import functools
import importlib.util
import sys
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
_spec = importlib.util.spec_from_file_location("faults", ROOT / "tests" / "faults.py")
assert _spec
assert _spec.loader
faults = importlib.util.module_from_spec(_spec)
sys.modules["faults"] = faults
_spec.loader.exec_module(faults)

SOURCE = """\
def area(a, b):
    # an ordinary comment
    # fault: a sum -> return a + b | contact/test_laws
    # fault: a name that is long and carries on below -> return a * b if a > 0.0
    #   else 0 | b | contact/test_laws::test_a coupler/test_rules
    return a * b
"""


@functools.cache
def statements_of(source):
    """The first and last line (from 1) of each statement that begins its line, decorators and all; short ones first."""
    lines, found = source.split("\n"), set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.stmt):
            begins = lines[node.lineno - 1][:node.col_offset].isspace() or not node.col_offset
            if begins and not lines[node.lineno - 1].lstrip().startswith("elif "):
                first = min([node.lineno, *(d.lineno for d in getattr(node, "decorator_list", []))])
                found.add((first, node.end_lineno))
    return sorted(found, key=lambda lines: lines[1] - lines[0])


@functools.cache
def meaning_of(text):
    return ast.dump(ast.parse(f"if 1:\n{text}" if text[0].isspace() else text))


def changes(fault, source):
    """Whether the statement that a fault is planted in means something else by it: a whole file takes long to parse."""
    first, last = next(lines for lines in statements_of(source) if lines[0] <= fault.line <= lines[1])
    old, new = ("\n".join(text.split("\n")[first - 1:last]) for text in (source, fault.planted(source)))
    return meaning_of(new) != meaning_of(old)


def problems_of(fault, source):
    """What keeps a fault from being planted and noticed, in words."""
    try:
        if not changes(fault, source):
            yield "changes nothing"
        elif names := faults.undefined_by(fault, source):
            yield f"uses {', '.join(names)}, which nothing defines"
    except SyntaxError as exc:
        yield f"is no Python: {exc}"
    for test in fault.tests:
        file, _, name = test.partition("::")
        path = ROOT / file
        if not path.is_file():
            yield f"names {file}, which is not there"
        elif name and f"def {name.partition('[')[0].rpartition('::')[2]}(" not in path.read_text(encoding="utf-8"):
            yield f"names {test}, which is not there"


def test_every_fault_can_be_planted():
    marked = list(faults.all_faults())
    assert marked
    sources = {f.file: (ROOT / f.file).read_text(encoding="utf-8") for f in marked}
    found = [f"{f.file}:{f.line}: {f.name}: {said}" for f in marked for said in problems_of(f, sources[f.file])]
    found += [f"{file}: {name}: {n} faults of this name"
              for (file, name), n in Counter((f.file, f.name) for f in marked).items() if n > 1]
    assert not found, "\n".join(found)


def test_marks_above_one_line_and_carried_on():
    one, two = faults.marked_in(SOURCE, "a.py")
    assert (one.name, one.line, one.text, one.tests) == ("a sum", 6, "return a + b", ("tests/contact/test_laws.py",))
    assert (two.line, two.text) == (6, "return a * b if a > 0.0 else 0 | b")
    assert two.tests == ("tests/contact/test_laws.py::test_a", "tests/coupler/test_rules.py")
    assert one.planted(SOURCE) == SOURCE.replace("    return a * b\n", "    return a + b\n")


@pytest.mark.parametrize(("source", "said"), [
    ("# fault: no text | contact/test_laws\nx = 1\n", "a.py:1: a mark reads"),
    ("# fault: no tests -> x = 2\nx = 1\n", "a.py:1: a mark reads"),
    ("\n# fault: none -> x = 2 | contact/test_laws\n\nx = 1\n", "a.py:2: no line of code"),
    ("# fault: none -> x = 2 | contact/test_laws", "a.py:1: no line of code"),
])
def test_a_mark_of_another_form_is_refused(source, said):
    with pytest.raises(ValueError, match=said):
        list(faults.marked_in(source, "a.py"))


@pytest.mark.parametrize(("text", "tests", "said"), [
    ("x = 1  # the same", "contact/test_laws", "changes nothing"),
    ("x = (", "contact/test_laws", "is no Python"),
    ("x = none_such", "contact/test_laws", "uses none_such, which"),
    ("y = 1", "contact/test_laws", "uses x, which"),
    ("x = 2", "contact/test_none", "names tests/contact/test_none.py, which"),
    ("x = 2", "contact/test_laws::test_none", "::test_none, which"),
])
def test_a_fault_that_cannot_be_planted_is_told(text, tests, said):
    source = f"# fault: one -> {text} | {tests}\nx = 1\ndef of_x(y):\n    return [x + z for z in y], len(__file__)\n"
    (fault,) = faults.marked_in(source, "a.py")
    (told,) = problems_of(fault, source)
    assert said in told


def test_a_fault_that_would_be_a_name_error_is_not_planted(tmp_path):
    line = (ROOT / "contact/laws.py").read_text(encoding="utf-8").split("\n").index("import numpy as np") + 1
    fault = faults.Fault("an import lost", "contact/laws.py", line, "import math", ("tests/test_imports.py",))
    with pytest.raises(ValueError, match=f"contact/laws.py:{line}: an import lost: nothing defines np"):
        faults.faulty_copy(fault, tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_what_no_test_notices_is_reported(capsys):
    first = (ROOT / "contact/laws.py").read_text(encoding="utf-8").split("\n")[0]
    harmless = faults.Fault("a longer docstring", "contact/laws.py", 1, f"{first} More.", ("tests/test_imports.py",))
    harmful = faults.Fault("an import up", "contact/laws.py", 1, f"import coupler; {first}", ("tests/test_imports.py",))
    assert first.startswith('"""')
    assert faults.run([harmful]) == 0
    assert faults.run([harmless]) == 1
    assert capsys.readouterr().out.splitlines() == [
        "1/1 red          contact/laws.py:1: an import up", "1/1 NOT NOTICED  contact/laws.py:1: a longer docstring"]
