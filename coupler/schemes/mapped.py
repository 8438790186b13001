"""A half on a mesh of its own as one on the scene's mesh: what it is given and what it gives is carried between both.

Coordinates and nodal values are interpolated; what adds up (in joules) and what is per area or volume goes by the parts
that cells and surfaces share (coupler.scenario.mesh_maps).  Contact the half asks by itself, with its own surfaces.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from contact.half.interface import Interface
from coupler.errors import HalfError
from coupler.fmu.bounds import scenario_border
from coupler.fmu.half import Advance, Array, Block, Half
from coupler.fmu.held import HeldHalf, check_scene
from coupler.scenario import Scenario
from coupler.scenario.own_mesh import OwnMesh
from coupler.schemes.several import place_of, several_joined, size_of
from coupler.schemes.state import OFF_MESH

COORDINATES, ADDS_UP = "m", "J"  # units of blocks
T_OFF, X_OFF = OFF_MESH, "mesh.x_off"
_TOLD = (T_OFF, X_OFF)
_LENGTH = struct.Struct("<Q")


def joined(scenario: Scenario, halves: Mapping[str, Half]) -> Half:
    """Return the thermal half of a scenario, on the scene's mesh.  halves : by name.

    Raises HalfError for halves of another scene, and for blocks that no run can use.
    """
    half = halves["thermal"] if scenario.several is None else several_joined(scenario, halves)
    if scenario.own_mesh is None:
        return half
    check_scene(half, scenario.own_mesh.interface)
    held = HeldHalf(half, "thermal", scenario_border(scenario, "thermal"))
    return MappedHalf(held, scenario.own_mesh, scenario.interface)


class MappedHalf:
    """A half (coupler.fmu.half.Half) with the blocks of the scene's mesh, around one with those of its own mesh."""

    def __init__(self, half: Half, own: OwnMesh, interface: Interface) -> None:
        """interface : the scene's."""
        self.half, self._own, self._interface = half, own, interface
        self.name: str = half.name
        self.can_save, self.can_serialise = half.can_save, half.can_serialise
        self.strings: Mapping[str, str] = {
            **half.strings, "mesh.hash": interface.mesh_hash, "surfaces.hash": interface.surfaces_hash}
        self.blocks: Mapping[str, Block] = {name: self._on_the_scene(block) for name, block in half.blocks.items()} | {
            T_OFF: Block(T_OFF, (), "K", "output", "Real",
                         "what the scene's mesh does not hold of T: the largest difference there and back"),
            X_OFF: Block(X_OFF, (), "m", "output", "Real",
                         "what the half's own mesh does not hold of x: the largest difference there and back")}
        self._x = interface.nodes  # as given last
        self._kept: dict[int, Array] = {}

    def _on_the_scene(self, block: Block) -> Block:
        place = place_of(block)
        return replace(block, shape=(size_of(place, self._interface), *block.shape[1:])) if place else block

    # There and back.

    def _given(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Inputs on its own mesh."""
        self._x = inputs.get("x", self._x)
        return {name: self._carried(self.half.blocks[name], value, to_own=True) if name in self.half.blocks else value
                for name, value in inputs.items()}

    def _carried(self, block: Block, value: Array, *, to_own: bool) -> Array:
        """Values on the half's own mesh of those on the scene's, or the other way."""
        maps, place = self._own.maps, place_of(block)
        if place == "nodes":
            to = maps.to_own if to_own else maps.to_scene
            # fault: coordinates beside a curve are those of its edge -> return np.asarray(to.values @ value) |
            #   coupler/test_own_meshes::test_rings_that_turn_keep_their_shape
            return np.asarray((to.places if block.unit == COORDINATES else to.values) @ value)
        if place not in ("cells", "contact_nodes", "pair_nodes"):
            return value
        shared = getattr(maps, place)
        shared = shared if to_own else shared.turned
        # fault: joules are carried as means -> if False: |
        #   coupler/test_own_meshes::test_what_a_half_is_given_adds_up
        if block.unit == ADDS_UP:
            return np.asarray(shared.sums(value))
        if place == "contact_nodes":
            return np.asarray((maps.surface_to_own if to_own else maps.surface_to_scene) @ value)
        return np.asarray(shared.means(value))

    def _wanted(self, names: Sequence[str]) -> list[str]:
        """What the half is asked for where somebody asks for names of the scene."""
        more = ["T"] if T_OFF in names and "T" not in names else []
        return [*(n for n in names if n not in _TOLD), *more]

    def _found(self, names: Sequence[str], values: Mapping[str, Array]) -> dict[str, Array]:
        """Outputs by name on the scene's mesh."""
        found = {n: self._carried(self.half.blocks[n], values[n], to_own=False) for n in names if n not in _TOLD}
        maps = self._own.maps
        if T_OFF in names:
            T = values["T"]
            found[T_OFF] = np.asarray(np.abs(maps.to_own.values @ (maps.to_scene.values @ T) - T).max(initial=0.0))
        if X_OFF in names:
            back = maps.to_scene.places @ (maps.to_own.places @ self._x)
            found[X_OFF] = np.asarray(np.linalg.norm(back - self._x, axis=1).max(initial=0.0))
        return found

    # As of Half.

    def initialise(self, t_start: float, t_end: float, parameters: Mapping[str, str], inputs: Mapping[str, Array],
                   outputs: Sequence[str]) -> dict[str, Array]:
        """As of Half."""
        return self._found(outputs, self.half.initialise(t_start, t_end, parameters, self._given(inputs),
                                                         self._wanted(outputs)))

    def advance(self, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Advance:
        """As of Half."""
        begun = time.perf_counter()
        given = self._given(inputs)
        between = time.perf_counter() - begun
        done = self.half.advance(t, h, given, self._wanted(outputs))
        begun = time.perf_counter()
        found = self._found(outputs, done.outputs) if done.outputs else {}
        return replace(done, outputs=found, border=done.border + between + time.perf_counter() - begun)

    def read(self, names: Sequence[str], finite: bool = True) -> dict[str, Array]:
        """As of Half."""
        return self._found(names, self.half.read(self._wanted(names), finite))

    def save(self) -> int:
        """As of Half."""
        token = self.half.save()
        self._kept[token] = self._x
        return token

    def restore(self, token: int) -> None:
        """As of Half."""
        self.half.restore(token)
        # fault: what x was is forgotten by who goes back -> pass |
        #   coupler/test_own_meshes::test_going_back_takes_the_coordinates_along
        self._x = self._kept[token]

    def release(self, token: int) -> None:
        """As of Half."""
        self.half.release(token)
        del self._kept[token]

    def serialise(self, token: int) -> bytes:
        """As of Half: the bytes of the half behind the coordinates."""
        x = np.ascontiguousarray(self._kept[token], dtype="<f8").tobytes()
        return _LENGTH.pack(len(x)) + x + self.half.serialise(token)

    def deserialise(self, data: bytes) -> int:
        """As of Half.  Raises HalfError for bytes of a scene of another size."""
        (length,) = _LENGTH.unpack_from(data) if len(data) >= _LENGTH.size else (-1,)
        if length != self._interface.nodes.nbytes:
            raise HalfError("these bytes are no state of it", half=self.name)
        end = _LENGTH.size + length
        token = self.half.deserialise(data[end:])
        self._kept[token] = np.frombuffer(data[_LENGTH.size:end], dtype="<f8").reshape(self._interface.nodes.shape)
        return token

    def log_tail(self) -> str:
        """As of Half."""
        return self.half.log_tail()

    def close(self) -> None:
        """As of Half."""
        self.half.close()
