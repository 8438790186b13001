"""A bench for a half: new instances, and inputs that change a little from substep to substep."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from contact.half.start import start_coordinates
from coupler.errors import HalfError
from coupler.fmu.bounds import BorderScene
from coupler.fmu.half import Advance, Array, Block, Half, Status
from coupler.verify.border import Finding

HALVINGS = 20
END = 1e9  # s, stop time given to the half
NUMBERS = ("Real", "Integer", "Boolean")
MOVING = 3  # substeps after which inputs stay
LONG = 12  # substeps of what is looked at for longer
NO_REFERENCE = "no scene is known that Slideline's own half could compute"


@dataclass(frozen=True)
class Declared:
    """What a half says it can do.  can_save, can_serialise : FMU state.

    any_step : take steps of any length.  many : be there more than once in a process.  reads : paths of its scene
    (coupler.scenario.understood); None where it does not say.
    """

    can_save: bool = True
    can_serialise: bool = True
    any_step: bool = True
    many: bool = True
    reads: frozenset[str] | None = None


EVERYTHING = Declared()


@dataclass(frozen=True)
class Bench:
    """A half on a bench.

    make : returns a new instance, loaded and not initialised.  h : size of a substep [s].

    starts : the Real inputs as a new instance has them, x as the scene has it.  blocks : all of the half's.
    scene : it is held against; None where nobody knows.  declared : what the half says it can do.
    strings : its constant texts.  reference : returns Slideline's own half of the scene; None, and then why_none says
    why, where there is none.
    """

    make: Callable[[], Half]
    h: float
    starts: Mapping[str, Array]
    blocks: Mapping[str, Block]
    scene: BorderScene | None = None
    declared: Declared = EVERYTHING
    strings: Mapping[str, str] = field(default_factory=dict)
    reference: Callable[[], Half] | None = None
    why_none: str = NO_REFERENCE

    @contextmanager
    def half(self) -> Iterator[Half]:
        """Give a new instance, initialised with its own start values; it is closed at the end."""
        half = self.make()
        try:
            half.initialise(0.0, END, {}, self.starts, ())
            yield half
        finally:
            half.close()

    @property
    def outputs(self) -> list[str]:
        """All its outputs that are numbers."""
        return [name for name, b in self.blocks.items() if b.causality == "output" and b.kind in NUMBERS]

    def inputs(self, k: int) -> dict[str, Array]:
        """Return the inputs of substep k (from 1), by name in the shape and unit of their blocks.

        They are start values, changed where name or unit says what is harmless: temperatures by 1 to 3 K a substep in a
        pattern, coordinates by 1e-7 of their span as a whole, pressures by 1e5 Pa, heats by 1 mJ; loads, controls and
        what has no meaning at the border stay.
        """
        k = min(k, MOVING)
        return {name: _moved(name, self.blocks[name].unit, start, k) for name, start in self.starts.items()}

    def steps(self, half: Half, n: int = LONG, first: int = 1) -> Iterator[dict[str, Array]]:
        """Take n substeps, or as many as it takes, and yield the outputs of each as they come."""
        for k in range(first, first + n):
            done = half.advance((k - 1) * self.h, self.h, self.inputs(k), self.outputs)
            if done.status is not Status.OK:
                return
            yield done.outputs

    def step(self, half: Half, k: int) -> dict[str, Array]:
        """Take substep k, from (k - 1) h by h, and return all outputs by name in the shape and unit of their blocks.

        Raises HalfError where it is refused.
        """
        return took(half.advance((k - 1) * self.h, self.h, self.inputs(k), self.outputs))


def took(done: Advance) -> dict[str, Array]:
    """Return the outputs of a substep, by name in the shape and unit of their blocks.

    Raises HalfError where it was refused.
    """
    if done.status is not Status.OK:
        raise HalfError(f"it refused an ordinary substep: {done.message}")
    return done.outputs


def settled(make: Callable[[], Half], h: float, scene: BorderScene | None = None, declared: Declared = EVERYTHING,
            reference: Callable[[], Half] | None = None, why_none: str = NO_REFERENCE) -> Bench:
    """Return a bench with a substep that the half takes three times: h, or h/2, h/4, ...  Raises HalfError.

    scene : that it is held against, where it is known.  declared : what the half says it can do; of one whose steps
    have one length no other than h is tried.  reference, why_none : as of a Bench.
    """
    half = make()
    try:
        blocks, strings = dict(half.blocks), dict(half.strings)
        starts = half.read([name for name, b in blocks.items() if b.causality == "input" and b.kind == "Real"])
    finally:
        half.close()
    if scene is not None and "x" in starts and starts["x"].shape == scene.interface.nodes.shape:
        starts["x"] = start_coordinates(scene.interface)
    for _ in range(HALVINGS if declared.any_step else 1):
        bench = Bench(make, h, starts, blocks, scene, declared, strings, reference, why_none)
        with bench.half() as half:
            done = [half.advance((k - 1) * h, h, bench.inputs(k), bench.outputs) for k in (1, 2, 3)]
        refused = [d.message for d in done if d.status is not Status.OK]
        if not refused:
            return bench
        h *= 0.5
    raise HalfError(f"it takes no substep, not even of {2 * h:.3g} s: {refused[0]}")


def differing(a: Mapping[str, Array], b: Mapping[str, Array]) -> list[str]:
    """Return the names whose values are not equal to the bit.

    a : any shape and unit each, by name.  b : same shape and unit for what is to be equal.
    """
    # fault: verify-half: outputs nearly the same pass for the same -> return [name for name in a if name not in b or
    #   not np.allclose(a[name], b[name])] | coupler/test_verify
    return [name for name in a if name not in b or np.asarray(a[name]).tobytes() != np.asarray(b[name]).tobytes()]


def first_outputs(bench: Bench) -> dict[str, Array]:
    """Return the outputs of a new instance at the start, by name in the shape and unit of their blocks."""
    half = bench.make()
    try:
        return half.initialise(0.0, END, {}, bench.starts, bench.outputs)
    finally:
        half.close()


def _moved(name: str, unit: str, start: Array, k: int) -> Array:
    value = np.asarray(start, dtype=float)
    if name.startswith(("load.", "bc.", "control.")) or value.size == 0:
        return value
    if unit == "K":
        return value + k * (2.0 + np.cos(np.arange(value.size))).reshape(value.shape)
    if name == "x":
        return value + k * 1e-7 * float(np.ptp(value))
    if name == "contact.t_N":
        return value - k * 1e5
    return value + k * 1e-3 if unit == "J" else value


Check = Callable[[Bench, str], Finding]  # its name is the second, as the tables of checks have it
