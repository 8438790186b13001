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
from contact.half.memory import LAYOUT
from coupler.errors import HalfError
from coupler.fmu.bounds import scenario_border
from coupler.fmu.half import Advance, Answer, Array, Block, Half, begin
from coupler.fmu.held import HeldHalf, check_scene
from coupler.scenario import Scenario
from coupler.scenario.overlaps import Overlap
from coupler.scenario.own_mesh import OwnMesh
from coupler.schemes.several import place_of, several_joined, size_of
from coupler.schemes.state import OFF_MESH, SHAPE_OFF

COORDINATES, ADDS_UP, GAP = "m", "J", "contact.gap"  # units of blocks, and one that is like no other
T_OFF, X_OFF = OFF_MESH, SHAPE_OFF
_TOLD = {T_OFF: "T", X_OFF: "x"}
_LENGTH = struct.Struct("<Q")


def joined(scenario: Scenario, role: str, halves: Mapping[str, Half]) -> Half:
    """Return the half of a role of a scenario, on the scene's mesh.  halves : by name.

    Raises HalfError for halves of another scene, and for blocks that no run can use.
    """
    one = role != "thermal" or scenario.several is None
    half = halves[role] if one else several_joined(scenario, halves)
    if role not in scenario.own_meshes:
        return half
    own = scenario.own_meshes[role]
    check_scene(half, own.interface)
    return MappedHalf(HeldHalf(half, role, scenario_border(scenario, role)), own, scenario.interface)


class MappedHalf:
    """A half (coupler.fmu.half.Half) with the blocks of the scene's mesh, around one with those of its own mesh.

    Of T and x it gives out what the way there and back loses: of what the half makes all that the scene's mesh does not
    hold, of what it is given all that its own does not.
    """

    def __init__(self, half: Half, own: OwnMesh, interface: Interface) -> None:
        """interface : the scene's."""
        self.half, self._own, self._interface = half, own, interface
        self.name: str = half.name
        self.can_save, self.can_serialise = half.can_save, half.can_serialise
        # What it remembers is on its own mesh, and of no use to another run (coupler.scenario.own_mesh).
        told = {name: text for name, text in half.strings.items() if name != LAYOUT}
        self.strings: Mapping[str, str] = {
            **told, "mesh.hash": interface.mesh_hash, "surfaces.hash": interface.surfaces_hash}
        makes = {name: name in half.blocks and half.blocks[name].causality == "output" for name in ("T", "x")}
        whose = {True: "the scene's mesh", False: "the half's own mesh"}
        self.blocks: Mapping[str, Block] = {name: self._on_the_scene(block) for name, block in half.blocks.items()} | {
            off: Block(off, (), unit, "output", "Real",
                       f"what {whose[makes[name]]} does not hold of {name}: the largest difference there and back")
            for (off, name), unit in zip(_TOLD.items(), ("K", "m"), strict=True)}
        self._makes = makes
        # The one of x and T that it is given, as given last; one that it never is given is even.
        n = len(interface.nodes)
        self._last: Array = np.zeros(n) if makes["x"] else interface.nodes
        self._kept: dict[int, Array] = {}
        self._far = {to_own: _gaps_of_nothing(i) for to_own, i in ((False, interface), (True, own.interface))}

    def _on_the_scene(self, block: Block) -> Block:
        place = place_of(block)
        return replace(block, shape=(size_of(place, self._interface), *block.shape[1:])) if place else block

    # There and back.

    def _given(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Inputs on its own mesh."""
        self._last = inputs.get("T" if self._makes["x"] else "x", self._last)
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
        if block.name == GAP and place == "pair_nodes":
            return self._gaps(value, shared, to_own=to_own)
        if place == "contact_nodes":
            return np.asarray((maps.surface_to_own if to_own else maps.surface_to_scene) @ value)
        return np.asarray(shared.means(value))

    def _gaps(self, value: Array, shared: Overlap, *, to_own: bool) -> Array:
        """Gaps are the means of those that face something; where none does, what they are where nothing is faced."""
        # fault: a gap of nothing is a gap -> faced = np.ones(len(value), dtype=bool) |
        #   coupler/test_own_mechanical_meshes::test_a_gap_beyond_the_end_is_no_part_of_those_before_it
        faced = value < self._far[not to_own]
        much = shared.means(faced.astype(np.float64))
        means = shared.means(np.where(faced, value, 0.0))
        return np.where(much > 0.0, means / np.where(much > 0.0, much, 1.0), self._far[to_own])

    def _wanted(self, names: Sequence[str]) -> list[str]:
        """What the half is asked for where somebody asks for names of the scene."""
        more = [name for off, name in _TOLD.items() if off in names and self._makes[name] and name not in names]
        return [*(n for n in names if n not in _TOLD), *more]

    def _found(self, names: Sequence[str], values: Mapping[str, Array]) -> dict[str, Array]:
        """Outputs by name on the scene's mesh."""
        found = {n: self._carried(self.half.blocks[n], values[n], to_own=False) for n in names if n not in _TOLD}
        for off, name in _TOLD.items():
            if off in names:
                found[off] = self._lost(name, values[name] if self._makes[name] else self._last)
        return found

    def _lost(self, name: str, value: Array) -> Array:
        """The largest difference of T or x to itself after the way to the other mesh and back."""
        maps = self._own.maps
        there, back = (maps.to_scene, maps.to_own) if self._makes[name] else (maps.to_own, maps.to_scene)
        if name == "T":
            return np.asarray(np.abs(back.values @ (there.values @ value) - value).max(initial=0.0))
        return np.asarray(np.linalg.norm(back.places @ (there.places @ value) - value, axis=1).max(initial=0.0))

    # As of Half.

    def initialise(self, t_start: float, t_end: float, parameters: Mapping[str, str], inputs: Mapping[str, Array],
                   outputs: Sequence[str]) -> dict[str, Array]:
        """As of Half."""
        return self._found(outputs, self.half.initialise(t_start, t_end, parameters, self._given(inputs),
                                                         self._wanted(outputs)))

    def advance(self, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Advance:
        """As of Half."""
        return self.begin(t, h, inputs, outputs)()

    def begin(self, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Answer:
        """As of Half."""
        begun = time.perf_counter()
        given = self._given(inputs)
        between = time.perf_counter() - begun
        answer = begin(self.half, t, h, given, self._wanted(outputs))

        def on_the_scene() -> Advance:
            done = answer()
            begun = time.perf_counter()
            found = self._found(outputs, done.outputs) if done.outputs else {}
            return replace(done, outputs=found, border=done.border + between + time.perf_counter() - begun)

        return on_the_scene

    def read(self, names: Sequence[str], finite: bool = True) -> dict[str, Array]:
        """As of Half."""
        return self._found(names, self.half.read(self._wanted(names), finite))

    def save(self) -> int:
        """As of Half."""
        token = self.half.save()
        self._kept[token] = self._last
        return token

    def restore(self, token: int) -> None:
        """As of Half."""
        self.half.restore(token)
        # fault: what x was is forgotten by who goes back -> pass |
        #   coupler/test_own_meshes::test_going_back_takes_the_coordinates_along
        self._last = self._kept[token]

    def release(self, token: int) -> None:
        """As of Half."""
        self.half.release(token)
        del self._kept[token]

    def serialise(self, token: int) -> bytes:
        """As of Half: the bytes of the half behind the coordinates, or temperatures, that it was given."""
        given = np.ascontiguousarray(self._kept[token], dtype="<f8").tobytes()
        return _LENGTH.pack(len(given)) + given + self.half.serialise(token)

    def deserialise(self, data: bytes) -> int:
        """As of Half.  Raises HalfError for bytes of a scene of another size."""
        (length,) = _LENGTH.unpack_from(data) if len(data) >= _LENGTH.size else (-1,)
        if length != self._last.nbytes:
            raise HalfError("these bytes are no state of it", half=self.name)
        end = _LENGTH.size + length
        token = self.half.deserialise(data[end:])
        self._kept[token] = np.frombuffer(data[_LENGTH.size:end], dtype="<f8").reshape(self._last.shape)
        return token

    def log_tail(self) -> str:
        """As of Half."""
        return self.half.log_tail()

    def close(self) -> None:
        """As of Half."""
        self.half.close()


def _gaps_of_nothing(interface: Interface) -> Array:
    """(n_q,) [m] the gap of a pair node where nothing is faced: the gap_max of its pair."""
    most = {pair.name: pair.gap_max for pair in interface.pairs}
    found = np.empty(len(interface.pair_nodes))
    for side in interface.pair_sides:
        found[side.at] = most[side.pair]
    return found
