"""Bodies far from each other on one floor: none comes to rest, bounces or rubs otherwise because of the others."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact.half.interface import Interface, Pair
from contact.rpc.link import open_link
from mechanical_fmu import advance
from mechanical_fmu.impact import with_its_energy

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NO_CELLS, done, elastic, hold, inputs_of, rectangle
from test_friction_inertia import MASS, MU, RHO, SIDE, V0, G

BELT = 0.4  # [m/s]


def beside(rigid: bool, height: float, mu: float = 0.0, belt: float = 0.0, alone: bool = False, **more: object):
    """A rigid block that slides on a floor, and 0.5 m beside it another body, `height` [m] above."""
    n1, c1, s1 = rectangle(np.linspace(-0.2, 1.0, 25), np.array([-0.02, 0.0]))
    n2, c2, s2 = rectangle(np.linspace(0.0, SIDE, 3), np.linspace(0.0, SIDE, 3), first=len(n1))
    n3, c3, s3 = rectangle(np.linspace(0.0, SIDE, 3), np.linspace(0.0, SIDE, 3), first=len(n1) + len(n2))
    n3 += [0.5, height]
    nodes, cells, names = [n1, n2, n3], [c1, c2, c3], ("floor", "a", "b")
    pairs = (Pair("p", "a.bottom", "floor.top", 0.1, 1e12, mu=MU), Pair("q", "b.bottom", "floor.top", 0.1, 1e12, mu=mu))
    n = 2 if alone else 3
    body = np.concatenate([np.full(len(k), i, np.int32) for i, k in enumerate(cells[:n])])
    surfaces = {f"{name}.{k}": v for name, of in zip(names[:n], (s1, s2, s3), strict=False) for k, v in of.items()}
    interface = Interface("plane", np.concatenate(nodes[:n]), np.concatenate(cells[:n]).astype(np.int32), NO_CELLS[3],
                          body, body[:0], names[:n], ("m",) * n, surfaces, {}, pairs[: n - 1])
    bodies = {"floor": {"material": "m", "rigid": True}, "a": {"material": "m", "rigid": True, "v0": [V0, 0.0]},
              "b": {"material": "m", "rigid": rigid}}
    moves = {"t": [0.0, 1.0], "value": [0.0, belt]} if belt else 0.0
    held = [hold("floor", 0, moves), hold("floor", 1), hold("floor", 2)]
    return elastic(interface, held, {"rho": RHO}, tolerance=1e-10, bodies={name: bodies[name] for name in names[:n]},
                   **{"dynamics": {}, "gravity": {"y": -G}} | more)


def went(half, steps):
    """t (n,), mean displacement (n, 2) [m] of a, and heat (n,) [J] of its friction in each step."""
    link, t, rows = open_link("direct"), 0.0, []
    state, _ = half.start(inputs_of(half), t, link)
    a = half.system.interface.node_body == 1
    mine = half.system.contact.on_slaves(["p"])
    for h in steps:
        state, out = done(half.step(state, inputs_of(half), t, h, link))
        t += h
        rows.append((t, *np.array(state.u)[a].mean(axis=0), float(out["contact.E_friction"][mine].sum())))
    link.close()
    found = np.array(rows)
    return found[:, 0], found[:, 1:3], found[:, 3]


STEPS = (5e-4,) * 10 + (4e-3,) * 90


@pytest.mark.parametrize(("case", "belt"), [((False, 0.0), 0.0), ((True, 2e-3, 0.3), BELT),
                                            pytest.param((True, 2e-3), 0.0, marks=pytest.mark.slow),
                                            pytest.param((False, 0.0, 0.3), BELT, marks=pytest.mark.slow)])
def test_a_block_comes_to_rest_beside_others(case: tuple[bool, float], belt: float) -> None:
    """Beside a body that deforms, or bounces, it hopped for ever, and its heat was 1 % off.

    What a moving floor did in the step in which the block came to rest was taken for heat, too: 0.7 % less.
    """
    t, u, heat = went(beside(*case, belt=belt), STEPS)
    stops = (V0 - belt) / (MU * G)
    assert u[-1, 0] == pytest.approx(0.5 * (V0 + belt) * stops + belt * (t[-1] - stops), rel=1e-3)
    assert heat.sum() == pytest.approx(0.5 * MASS * (V0 - belt)**2, rel=1e-3)
    assert np.abs(u[t > stops + 0.01, 1]).max() < 1e-8


def test_what_bounces_leaves_what_lies_alone() -> None:
    """The energy that contact owed one of them was taken from the other, too."""
    steps = (5e-4,) * 200
    _, u, heat = went(beside(True, 2e-3), steps)
    _, alone, its_heat = went(beside(True, 2e-3, alone=True), steps)
    assert np.abs(u - alone).max() < 1e-9
    assert heat == pytest.approx(its_heat, abs=1e-9 * its_heat.sum())


def owing(state, debt):
    return replace(state, stored=state.stored - debt, owed=debt)


def test_energy_that_contact_owes_is_told() -> None:
    """A corner that digs in between two points of contact makes energy; contact owed it, and told no one."""
    half, link = beside(True, 0.02), open_link("direct")
    state, _ = half.start(inputs_of(half), 0.0, link)
    for debt in (0.0, 0.1):
        _, out = done(half.step(owing(state, debt), inputs_of(half), 0.0, 1e-4, link))
        assert out["energy.made"] == pytest.approx(debt, rel=0.1, abs=1e-6)  # some of it is paid back
    link.close()


def test_no_step_is_cut_for_what_is_owed_of_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each step of a body that touched was cut ten times, where it could not pay for all that contact had made."""
    half, link, tried = beside(True, 0.02), open_link("direct"), []
    state, _ = half.start(inputs_of(half), 0.0, link)

    def counted(*given, **more):
        tried.append(1)
        return with_its_energy(*given, **more)

    monkeypatch.setattr(advance, "with_its_energy", counted)
    done(half.step(owing(state, 1e3), inputs_of(half), 0.0, 1e-4, link))
    link.close()
    assert len(tried) == 1


def test_pairs_by_their_penalty_alone_see_corners() -> None:
    """Where multipliers press, too, the pressure ends elsewhere than the gap."""
    assert beside(True, 0.0).system.contact.message.passes.parting.tolist() == [1, 1]
    augmented = beside(False, 0.0, pairs={"q": {"augmented": {}}})
    assert augmented.system.contact.message.passes.parting.tolist() == [1, 0]
