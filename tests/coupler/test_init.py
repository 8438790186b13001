"""`slideline init`: every template is whole; what is chosen stands in the file, comments and files stay."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from coupler import load_scenario
from coupler.cli.cli import app
from coupler.errors import ScenarioError
from coupler.init.init import ask_choices, ask_out, ask_template, new_scenario
from coupler.init.templates import Choices, chosen_materials, exchangeable, library, template_named, templates

sys.path.insert(0, str(Path(__file__).parent))
from decks import heat_deck

PAGE = Path(__file__).resolve().parents[2] / "docs/templates.md"


def comments(text: str) -> list[str]:
    return [line.strip() for line in text.splitlines() if line.strip().startswith("#")]


@pytest.mark.parametrize("name", list(templates()))
def test_a_template_says_what_it_is_and_what_to_change(name: str, tmp_path: Path) -> None:
    out = tmp_path / "mine.yaml"
    template = template_named(name)
    new_scenario(template, Choices(), out)
    head = out.read_text(encoding="utf-8").partition("slideline: 2")[0]
    assert "slideline run mine.yaml --report" in head
    assert "Change first:" in head
    assert "Expect:" in head
    assert template.about.endswith(".")
    assert out.read_text(encoding="utf-8") == template.text_for("mine.yaml")


def test_what_was_chosen_stands_in_the_file_and_comments_stay(tmp_path: Path) -> None:
    out, template = tmp_path / "mine.yaml", template_named("heated_blocks")
    choices = Choices("Mine", 900.0, {"lower": "copper"}, 2.0, {"bodies.upper.T0": 50, "mechanical.half": "rigid",
                                                               "contact.interface.conduction.open": None})
    s = new_scenario(template, choices, out)
    text, tree = out.read_text(encoding="utf-8"), load_scenario(out).resolved
    assert s.resolved == tree
    assert (s.title, tree["coupling"]["end"], tree["bodies"]["upper"]["T0"]) == ("Mine", 900, 50)
    assert tree["bodies"]["lower"]["mesh"]["rectangle"]["cells"] == [36, 18]
    copper = library()["copper"]
    assert {k: tree["materials"]["lower"][k] for k in copper.values} == dict(copper.values)
    assert tree["materials"]["lower"]["T_ref"] == 20
    assert copper.about in text
    assert "E: 1.15e+11" in text
    assert "open: null" in text
    assert set(comments(template.text_for("mine.yaml"))) <= set(comments(text))


def test_a_later_end_draws_the_last_windows_out(tmp_path: Path) -> None:
    s = new_scenario(template_named("forging"), Choices(end=2.5), tmp_path / "a.yaml")
    assert s.resolved["coupling"]["windows"][-1] == {"until": 2.5, "size": 0.05}


def test_a_strip_stays_one_cell_wide(tmp_path: Path) -> None:
    s = new_scenario(template_named("casting"), Choices(mesh=0.5), tmp_path / "a.yaml")
    assert s.resolved["bodies"]["casting"]["mesh"]["rectangle"]["cells"] == [50, 1]


def test_only_plain_materials_are_exchanged():
    assert exchangeable(template_named("casting").document.tree) == ["mould"]
    assert exchangeable(template_named("forging").document.tree) == ["die"]
    # alpha 0 without T_ref is a choice of the scene, not a number of the metal.
    assert exchangeable(template_named("friction").document.tree) == ["block", "bar"]


def test_a_body_that_does_not_expand_goes_on_not_to(tmp_path: Path) -> None:
    s = new_scenario(template_named("friction"), Choices(materials={"bar": "copper"}), tmp_path / "a.yaml")
    assert s.resolved["materials"]["bar"] == {**library()["copper"].values, "alpha": 0}


@pytest.mark.parametrize(("choices", "text"), [
    (Choices(end=-1.0), "after 0"),
    (Choices(mesh=0.0), "--mesh"),
    (Choices(materials={"lowr": "copper"}), "Did you mean 'lower'"),
    (Choices(materials={"lower": "coper"}), "Did you mean 'copper'"),
    (Choices(sets={"coupling.shceme": "staggered"}), "Did you mean 'scheme'"),
    (Choices(sets={"bodies.lower.material": "wood"}), "wood"),
])
def test_a_wrong_choice_is_one_error_and_no_file(choices: Choices, text: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=text):
        new_scenario(template_named("heated_blocks"), choices, tmp_path / "a.yaml")
    assert not list(tmp_path.iterdir())


def test_what_melts_is_not_exchanged(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="melts, flows"):
        new_scenario(template_named("casting"), Choices(materials={"metal": "copper"}), tmp_path / "a.yaml")
    with pytest.raises(ScenarioError, match="NAME=KIND"):
        chosen_materials(["copper"])


def test_a_file_that_is_there_stays(tmp_path: Path) -> None:
    out = tmp_path / "mine.yaml"
    out.write_text("mine")
    dangling = tmp_path / "link.yaml"
    dangling.symlink_to(tmp_path / "elsewhere.yaml")
    for path in (out, dangling):
        with pytest.raises(ScenarioError, match="left as it is"):
            new_scenario(template_named("lumped"), Choices(), path)
    assert out.read_text() == "mine"
    with pytest.raises(ScenarioError, match="folder of this file does not exist"):
        new_scenario(template_named("lumped"), Choices(), tmp_path / "no" / "such.yaml")


def answering(answers: Iterator[str], refused: list[str]) -> Any:
    """Asks nobody: takes the next answers until one will do."""

    def ask(question: str, default: str, read: Callable[[str], Any]) -> Any:
        for text in answers:
            try:
                return read(text or default)
            except ScenarioError as exc:
                refused.append(str(exc))
        raise AssertionError(f"no answer left to {question}")

    return ask


def test_questions_go_on_until_answered(tmp_path: Path) -> None:
    said: list[str] = []
    refused: list[str] = []
    (tmp_path / "there.yaml").touch()
    free, there = str(tmp_path / "mine.yaml"), str(tmp_path / "there.yaml")
    answers = iter(["7", "shrinkfit", "shrink_fit", "My ring", "soon", "-3", "120", "woood", "titanium", "keep", "0",
                    "2", there, free])
    ask = answering(answers, refused)
    template = ask_template(ask, said.append)
    choices = ask_choices(template, Choices(), ask, said.append)
    assert (template.name, choices) == ("shrink_fit", Choices("My ring", 120.0, {"shaft": "titanium"}, 2.0))
    assert ask_out(template, ask) == Path(free)
    assert len(refused) == 7
    assert any("titanium" in line for line in said)
    new_scenario(template, choices, Path(free))


def test_defaults_change_nothing_and_options_are_not_asked_again():
    ask = answering(iter([""] * 9), [])
    template = ask_template(ask, lambda _: None)
    assert ask_choices(template, Choices(), ask, lambda _: None) == Choices()
    given = Choices("T", 5.0, {"mould": "steel"}, 3.0, {"bodies.mould.T0": 300})
    assert ask_choices(template_named("casting"), given, answering(iter([]), []), lambda _: None) == given


def test_named_materials_are_of_this_world():
    for m in library().values():
        assert m.source
        diffusivity = m.values["k"] / (m.values["rho"] * m.values["c"])
        assert 1e-6 < diffusivity < 2e-4, m.name
        # Of dense solids rho c hardly varies, and E alpha^2 is a small share of rho c (Grueneisen).
        assert 2e6 < m.values["rho"] * m.values["c"] < 4e6, m.name
        assert m.values["E"] * m.values["alpha"] ** 2 * 300 < 0.05 * m.values["rho"] * m.values["c"], m.name
        assert np.isfinite(list(m.values.values())).all()


@pytest.mark.parametrize(("arguments", "text"), [
    (("--list",), "shrink_fit"),
    (("lumped", "-o", "mine.yaml", "--set", "bodies.skin.T0=850"), "slideline run mine.yaml --report"),
    (("lumped", "-o", "mine.yaml", "--material", "wall=copper", "--mesh", "2", "--end", "7", "--title", "It"), "It"),
])
def test_the_verb(arguments: tuple[str, ...], text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["init", *arguments])
    assert done.exit_code == 0, done.output
    assert text in done.output
    assert [p.name for p in tmp_path.iterdir()] == (["mine.yaml"] if "mine.yaml" in arguments else [])


@pytest.mark.parametrize(("arguments", "text"), [
    ((), "no terminal to ask on"),
    (("sliding",), "no such template"),
    (("lumped", "--from", "model.inp"), "converted as it is"),
])
def test_the_verb_refuses(arguments: tuple[str, ...], text: str, tmp_path: Path,
                          monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["init", *arguments])
    assert isinstance(done.exception, ScenarioError)
    assert text in str(done.exception)
    assert not list(tmp_path.iterdir())


def test_the_page_has_the_numbers_of_the_library():
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in PAGE.read_text(encoding="utf-8").splitlines()
            if line.startswith("| `")]
    told = {row[0].split("`")[1]: [float(cell) for cell in row[1:]] for row in rows if len(row) == 7}
    columns = {"rho": 1.0, "k": 1.0, "c": 1.0, "E": 1e9, "nu": 1.0, "alpha": 1.0}
    assert told == {m.name: [m.values[key] / unit for key, unit in columns.items()] for m in library().values()}
    assert {row[0].strip("`") for row in rows if len(row) == 3} == set(templates())


def test_a_deck_is_converted_and_what_was_missed_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.inp").write_text(heat_deck("*NO SUCH KEYWORD\n"), encoding="utf-8")
    done = CliRunner().invoke(app, ["init", "--from", "model.inp"])
    assert done.exit_code == 0, done.output
    assert "model.inp:" in done.output
    assert "NO SUCH KEYWORD" in done.output
    assert "slideline run model.yaml --report" in done.output
    assert {p.name for p in tmp_path.iterdir()} == {"model.inp", "model.yaml", "model.msh"}
    load_scenario("model.yaml")
    again = CliRunner().invoke(app, ["init", "--from", "model.inp"])
    assert isinstance(again.exception, ScenarioError)
    assert "left as it is" in str(again.exception)
