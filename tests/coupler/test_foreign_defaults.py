"""A mechanical half of another package is told defaults that the scenario leaves out: it need not know them."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from foreign_scenes import scenes


def test_how_penetration_is_driven_out_is_told_as_to_ours(tmp_path, monkeypatch):
    own, foreign = scenes(tmp_path, "mechanical", monkeypatch)
    told = foreign.models["mechanical"]["pairs"]["joint"]
    assert told["augmented"] == own.models["mechanical"]["pairs"]["joint"]["augmented"]
    assert told["augmented"]["method"] == "semi_smooth"


def test_the_temperature_without_stress_is_told_where_none_is_stated(tmp_path, monkeypatch):
    own, foreign = scenes(tmp_path, "mechanical", monkeypatch, **{"materials.brass.T_ref": None,
                                                                 "materials.brass.alpha": 0})
    for scene in (own, foreign):
        assert scene.models["mechanical"]["materials"]["brass"]["T_ref"] == 293.15
