"""The command line as a user meets it: exit codes, what is printed, what Ctrl-C leaves."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from coupler import Results, load_scenario
from coupler.cli import cli
from coupler.cli.running import _reported
from coupler.cli.scene import apart
from coupler.errors import CouplingError, SlidelineError

sys.path.insert(0, str(Path(__file__).parent))
from synthetic_run import write_run

ROOT = Path(__file__).resolve().parents[2]
BARS = str(ROOT / "scenarios/heated_bars.yaml")
BLOCKS = str(ROOT / "scenarios/sliding_blocks.yaml")
SMALL = ("--set", "bodies.lower.mesh.rectangle.cells=[6, 6]", "--set", "bodies.upper.mesh.rectangle.cells=[6, 6]")


def slideline(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """The command in a process of its own."""
    return subprocess.run([sys.executable, "-m", "coupler.cli", *arguments], cwd=folder, capture_output=True, text=True,
                          check=False)


@pytest.fixture
def here(tmp_path, monkeypatch, capsys):
    """The command in this process, which has imported everything."""
    def said(*arguments: str) -> subprocess.CompletedProcess[str]:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["slideline", *arguments])
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return subprocess.CompletedProcess(arguments, ended.value.code or 0, *capsys.readouterr())

    return said


def test_check_says_what_would_run(tmp_path):
    done = slideline(tmp_path, "check", BLOCKS)
    assert done.returncode == 0, done.stderr
    for fact in ("1250 nodes", "slave upper.bottom", "elastic", "extrapolated", "14772.7", "lower.top.left"):
        assert fact in done.stdout
    assert "note" not in done.stdout
    assert not list(tmp_path.iterdir())


def test_check_tells_a_script_the_same(here):
    done = here("check", BLOCKS, "--json")
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    s = load_scenario(BLOCKS)
    assert (facts["valid"], facts["errors"], facts["nodes"], facts["hash"]) == (True, [], 1250, s.hash)
    assert (facts["outcome"], facts["exit_code"]) == ("completed", 0)
    assert facts["pairs"] == [{"name": "interface", "slave": "upper.bottom", "master": "lower.top",
                               "gap": [pytest.approx(0.0508), pytest.approx(0.0508)]}]
    assert facts["probes"] == {name: probe.unit for name, probe in s.probes.items()}
    assert facts["windows"]["adaptive"] is (s.coupling.adaptive is not None)
    wrong = here("check", BLOCKS, "--json", "--set", "coupling.end=3 mm", "--set", "geometry=plain")
    assert wrong.returncode == 2, wrong.stderr
    facts = json.loads(wrong.stdout)
    assert (facts["valid"], facts["outcome"], facts["exit_code"]) == (False, "failed", 2)
    assert {e["key"]: e["where"]["value"] for e in facts["errors"]} == {"coupling.end": "3 mm", "geometry": "plain"}
    assert all(e["message"] and e["remedy"] for e in facts["errors"])
    # The same errors in the same form as those of a run, with the line and the key also where version 0.1 had them.
    run = json.loads(here("run", BLOCKS, "--json", "--set", "coupling.end=3 mm", "--set", "geometry=plain").stdout)
    assert [e | {"line": e["where"]["line"], "key": e["where"]["key"]} for e in run["errors"]] == facts["errors"]
    assert {key: facts[key] for key in run if key != "errors"} == {key: run[key] for key in run if key != "errors"}


def test_a_name_that_list_tells_is_a_scenario(here):
    done = here("check", "heated_bars")
    assert done.returncode == 0, done.stderr
    assert done.stdout == here("check", BARS).stdout


@pytest.mark.parametrize(("gap", "words"), [
    (None, ""), ((0.0, 0.0), ", in touch"), ((5e-4, 5e-4), ", 0.0005 m apart"), ((0.0, 5e-4), ", 0 to 0.0005 m apart"),
    ((-1e-4, 0.0), ", up to 0.0001 m into each other"),
    ((-1e-4, 2e-4), ", 0.0001 m into each other to 0.0002 m apart")])
def test_how_a_pair_begins_is_told_in_words(gap, words):
    assert apart(gap) == words


def test_halves_are_told_by_the_words_that_swap_takes(here):
    rods = ("--swap", "thermal=rod", "--swap", "mechanical=rod")
    casting = str(ROOT / "scenarios/casting_1d.yaml")
    assert "halves: thermal rod, mechanical rod;" in here("check", casting, *rods).stdout
    told = json.loads(here("check", casting, *rods, "--json").stdout)["halves"]
    again = here("check", casting, *(f"--swap={role}={word}" for role, word in told.items()))
    assert again.returncode == 0, again.stderr


def test_check_tells_what_is_odd_though_no_error(here):
    done = here("check", BLOCKS, "--set", "bodies.upper.mesh.rectangle.origin=[0, 0.03]")
    assert done.returncode == 0, done.stderr
    assert "note: pair interface: 23 of the nodes looked at on upper.bottom start inside lower" in done.stdout


def test_run_report_and_their_files(tmp_path):
    done = slideline(tmp_path, "run", BARS, "-o", "bars.h5", "--set", "coupling.end=8", "--set",
                     "coupling.windows=[{until: 8, size: 1}]")
    assert done.returncode == 0, done.stderr
    assert "completed" in done.stdout
    assert "window" in done.stderr
    assert {p.name for p in tmp_path.iterdir()} == {"bars.h5", "bars.thermal.vtkhdf", "bars.mechanical.vtkhdf"}
    done = slideline(tmp_path, "report", "bars.h5")
    assert done.returncode == 0, done.stderr
    assert "<html" in (tmp_path / "bars.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(("arguments", "code", "text"), [
    (("check", "heated_barz"), 2, "no such file"),
    (("check", "heated_barz"), 2, "'heated_bars'"),
    (("check", "quay"), 2, "slideline list"),
    (("run", BARS, "--set", "coupling.shceme=staggered"), 2, "scheme"),
    (("run", BARS, "--swap", "mechanic=rigid"), 2, "--swap mechanical=rigid"),
    (("run", BARS, "--swap", "mechanical=rubber"), 2, "rubber"),
    (("run", BARS, "-o", "no/such/folder/run.h5"), 3, "does not exist"),
    (("report", "nowhere.h5"), 3, "nowhere.h5"),
    (("chek", "s.yaml"), 2, "Did you mean 'check'?"),
    (("run", "heated_bars.yaml"), 2, "Did you mean the installed scenario 'heated_bars'?"),
    (("run", BARS, "--until", "-5"), 2, "--until: no window ends at or before this time (got -5.0)"),
    (("run", BARS, "--until", "nan"), 2, "--until: no window ends at or before this time (got nan)"),
    (("run", BARS, "--until", "-1 h"), 2, "--until: no window ends at or before this time (got -3600.0)"),
    (("run", BARS, "--until", "soon"), 2, "--until: a time is needed here (got 'soon'). Give seconds, or a number"),
    (("run", BARS, "--until", "5 mm"), 2, "--until: a time is needed here (got '5 mm'). Give seconds, or a number"),
    (("run", BARS, "--until", "5 minn"), 2, "--until: a time is needed here (got '5 minn'). Did you mean min"),
])
def test_wrong_input_is_one_error_and_a_code(tmp_path, monkeypatch, capsys, arguments, code, text):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["slideline", *arguments])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == code
    said = capsys.readouterr().err
    assert text in said
    assert "Traceback" not in said
    assert not list(tmp_path.iterdir())


def test_a_script_reads_why_a_command_failed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)

    def failed(*arguments):
        monkeypatch.setattr(sys, "argv", ["slideline", *arguments, "--json"])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        told = capsys.readouterr()
        assert "error" in told.err.lower()
        facts = json.loads(told.out)
        assert (facts["outcome"], facts["exit_code"]) == ("failed", ended.value.code)
        assert not any(note.startswith("note") for note in facts["notes"])
        return ended.value.code, facts["errors"]

    code, errors = failed("run", BARS, "--set", "coupling.shceme=staggered", "--set", "geometry=plain")
    assert (code, {e["where"]["key"] for e in errors}) == (2, {"coupling.shceme", "geometry"})
    assert all(e["kind"] == "input" and e["message"] and e["remedy"] for e in errors)
    assert failed("status", "nowhere.h5")[1][0]["kind"] == "results"
    for wrong in (["run", BARS, "--nuthing"], ["run"], ["rum", BARS]):
        code, errors = failed(*wrong)
        assert (code, errors[0]["kind"]) == (2, "usage")
        assert errors[0]["message"]
    monkeypatch.setattr("coupler.cli.running.run", _no_equilibrium)
    code, errors = failed("run", BARS, "-q")
    assert (code, errors) == (1, [{"kind": "window", "message": "no equilibrium", "remedy": "Use smaller windows",
                                   "where": {"t": 2.5, "window": 3, "iteration": 4}}])


def _no_equilibrium(*_arguments, **_options):
    error = CouplingError("no equilibrium", t=2.5, window=3, iteration=4, remedy="Use smaller windows")
    error.add_note("note: bodies overlap")
    raise error


@pytest.mark.slow
def test_a_process_ends_with_the_code_too(tmp_path):
    done = slideline(tmp_path, "run", "nowhere.yaml")
    assert done.returncode == 2, done.stderr
    assert "nowhere.yaml" in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("how", [(), ("--processes",)])
def test_ctrl_c_leaves_a_readable_file_and_no_process(tmp_path, how):
    out = tmp_path / "run.h5"
    child = subprocess.Popen([sys.executable, "-m", "coupler.cli", "run", BLOCKS, "-o", str(out), *SMALL, *how],
                             stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
    family = psutil.Process(child.pid)
    assert child.stderr
    with child:
        try:
            while "| window" not in (line := child.stderr.readline()):
                assert line, "the run ended before its first window"
            children = family.children(recursive=True)
            # The process that built the halves waits a while for more.
            roles = [c for c in children if "coupler.fmu.build_server" not in c.cmdline()]
            assert len(roles) == (3 if how else 0)
            os.killpg(child.pid, signal.SIGINT)  # what a terminal does: the whole group
            output, errors = child.communicate(timeout=120)
        finally:
            child.kill()
    assert child.returncode == 130, errors
    assert "interrupted" in output
    deadline = time.monotonic() + 60
    while any(c.is_running() and c.status() != psutil.STATUS_ZOMBIE for c in children):
        assert time.monotonic() < deadline, "a process outlived the run"
        time.sleep(0.05)
    results = Results(out)
    assert results.outcome == "interrupted"
    assert 0 < results.t[-1] < 25000
    assert len(results.probe("lower.top.left")[1]) == len(results.t)


def test_a_run_that_fails_has_its_page_too(tmp_path):
    out, page = tmp_path / "run.h5", tmp_path / "run.html"
    write_run(out)
    with pytest.raises(SlidelineError), _reported(out, True):
        raise SlidelineError("it failed before it wrote anything: the file is that of an earlier run")
    assert not page.exists()

    def fails():
        with _reported(out, True):
            out.unlink()
            write_run(out, outcome="failed", message="no equilibrium")
            raise SlidelineError("no equilibrium")

    with pytest.raises(SlidelineError) as failed:
        fails()
    assert "This run failed." in page.read_text("utf-8")
    assert str(page) in failed.value.__notes__[0]


@pytest.mark.slow
def test_flags_take_no_value(tmp_path):
    """`--report <bool>` looks as if a value followed."""
    for arguments in (("--help",), ("run", "--help"), ("verify-half", "--help")):
        done = slideline(tmp_path, *arguments)
        assert done.returncode == 0, done.stderr
        assert "--help" in done.stdout
        assert "bool" not in done.stdout


def test_bounds_of_a_comparison_are_checked_before_anything_runs(here, tmp_path):
    """They were left out in silence: without a comparison, and of quantities that nothing has."""
    for arguments, said in ((("--within", "T=1K"), "Add --compare"),
                            (("--swap", "mechanical=elastic", "--compare", "--within", "temp=1K"), "got 'temp'")):
        done = here("run", BARS, *arguments)
        assert (done.returncode, said in done.stderr, "--within" in done.stderr) == (2, True, True), done.stderr
        assert not list(tmp_path.iterdir())


def test_a_study_without_a_grid_is_one_line(here):
    done = here("study", BARS, "--grid", "foo=1")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
