"""A run takes one thread of BLAS, however many its caller has: the same bits as in processes of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from coupler import Results, Run, load_scenario, run

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios" / "sliding_blocks.yaml"
# Large enough for BLAS to share its work out: at 24 x 24 cells a block bits differ from the first touch on.
SHORT = {"coupling.end": 12500, "coupling.windows": [{"until": 9900, "size": 3300}, {"until": 10000, "size": 20},
                                                     {"until": 12500, "size": 250}]}


def blas_threads() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def solve(folder: Path, name: str, processes: bool = False) -> Results:
    return run(load_scenario(SCENARIO, overrides=SHORT), folder / f"{name}.h5", processes=processes)


@pytest.mark.slow
def test_two_threads_of_blas_change_no_bit(tmp_path: Path) -> None:
    with threadpool_limits(2):
        embedded = solve(tmp_path, "embedded")
        hosted = solve(tmp_path, "hosted", processes=True)
    for name in embedded.probe_names:
        np.testing.assert_array_equal(embedded.probe(name)[1], hosted.probe(name)[1], err_msg=name)
    assert embedded.ledger == hosted.ledger


def test_a_caller_has_its_threads_back(tmp_path: Path) -> None:
    with threadpool_limits(2):
        with Run(load_scenario(SCENARIO, overrides=SHORT), tmp_path / "run.h5") as r:
            next(r.windows())
            assert blas_threads() == {1}
        assert blas_threads() == {2}
