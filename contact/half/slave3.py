"""The FMI 3.0 face of a half: what HalfSlave is, asked by the types of FMI 3.0, arrays by one reference each.

The wrapper of pythonfmu3 asks by name and knows no class, so nothing of that package is needed to run.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pythonfmu.enums import Fmi2Status

from contact.half.layout3 import time_references
from contact.half.slave import HalfSlave, guarded


def _nothing(slave: HalfSlave, *args: Any) -> None:
    return None


class HalfSlave3(HalfSlave):
    """A half as the wrapper of pythonfmu3 wants it.  The entry script of an FMU derives the one concrete class."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        layout = self._store.layout
        self._time_at, self._start_at = time_references(layout)
        self._began = 0.0
        self._places = {layout.first[v.name]: np.arange(layout.first[v.name], layout.first[v.name] + v.size)
                        for v in layout.reals}
        self._joined: dict[tuple[int, ...], list[int]] = {}

    def _say(self, text: str, status: Fmi2Status) -> None:
        super()._say(text, status)
        # Its messages have one attribute more; without it the wrapper crashes.
        # fault: the first message of an FMU of FMI 3.0 crashes its process -> for message in (): |
        #   contact/test_half_build3
        for message in self.log_queue:
            message.debug = False

    @guarded(lambda slave, vrs: [math.nan] * (slave._store.layout.n_real + len(vrs)))
    def get_float64(self, vrs: list[int]) -> list[float]:
        """Return the values of arrays and scalars, one after the other, row by row; always enough of them."""
        self._answer_early()
        times = {self._time_at: self._time, self._start_at: self._began}
        if times.keys().isdisjoint(vrs):
            return self._store.get_reals(self._scalars(vrs))
        return [value for vr in vrs
                for value in ([times[vr]] if vr in times else self._store.get_reals(self._scalars([vr])))]

    @guarded(_nothing)
    def set_float64(self, vrs: list[int], values: list[float]) -> None:
        """Set inputs and parameters."""
        if self._start_at in vrs:
            at = sum(self._places[vr].size for vr in vrs[: vrs.index(self._start_at)])
            self._began = values[at]
            # fault: an FMU of FMI 3.0 begins at 0 s always -> pass | contact/test_half_build3
            self.setup_experiment(self._began)
            vrs, values = [vr for vr in vrs if vr != self._start_at], values[:at] + values[at + 1 :]
        places = self._scalars(vrs)
        if len(places) != len(values):
            raise ValueError(f"{len(values)} values were given for {len(places)}")
        self.set_real(places, values)

    # Integers and texts are no arrays, and called otherwise only.

    def get_int32(self, vrs: list[int]) -> list[int]:
        """Return Integers by value reference."""
        return list(self.get_integer(vrs))

    def set_int32(self, vrs: list[int], values: list[int]) -> None:
        """Set Integer inputs and parameters."""
        self.set_integer(vrs, values)

    def _scalars(self, vrs: list[int]) -> list[int]:
        """References of all values of variables, as FMI 2.0 has them.  Raises ValueError for one of no Float64."""
        key = tuple(vrs)
        if key not in self._joined:
            unknown = [vr for vr in vrs if vr not in self._places]
            if unknown:
                raise ValueError(f"value reference {unknown[0]} is no Float64")
            parts: list[NDArray[np.intp]] = [self._places[vr] for vr in vrs]
            self._joined[key] = np.concatenate(parts).tolist() if parts else []
        return self._joined[key]
