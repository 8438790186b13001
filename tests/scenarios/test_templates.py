"""Every template of `slideline init` runs as it is written: coarser, and some windows of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupler import load_scenario, run
from coupler.init.init import new_scenario
from coupler.init.templates import Choices, template_named, templates

# Seconds of each scene that a test can afford.
SHORT = {"casting": 0.05, "forging": 0.1, "friction": 1, "heated_blocks": 0.05, "lumped": 5, "shrink_fit": 6}


def test_every_template_has_its_short_end():
    assert set(templates()) == set(SHORT)


@pytest.mark.few("casting", "friction", "lumped")
@pytest.mark.parametrize("name", sorted(SHORT))
def test_a_template_runs_as_it_is_written(name: str, tmp_path: Path) -> None:
    out = tmp_path / "mine.yaml"
    new_scenario(template_named(name), Choices(end=SHORT[name], mesh=0.5), out)
    assert list(tmp_path.iterdir()) == [out]
    results = run(load_scenario(out), tmp_path / "run.h5")
    assert results.outcome == "completed"
    assert results.t[-1] == SHORT[name]
    assert results.heat_imbalance < 1e-10  # of the sum of |terms|: the bound of every run
