"""The overlap of pressed surfaces against what matters: a line of the trust table."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler import run
from coupler.schemes.levels import Level
from coupler.trust.checks import Check
from coupler.trust.surfaces.penetration import SHARE, PenetrationLog, Yields, check

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, load_text

M = 2.0e11 * 0.7 / (1.3 * 0.4)
P, THICK = 1.0e7, 1.0  # Pa, m: the blocks of the scene are 2 m wide and 1 m high


def told(folder: Path, depth: float, pressed: slice = slice(None), augmented: tuple[str, ...] = (),
         **keys: Any) -> Check:
    """The check of one window in which the slave's nodes press and lie `depth` [m] deep."""
    interface = load_text(folder, GOOD, keys).interface
    yields, own = Yields(interface, augmented), interface.side_of("face", "upper.bottom").at
    n = len(interface.pair_nodes)
    t_N, gap, covered = np.zeros(n), np.zeros(n), np.zeros(n)
    at = np.arange(own.start, own.stop)[pressed]
    t_N[at], gap[at], covered[at] = -P, -depth, 1.0
    now = Level(1.0, np.full(len(interface.nodes), 300.0), interface.nodes, t_N, gap, covered)
    return check(yields.watched(PenetrationLog(), now), yields, False)


def test_it_is_held_against_what_both_bodies_yield(tmp_path: Path) -> None:
    """A zone wider than the bodies are thick: that far; a narrow one: as far as it is wide."""
    gives = P * 2.0 / M * THICK
    assert told(tmp_path, 0.02 * gives).number == pytest.approx(0.02, rel=1e-9)
    assert told(tmp_path, 0.02 * gives).verdict == "noted"
    assert told(tmp_path, 0.009 * gives).verdict == "holds"
    one_node = told(tmp_path, 0.02 * gives, slice(2, 3))
    assert one_node.number == pytest.approx(0.02 / 0.4, rel=1e-9)


def test_it_is_held_against_an_interference_as_drawn(tmp_path: Path) -> None:
    drawn = {"bodies.upper.mesh.rectangle.origin": [0, 0.999]}
    found = told(tmp_path, 2.0e-5, **drawn)
    assert found.number == pytest.approx(0.02, rel=1e-6)
    assert "interference as drawn" in found.what


def test_nobody_is_told_to_set_what_is_set(tmp_path: Path) -> None:
    drawn = {"bodies.upper.mesh.rectangle.origin": [0, 0.999]}
    assert told(tmp_path, 2.0e-5, **drawn).remedy.startswith("Set augmented: {}")
    assert told(tmp_path, 2.0e-5, augmented=("face",), **drawn).remedy.startswith("Use shorter edges")


@pytest.mark.parametrize("augmented", [(), ("face",)])
def test_of_points_at_nodes_the_deepest_of_either_side_is_told(augmented: tuple[str, ...], tmp_path: Path) -> None:
    """A node of the master between the slave's, which press without overlap; cut edges leave none there."""
    gives, shares = P * 2.0 / M * THICK, {}
    for form in ("nodes", "edges"):
        interface = load_text(tmp_path, GOOD, {"contact.face.form": form}).interface
        own, other = (interface.side_of("face", name).at for name in ("upper.bottom", "lower.top"))
        t_N, gap = np.zeros(len(interface.pair_nodes)), np.zeros(len(interface.pair_nodes))
        t_N[own], gap[other.start + 1] = -P, -0.3 * gives
        now = Level(1.0, np.full(len(interface.nodes), 300.0), interface.nodes, t_N, gap, (t_N < 0.0).astype(float))
        yields = Yields(interface, augmented)
        shares[form] = check(yields.watched(PenetrationLog(), now), yields, False)
    assert shares["edges"].verdict == "holds"
    assert shares["nodes"].verdict == "noted"
    assert shares["nodes"].number == pytest.approx(0.3, rel=1e-9)
    assert "form: nodes" in shares["nodes"].what


@pytest.mark.parametrize("augmented", [(), ("face",)])
def test_a_node_that_sinks_in_where_nothing_presses_breaks_trust(augmented: tuple[str, ...], tmp_path: Path) -> None:
    """No pressure explains its depth: what is missing is all of it.  A touch that a window ended at is none."""
    found = {}
    for form, deep in (("nodes", 2e-3), ("nodes", 1e-6), ("edges", 2e-3)):
        interface = load_text(tmp_path, GOOD, {"contact.face.form": form}).interface
        other = interface.side_of("face", "lower.top").at
        t_N, gap = np.zeros(len(interface.pair_nodes)), np.full(len(interface.pair_nodes), np.nan)
        gap[other.start + 1] = -deep
        now = Level(1.0, np.full(len(interface.nodes), 300.0), interface.nodes, t_N, gap, np.zeros(len(gap)))
        yields = Yields(interface, augmented)
        found[form, deep] = check(yields.watched(PenetrationLog(), now), yields, False)
    told_deep = found["nodes", 2e-3]
    assert (told_deep.verdict, told_deep.number) == ("broken", 1.0)
    assert "a node penetrates by 0.002 m without any pressure, at t = 1 s" in told_deep.what
    assert found["nodes", 1e-6].verdict == found["edges", 2e-3].verdict == "holds"


def test_a_corner_that_sinks_in_where_nothing_presses_breaks_trust(tmp_path: Path) -> None:
    """On a long edge multipliers may press nowhere: a wedge went 0.2 mm into a floor without a force, exit 0."""
    interface = load_text(tmp_path, GOOD, {}).interface
    side, n = interface.side_of("face", "upper.bottom"), len(interface.pair_nodes)
    x = interface.nodes[side.nodes, 0]
    corner, within = (side.at.start + int(k) for k in (x.argmin(), np.argsort(x)[1]))

    def found(*windows: tuple[int, float, float]) -> Check:
        """Windows: the node that is in, how deep, and what presses everywhere."""
        yields, log = Yields(interface, ("face",)), PenetrationLog()
        for node, deep, p in windows:
            gap = np.full(n, np.nan)
            gap[node] = -deep
            log = yields.watched(log, Level(1.0, np.full(len(interface.nodes), 300.0), interface.nodes,
                                            np.full(n, -p), gap, np.ones(n)))
        return check(log, yields, False)

    told_deep = found((corner, 2e-3, 0.0))
    assert (told_deep.verdict, told_deep.number) == ("broken", 1.0)
    assert "a corner penetrates by 0.002 m without any pressure, at t = 1 s" in told_deep.what
    # What round edges overlap is theirs; a corner that presses later, or did before, has its pressure.
    assert found((within, 2e-3, 0.0)).verdict == "holds"
    assert found((corner, 1e-6, 0.0)).verdict == "holds"
    assert found((corner, 2e-3, 0.0), (corner, 2e-3, P)).verdict == "holds"
    assert found((corner, 1e-3, P), (corner, 2e-3, 0.0)).verdict == "holds"


def test_a_corner_that_another_pair_presses_is_held_by_that(tmp_path: Path) -> None:
    """A billet's corner stands on the die, and its side has not met it yet: it overlaps for the sake of the one."""
    interface = load_text(tmp_path, GOOD, {}).interface
    interface = replace(interface, pairs=(*interface.pairs, replace(interface.pairs[0], name="other")))
    corner = interface.nodes[interface.side_of("face", "upper.bottom").nodes, 0].argmin()
    verdicts = []
    for pressed in (False, True):
        gap, t_N = np.full(len(interface.pair_nodes), np.nan), np.zeros(len(interface.pair_nodes))
        gap[interface.side_of("face", "upper.bottom").at.start + corner] = -2e-3
        t_N[interface.side_of("other", "upper.bottom").at.start + corner] = -P if pressed else 0.0
        yields = Yields(interface, ("face", "other"))
        now = Level(1.0, np.full(len(interface.nodes), 300.0), interface.nodes, t_N, gap, np.ones(len(t_N)))
        verdicts.append(check(yields.watched(PenetrationLog(), now), yields, False).verdict)
    assert verdicts == ["broken", "holds"]


def test_a_touch_that_a_window_ended_at_is_not_held_against_its_load(tmp_path: Path) -> None:
    """A body that bounces leaves 1e-9 of its load and 1e-6 of its overlap where a window ends as it parts."""
    interface = load_text(tmp_path, GOOD, {}).interface
    yields, own = Yields(interface), interface.side_of("face", "upper.bottom").at
    gives, log, n = P * 2.0 / M * THICK, PenetrationLog(), len(interface.pair_nodes)
    for t, load, depth in ((1.0, 1.0, 0.02), (2.0, 1e-9, 2e-8), (3.0, 1e-2, 1e-4)):
        t_N, gap, covered = np.zeros(n), np.zeros(n), np.zeros(n)
        t_N[own], gap[own], covered[own] = -P * load, -depth * gives, 1.0
        log = yields.watched(log, Level(t, np.full(len(interface.nodes), 300.0), interface.nodes, t_N, gap, covered))
    assert (log.share, log.t) == (pytest.approx(0.02, rel=1e-9), 1.0)
    assert log.most["face"] > 0.0
    # A load of its own counts, however small it is.
    log = yields.watched(PenetrationLog(), Level(2.0, np.full(len(interface.nodes), 300.0), interface.nodes,
                                                 t_N * 1e-7, gap * 1e-3, covered))
    assert log.share == pytest.approx(1e-4 * 1e-3 / (1e-2 * 1e-7), rel=1e-9)


def test_an_augmented_pair_has_its_pressure_whatever_its_corners_overlap(tmp_path: Path) -> None:
    """What is drawn into each other must still be driven out of each other."""
    gives = P * 2.0 / M * THICK
    assert told(tmp_path, 50.0 * gives, augmented=("face",)).verdict == "holds"
    assert told(tmp_path, 0.02 * gives, augmented=("another",)).verdict == "noted"
    drawn = {"bodies.upper.mesh.rectangle.origin": [0, 0.999]}
    assert told(tmp_path, 2.0e-5, augmented=("face",), **drawn).number == pytest.approx(0.02, rel=1e-6)


def test_where_nothing_deforms_it_is_not_checked(tmp_path: Path) -> None:
    interface = load_text(tmp_path, GOOD).interface
    assert check(PenetrationLog(), Yields(interface), True).verdict == "not checked"
    assert check(PenetrationLog(), Yields(replace(interface, stiffness={})), False).verdict == "not checked"


@pytest.mark.parametrize(("augmented", "verdict"), [(None, "noted"), ({}, "holds")])
def test_a_run_tells_the_pressure_that_is_missing(augmented: Any, verdict: str, tmp_path: Path) -> None:
    """Cells half as deep as the blocks: by the penalty alone a good part of the pressure is missing."""
    scenario = load_text(tmp_path, GOOD, {"contact.face.augmented": augmented, "coupling.end": 10,
                                          "output.fields": {"every": 1}, "coupling.kinks": [],
                                          "signals.push": {"t": [0, 10], "value": [0, -1e-4]}})
    found = next(c for c in run(scenario, out=tmp_path / "run.h5").trust if c.name == SHARE)
    assert found.verdict == verdict
    if augmented is None:
        assert 0.1 < found.number < 1.0
