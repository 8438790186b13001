"""How far surfaces are from the one temperature of a lumped body, or of a rod's column: closed forms of slabs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact.half.interface import Interface, Pair
from contact.half.model import Done, HalfModel
from contact.rpc.link import open_link
from thermal_fmu.half import load
from thermal_fmu.stations.half import load_lumped, load_rod

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import Box, inputs_of, scene

W, H, K = 0.03, 0.02, 2.0  # m, m, W/mK
MATERIAL = {"rho": 1300.0, "c": 1000.0, "k": K}
Q = 1000.0


def off(half: HalfModel, interface: Interface, h: float = 1e-3) -> float:
    """What a step of h [s] tells [K]."""
    link = open_link("direct")
    inputs = inputs_of(interface, half)
    state, first = half.start(inputs, 0.0, link)
    assert first["across.T_off"] == 0.0
    done = half.step(state, inputs, 0.0, h, link)
    assert isinstance(done, Done), done
    return float(done.outputs["across.T_off"])


def spec(half: str, boundary: list[dict[str, Any]], **more: Any) -> dict[str, Any]:
    return {"half": half, "format": 2, "materials": {"m": MATERIAL}, "bodies": {"a": {"material": "m", "T0": 300.0}},
            "boundary": boundary, **more}


BOTH = [{"on": "a.left", "flux": Q}, {"on": "a.right", "flux": Q}]
ONE = [{"on": "a.left", "flux": Q}]
THROUGH = [{"on": "a.left", "flux": Q}, {"on": "a.right", "flux": -Q}]
# Of a slab of thickness w: a parabola for what stays, a line for what goes through.
SLABS = [(BOTH, Q * W / (6 * K)), (ONE, Q * W / (3 * K)), (THROUGH, Q * W / (2 * K))]


@pytest.mark.parametrize("cells", [(1, 1), (4, 3)])
@pytest.mark.parametrize(("boundary", "exact"), SLABS, ids=["both", "one", "through"])
def test_a_lumped_slab(boundary, exact, cells):
    interface = scene(Box(0, W, 0, H, *cells))
    assert off(load_lumped(interface, spec("lumped", boundary)), interface) == pytest.approx(exact, rel=1e-9)


def test_heat_that_goes_through_as_films():
    """Between two films of 1 kelvin more and less than it has: nothing is stored, and one face is as warm as cold."""
    interface = scene(Box(0, W, 0, H, 3, 2))
    films = [{"on": f"a.{side}", "convection": {"h": 40.0, "T": T}} for side, T in (("left", 301.0), ("right", 299.0))]
    assert off(load_lumped(interface, spec("lumped", films)), interface) == pytest.approx(40.0 * W / (2 * K), rel=1e-9)


def test_a_wall_at_a_temperature():
    """What a prescribed temperature lets out is what the other side lets in."""
    interface = scene(Box(0, W, 0, H, 3, 2))
    wall = [{"on": "a.right", "temperature": 300.0}, *ONE]
    assert off(load_lumped(interface, spec("lumped", wall)), interface) == pytest.approx(Q * W / (2 * K), rel=1e-9)


@pytest.mark.parametrize("cells", [1, 4])
@pytest.mark.parametrize(("sides", "exact"), [
    (("top", "bottom"), Q * H / (6 * K)), (("top",), Q * H / (3 * K)), (("left",), 0.0)])
def test_a_rod(sides, exact, cells):
    """Across its height; what comes in at an end goes along it."""
    interface = scene(Box(0, W, 0, H, 5, cells))
    boundary = [{"on": f"a.{side}", "flux": Q} for side in sides]
    told = off(load_rod(interface, spec("thermal_rod", boundary)), interface)
    assert told == pytest.approx(exact, rel=1e-9, abs=1e-9)


def test_a_rod_on_a_cold_floor():
    interface = scene(Box(0, W, 0, H, 5, 2))
    floor = [{"on": "a.bottom", "temperature": 300.0}, {"on": "a.top", "flux": Q}]
    assert off(load_rod(interface, spec("thermal_rod", floor)), interface) == pytest.approx(Q * H / (2 * K), rel=1e-9)


def test_around_an_axis():
    """A disc heated on its lower face, and a cylinder on its mantle: q L/(3 k) with L = V/A, where it is q R/(4 k)."""
    R = 0.05
    interface = scene(Box(0, R, 0, H, 6, 3), geometry="axisymmetric")
    disc = spec("lumped", [{"on": "a.bottom", "flux": Q}])
    assert off(load_lumped(interface, disc), interface) == pytest.approx(Q * H / (3 * K), rel=1e-9)
    mantle = spec("lumped", [{"on": "a.right", "flux": Q}])
    assert off(load_lumped(interface, mantle), interface) == pytest.approx(Q * 0.5 * R / (3 * K), rel=1e-9)


def test_what_crosses_a_pair_is_told_of_both_sides():
    """Two slabs of 300 and 310 K with 50 W/m2K between them, each insulated elsewhere."""
    pair = Pair("face", "b.left", "a.right", 0.1, 1e9)
    interface = scene(Box(0, W, 0, H, 2, 2), Box(2 * W, 3 * W, 0, H, 3, 3), pairs=(pair,))
    law = {"law": "constant", "h": 50.0}
    model = spec("lumped", [], pairs={"face": {"conduction": {"closed": law, "open": law}}})
    model["bodies"]["b"] = {"material": "m", "T0": 310.0}
    assert off(load_lumped(interface, model), interface) == pytest.approx(500.0 * W / (3 * K), rel=1e-3)


def test_it_is_what_the_field_half_finds():
    """A slab of Biot number 2, heated for long by a film: the face of the field half above the mean of its nodes."""
    interface = scene(Box(0, W, 0, H, 30, 1))
    film = [{"on": "a.left", "convection": {"h": 2.0 * K / W, "T": 400.0}}]
    field, link = load(interface, spec("thermal", film)), open_link("direct")
    inputs = inputs_of(interface, field)
    state, _ = field.start(inputs, 0.0, link)
    settle = 0.5 * W**2 * MATERIAL["rho"] * MATERIAL["c"] / K
    for k in range(40):
        done = field.step(state, inputs, k * settle / 40, settle / 40, link)
        assert isinstance(done, Done), done
        state = done.state
    T = np.asarray(done.outputs["T"])
    column = np.array([T[np.isclose(interface.nodes[:, 0], x)].mean() for x in np.unique(interface.nodes[:, 0])])
    mean = float(np.trapezoid(column) / 30)
    q = 2.0 * K / W * (400.0 - column[0])
    flux = spec("lumped", [{"on": "a.left", "flux": q}])
    told = off(load_lumped(interface, flux), interface)
    assert column[0] - mean == pytest.approx(told, rel=0.1)
    assert told > 5.0
