"""Radiation to the surroundings and between facing points (A4, A10, A11, D8), and the blend of the two."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import EXPECTED, Box, FlatContact, inputs_of, order, run, scene, spec

from contact.half.functions import property_from
from contact.half.interface import Pair
from contact.half.model import Discard
from contact.rpc.link import DirectLink
from contact.service import ContactService
from thermal_fmu.exchange import RadiationGroup, gap_radiation_flow
from thermal_fmu.half import load

SIGMA = 5.670374419e-8


def radiation(on, T, emissivity=0.8, name=None, **more):
    return {"on": on, "radiation": {"emissivity": emissivity, "T": T, **more}} | ({"name": name} if name else {})


@pytest.mark.parametrize("T0", [1000.0, 10.0])
def test_a4_nafems_t2(T0):
    """A rod held at 1000 K that radiates from its end, also from a far start."""
    case = EXPECTED["A4"]
    model = spec([{"on": "a.left", "temperature": 1000.0}, radiation("a.right", 300.0, 0.98)],
                 k=55.6, T0=T0, method="steady", sigma_SB=5.67e-8)
    ran = run(scene(Box(0, 0.1, 0, 0.01, 10)), model, 1.0, 1)
    assert abs(ran.T[-1, 10] - case["T_B"]) < case["tolerance"]
    assert abs(-ran.outputs[-1]["heat.radiation"] / 0.01 / case["q"] - 1.0) < case["tolerance_q"]
    assert ran.imbalance() < EXPECTED["A16"]["tolerance"]


def lumped(boundary, T0, refine):
    """A body of rho c V/A = 39000 that conducts too well to have two temperatures: T at the times of A10."""
    model = spec([{"on": "a.right", **boundary}], k=1e9, c=39.0, rho=1000.0, T0=T0)
    dt = np.repeat([4.0, 8.0, 20.0], np.array([25, 50, 75]) * refine) / refine
    ran = run(scene(Box(0, 1, 0, 1, 1)), model, dt)
    return ran.T[[np.argmin(abs(ran.t - t)) for t in EXPECTED["A10"]["t"]]].mean(axis=1)


@pytest.mark.few("300.0-to_300")
@pytest.mark.parametrize(("T_inf", "key"), [(0.0, "to_0"), (300.0, "to_300")])
def test_a10_a_body_cools_by_radiation(T_inf, key):
    """Second order in dt, 2e-2 K with steps of 4 to 20 s, and 4e-4 K where both step sizes are combined."""
    expected = EXPECTED["A10"][key]
    coarse, fine = (lumped({"radiation": {"emissivity": 0.8, "T": T_inf}}, 1200.0, n) for n in (1, 2))
    assert np.abs(coarse - expected).max() < 2e-2
    assert abs(order([abs(coarse - expected)[0], abs(fine - expected)[0]]) - 2.0) < 0.1
    assert np.abs((4.0 * fine - coarse) / 3.0 - expected).max() < 4e-4


@pytest.mark.slow
def test_a11_free_convection():
    """q = 2 dT^(4/3): the exponent 1/3 of a film."""
    expected = np.array(EXPECTED["A11"]["dT"]) + 300.0
    film = {"convection": {"h": 2.0, "T": 300.0, "exponent": 1.0 / 3.0}}
    coarse, fine = (lumped(film, 1200.0, n) for n in (1, 2))
    assert np.abs(coarse - expected).max() < 5e-3
    assert np.abs((4.0 * fine - coarse) / 3.0 - expected).max() < 4e-4


def plates(gap=1e-3, slide=0.0, geometry="plane"):
    """Two plates .1 wide, b above a by a gap; b is the slave."""
    return scene(Box(0.0, 0.1, 0.0, 0.01, 5, 1), Box(slide, 0.1 + slide, 0.01 + gap, 0.02 + gap, 7, 1),
                 geometry=geometry, pairs=(Pair("p", "b.bottom", "a.top", 0.1, 1e9),))


def held_plates(T_a, T_b, boundary=(), **near):
    """model.json of plates held at two temperatures, of emissivities .8 (a) and .1 (b)."""
    everywhere = [{"on": f"{b}.{s}", "temperature": T} for b, T in (("a", T_a), ("b", T_b))
                  for s in ("top", "bottom")]
    model = spec([*everywhere, *boundary], method="steady",
                 pairs={"p": {"radiation": {"emissivity_slave": 0.1, "emissivity_master": 0.8, **near}}})
    return model | {"bodies": {"a": {"material": "m", "T0": T_a}, "b": {"material": "m", "T0": T_b}}}


@pytest.mark.parametrize("p", [0.0, 1e6])
def test_d8_parallel_plates(p):
    """Apart and touching alike: radiation does not jump at touch."""
    mesh = plates()
    t_N = np.full(len(mesh.pair_nodes), -p)
    out = run(mesh, held_plates(600.0, 900.0), 1.0, 1, t_N=t_N).outputs[-1]
    assert abs(out["heat.near_radiation.slave"] / (-0.1 * EXPECTED["D8"]["q"]) - 1.0) < 2e-7  # the printed digits
    assert abs(out["heat.near_radiation.master"] / (0.1 * EXPECTED["D8"]["q"]) - 1.0) < 2e-7


LIMITS = {"gap": {"d_near": 1e-3, "d_far": 5e-3}}
Q_NEAR = SIGMA * (900.0**4 - 600.0**4) / (1 / 0.1 + 1 / 0.8 - 1)
Q_FAR = SIGMA * (0.1 * (900.0**4 - 300.0**4) + 0.8 * (600.0**4 - 300.0**4))


def blended(gap, slide=0.0, p=0.0):
    """(near, far) heat that leaves per second, with the far one of both plates."""
    mesh = plates(gap, slide)
    far = [radiation("a.top", 300.0, 0.8, **LIMITS), radiation("b.bottom", 300.0, 0.1, **LIMITS)]
    out = run(mesh, held_plates(600.0, 900.0, far, **LIMITS), 1.0, 1, DirectLink(ContactService().handle),
              t_N=np.full(len(mesh.pair_nodes), -p)).outputs[-1]
    assert abs(out["heat.near_radiation.slave"] + out["heat.near_radiation.master"]) < 1e-12 * 0.1 * Q_FAR
    return out["heat.near_radiation.master"], -out["heat.radiation"]


@pytest.mark.parametrize(("gap", "w"), [(1e-6, 0.0), (1e-3, 0.0), (2e-3, 0.25), (3e-3, 0.5), (4.999e-3, 0.99975),
                                        (5e-3, 1.0), (9e-3, 1.0)])
def test_near_turns_into_far_as_the_gap_opens(gap, w):
    near, far = blended(gap)
    assert abs(near - (1.0 - w) * 0.1 * Q_NEAR) < 1e-9 * 0.1 * Q_FAR
    assert abs(far - w * 0.1 * Q_FAR) < 1e-9 * 0.1 * Q_FAR


def test_what_faces_nothing_radiates_far():
    """A third slid off: that third of either plate, whatever the gap; pressed points have gap 0."""
    for gap, p in ((2e-4, 0.0), (2e-3, 1e6)):
        near, far = blended(gap, slide=0.03, p=p)
        assert abs(near / (0.07 * Q_NEAR) - 1.0) < 1e-9
        assert abs(far / (0.03 * Q_FAR) - 1.0) < 1e-9


def test_without_limits_a_surface_radiates_whole():
    far = [radiation("a.top", 300.0, 0.8), radiation("b.bottom", 300.0, 0.1, name="lamp")]
    for lamp in (1.0, 0.25):
        out = run(plates(), held_plates(600.0, 900.0, far), 1.0, 1, load_lamp=lamp).outputs[-1]
        expected = 0.1 * SIGMA * (lamp * 0.1 * (900.0**4 - 300.0**4) + 0.8 * (600.0**4 - 300.0**4))
        assert abs(-out["heat.radiation"] / expected - 1.0) < 1e-12


def test_emissivities_follow_their_own_side():
    """eps(T) of the slave at the slave's temperature, of the master at the master's."""
    eps = {"polynomial": [0.1, 5e-4]}
    model = held_plates(600.0, 900.0)
    model["pairs"]["p"]["radiation"] = {"emissivity_slave": eps, "emissivity_master": eps}
    out = run(plates(), model, 1.0, 1).outputs[-1]
    q = SIGMA * (900.0**4 - 600.0**4) / (1 / 0.55 + 1 / 0.4 - 1)
    assert abs(out["heat.near_radiation.master"] / (0.1 * q) - 1.0) < 1e-12


def discarded(model, mesh=None):
    """Why the first step of a scene is discarded."""
    mesh = mesh or scene(Box(0, 0.1, 0, 0.01, 4))
    half, link = load(mesh, model), FlatContact()
    given = inputs_of(mesh, half)
    state, _ = half.start(given, 0.0, link)
    done = half.step(state, given, 0.0, 1.0, link)
    assert isinstance(done, Discard)
    return done.message


def test_a_point_without_area_radiates_nothing():
    """As under `form: nodes` a node has that faces nothing with its edges."""
    emissivities = property_from(0.3), property_from(0.8)
    half, one = np.full((2, 2), 0.5), np.ones(2)
    group = RadiationGroup(0, emissivities, np.array([[0, 1, 2, 3]] * 2), half, half, np.array([0.0, 1e-3]), one,
                               one)
    flow, slope = gap_radiation_flow(group, 5.67e-8, np.array([300.0, 300.0, 800.0, 800.0]))
    assert (flow[0] == 0.0).all()
    assert (slope[0] == 0.0).all()
    assert np.isfinite(flow).all()
    assert np.isfinite(slope).all()
    assert (flow[1] != 0.0).all()


def test_temperatures_below_0_kelvin_are_told():
    cooled = spec([radiation("a.right", 300.0), {"on": "a.right", "flux": -1e6}], T0=300.0)
    assert "radiation needs temperatures in kelvin" in discarded(cooled)
    falling = {"t": [0, 1], "value": [20.0, -500.0]}
    outside = spec([radiation("a.right", {"terms": [{"t": falling, "x": {"polynomial": [1.0, 1.0]}}]})], T0=300.0)
    assert "surroundings of -" in discarded(outside)
    model = held_plates(600.0, 900.0)
    model["boundary"][0]["name"] = "cold"
    mesh = plates()
    half, link = load(mesh, model), FlatContact()
    given = inputs_of(mesh, half, load_cold=-1.0)
    done = half.step(half.start(given, 0.0, link)[0], given, 0.0, 1.0, link)
    assert isinstance(done, Discard)
    assert "kelvin" in done.message


def test_an_emissivity_that_leaves_its_range_is_told():
    assert "emissivity of surface a.right is 1.2" in discarded(
        spec([radiation("a.right", 300.0, {"polynomial": [0.6, 0.002]})], T0=300.0))
    model = held_plates(600.0, 900.0)
    model["pairs"]["p"]["radiation"]["emissivity_master"] = {"polynomial": [1.0, -0.002]}
    assert "master" in discarded(model, plates())


WRONG = [
    ({"emissivity": 0.0}, "emissivity: must be greater than zero and at most 1, not 0"),
    ({"emissivity": 1.2}, "at most 1, not 1.2"),
    ({"emissivity": {"T": [300, 400], "value": [0.5, -0.1]}}, "not -0.1"),
    ({"gap": {"d_near": 2e-3, "d_far": 2e-3}}, "d_far must be greater than d_near, not 0.002"),
    ({"gap": {"d_near": 2e-3}}, "radiation.gap.d_far: a required key is missing"),
    ({"T": -5.0}, "T of a radiation is -5: radiation needs temperatures in kelvin"),
    ({"on": "a.nowhere"}, "there is no surface 'a.nowhere'"),
    ({"emissivty": 0.5}, "radiation.emissivty: unknown key.* Did you mean 'emissivity'"),
]


def _changed(boundary, change):
    """Its place changed, or its radiation."""
    return boundary | change if "on" in change else boundary | {"radiation": boundary["radiation"] | change}


@pytest.mark.parametrize(("change", "message"), WRONG)
def test_what_radiation_refuses(change, message):
    with pytest.raises(ValueError, match=message) as refused:
        load(plates(), held_plates(600.0, 900.0, [_changed(radiation("a.top", 300.0), change)]))
    assert str(refused.value).startswith("model.json: ")


@pytest.mark.parametrize(("change", "message"), [
    ({"emissivity_slave": -0.1}, "emissivity_slave: must be greater than zero and at most 1, not -0.1"),
    ({"gap": {"d_near": 3e-3, "d_far": 2e-3}}, "d_far must be greater than d_near, not 0.002"),
    ({"eps": 1.0}, "radiation.eps: unknown key")])
def test_what_radiation_of_a_pair_refuses(change, message):
    with pytest.raises(ValueError, match=message):
        load(plates(), held_plates(600.0, 900.0, **change))


def test_a_start_below_0_kelvin_is_refused_where_something_radiates():
    model = held_plates(600.0, 900.0)
    model["bodies"]["b"]["T0"] = -10.0
    with pytest.raises(ValueError, match=r"bodies\.b\.T0 is -10: radiation needs temperatures in kelvin"):
        load(plates(), model)
    with pytest.raises(ValueError, match="sigma_SB: must be greater than zero"):
        load(plates(), held_plates(600.0, 900.0) | {"sigma_SB": 0.0})
    del model["pairs"]["p"]["radiation"]
    load(plates(), model)
