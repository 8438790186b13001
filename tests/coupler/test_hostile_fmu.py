"""An FMU that answers what no FMU may: each is an error by name, and takes no memory.  Both versions of FMI."""

from __future__ import annotations

from collections import deque
from ctypes import c_size_t, c_void_p

import pytest
from fmpy.fmi1 import FMICallException

from coupler.errors import HalfError
from coupler.fmu.fmi import LOG_LENGTH, LOG_TEXT, FmuHalf, _recorder
from coupler.fmu.library import Instance2, Instance3


class Library:
    """status : what every function answers.  size : of a state, as it says."""

    def __init__(self, status: int = 0, size: int = 0) -> None:
        self.status, self.size = status, size

    def __getattr__(self, function: str):
        def call(*args):
            if self.status > 1:
                raise FMICallException(function=function, status=self.status)
            if "Serialized" in function:
                c_size_t.from_buffer(args[2]._obj).value = self.size
            return self.status

        return call


def half(fmi: int = 2, **how: int) -> FmuHalf:
    half = FmuHalf.__new__(FmuHalf)
    half.name, half.can_serialise, half.blocks = "toy", True, {}
    kind = Instance3 if fmi == 3 else Instance2
    half._fmu = kind.__new__(kind)
    half._fmu._fmu, half._fmu._instance, half._dead, half._begun = Library(**how), None, False, True
    half._log, half._states, half._token = deque(maxlen=LOG_LENGTH), {1: c_void_p(1)}, 1
    half._t = half._h = float("nan")
    return half


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(("status", "said"), [(9, "status 9, which FMI has not"), (3, "error"),
                                              (4, "fatal")])
def test_a_status_that_fmi_does_not_know_is_told(status, said, fmi):
    with pytest.raises(HalfError, match=f"fmi{fmi}DoStep answered {said}"):
        half(fmi, status=status).advance(0.0, 1.0, {}, ())


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("size", [2**40, 2**63])
def test_a_state_larger_than_memory_is_refused_by_its_size(size, fmi):
    with pytest.raises(HalfError, match=f"it says its state takes {size} bytes, more than 8 GiB: no resume"):
        half(fmi, size=size).serialise(1)


def test_a_log_without_end_is_cut():
    talkative = half()
    say = _recorder(talkative._log)
    for _ in range(3 * LOG_LENGTH):
        say(0, b"x" * 100_000)
    assert len(talkative._log) == LOG_LENGTH
    assert max(map(len, talkative._log)) < LOG_TEXT + 20
    assert talkative.log_tail().startswith("[ok] xxx")
