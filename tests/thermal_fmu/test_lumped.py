"""The lumped thermal half: closed forms of one temperature, two bodies in contact, orders, latent heat."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact.half.interface import Interface, Pair
from contact.half.model import Done
from contact.half.state import from_bytes, to_bytes
from contact.rpc.link import open_link
from thermal_fmu.stations.half import load_lumped

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import EXPECTED, Box, FlatContact, imbalance, inputs_of, order, scene

AREA, LENGTH = 0.02, 0.03
ONE = scene(Box(0, LENGTH, 0, AREA, 3, 2))
# rho c V/A = 39000 J/m2K through the left end.
HEAVY = {"rho": 1300.0, "c": 1000.0, "k": 1.0}


def spec(boundary: list[dict[str, Any]], T0: float, material: dict[str, Any] = HEAVY, **more: Any) -> dict[str, Any]:
    return {"half": "lumped", "format": 2, "materials": {"m": material}, "bodies": {"a": {"material": "m", "T0": T0}},
            "boundary": boundary, **more}


def drive(interface: Interface, model: dict[str, Any], dt: np.ndarray, **given: Any) -> list[dict[str, Any]]:
    """Outputs of the steps dt."""
    half, link = load_lumped(interface, model), open_link("direct")
    inputs, out, t = inputs_of(interface, half, **given), [], 0.0
    state, _ = half.start(inputs, 0.0, link)
    for h in dt:
        done = half.step(state, inputs, t, float(h), link)
        assert isinstance(done, Done), done
        state, t = done.state, t + float(h)
        out.append(dict(done.outputs))
    assert imbalance(out) < 1e-10
    return out


def at_times(model: dict[str, Any], times: list[float], n: int) -> np.ndarray:
    """T at these times, n steps between each two of them; every node must have the body's."""
    parts = np.diff([0.0, *times])
    out = drive(ONE, model, np.repeat(parts / n, n))
    T = np.array([step["T"] for step in out])
    assert (T[:, :1] == T).all()
    return T[n - 1:: n, 0]


@pytest.mark.parametrize("key", ["to_0", "to_300"])
def test_radiation(key: str) -> None:
    """A10; 40 steps a part leave 1e-3 K by the midpoint rule."""
    T_inf = {"to_0": 0.0, "to_300": 300.0}[key]
    boundary = [{"on": "a.left", "radiation": {"emissivity": 0.8, "T": T_inf}}]
    case = EXPECTED["A10"]
    T = at_times(spec(boundary, 1200.0), case["t"], 40)
    assert pytest.approx(case[key], abs=0.02) == T


def test_free_convection() -> None:
    """A11."""
    boundary = [{"on": "a.left", "convection": {"h": 2.0, "T": 300.0, "exponent": 1.0 / 3.0}}]
    case = EXPECTED["A11"]
    T = at_times(spec(boundary, 1200.0), case["t"], 40)
    assert pytest.approx(case["dT"], abs=0.01) == T - 300.0


@pytest.mark.few("sdirk2-2", "theta-1")
@pytest.mark.parametrize(("method", "wanted"), [("midpoint", 2), ("sdirk2", 2), ("backward_euler", 1),
                                                ("theta", 1)])
def test_order(method: str, wanted: int) -> None:
    """C dT/dt = G (T_s - T) to t = C/G: the error falls with the order, and is small in itself."""
    boundary = [{"on": "a.left", "convection": {"h": 5000.0, "T": 933.0}}]
    exact = 933.0 - 500.0 * np.exp(-1.0)
    theta = {"theta": 0.75} if method == "theta" else {}
    errors = [abs(drive(ONE, spec(boundary, 433.0, method=method, **theta), np.full(n, 7.8 / n))[-1]["T"][0] - exact)
              for n in (8, 16, 32, 64)]
    assert order(errors) == pytest.approx(wanted, abs=0.15)
    assert errors[0] < (1.0 if wanted == 2 else 15.0)


def two() -> Interface:
    return scene(Box(0, LENGTH, 0, AREA, 2), Box(LENGTH, 2 * LENGTH, 0, AREA, 1),
                 pairs=(Pair("p", "a.right", "b.left", 0.01, 0.0),))


def test_two_bodies_in_contact_share_their_heat() -> None:
    """C_a C_b/(C_a + C_b) dD/dt = -h A D for the difference D, and nothing is lost."""
    model = spec([], 500.0, pairs={"p": {"conduction": {"closed": {"law": "power", "h0": 100.0, "h1": 300.0, "p0": 1e6,
                                                    "exponent": 1.0}, "open": None}}})
    model["materials"]["n"] = {"rho": 2600.0, "c": 1000.0, "k": 1.0}
    model["bodies"]["b"] = {"material": "n", "T0": 300.0}
    interface = two()
    out = drive(interface, model, np.full(64, 1.0), t_N=np.full(interface.pair_nodes.size, -2e6))
    T_a, T_b = out[-1]["T"][0], out[-1]["T"][-1]
    rate = 700.0 * (1 / 39000.0 + 1 / 78000.0)
    assert pytest.approx(200.0 * np.exp(-rate * 64.0), rel=1e-4) == T_a - T_b
    assert pytest.approx((39.0 * 500.0 + 78.0 * 300.0) / 117.0, rel=1e-12) == (39.0 * T_a + 78.0 * T_b) / 117.0
    assert out[-1]["contact.touching"] == 2.0


def test_a_prescribed_side_holds_the_whole_body() -> None:
    out = drive(ONE, spec([{"on": "a.top", "temperature": {"t": [0, 10], "value": [300, 400]}}],
                          300.0), np.full(4, 2.5))
    assert out[-1]["T"] == pytest.approx(400.0, abs=1e-12)
    assert out[-1]["heat.temperature.in"] == pytest.approx(25.0 * 1300.0 * 1000.0 * AREA * LENGTH)


def test_latent_heat_whatever_the_step() -> None:
    """A constant flux out takes superheat, latent heat and then heat of the solid, to the joule."""
    melt = {"rho": 2500.0, "k": 100.0, "c": {"solid": 1100.0, "liquid": 1180.0},
            "latent": {"L": 3.97e5, "T_s": 933.0, "T_l": 933.0}}
    q = 2500.0 * LENGTH * (1180.0 * 7.0 + 3.97e5 + 1100.0 * 33.0) / 100.0
    for n in (1, 3, 50):
        out = drive(ONE, spec([{"on": "a.left", "flux": -q}], 940.0, melt), np.full(n, 100.0 / n))
        assert out[-1]["T"] == pytest.approx(900.0, abs=1e-6)
        assert (out[-1]["f_s"] == 1.0).all()
    half_way = 2500.0 * LENGTH * (1180.0 * 7.0 + 0.5 * 3.97e5) / 100.0
    out = drive(ONE, spec([{"on": "a.left", "flux": -half_way}], 940.0, melt), np.full(7, 100.0 / 7))
    assert out[-1]["f_s"] == pytest.approx(0.5, abs=1e-9)


def test_a_restored_body_gives_the_same_bits() -> None:
    model = spec([{"on": "a.left", "radiation": {"emissivity": 0.8, "T": 300.0}}], 1200.0)
    half, link = load_lumped(ONE, model), open_link("direct")
    inputs = inputs_of(ONE, half)
    state = half.step(half.start(inputs, 0.0, link)[0], inputs, 0.0, 9.0, link).state
    hot = half.step(state, inputs, 9.0, 9.0, link)
    cold = load_lumped(ONE, model).step(from_bytes(to_bytes(state), ("thermal_fmu",)), inputs, 9.0, 9.0, link)
    assert np.array_equal(hot.outputs["T"], cold.outputs["T"])
    assert hot.outputs["heat.radiation"] == cold.outputs["heat.radiation"]


@pytest.mark.parametrize("h", [1e4, 1e8, 1e12])
def test_little_heat_is_kept_beside_round_off_of_a_contact(h: float) -> None:
    """1e-6 J a step into two bodies of 1 J/K in contact: round-off of h A T dt is up to 1e8 times that."""
    mesh = scene(Box(0, 1, 0, 1, 1, 1), Box(0, 1, -1, 0, 1, 1),
                 pairs=(Pair("p", "a.bottom", "b.top", gap_max=1.0, eps_N=1.0),))
    T0, unit = 1000.0 / 3.0, {"rho": 1.0, "c": 1.0, "k": 1.0}
    model = spec([{"on": "a.top", "flux": 1e-8}], T0, unit,
                 pairs={"p": {"conduction": {"closed": {"law": "constant", "h": h}, "open": None}}})
    model["bodies"]["b"] = {"material": "m", "T0": T0}
    half, link = load_lumped(mesh, model), FlatContact()
    inputs = inputs_of(mesh, half, t_N=np.full(len(mesh.contact_nodes), -1e6))
    state, stored = half.start(inputs, 0.0, link)[0], 0.0
    for n in range(20):
        done = half.step(state, inputs, 100.0 * n, 100.0, link)
        assert isinstance(done, Done), done
        state, stored = done.state, float(done.outputs["heat_stored"])
    assert stored == pytest.approx(20 * 1e-6, rel=1e-4)  # a rounding of T is 6e-8 of a step
