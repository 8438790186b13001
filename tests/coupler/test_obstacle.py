"""What no window can get past: adaptive windows go as far as mechanics can, and the run ends soon, and says where."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from start_scenes import STEEL, solved

from coupler import CouplingError, Results

# A bar in plane strain that flows at 100 MPa and does not harden, pulled by a traction that rises by 200 MPa/s.
LIMIT = 2.0 / math.sqrt(3.0) * 0.5
FLOWS: dict[str, Any] = {
    "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
    "materials": {"soft": {**STEEL, "plastic": {"s_y": 1e8}}},
    "bodies": {"bar": {"mesh": {"rectangle": {"origin": [0, 0], "size": [0.1, 0.1], "cells": [2, 2]}},
                       "material": "soft", "T0": 300.0}},
    "thermal": {"boundary": [{"on": "bar.left", "temperature": 300.0}]},
    "mechanical": {"half": "elastic", "elastic": {"boundary": [
        {"on": "bar.left", "u_x": 0.0}, {"on": "bar.bottom", "u_y": 0.0},
        {"on": "bar.right", "t_x": {"t": [0, 1], "value": [0, 2e8]}}]}},
    "coupling": {"end": 1.0}}


def test_a_limit_load_ends_the_run_where_it_is_and_soon(tmp_path: Path) -> None:
    with pytest.raises(CouplingError, match="limit load") as error:
        solved(tmp_path, FLOWS, "flows")
    tries, _, past = str(error.value).partition(" windows that came nearer and nearer did not get past t = ")
    assert int(tries.split()[-1]) <= 8
    # The last equilibrium, and what no window reached, are on either side of it, close by.  The traction is of the area
    # as drawn, and the bar has become thinner: by how much depends on the windows.
    thinner = Results(tmp_path / "flows.h5").field("mechanical.u")[1][-1].reshape(-1, 2)[:, 1].min() / 0.1
    assert -0.01 < thinner < -0.001
    assert error.value.t == pytest.approx(LIMIT * (1.0 + thinner), rel=1e-3)
    assert 0.0 < float(past.split()[0]) - error.value.t < 1e-3


# A block of 0.1 m, 0.05 m high, under 5 MPa, pulled by a traction that rises by 9 MPa/s: friction holds it up to mu N,
# at 0.3 * 5e6 * 0.1/(9e6 * 0.05) s.
LOST = 1.0 / 3.0
PULLED: dict[str, Any] = {
    "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane", "materials": {"steel": STEEL},
    "bodies": {"block": {"mesh": {"rectangle": {"origin": [0, 0], "size": [0.1, 0.05], "cells": [4, 2]}},
                         "material": "steel", "T0": 300.0},
               "floor": {"mesh": {"rectangle": {"origin": [-0.1, -0.05], "size": [0.4, 0.05], "cells": [12, 2]}},
                         "material": "steel", "T0": 300.0}},
    "contact": {"face": {"slave": "block.bottom", "master": "floor.top", "gap_max": 1e-3, "friction": {"mu": 0.3},
                         "conduction": {"closed": {"law": "constant", "h": 3000},
                                        "open": {"law": "gas", "k_g": 0.03, "g_m": 1e-5}}}},
    "thermal": {"boundary": [{"on": "floor.bottom", "temperature": 300.0}]},
    "mechanical": {"half": "elastic", "elastic": {"boundary": [
        {"on": "block.top", "pressure": 5e6}, {"on": "floor.bottom", "u_x": 0.0}, {"on": "floor.bottom", "u_y": 0.0},
        {"on": "block.left", "t_x": {"t": [0, 1], "value": [0, 9e6]}}]}},
    "coupling": {"end": 1.0}}


@pytest.mark.slow
def test_a_pull_that_friction_cannot_hold_ends_the_run_where_it_lets_go(tmp_path: Path) -> None:
    """It was not over after 5 minutes: in windows down to 8e-6 s by then, each given up on four times."""
    with pytest.raises(CouplingError, match="did not get past t = ") as error:
        solved(tmp_path, PULLED, "pulled")
    assert error.value.t == pytest.approx(LOST, rel=1e-3)
    assert "nothing holds body block against" in str(error.value)
    assert "may be more than friction can hold" in str(error.value)
    assert "limit load" in str(error.value)
    past = float(str(error.value).partition("did not get past t = ")[2].split()[0])
    assert LOST * (1.0 - 1e-4) < past < LOST * (1.0 + 1e-3)
