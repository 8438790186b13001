"""The values of a half's FMI variables, by value reference and by name; some are worked out when somebody asks.

Nobody reads the stresses of most substeps.  Outputs that are owed stay with what they follow from, and are written
when a reference of theirs is read, or when the state goes into bytes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.layout import Layout, checked_output
from contact.half.model import Floats, Outputs, Value, Values, Variable


@dataclass(frozen=True)
class Owed:
    """An output that is not worked out yet.  first : the place of its first value.  of : what knows it."""

    variable: Variable
    first: int
    of: Outputs

    @property
    def last(self) -> int:
        """The place behind its last value."""
        return self.first + self.variable.size

    def pay(self, reals: Floats) -> None:
        """Write it into reals : (n_real,), in SI.  Raises ValueError where its shape is another: a bug."""
        self._put(reals, self.of[self.variable.name])

    def leave(self, reals: Floats) -> None:
        """Write what a state in bytes tells of it: itself, unless that costs too much for what nobody may ask for."""
        name, kept = self.variable.name, self.of.unless_asked
        # fault: what is seldom asked for is worked out for every state in bytes -> self.pay(reals) | contact/test_store
        self._put(reals, kept[name] if name in kept else self.of[name])

    def _put(self, reals: Floats, value: Value) -> None:
        reals[self.first : self.last] = np.ravel(checked_output(self.variable, value))


class VariableStore:
    """The values of a half's FMI variables.

    reals : (layout.n_real,) of all Reals, where value reference = place; what is owed has an older value there.
    integers, texts : in the order of the layout.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.reals: Floats = layout.start_store()
        self.owed: tuple[Owed, ...] = ()
        self.integers = [int(v.start) for v in layout.integers]
        self.texts = [str(v.start) for v in layout.texts]
        self._ranges: dict[tuple[int, int], list[int]] = {}

    # By value reference, as FMI asks

    def get_reals(self, vrs: list[int]) -> list[float]:
        """Return values, in a list of their own length.  Raises ValueError for a reference that is no Real."""
        place = self._place(vrs)
        # fault: outputs that are owed are never worked out -> if False: | contact/test_store
        if self.owed:
            self._settle(place)
        values: list[float] = self.reals[place].tolist()
        return values

    def settle(self) -> None:
        """Work out all outputs that are owed."""
        self._settle(slice(0, self.layout.n_real))

    def set_reals(self, vrs: list[int], values: list[float]) -> None:
        """Set inputs and parameters.  Raises ValueError for any other."""
        place = self._place(vrs)
        last = place.stop - 1 if isinstance(place, slice) else int(place.max())
        if last >= self.layout.n_set:
            raise ValueError(f"{self.layout.name_of(last)} is not an input or parameter")
        self.reals[place] = np.fromiter(values, np.float64, len(values))

    def read(self, first: int, values: Floats) -> None:
        """Fill values : (n,) with those from a place on.  Raises ValueError where these are no Reals."""
        last = first + values.size
        if not 0 <= first <= last <= self.layout.n_real:
            raise ValueError("a value reference that is no Real")
        # fault: a block that is owed is read as it was -> if False: | contact/test_store
        if self.owed:
            self._settle(slice(first, last))
        values[:] = self.reals[first:last]

    def write(self, first: int, values: Floats) -> None:
        """Set inputs and parameters from a place on to values : (n,).  Raises ValueError for any other."""
        last = first + values.size
        # fault: outputs can be set by blocks -> if first < 0: | contact/test_store
        if first < 0 or last > self.layout.n_set:
            raise ValueError(f"{self.layout.name_of(max(last - 1, 0))} is not an input or parameter")
        self.reals[first:last] = values

    def integer_at(self, vr: int, settable: bool = False) -> int:
        """Return the place in integers of a value reference.

        Raises ValueError for another kind, or where not settable.
        """
        return self._among(vr, "Integer", self.layout.n_real, settable)

    def text_at(self, vr: int, settable: bool = False) -> int:
        """Return the place in texts of a value reference.

        Raises ValueError for another kind, or where not settable.
        """
        return self._among(vr, "String", self.layout.n_real + len(self.layout.integers), settable)

    # By name, as the half asks

    def text(self, name: str) -> str:
        """Return a text by its variable's name."""
        return self.texts[self.text_at(self.layout.first[name])]

    def set_text(self, name: str, value: str) -> None:
        """Write a text, whatever its causality."""
        self.texts[self.text_at(self.layout.first[name])] = value

    def inputs(self) -> Values:
        """Return copies of what is set from outside, by name, so that no model holds what changes under it."""
        store = self.reals[: self.layout.n_set].copy()
        store.flags.writeable = False
        values: dict[str, Value] = {name: store[a:b].reshape(shape) if shape else float(store[a])
                                    for name, a, b, shape in self.layout.real_inputs}
        pairs: list[tuple[Any, Value]] = [*zip(self.layout.integers, self.integers, strict=True),
                                          *zip(self.layout.texts, self.texts, strict=True)]
        values.update({v.name: value for v, value in pairs if v.causality != "output"})
        return values

    def input_refused(self) -> str:
        """Return why the inputs cannot be used: the name of one that is not finite, or ""."""
        if np.isfinite(self.reals[: self.layout.n_set]).all():
            return ""
        name = (self.layout.not_finite(self.reals, "input") or self.layout.not_finite(self.reals, "parameter"))
        return f"input {name} holds a value that is not finite"

    def take_outputs(self, outputs: Values) -> str:
        """Write outputs, all or none; return why they are refused (one is not finite), or "".

        Raises ValueError for an output of another shape or kind, KeyError for one that was not declared: bugs.
        """
        known = self.layout.outputs
        given = outputs if isinstance(outputs, Outputs) else Outputs(outputs)
        checked = {name: checked_output(known[name], value) for name, value in given.now.items()}
        for name, value in checked.items():
            if not (math.isfinite(value) if isinstance(value, float) else
                    isinstance(value, (int, str)) or np.isfinite(value).all()):
                return f"output {name} is not finite"
        for name, value in checked.items():
            at = self.layout.first[name]
            if isinstance(value, str):
                self.texts[self.text_at(at)] = value
            elif isinstance(value, int):
                self.integers[self.integer_at(at)] = value
            elif isinstance(value, float):
                self.reals[at] = value
            else:
                self.reals[at : at + value.size] = value.ravel()
        # What is left out keeps its value, owed or not.
        # fault: what a step left out is owed no more -> self.owed = () | contact/test_store
        self.owed = tuple(one for one in self.owed if one.variable.name not in (*checked, *given.owed))
        self.owed += tuple(self._owed(name, given) for name in given.owed)
        return ""

    def report(self, code: int, message: str, dt_suggest: float, dt_stable: float) -> None:
        """Write status.*."""
        first = self.layout.first
        self.integers[self.integer_at(first["status.code"])] = code
        self.set_text("status.message", message)
        self.reals[first["status.dt_suggest"]] = dt_suggest
        self.reals[first["status.dt_stable"]] = dt_stable

    # Inside

    def _owed(self, name: str, of: Outputs) -> Owed:
        return Owed(self.layout.outputs[name], self.layout.first[name], of)

    def _settle(self, place: slice | NDArray[np.intp]) -> None:
        """Work out what is owed at places that are read."""
        if isinstance(place, slice):
            read = [one for one in self.owed if one.first < place.stop and place.start < one.last]
        else:
            read = [one for one in self.owed if ((one.first <= place) & (place < one.last)).any()]
        for one in read:
            one.pay(self.reals)
        if read:
            self.owed = tuple(one for one in self.owed if one not in read)

    def _place(self, vrs: list[int]) -> slice | NDArray[np.intp]:
        """Return where value references lie; a slice if they are consecutive (the whole list is compared)."""
        n = len(vrs)
        if n == 0:
            return slice(0, 0)
        if vrs[-1] - vrs[0] == n - 1 and vrs[0] >= 0 and vrs[-1] < self.layout.n_real:
            key = (vrs[0], n)
            if key not in self._ranges:
                self._ranges[key] = list(range(vrs[0], vrs[0] + n))
            if vrs == self._ranges[key]:
                return slice(vrs[0], vrs[0] + n)
        places = np.array(vrs, dtype=np.intp)
        if places.min() < 0 or places.max() >= self.layout.n_real:
            raise ValueError("a value reference that is no Real")
        return places

    def _among(self, vr: int, kind: str, start: int, settable: bool) -> int:
        variables = self.layout.texts if kind == "String" else self.layout.integers
        if not 0 <= vr - start < len(variables):
            raise ValueError(f"value reference {vr} is no {kind}")
        if settable and variables[vr - start].causality == "output":
            raise ValueError(f"{variables[vr - start].name} is not an input or parameter")
        return vr - start
