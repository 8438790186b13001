"""Runs of a program: its deck in, its results out, and what is told where it fails."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from contact.half import calculix
from contact.half.functions import property_from
from contact.half.program import Program, ProgramError, program_of, refuse_unknown

PYTHON = Program("deck", Path(sys.executable), 20.0)


def run(code: str, program: Program = PYTHON, wanted: tuple[str, ...] = ("out.txt",)) -> dict[str, str]:
    return program.run(["job.py"], {"job.py": code}, wanted)


def test_a_program_reads_its_deck_and_its_results_are_read():
    code = "open('out.txt', 'w').write(open('job.py').read()[:4]); print('x' * 10)"
    assert run(code) == {"out.txt": "open"}


def test_what_a_failed_program_said_last_is_told():
    said = r"deck ended with exit code 7 after .* It said last:\n(.*\n)*no licence"
    with pytest.raises(ProgramError, match=said) as e:
        run("print('begin'); [print('line', i) for i in range(2000)]; print('no licence'); raise SystemExit(7)")
    assert "begin" not in str(e.value), "the end of it"


def test_results_that_are_not_there_are_told():
    with pytest.raises(ProgramError, match=r"deck ended without writing out.txt; it said nothing"):
        run("pass")


@pytest.mark.skipif(os.name != "posix", reason="groups of processes are of posix")
def test_a_program_that_takes_too_long_is_stopped_with_all_it_started(tmp_path):
    told = tmp_path / "child.txt"
    code = ("import subprocess, sys, time\n"
            "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)'])\n"
            f"open({str(told)!r}, 'w').write(str(child.pid)); print('at it', flush=True); time.sleep(600)")
    begun = time.monotonic()
    said = r"deck took longer than options.time_limit \(8 s\) and was stopped.*\nat it"
    with pytest.raises(ProgramError, match=said):
        run(code, Program("deck", Path(sys.executable), 8.0))
    assert time.monotonic() - begun < 60.0
    child = int(told.read_text())
    for _ in range(100):
        if not _goes_on(child):
            return
        time.sleep(0.1)
    pytest.fail("what it started goes on")


def _goes_on(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_a_program_that_is_not_there_is_told_with_its_remedy():
    with pytest.raises(ValueError, match=r"no_such_ccx is not on the PATH\. Install it"):
        program_of({"program": "no_such_ccx"}, "ccx", "Install it")
    with pytest.raises(ValueError, match="/no/such/ccx is no program that can be run"):
        program_of({"program": "/no/such/ccx"}, "ccx", "Install it")


@pytest.mark.parametrize("limit", [0, -1.0, "60", True])
def test_a_time_limit_is_a_number_of_seconds(limit):
    with pytest.raises(ValueError, match="time_limit must be a number"):
        program_of({"program": sys.executable, "time_limit": limit}, "ccx", "")


def test_an_option_that_nobody_reads_is_told():
    with pytest.raises(ValueError, match="there is no option limit; there are program, time_limit"):
        refuse_unknown({"limit": 1}, ("program", "time_limit"))


DAT = """
 temperatures for set NFRONT and time  0.5000000E+00

         1  1.000000E+00
         2  2.000000E+00

 temperatures for set NFRONT and time  1.0000000E+00

         1  3.000000E+00
         2 -4.500000E-01

 forces (fx,fy,fz) for set NFRONT and time  1.0000000E+00

         1  1.0E+00  2.0E+00  3.0E+00
"""


def test_the_last_table_is_read():
    np.testing.assert_array_equal(calculix.printed(DAT, "temperatures", 2, 1), [[3.0], [-0.45]])


@pytest.mark.parametrize(("title", "said"), [("displacements", "ccx printed no displacements"),
                                             ("forces", "no number for forces of node 2")])
def test_a_table_that_is_missing_or_short_is_told(title, said):
    with pytest.raises(ProgramError, match=said):
        calculix.printed(DAT, title, 2, 3)


def test_a_property_becomes_a_table_between_the_same_knots():
    k = property_from({"T": [300.0, 500.0], "value": [20.0, 60.0]})
    rows = [[float(v) for v in row.split(",")] for row in calculix.table(k, property_from(7.0), shift=100.0)]
    np.testing.assert_allclose(rows, [[20.0, 7.0, 200.0], [60.0, 7.0, 400.0]], rtol=1e-12)
    assert all(len(word.strip()) <= 20 for word in next(calculix.table(k)).split(",")), "ccx reads no more"
