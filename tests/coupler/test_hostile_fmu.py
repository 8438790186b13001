"""An FMU that answers what no FMU may: each is an error by name, and takes no memory."""

from __future__ import annotations

from collections import deque
from ctypes import c_size_t, c_void_p

import pytest
from fmpy.fmi1 import FMICallException

from coupler.errors import HalfError
from coupler.fmu.fmi import LOG_LENGTH, LOG_TEXT, FmuHalf


class Library:
    """status : what every function answers.  size : of a state, as it says."""

    def __init__(self, status: int = 0, size: int = 0) -> None:
        self.status, self.size = status, size

    def __getattr__(self, function: str):
        def call(*args):
            if self.status > 1:
                raise FMICallException(function=function, status=self.status)
            if function == "fmi2SerializedFMUstateSize":
                c_size_t.from_buffer(args[2]._obj).value = self.size
            return self.status

        return call


def half(**how: int) -> FmuHalf:
    half = FmuHalf.__new__(FmuHalf)
    half.name, half.can_serialise, half.blocks = "toy", True, {}
    half._fmu, half._instance, half._dead, half._begun = Library(**how), None, False, True
    half._log, half._states, half._token = deque(maxlen=LOG_LENGTH), {1: c_void_p(1)}, 1
    half._t = half._h = float("nan")
    return half


@pytest.mark.parametrize(("status", "said"), [(9, "status 9, which FMI has not"), (3, "error"),
                                              (4, "fatal")])
def test_a_status_that_fmi_does_not_know_is_told(status, said):
    with pytest.raises(HalfError, match=f"fmi2DoStep answered {said}"):
        half(status=status).advance(0.0, 1.0, {}, ())


@pytest.mark.parametrize("size", [2**40, 2**63])
def test_a_state_larger_than_memory_is_refused_by_its_size(size):
    with pytest.raises(HalfError, match=f"it says its state takes {size} bytes, more than 8 GiB: no resume"):
        half(size=size).serialise(1)


def test_a_log_without_end_is_cut():
    talkative = half()
    talkative._description = type("D", (), {"tool": "PythonFMU"})()
    logger = talkative._make_callbacks().logger
    for _ in range(3 * LOG_LENGTH):
        logger(None, b"toy", 0, b"", b"x" * 100_000)
    assert len(talkative._log) == LOG_LENGTH
    assert max(map(len, talkative._log)) < LOG_TEXT + 20
    assert talkative.log_tail().startswith("[ok] xxx")
