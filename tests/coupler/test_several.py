"""Several thermal halves in a scene: one half's answer as well as they agree, and its machinery to the bit."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import psutil
import pytest

from coupler import CouplingError, HalfError, Results, load_scenario, run
from coupler.running.progress import Progress
from coupler.running.resume import resume, resumed

sys.path.insert(0, str(Path(__file__).parent))
from killed_runs import differences
from several_scenes import BLOCKS, SCENARIOS, THREE, TWO, apart, blocks, ran

pytestmark = pytest.mark.usefixtures("unlooked")

SHORT = {"coupling.end": 20, "coupling.windows": [{"until": 20, "size": 5}], "output.checkpoint": 0}
SAME_T, SAME_HEAT = 1e-6, 1e-9  # K at the default tolerance of 1e-7 K; of the largest term


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return blocks(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def alone(file: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Results]:
    """The run of one half by a scheme, made once."""
    @cache
    def run_by(scheme: str) -> Results:
        return ran(file, tmp_path_factory.mktemp(scheme) / "one.h5", {"coupling.scheme": scheme})
    return run_by


@pytest.fixture(scope="module")
def whole(file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two halves in this process, a short while."""
    out = tmp_path_factory.mktemp("whole") / "run.h5"
    ran(file, out, SHORT | {"thermal.halves": TWO})
    return out


def same(one: Results, other: Results, least_moved: float) -> None:
    """Assert that two runs are one within what halves agree to, and that something happened in them."""
    assert np.abs(one.field("thermal.T")[1] - other.field("thermal.T")[1]).max() < SAME_T
    off = apart(one, other)
    for name in off:
        assert off[name] < (SAME_HEAT if name.startswith("heat.") else SAME_T) or name in (
            "thermal.q", "thermal.surface.E", "mechanical.p", "thermal.surface.T"), (name, off[name])
    across = [J for n, J in one.ledger.items() if n.startswith(("contact.", "gap.")) and n.endswith("slave")]
    assert max(map(abs, across)) > least_moved
    assert other.heat_imbalance < 1e-9


# Two halves in one scheme more: what a scheme asks of halves does not know how many they are.
@pytest.mark.few("three-extrapolated")
@pytest.mark.parametrize(("halves", "scheme"), [
    (TWO, "extrapolated"), (THREE, "staggered"), (THREE, "extrapolated"), (THREE, "iterated"),
    (THREE, "mechanical_first")],
    ids=["two-extrapolated", "three-staggered", "three-extrapolated", "three-iterated", "three-mechanical_first"])
def test_several_halves_are_one(file: Path, alone, tmp_path: Path, halves, scheme: str) -> None:
    """Open and closed pairs, radiation between them, sources, named conditions, a conductivity of temperature."""
    same(alone(scheme), ran(file, tmp_path / "several.h5", {"coupling.scheme": scheme, "thermal.halves": halves}), 1e5)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["backward_euler", "sdirk2", "steady"])
def test_with_every_method_in_time(file: Path, tmp_path: Path, method: str) -> None:
    changes = {"thermal.method": method, "coupling.end": 20, "coupling.windows": [{"until": 20, "size": 10}]}
    one = ran(file, tmp_path / "one.h5", changes)
    same(one, ran(file, tmp_path / "several.h5", changes | {"thermal.halves": THREE}), 5e3)


@pytest.mark.slow
def test_windows_that_find_their_own_size(file: Path, tmp_path: Path) -> None:
    text = BLOCKS.replace("  windows: [{until: 80, size: 8}]\n", "").replace("every: 1", "at: [20, 50]")
    own = blocks(tmp_path, text.replace("end: 80", "end: 50"))
    one, several = (ran(own, tmp_path / f"{name}.h5", changes) for name, changes in (
        ("one", {}), ("several", {"thermal.halves": THREE})))
    assert len(one.t) == len(several.t)
    # What halves are apart is in the sizes, too, which follow estimates of errors.
    assert np.abs(one.field("thermal.T")[1] - several.field("thermal.T")[1]).max() < 1e-3


@pytest.mark.slow
def test_rods_of_which_one_melts(tmp_path: Path) -> None:
    changes = {"coupling.end": 5, "coupling.windows": [{"until": 5, "size": 0.1}], "output.fields": {"every": 10}}
    halves = {"metal": {"bodies": ["rod"]}, "mould": {"bodies": ["mould"]}}
    one = ran(SCENARIOS / "casting_1d.yaml", tmp_path / "one.h5", changes)
    several = ran(SCENARIOS / "casting_1d.yaml", tmp_path / "several.h5", changes | {"thermal.halves": halves})
    same(one, several, 1e3)
    assert one.probe("rod.solid")[1][-1] == pytest.approx(0.12, abs=0.01)
    assert several.probe("rod.solid")[1][-1] == pytest.approx(one.probe("rod.solid")[1][-1], abs=1e-9)


@pytest.mark.slow
def test_whole_bodies_of_one_temperature(tmp_path: Path) -> None:
    changes = {"thermal.boundary": [{"on": "body.left", "convection": {"h": 5000, "T": 933}}]}
    halves = {"metal": {"bodies": ["body"]}, "wall": {"bodies": ["wall"]}}
    one = ran(SCENARIOS / "lumped_gap.yaml", tmp_path / "one.h5", changes)
    several = ran(SCENARIOS / "lumped_gap.yaml", tmp_path / "several.h5", changes | {"thermal.halves": halves})
    same(one, several, 1e4)


@pytest.mark.slow
def test_friction_and_mechanical_heat_reach_each_body_once(tmp_path: Path) -> None:
    """A brake pad of an alloy that cools where it is pressed at once; the disc is solved for elsewhere."""
    changes = {"coupling.scheme": "adiabatic", "coupling.end": 0.2, "coupling.windows": [{"until": 0.2, "size": 0.05}],
               "output.fields": {"every": 1}, "mechanical.elastic.thermoelastic_heat": True,
               "mechanical.elastic.adiabatic": True,
               "bodies.disc.mesh.rectangle.cells": [10, 4], "bodies.pad.mesh.rectangle.cells": [6, 4]}
    halves = {"disc": {"bodies": ["disc"]}, "pad": {"bodies": ["pad"]}}
    one = ran(SCENARIOS / "brake_pad.yaml", tmp_path / "one.h5", changes)
    several = ran(SCENARIOS / "brake_pad.yaml", tmp_path / "several.h5", changes | {"thermal.halves": halves})
    assert one.ledger["friction.slave"] > 100.0
    assert abs(one.ledger["entropy"]) > 1.0
    off = apart(one, several)
    assert off["thermal.T"] < SAME_T
    assert max(J for n, J in off.items() if n.startswith("heat.")) < 1e-6


@pytest.mark.slow
def test_what_halves_are_apart_falls_with_the_tolerance(file: Path, alone, tmp_path: Path) -> None:
    one, off = alone("extrapolated"), []
    for tolerance in (1e-1, 1e-3, 1e-5):
        several = ran(file, tmp_path / f"{tolerance}.h5", {"thermal.halves": THREE, "thermal.across": {
            "tolerance": tolerance}})
        crossed = several.ledger["contact.slave"] + several.ledger["contact.master"]
        off.append((np.abs(one.field("thermal.T")[1] - several.field("thermal.T")[1]).max(), abs(crossed)))
    for wide, narrow in pairwise(off):
        assert narrow[0] < 0.1 * wide[0]
        assert narrow[1] < 0.1 * wide[1]
    assert off[0][0] > 1e-3


@pytest.mark.slow
def test_numbers_of_the_role_are_those_of_one_half(tmp_path: Path) -> None:
    probes = {n.replace(".", "_"): {f"thermal.{n}": "value"} for n in ("contact.touching", "max_dT", "heat_stored")}
    own = blocks(tmp_path, BLOCKS.replace("t: [0, 40, 80]", "t: [0, 4, 8]"))
    one = ran(own, tmp_path / "one.h5", SHORT | {"probes": probes})
    several = ran(own, tmp_path / "several.h5", SHORT | {"probes": probes, "thermal.halves": THREE})
    for name in probes:
        np.testing.assert_allclose(several.probe(name)[1], one.probe(name)[1], rtol=1e-8)
    assert one.probe("contact_touching")[1][-1] > 0


def test_a_probe_tells_how_well_they_agree(file: Path, tmp_path: Path) -> None:
    several = ran(file, tmp_path / "run.h5", SHORT | {
        "thermal.halves": THREE, "probes": {
            "off": {"thermal.across.off": "value"}, "n": {"thermal.across.iterations": "value"}}})
    off, n = (several.probe(name)[1][1:] for name in ("off", "n"))
    assert (off <= 1e-7).all()
    assert (n >= 2).all()
    assert (n <= 12).all()


def test_halves_that_do_not_agree_are_named(file: Path, tmp_path: Path) -> None:
    with pytest.raises(CouplingError, match=r"thermal\.a and thermal\.b did not agree from 0 s .* off by .* K after 1"):
        ran(file, tmp_path / "run.h5", {"thermal.halves": TWO, "thermal.across": {"iterations": 1}})


def test_a_half_without_neighbours_is_asked_once(file: Path, tmp_path: Path) -> None:
    """Nothing crosses where pairs are within halves: the bits of one half, and one call a substep each."""
    apart_ = BLOCKS.replace("slave: lower.top\n    master: middle.bottom", "slave: lower.top\n    master: lower.bottom")
    own = blocks(tmp_path, apart_.replace("gap_max: 0.1", "gap_max: 0.01", 1))
    halves = {"pair": {"bodies": ["upper", "middle"]}, "alone": {"bodies": ["lower"]}}
    one = ran(own, tmp_path / "one.h5", SHORT)
    several = ran(own, tmp_path / "several.h5", SHORT | {"thermal.halves": halves, "probes": {
        "n": {"thermal.across.iterations": "value"}}})
    assert (several.probe("n")[1][1:] == 1.0).all()
    assert np.abs(one.field("thermal.T")[1] - several.field("thermal.T")[1]).max() < 1e-9


@pytest.mark.slow
def test_in_processes_they_give_the_same_bits(file: Path, whole: Path, tmp_path: Path) -> None:
    ran(file, tmp_path / "run.h5", SHORT | {"thermal.halves": TWO}, processes=True)
    assert differences(whole, tmp_path / "run.h5") == []


@pytest.mark.slow
@pytest.mark.parametrize("processes", [False, True])
def test_a_run_that_stopped_goes_on_to_the_same_bits(file: Path, whole: Path, tmp_path: Path, processes: bool) -> None:
    out = tmp_path / "run.h5"
    scene = load_scenario(file, SHORT | {"thermal.halves": TWO})
    assert run(scene, out, until=10.0).outcome == "stopped"
    assert resume(out, processes=processes).outcome == "completed"
    assert differences(whole, out) == []


@pytest.mark.slow
def test_one_that_dies_is_named_and_the_run_goes_on(file: Path, whole: Path, tmp_path: Path) -> None:
    out = tmp_path / "run.h5"

    def kill(progress: Progress) -> None:
        if progress.number == 2:
            os.kill(_child_of(os.getpid(), "thermal.b"), signal.SIGKILL)

    with pytest.raises(HalfError) as died:
        ran(file, out, SHORT | {"thermal.halves": TWO}, processes=True, on_window=kill)
    assert "thermal.b" in str(died.value)
    resume(resumed(out))
    assert differences(whole, out) == []


@pytest.mark.slow
def test_one_that_dies_is_started_anew_where_that_is_allowed(file: Path, whole: Path, tmp_path: Path) -> None:
    def kill(progress: Progress) -> None:
        if progress.number == 2:
            os.kill(_child_of(os.getpid(), "thermal.b"), signal.SIGKILL)

    out = tmp_path / "run.h5"
    ran(file, out, SHORT | {"thermal.halves": TWO, "coupling.restart": 1}, processes=True, on_window=kill)
    found = Results(out)
    assert len(found.totals["restarts"]) == 1
    assert "half 'thermal.b'" in found.totals["restarts"][0]
    # Restarts stand in the totals and the header.
    assert [d for d in differences(whole, out) if not d.startswith(("header", "totals"))] == []


def _child_of(parent: int, name: str) -> int:
    return next(p.pid for p in psutil.Process(parent).children(recursive=True) if name in p.cmdline())
