"""Files that are no scenario at all, and files made to hang their reader."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from coupler.errors import UNPRINTABLE, ScenarioError
from coupler.scenario import load_scenario
from coupler.scenario.document import MAX_BYTES, document_from, read_document

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, load_text

BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 12))


def refusal(path: Path, data: bytes | None) -> ScenarioError:
    """The error a file with these bytes gives."""
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path)
    assert caught.value.file == str(path)
    return caught.value


@pytest.mark.parametrize(("data", "words", "line"), [
    (None, "no such file", 0),
    (b"", "empty", 0),
    (b"# only a comment\n", "empty", 0),
    (b"- a\n- b\n", "mapping of keys", 1),
    (b"just text\n", "mapping of keys", 1),
    (b"a: 1\nb: [1, 2\nc: 3\n", "not valid YAML", 3),
    (b"a: 1\n\tb: 2\n", "not valid YAML", 2),
    (b"a: \xff\xfe\n", "not UTF-8", 1),
    (b"\x89HDF\r\n\x1a\n\x00", "results file, not a scenario", 0),
    ("ä: 1\n".encode("latin-1"), "not UTF-8", 1),
    (b"a: 1\x00\n", "not valid YAML", 0),
    (b"a: 1\nb: 2\na: 3\n", "is duplicated", 3),
    (b"a: {b: 1, b: 2}\n", "is duplicated", 1),
    (b"a: 1\n---\nb: 2\n", "not valid YAML", 2),
    (b"1: 2\n", "not text", 1),
    (b"a: !!python/object/apply:os.system ['true']\n", "tag", 1),
    (b"a: !thing {b: 1}\n", "tag", 1),
    (b"a: !thing 1\n", "tag", 1),
    (b"title: 2020-01-01\n", "date", 1),
    (b"title: 2020-13-45\n", "not valid YAML", 0),
    (b"a: *nowhere\n", "not valid YAML", 1),
])
def test_what_is_no_scenario_is_one_clear_error(data: bytes | None, words: str, line: int, tmp_path: Path) -> None:
    error = refusal(tmp_path / "s.yaml", data)
    assert words in error.message
    assert error.line == line


@pytest.mark.parametrize(("data", "words", "remedy"), [
    (b"a:\n\tb: 2\n", "not valid YAML", "not with tabs"),
    (b"a: {b: 1, b: {c: 2}}\n", 'a key is duplicated: "b"', "Remove or rename"),
    (b"a: {E: 2,1e11: }\n", "not text", "decimal point, not a comma"),
])
def test_slips_of_typing_have_a_remedy(data: bytes, words: str, remedy: str, tmp_path: Path) -> None:
    error = refusal(tmp_path / "s.yaml", data)
    assert words in error.message
    assert "value" not in error.message
    assert remedy in error.remedy


def test_an_on_that_became_true_is_understood(tmp_path: Path) -> None:
    error = refusal(tmp_path / "scene.yaml", b"thermal: {boundary: [{true: rod.left, temperature: 20}]}\n")
    assert error.key == "thermal.boundary.0"
    assert "the key true is not text. A program that writes YAML 1.1 makes `true` of `on`: write on" in str(error)


def test_what_is_done_to_a_document_another_of_the_same_text_does_not_see(tmp_path: Path,
                                                                          monkeypatch: pytest.MonkeyPatch) -> None:
    text = "a: {b: [1, 2.5, two]}\nc: &c {d: 1e-3}\ne: *c\n"
    parsed = []
    load = YAML.load
    monkeypatch.setattr(YAML, "load", lambda self, text: parsed.append(text) or load(self, text))
    first = document_from(tmp_path / "s.yaml", text)
    first.tree["a"]["b"].append(3)
    first.tree["c"]["d"] = 7.0
    first.lines.clear()
    second = document_from(tmp_path / "other.yaml", text)
    assert second.tree == {"a": {"b": [1, 2.5, "two"]}, "c": {"d": 1e-3}, "e": {"d": 1e-3}}
    assert second.lines[("c",)] == 2
    assert second.path.name == "other.yaml"
    assert parsed == [text]
    assert document_from(tmp_path / "s.yaml", text.replace("two", "three")).tree["a"]["b"][2] == "three"
    assert len(parsed) == 2


def test_a_folder_is_not_a_scenario(tmp_path: Path) -> None:
    assert "regular file" in refusal(tmp_path, None).message


@pytest.mark.parametrize("data", [
    pytest.param(BOMB.encode(), id="aliases within aliases"),
    pytest.param(b"a: &a [*a]\n", id="a list in itself"),
    pytest.param(b"a: &a {b: *a}\n", id="a mapping in itself"),
    pytest.param(b"a: " + b"[" * 100_000, id="deep flow"),
    pytest.param(b"a: " + b"{a: " * 2_000, id="deep mappings"),
    pytest.param(b"".join(b" " * i + b"a:\n" for i in range(600)), id="deep lines"),
    pytest.param(b"a: &a {" + b"".join(b"k%d: 1, " % i for i in range(2000)) + b"}\nb: {<<: ["
                 + b"*a, " * 5000 + b"]}\n",
                 id="merged again and again"),
    pytest.param(b"a0: &a0 [1, 2, 3]\n" + b"".join(b"a%d: &a%d [*a%d, *a%d, *a%d]\n" % (i, i, i - 1, i - 1, i - 1)
                                                 for i in range(1, 40)), id="few aliases, many values"),
])
def test_texts_made_to_hang_are_refused_soon(data: bytes, tmp_path: Path) -> None:
    start = time.process_time()
    refusal(tmp_path / "s.yaml", data)
    assert time.process_time() - start < 10


def test_many_aliases_are_refused_by_their_number(tmp_path: Path) -> None:
    few, many = (b"a: &a 1\nb: [" + b"*a, " * n + b"]\n" for n in (100, 300))
    path = tmp_path / "s.yaml"
    path.write_bytes(few)
    assert len(read_document(path).tree["b"]) == 100
    assert "more than 200 aliases" in refusal(path, many).message


def test_a_huge_file_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    with path.open("wb") as f:
        f.truncate(200_000_000)
    start = time.process_time()
    error = refusal(path, None)
    assert f"larger than {MAX_BYTES}" in error.message
    assert time.process_time() - start < 2


def test_anchors_and_merges_within_reason_are_welcome(tmp_path: Path) -> None:
    text = GOOD.replace("mesh: {rectangle: {origin: [0, 0], size: [2, 1], cells: [4, 2]}}",
                        "mesh: {rectangle: &r {origin: [0, 0], size: [2, 1], cells: [4, 2]}}")
    text = text.replace("mesh: {rectangle: {origin: [0, 1], size: [2, 1], cells: [5, 2]}}",
                        "mesh: {rectangle: {<<: *r, origin: [0, 1]}}")
    s = load_text(tmp_path, text)
    assert s.interface.nodes[:, 1].max() == 2.0
    assert len(s.interface.quads) == 16


def test_numbers_are_those_of_yaml_1_2(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text("a: [1e7, 1.0e-3, 0x10, .5, -3, yes, true, ~, '1']\n", encoding="utf-8")
    assert read_document(path).tree == {"a": [1e7, 1e-3, 16, 0.5, -3, "yes", True, None, "1"]}


def test_a_byte_order_mark_and_windows_lines_do_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode())
    assert load_scenario(path).title == "Two blocks"


KEYS = ", ".join(f"k{i}: 1" for i in range(700))


@pytest.mark.parametrize("text", [
    f"a: &a {{{KEYS}}}\nb:\n" + "  - {<<: *a}\n" * 190,
    f"a: &a {{{KEYS}}}\nb: {{<<: [{', '.join(['*a'] * 190)}]}}\n",
    f"a: &a0 {{{KEYS}}}\n" + "".join(f"b{i}: &a{i + 1} {{<<: *a{i}, z{i}: 1}}\n" for i in range(150))])
def test_merges_are_counted_while_they_are_made(tmp_path, text):
    """9 kB took 4.2 s to be refused."""
    started = time.perf_counter()
    error = refusal(tmp_path / "s.yaml", text.encode())
    assert "the merges (<<) bring in more than 10000 keys" in str(error)
    assert error.line > 1
    assert time.perf_counter() - started < 2.0


def test_a_few_merges_are_read(tmp_path):
    (tmp_path / "s.yaml").write_text(f"a: &a {{{KEYS}}}\n" + "".join(f"b{i}: {{<<: *a, own: 2}}\n" for i in range(14)))
    tree = read_document(tmp_path / "s.yaml").tree
    assert tree["b13"] == {**tree["a"], "own": 2}


@pytest.mark.parametrize(("text", "character"), [
    ('name: "\\ud800"', "U+D800"), ('name: "\\e[2J"', "U+001B"), ('"a\\e]0;x\\a": 1', "U+001B"),
    ('a: "x\\rb"', "U+000D"), ('a: ["\\x9b"]', "U+009B"), ('a: "\u202egnp.exe"', "U+202E"),
    ('a: "\\ud83d\\ude00"', "U+D83D"), ('a: "\\0"', "U+0000")])
def test_what_cannot_be_printed_is_refused_by_its_number(tmp_path, text, character):
    error = refusal(tmp_path / "s.yaml", f"slideline: 2\n{text}\n".encode())
    assert f"the text holds the character {character}, which cannot be printed" in str(error)
    assert UNPRINTABLE.search(str(error)) is None


def test_what_can_be_printed_is_read(tmp_path):
    text = 'title: "Rädchen, 轮, \U0001F600, \\t tab"\ntwo: |\n  lines\n  more\n'
    (tmp_path / "s.yaml").write_text(f"slideline: 2\n{text}")
    tree = read_document(tmp_path / "s.yaml").tree
    assert (tree["title"], tree["two"]) == ("Rädchen, 轮, \U0001F600, \t tab", "lines\nmore\n")


def test_names_are_of_a_length_that_files_can_have(tmp_path):
    error = refusal(tmp_path / "s.yaml", f"slideline: 2\nbodies:\n  {'b' * 250}: 1\n".encode())
    assert "the key bbbbbbbbbbbbbbbbbbbb... has 250 letters. At most 100 are allowed" in str(error)
