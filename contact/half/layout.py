"""Where every variable of a half lies: value references, and the variables all halves have."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from contact.half.interface import Interface
from contact.half.model import Floats, Value, Variable


def standard_variables(interface: Interface, packages: str) -> tuple[Variable, ...]:
    """What every half has beside its own fields.  packages : the hashes of the packages inside the FMU."""
    def constant(name: str, text: str) -> Variable:
        return Variable(name, kind="String", start=text, variability="constant")

    return (
        Variable("status.dt_suggest", unit="s", description="a step worth trying after a discard, 0: no idea"),
        Variable("status.dt_stable", unit="s", description="largest step thought stable, 0: unknown"),
        Variable("status.code", kind="Integer", start=0,
                 description="0 well, 1 step discarded, 2 the half failed, 3 interrupted"),
        Variable("control.event", causality="input", kind="Integer", start=0,
                 description="rises at events the half cannot see itself"),
        Variable("control.method", causality="input", kind="Integer", start=0,
                 description="solution method, 0: as in model.json"),
        Variable("status.message", kind="String", start=""),
        constant("mesh.hash", interface.mesh_hash),
        constant("surfaces.hash", interface.surfaces_hash),
        constant("geometry", interface.geometry),
        constant("packages.hash", packages),
        Variable("contact.link", causality="parameter", kind="String", start="direct",
                 description="how the contact service is reached"),
    )


@dataclass(frozen=True)
class Layout:
    """The order of a half's scalars: value reference = place.

    reals, integers, texts : the variables of each kind; Reals first, and of the Reals what is set from outside first.
    first : name -> value reference of its first scalar.
    n_set : how many Real scalars are inputs or parameters.  n_real : all Real scalars.
    """

    reals: tuple[Variable, ...]
    integers: tuple[Variable, ...]
    texts: tuple[Variable, ...]
    first: Mapping[str, int]
    n_set: int
    n_real: int

    @property
    def variables(self) -> tuple[Variable, ...]:
        return self.reals + self.integers + self.texts

    # Worked out once: a step asks for these hundreds of times.

    @cached_property
    def outputs(self) -> Mapping[str, Variable]:
        """The outputs by name."""
        return {v.name: v for v in self.variables if v.causality == "output"}

    @cached_property
    def real_inputs(self) -> tuple[tuple[str, int, int, tuple[int, ...]], ...]:
        """Name, first and last + 1 place, and shape of every Real that is set from outside."""
        return tuple((v.name, self.first[v.name], self.first[v.name] + v.size, v.shape)
                     for v in self.reals if v.causality != "output")

    def block(self, store: Floats, variable: Variable) -> Floats:
        """The part of store : (n_real,) that belongs to a Real variable, in its shape (a view)."""
        at = self.first[variable.name]
        return store[at : at + variable.size].reshape(variable.shape)

    def name_of(self, reference: int) -> str:
        """Name of the variable a value reference belongs to."""
        for variable in self.variables:
            if self.first[variable.name] <= reference < self.first[variable.name] + variable.size:
                return variable.name
        return f"value reference {reference}"

    def not_finite(self, store: Floats, causality: str) -> str:
        """Name of the first Real of a causality that holds NaN or infinity in store : (n_real,), or ""."""
        for variable in self.reals:
            if variable.causality == causality and not np.isfinite(self.block(store, variable)).all():
                return variable.name
        return ""

    def start_store(self) -> Floats:
        """(n_real,) start values; outputs that are not constant are NaN until the half has started."""
        store = np.full(self.n_real, np.nan)
        for variable in self.reals:
            if variable.causality != "output" or variable.variability == "constant":
                self.block(store, variable)[...] = variable.start
        return store


def layout_of(own: Iterable[Variable], standard: Iterable[Variable]) -> Layout:
    """Lay out a half's own variables, then those standard ones it does not declare itself.

    Raises ValueError for a name used twice.
    """
    declared = tuple(own)
    names = [v.name for v in declared]
    twice = sorted({n for n in names if names.count(n) > 1}) if len(set(names)) < len(names) else []
    if twice:
        raise ValueError(f"variables declared twice: {', '.join(twice)}")
    everything = declared + tuple(v for v in standard if v.name not in set(names))

    def kind(name: str) -> tuple[Variable, ...]:
        return tuple(v for v in everything if v.kind == name)

    reals = tuple(sorted(kind("Real"), key=lambda v: v.causality == "output"))
    integers, texts = kind("Integer"), kind("String")
    first, at = {}, 0
    for variable in reals + integers + texts:
        first[variable.name] = at
        at += variable.size
    return Layout(reals, integers, texts, first,
                  n_set=sum(v.size for v in reals if v.causality != "output"), n_real=sum(v.size for v in reals))


def checked_output(variable: Variable, value: Value) -> Value:
    """An output as the layout wants it.  Raises ValueError where its shape or kind is another."""
    if variable.kind == "Real":
        if variable.shape == () and isinstance(value, float):
            return float(value)
        array = np.asarray(value, dtype=np.float64)
        if array.shape != variable.shape:
            raise ValueError(f"output {variable.name} has shape {array.shape}, not {variable.shape}")
        return array
    if variable.kind == "Integer":
        if isinstance(value, str) or int(value) != value:
            raise ValueError(f"output {variable.name}: {value!r} is not a whole number")
        return int(value)
    if not isinstance(value, str):
        raise ValueError(f"output {variable.name}: {value!r} is not a text")
    return value
