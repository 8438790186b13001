"""A block pressed between two plates, all of it turned by a quarter: pressure, shear, stress and heat stay."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NO_CELLS, elastic, rectangle, told_in

from contact.half.interface import Interface, Pair

PRESS, MU, ABOUT = 1e-4, 0.4, [0.3, -0.7]  # m, 1, m
FORMS = {"edges": {}, "nodes": {"by_node": True}, "two passes": {"two_pass": True}, "smooth": {"smooth": True}}


def scene(mu: float, **pair: Any) -> Interface:
    """Two plates, the block between them narrower than either; no mesh matches another."""
    parts = {"low": rectangle(np.linspace(0.0, 1.4, 8), np.linspace(0.0, 0.3, 3)),
             "block": rectangle(np.linspace(0.2, 1.2, 5), np.linspace(0.3, 0.9, 4)),
             "top": rectangle(np.linspace(-0.1, 1.4, 7), np.linspace(0.9, 1.2, 3))}
    first = np.cumsum([0, *(len(nodes) for nodes, _, _ in parts.values())])
    surfaces = {f"{body}.{side}": edges + n for (body, (_, _, sides)), n in zip(parts.items(), first[:-1], strict=True)
                for side, edges in sides.items()}
    cells = [c + n for (_, c, _), n in zip(parts.values(), first[:-1], strict=True)]
    return Interface("plane", np.concatenate([nodes for nodes, _, _ in parts.values()]),
                     np.concatenate(cells).astype(np.int32), NO_CELLS[3],
                     np.repeat(np.arange(3), [len(c) for c in cells]).astype(np.int32), np.empty(0, np.int32),
                     tuple(parts), ("m",) * 3, surfaces, {},
                     (Pair("below", "block.bottom", "low.top", 0.2, 1e12, mu=mu, **pair),
                      Pair("above", "block.top", "top.bottom", 0.2, 1e12, mu=mu, **pair)))


def pressed(angle: float, windows: int, mu: float, method: str | None, **pair: Any) -> list[dict[str, Any]]:
    """What the half gives out: pressed and dragged a little, then turned about a point in so many windows."""
    turn = {"about": ABOUT, "angle": {"t": [1.0, 2.0], "value": [0.0, angle]}}
    way = {key: {"t": [0.0, 1.0], "value": [0.0, m]} for key, m in (("u_x", 0.2 * PRESS), ("u_y", -PRESS))}
    settles = {} if method is None else {"augmented": {"method": method, "tolerance": 1e-8}}
    boundary = [{"on": "low.bottom", "rotation": turn}, {"on": "top.top", "rotation": turn, **way}]
    half = elastic(scene(mu, **pair), boundary, tolerance=1e-10, pairs={"below": settles, "above": settles})
    return told_in(half, windows)


@pytest.mark.few("0.4-edges-None-1", "0.4-two passes-uzawa-9", "0.4-nodes-semi_smooth-3", "0.02-edges-semi_smooth-1")
@pytest.mark.parametrize("windows", [1, 3, 9])
@pytest.mark.parametrize("method", [None, "uzawa", "semi_smooth"])
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("mu", [MU, 0.02])
def test_a_block_between_plates_feels_nothing_of_a_turn(mu: float, form: str, method: str | None, windows: int) -> None:
    """With what sticks (mu 0.4) and where part of it slipped (0.02): by yesterday's overlap 34 % of the pressure."""
    first, *turned = pressed(0.5 * np.pi, windows, mu, method, **FORMS[form])
    _, *still = pressed(0.0, windows, mu, method, **FORMS[form])
    assert np.abs(first["contact.t_T"]).max() > (0.02 if mu == MU else 0.019) * np.abs(first["contact.t_N"]).max()
    assert (first["contact.slipping"] > 0.0) == (mu != MU)
    for there, here in zip(turned, still, strict=True):
        assert there["cuts"] == 0.0
        for name in ("contact.t_N", "contact.t_T", "sigma_v"):
            assert np.abs(there[name] - here[name]).max() <= 1e-8 * np.abs(here[name]).max()
        assert not there["contact.E_friction"].any() or mu != MU
        work = PRESS * np.abs(first["contact.t_T"]).max()
        assert np.abs(there["contact.E_friction"] - here["contact.E_friction"]).max() <= 1e-8 * work
