"""Cases D9 and D13: a rod whose own heat moves its tip, and the tip's gap or pressure lets the heat out.

D13, what finer windows and meshes give (plane stress, penalty 1e14 Pa/m; the reference is 1-D, small strains, and an
independent finite-volume program gives 39.3894 s as well):
    cells  windows in contact   t_touch    T tip at 50, 100, 200, 400 s            p [MPa]
    20     1 s, extrapolated    39.3405    301.387 312.144 332.399 346.368    .1516 .6867 1.2852 1.6865   (1e13 Pa/m)
    40     2 s, extrapolated    39.3463    301.483 312.209 332.392 346.357    .1510 .6859 1.2841 1.6860   (1e13 Pa/m)
    40     1 s, extrapolated    39.3746    301.483 312.209 332.391 346.357    .1510 .6858 1.2841 1.6860   (1e13 Pa/m)
    40     1 s, staggered       39.3746    301.483 312.212 332.397 346.360    .1510 .6859 1.2842 1.6860   (1e13 Pa/m)
    40     1 to 10 s, extrap.   39.3746    301.483 312.208 332.387 346.346    .1513 .6870 1.2864 1.6889
    40     1 to 10 s, stagg.    39.3746    301.483 312.215 332.414 346.370    .1513 .6871 1.2866 1.6892
    exact                       39.3899    301.514 312.224 332.358 346.302    .1510 .6878 1.2888 1.6932
The tip's .03 K at 50 s is the mesh's; the pressure's 0.3 % at the end is strain: 1e-3 twice, of heat and of pressure. A
penalty eps_N takes E/(eps_N L) of it: .2 % at 1e13 Pa/m, where E/h is 1.6 % with 40 cells; augmented contact nothing.
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

sys.path.insert(0, str(Path(__file__).parent))
from contact_rods import Rod, Tree, rod_scene, solve

from coupler import Results

pytestmark = pytest.mark.usefixtures("unlooked")

ROOT = Path(__file__).resolve().parents[2]
EXPECTED = tomllib.loads((ROOT / "tests/expected.toml").read_text(encoding="utf-8"))
D9, D13 = EXPECTED["D9"], EXPECTED["D13"]


def clearance(folder: Path, scale: float, scheme: str) -> Results:
    """D9 with expansions and gaps `scale` times as large: the same temperatures."""
    d0 = 1e-3 * scale
    rod = Rod(gap=d0, hot=600.0, alpha=2e-5 * scale, k=10.0, E=2e9, rho=1000.0, c=1000.0, penalty=1e12)
    law = {"closed": {"law": "constant", "h": 500.0}, "open": {"law": "table", "x": [0.0, d0], "h": [500.0, 0.0]}}
    windows = [{"until": 20000, "first": 10, "last": 800}]
    return solve(folder, rod_scene(rod, law, {"scheme": scheme, "end": 20000, "windows": windows}))


@pytest.mark.few("extrapolated")
@pytest.mark.parametrize("scheme", ["staggered", "extrapolated"])
def test_d9_clearance_that_heat_sets_itself(scheme: str, tmp_path: Path) -> None:
    """Strains of 4e-6, so the closed form of small strains is met: 400 K, not 600 K as if it could not move."""
    scale = 1e-3
    results = clearance(tmp_path, scale, scheme)
    T, d = results.probe("T")[1][-1], results.probe("gap")[1][-1] / scale
    h = 500.0 * (1.0 - d / 1e-3)
    assert pytest.approx(D9["T_B"], abs=D9["tolerance_T"]) == T
    assert d == pytest.approx(D9["d"], rel=D9["tolerance"])
    assert h == pytest.approx(D9["h"], rel=D9["tolerance"])
    assert h * (T - 300.0) == pytest.approx(D9["q"], rel=D9["tolerance"])
    assert np.diff(results.probe("T")[1]).min() > -1e-3, "windows this small bring no swing"


@pytest.mark.slow
def test_d9_with_strains_as_they_are(tmp_path: Path) -> None:
    """At full size the tip is wider by alpha (T_B - 300), so it gives off more by that share."""
    results = clearance(tmp_path, 1.0, "extrapolated")

    def out_of_balance(T: float) -> float:
        d = 1e-3 - 2e-5 * 0.1 * (0.5 * (600.0 + T) - 300.0)
        return 10.0 * (600.0 - T) / 0.1 - 500.0 * (1.0 - d / 1e-3) * (T - 300.0) * (1.0 + 2e-5 * (T - 300.0))

    assert results.probe("T")[1][-1] == pytest.approx(brentq(out_of_balance, 300.0, 600.0), abs=5e-3)


def closing(**pair: object) -> Tree:
    rod = Rod(gap=60e-6, hot=500.0, alpha=1.2e-5, k=45.0, E=2e9, rho=7850.0, c=460.0, penalty=1e14, cells=40,
              grading=4.0)
    law = {"closed": {"law": "power", "h0": 1000.0, "h1": 2e-4, "p0": 1.0, "exponent": 1.0}, "open": None}
    windows = [{"until": 30, "first": 0.5, "last": 1.5}, {"until": 50, "size": 1},
               {"until": 400, "first": 1, "last": 10}, {"until": 3000, "first": 10, "last": 300}]
    tree = rod_scene(rod, law, {"scheme": "extrapolated", "end": 3000, "windows": windows})
    tree["contact"]["tip"] |= pair
    return tree


def touch(results: Results) -> float:
    """When the gap closed [s]: the line through the last two open values, which is straight to 1e-4 of a window."""
    t, gap = results.probe("gap")
    k = int(np.argmax(results.probe("p")[1] > 0.0))
    return float(t[k - 1] - gap[k - 1] * (t[k - 1] - t[k - 2]) / (gap[k - 1] - gap[k - 2]))


@pytest.mark.slow
@pytest.mark.parametrize("pair", [{}, {"penalty": 1e12, "augmented": {"tolerance": 1e-4}}], ids=["stiff", "augmented"])
def test_d13_a_gap_closes(pair: Tree, tmp_path: Path) -> None:
    results = solve(tmp_path, closing(**pair))
    assert touch(results) == pytest.approx(D13["t_touch"], abs=D13["tolerance_t"])
    for name, unit in (("T", 1.0), ("p", 1e6)):
        t, values = results.probe(name)
        tolerance = {"abs": D13["tolerance_T"]} if name == "T" else {"rel": D13["tolerance_p"]}
        found = [*np.interp(D13["t"], t, values / unit), values[-1] / unit]
        assert found == pytest.approx([*D13[name], D13[f"{name}_steady"]], **tolerance)
    assert not results.ledger["gap.slave"], "nothing crosses an open gap here"
    assert abs(results.heat_imbalance) <= 1e-10
