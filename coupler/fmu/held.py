"""A half held to the border: every value that leaves it is looked at before anybody uses it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from contact.half.interface import Interface
from coupler.errors import HalfError
from coupler.fmu.bounds import BorderScene, Breach, off_the_mesh, other_scene, wrong_blocks, wrong_start, wrong_values
from coupler.fmu.half import Advance, Answer, Array, Block, Half, Status, begin

RETRY = 0.5  # of a step whose numbers a shorter one might mend


class HeldHalf:
    """A half (coupler.fmu.half.Half) that is another one, held to the bounds of its role in a scene.

    Its blocks are looked at when it is made, its first values when it starts: HalfError.  A substep whose numbers
    cannot be (coupler.fmu.bounds) is a discard like any other, so a window that went wrong is tried again shorter, and
    a half that is wrong at any length ends the run with the reason.
    """

    def __init__(self, half: Half, role: str, scene: BorderScene) -> None:
        """Raises HalfError, for all that is wrong with its blocks.  role : thermal or mechanical."""
        self.half, self._role, self._scene = half, role, scene
        self.name: str = half.name
        self.blocks: Mapping[str, Block] = half.blocks
        self.strings: Mapping[str, str] = half.strings
        self.can_save, self.can_serialise = half.can_save, half.can_serialise
        self.off_the_mesh = ""
        if wrong := list(wrong_blocks(role, half.blocks, scene)):
            raise HalfError("\n".join(map(str, wrong)), half=half.name)
        # Looked at whether or not the caller asks for them.
        self._looked = tuple(n for n in ("T", "x") if n in half.blocks and half.blocks[n].causality == "output")

    def initialise(self, t_start: float, t_end: float, parameters: Mapping[str, str], inputs: Mapping[str, Array],
                   outputs: Sequence[str]) -> dict[str, Array]:
        """As of the half.  Raises HalfError where its first values are not those of the scene, or cannot be."""
        first = self.half.initialise(t_start, t_end, parameters, inputs, outputs)
        seen = first | self.half.read([n for n in self._looked if n not in first])
        breach = wrong_start(self._role, seen, self._scene) or wrong_values(self._role, seen, self._scene)
        if breach is not None:
            raise HalfError(str(breach), half=self.name, log=self.log_tail())
        if "x" in self._looked:
            self.off_the_mesh = off_the_mesh(seen["x"], self._scene)
        return first

    def advance(self, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Advance:
        """As of the half; a substep whose numbers cannot be is a discard."""
        return self.begin(t, h, inputs, outputs)()

    def begin(self, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Answer:
        """As of the half."""
        answer = begin(self.half, t, h, inputs, outputs)

        def looked_at() -> Advance:
            done = answer()
            if done.status is not Status.OK:
                return done
            breach = wrong_values(self._role, done.outputs, self._scene)
            return done if breach is None else refused(breach, h, done.seconds)

        return looked_at

    def read(self, names: Sequence[str], finite: bool = True) -> dict[str, Array]:
        """As of the half."""
        return self.half.read(names, finite)

    def save(self) -> int:
        """As of the half."""
        return self.half.save()

    def restore(self, token: int) -> None:
        """As of the half."""
        self.half.restore(token)

    def release(self, token: int) -> None:
        """As of the half."""
        self.half.release(token)

    def serialise(self, token: int) -> bytes:
        """As of the half."""
        return self.half.serialise(token)

    def deserialise(self, data: bytes) -> int:
        """As of the half."""
        return self.half.deserialise(data)

    def log_tail(self) -> str:
        """As of the half."""
        return self.half.log_tail()

    def close(self) -> None:
        """As of the half."""
        self.half.close()


def check_scene(half: Half, interface: Interface) -> None:
    """Check that a half was built for this mesh, as far as it says so.  Raises HalfError."""
    if other := other_scene(half.strings, interface):
        raise HalfError(other, half=half.name)


def refused(breach: Breach, h: float, seconds: float) -> Advance:
    """Return a discard of a substep of h [s] for what cannot be; no shorter one is worth a try where none mends it."""
    # fault: what no step can mend is tried in shorter ones -> return Advance(Status.DISCARD, str(breach), {}, seconds,
    #   RETRY * h) | coupler/test_broken_halves
    return Advance(Status.DISCARD, str(breach), {}, seconds, RETRY * h if breach.mends else h)
