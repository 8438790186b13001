"""Several halves of a role as one half: its blocks are put together of theirs, its substeps are theirs in agreement.

Bodies of one half that meet bodies of another exchange heat h (T - T_other).  Each half books its own side and is given
the other's temperatures over the substep (`course.T_elsewhere`).  What they tell each other is a fixed point: they
advance in turn, each with the newest temperatures of the others, and where these are not yet those that an earlier one
was given, all go back and do it again, with a next guess by IQN-ILS.  Plain iteration contracts already, because what a
half answers lies between what it had and what it was given.  A step that rings in one of them is then taken again,
damped, by all, as one half would take it.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.errors import HalfError
from coupler.fmu.half import Advance, Array, Block, Half, Status
from coupler.scenario import Scenario
from coupler.scenario.options import Iteration
from coupler.scenario.several import Member, Several
from coupler.schemes.acceleration import Trail, next_guess
from coupler.schemes.ledger import NO_TERMS, PREFIX, STORED
from coupler.schemes.state import ACROSS, HIGH_OFF, LOW_OFF, T_MISSED

COURSE, COURSE_ELSEWHERE, DAMPED, DAMPS = COURSES = ("course.T", "course.T_elsewhere", "course.damped", "course.damps")
AFTER_A_JUMP, ALWAYS = 1.0, 2.0  # values of DAMPED
WOULD, DID = 1.0, 2.0  # values of DAMPS
ITERATIONS, OFF = "across.iterations", "across.off"  # of the last substep: how many, and how far apart at the end [K]
OF_BODY, OF_PAIR = "condition.heat.source.", "condition.heat.pair."
SUMS = ("iterations", "substeps", "rejected", "heat_stored", "contact.touching", *NO_TERMS)
LARGEST = ("residual", "max_dT", ACROSS)
LEAST = ("status.dt_stable", "status.dt_suggest")
# Of halves of other packages, which do not say what rows belong to.
PLACES = {"T": "nodes", "x": "nodes", "f_s": "nodes", "E_M": "cells", "E_S": "cells", "q": "cells",
          "surface.T": "contact_nodes", "surface.E": "contact_nodes", "contact.t_N": "pair_nodes",
          "contact.gap": "pair_nodes", "contact.covered": "pair_nodes", "contact.E_friction": "pair_nodes"}
LEFT_OUT = {"f_s": 1.0}  # what a half that does not have a field has of it: where nothing melts all is solid
ENERGIES = ("E_M", "E_S")  # of cells, delivered once
RETRY = 0.5  # of a substep without agreement
_TOLD = ("iterations", ITERATIONS, OFF)
_HEAD = struct.Struct("<3d")
_LENGTH = struct.Struct("<Q")
_HOW = Iteration()


@dataclass(frozen=True)
class _Rows:
    """Rows of a member in the scene.

    at : which, one of each row that it has.  own : of which it is the one that solves for them.
    """

    at: NDArray[np.intp]
    own: NDArray[np.bool_]


@dataclass(frozen=True)
class _Part:
    """A half and its place in the scene.  rows : by what they are on.  elsewhere : nodes of the scene, given to it."""

    member: Member
    half: Half
    rows: Mapping[str, _Rows]
    elsewhere: NDArray[np.intp]

    @property
    def told(self) -> NDArray[np.intp]:
        """Nodes of the scene whose temperatures it tells the others."""
        rows = self.rows["surface"]
        return rows.at[rows.own]

    def given(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return its share of inputs."""
        found = {}
        for name, value in inputs.items():
            block = self.half.blocks.get(name)
            if block is None:
                continue
            rows = self.rows.get(place_of(block))
            if rows is None:
                found[name] = value
                continue
            # fault: heat of bodies elsewhere is delivered to both halves -> found[name] = value[rows.at] |
            #   coupler/test_several::test_friction_and_mechanical_heat_reach_each_body_once
            found[name] = np.where(rows.own, value[rows.at], 0.0) if name in ENERGIES else value[rows.at]
        return found


@dataclass(frozen=True)
class _Substep:
    """What is asked for: from t by h [s], with what each is given.  outputs : of all of them together."""

    t: float
    h: float
    inputs: Sequence[Mapping[str, Array]]
    outputs: Sequence[str]


@dataclass
class _Tally:
    """What the calls of one substep took, added up."""

    seconds: float = 0.0
    border: float = 0.0
    transport: float = 0.0
    states: float = 0.0
    waited: float = 0.0
    requests: int = 0
    iterations: float = 0.0

    def count(self, done: Advance) -> None:
        self.seconds += done.seconds
        self.border += done.border
        self.transport += done.transport
        self.states += done.states
        self.waited += done.waited
        self.requests += done.requests
        self.iterations += float(done.outputs.get("iterations", np.zeros(())))


def several_joined(scenario: Scenario, halves: Mapping[str, Half]) -> Half:
    """Return the thermal half of a scenario, where it has several.  halves : by name.  Raises HalfError."""
    assert scenario.several is not None, "asked of scenes that have several"
    return SeveralHalves("thermal", scenario.several, halves, scenario.interface_of("thermal"))


class SeveralHalves:
    """coupler.fmu.half.Half of several in one role.

    A term of heat is the sum over those that book it; a body's is that of the half which solves for it.
    """

    def __init__(self, name: str, several: Several, halves: Mapping[str, Half], interface: Interface) -> None:
        """Raises HalfError where one was built for something else, or cannot go back."""
        self.name, self._across, self._interface = name, several.across, interface
        self._parts = tuple(_part(m, halves[m.name], interface) for m in several.members)
        self.can_save = all(p.half.can_save for p in self._parts)
        self.can_serialise = self.can_save and all(p.half.can_serialise for p in self._parts)
        for part in self._parts:
            _check(part, self.can_save)
        self._ways = dict(self._ways_of_all())
        self.blocks: Mapping[str, Block] = dict(self._blocks())
        self.strings: Mapping[str, str] = {
            **self._parts[0].half.strings, "mesh.hash": interface.mesh_hash, "surfaces.hash": interface.surfaces_hash,
            "geometry": interface.geometry}
        self._stale = _stale(self._parts)
        self._told = dict.fromkeys(_TOLD, 0.0)
        self._kept: dict[int, tuple[tuple[int, ...], dict[str, float]]] = {}
        self._token = 0

    # What it has, put together.

    def _ways_of_all(self) -> Iterator[tuple[str, list[tuple[int, Block]]]]:
        """Blocks by name, of each the halves that have it."""
        names = dict.fromkeys(n for p in self._parts for n in p.half.blocks)
        for name in names:
            yield name, [(k, p.half.blocks[name]) for k, p in enumerate(self._parts) if name in p.half.blocks]

    def _blocks(self) -> Iterator[tuple[str, Block]]:
        for name, found in self._ways.items():
            block = found[0][1]
            if name in COURSES:
                continue
            place = place_of(block)
            if place:
                shape = (size_of(place, self._interface), *block.shape[1:])
                yield name, replace(block, shape=shape)
            # What cannot be put together by a rule is not had.
            elif block.causality != "output" or block.kind != "Real" or _adds_up(name):
                yield name, block
        yield ITERATIONS, Block(ITERATIONS, (), "1", "output", "Real",
                                "times that the halves of the role took the substep until they agreed")
        yield OFF, Block(OFF, (), "K", "output", "Real", "by how much what they told each other was off at the end")

    def read(self, names: Sequence[str], finite: bool = True) -> dict[str, Array]:
        """As of Half."""
        own = [[n for n in names if n in p.half.blocks and n not in self._told] for p in self._parts]
        values = [p.half.read(wanted, finite) if wanted else {} for p, wanted in zip(self._parts, own, strict=True)]
        return {n: self._one(n, values) for n in names}

    def _one(self, name: str, values: Sequence[Mapping[str, Array]]) -> Array:
        """Put an output together of those of the halves."""
        if name in self._told:
            return np.array(self._told[name])
        block = self.blocks[name]
        place = place_of(block)
        if place:
            whole = np.full(block.shape, LEFT_OUT.get(name, 0.0))
            for part, value in zip(self._parts, values, strict=True):
                rows = part.rows[place]
                if name in value:
                    whole[rows.at[rows.own]] = value[name][rows.own]
            return whole
        if name.startswith(OF_PAIR):
            return self._of_pair(name, values)
        body = name.removeprefix(OF_BODY) if name.startswith(OF_BODY) else name.removeprefix(STORED)
        found = [v[name] for p, v in zip(self._parts, values, strict=True)
                 if name in v and (body == name or body in p.member.bodies)]
        put = max if name in LARGEST else min if name in LEAST else sum
        return np.asarray(put(found), dtype=np.float64)

    def _of_pair(self, name: str, values: Sequence[Mapping[str, Array]]) -> Array:
        """Each side as the half has it that solves for its body."""
        pair = next(p for p in self._interface.pairs if p.name == name.removeprefix(OF_PAIR))
        sides = [side.partition(".")[0] for side in (pair.slave, pair.master)]
        return np.array([next(v[name][k] for p, v in zip(self._parts, values, strict=True) if body in p.member.bodies)
                         for k, body in enumerate(sides)])

    # Time.

    def initialise(self, t_start: float, t_end: float, parameters: Mapping[str, str], inputs: Mapping[str, Array],
                   outputs: Sequence[str]) -> dict[str, Array]:
        """As of Half."""
        values = [p.half.initialise(t_start, t_end, {n: v for n, v in parameters.items() if n in p.half.blocks},
                                    p.given(inputs), [n for n in outputs if n in p.half.blocks]) for p in self._parts]
        return {n: self._one(n, values) for n in outputs}

    def advance(self, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Advance:
        """As of Half: a substep of all, in agreement; a discard where one of them discards or they do not agree."""
        tally = _Tally()
        # Only what crosses between halves makes them go back; after a discard the caller does.
        kept = [p.half.save() for p in self._parts] if self._stale.size else []
        try:
            answers: list[Mapping[str, Array]] = [{} for _ in self._parts]
            asked = _Substep(t, h, [p.given(inputs) for p in self._parts], outputs)
            discard = self._agreed(asked, kept, tally, answers)
            if discard is not None:
                for part, token in zip(self._parts, kept, strict=False):
                    part.half.restore(token)
                return replace(discard, seconds=tally.seconds, border=tally.border, transport=tally.transport,
                               states=tally.states, waited=tally.waited, requests=tally.requests)
        finally:
            for part, token in zip(self._parts, kept, strict=False):
                part.half.release(token)
        self._told["iterations"] = tally.iterations
        begun = time.perf_counter()
        values = {n: self._one(n, answers) for n in outputs}
        return Advance(Status.OK, "", values, tally.seconds, 0.0, tally.border + time.perf_counter() - begun,
                       tally.transport, tally.states, tally.waited, tally.requests)

    def _agreed(self, asked: _Substep, kept: Sequence[int], tally: _Tally,
                answers: list[Mapping[str, Array]]) -> Advance | None:
        """Bring all to the end; the discard where that fails.

        kept : their states at its start.  answers : what each gave out last is put there.
        """
        t, h, inputs = asked.t, asked.h, asked.inputs
        course, trail, off, how = self._course(), Trail(), 0.0, AFTER_A_JUMP
        for n in range(1, self._across.iterations + 1):
            guess = None if course is None else course[:, self._stale].ravel()
            damps = 0.0
            for k, part in enumerate(self._parts):
                meets = course is not None and part.elsewhere.size > 0
                if n > 1 and not meets:
                    continue
                if n > 1:
                    # fault: halves that do not agree go on from where they are -> pass |
                    #   coupler/test_several::test_several_halves_are_one[three-staggered]
                    part.half.restore(kept[k])
                given = dict(inputs[k])
                if course is not None and meets:
                    given |= {COURSE_ELSEWHERE: course[:, part.elsewhere], DAMPED: np.array(how)}
                # What all give out comes with every iteration: to ask once they agree would be a message more.
                names = dict.fromkeys((COURSE, DAMPS, "iterations", *asked.outputs))
                done = part.half.advance(t, h, given, [name for name in names if name in part.half.blocks])
                tally.count(done)
                answers[k] = done.outputs
                if done.status is not Status.OK:
                    return replace(done, message=f"{part.half.name}: {done.message}")
                if course is not None and meets:
                    # fault: a half is given the others' temperatures of the substep before -> pass |
                    #   coupler/test_several::test_several_halves_are_one[three-staggered]
                    course[:, part.told] = done.outputs[COURSE][:, part.rows["surface"].own]
                    damps = max(damps, float(done.outputs.get(DAMPS, np.zeros(()))))
            if course is None or guess is None:
                self._told |= {ITERATIONS: float(n), OFF: 0.0}
                return None
            trail = trail.plus(guess, course[:, self._stale].ravel())
            off = float(np.abs(trail.residual()).max(initial=0.0))
            self._told |= {ITERATIONS: float(n), OFF: off}
            # fault: halves agree after one iteration -> agree = True |
            #   coupler/test_several::test_a_probe_tells_how_well_they_agree
            agree = off <= self._across.tolerance
            # One that comes out of a jump damps its step whatever it is given; one that rings is known by agreement.
            # fault: what rings in one half is damped in no other -> if False: |
            #   coupler/test_several::test_several_halves_are_one[three-staggered]
            if how != ALWAYS and (damps == DID or (agree and damps == WOULD)):
                how, trail = ALWAYS, Trail()
            elif agree:
                return None
            else:
                after = next_guess(_HOW, trail, ())[0]
                course[:, self._stale] = after.reshape(len(course), -1)
        who = " and ".join(p.half.name for p in self._parts if p.elsewhere.size)
        return Advance(Status.DISCARD, f"{who} did not agree from {t:.9g} s by {h:.6g} s: the temperatures that they "
                       f"tell each other were still off by {off:.3g} K after {self._across.iterations} iterations "
                       "(thermal.across)", {}, 0.0, RETRY * h)

    def _course(self) -> Array | None:
        """Temperatures over a substep as they stay if nothing moves, (n_knots, n) [K]; None where nothing crosses."""
        course: Array | None = None
        for part in self._parts:
            if not part.elsewhere.size:
                continue
            now = part.half.read(["T", COURSE])
            if course is None:
                course = np.zeros((len(now[COURSE]), len(self._interface.nodes)))
            rows = part.rows["nodes"]
            course[:, rows.at[rows.own]] = now["T"][rows.own]
        return course

    # States: those of all.

    def save(self) -> int:
        """As of Half."""
        self._token += 1
        self._kept[self._token] = (tuple(p.half.save() for p in self._parts), dict(self._told))
        return self._token

    def restore(self, token: int) -> None:
        """As of Half."""
        tokens, told = self._kept[token]
        for part, one in zip(self._parts, tokens, strict=True):
            # fault: the first of several halves goes back alone -> if part is self._parts[0]: part.half.restore(one) |
            #   coupler/test_several::test_several_halves_are_one[three-iterated]
            part.half.restore(one)
        self._told = dict(told)

    def release(self, token: int) -> None:
        """As of Half."""
        tokens, _ = self._kept.pop(token)
        for part, one in zip(self._parts, tokens, strict=True):
            part.half.release(one)

    def serialise(self, token: int) -> bytes:
        """As of Half: the bytes of all, each after its length."""
        tokens, told = self._kept[token]
        states = [p.half.serialise(one) for p, one in zip(self._parts, tokens, strict=True)]
        return b"".join([_HEAD.pack(*(told[n] for n in _TOLD)), *(_LENGTH.pack(len(s)) + s for s in states)])

    def deserialise(self, data: bytes) -> int:
        """As of Half.  Raises HalfError for bytes that are not of so many halves."""
        states: list[bytes] = []
        at = _HEAD.size
        while len(states) < len(self._parts) and at + _LENGTH.size <= len(data):
            (length,) = _LENGTH.unpack_from(data, at)
            states.append(data[at + _LENGTH.size:at + _LENGTH.size + length])
            at += _LENGTH.size + length
        if at != len(data) or len(states) != len(self._parts):
            raise HalfError("these bytes are no state of it", half=self.name)
        told = dict(zip(_TOLD, _HEAD.unpack_from(data), strict=True))
        self._token += 1
        self._kept[self._token] = (tuple(p.half.deserialise(s) for p, s in zip(self._parts, states, strict=True)),
                                   told)
        return self._token

    def log_tail(self) -> str:
        """As of Half: of each under its name."""
        tails = {p.half.name: p.half.log_tail() for p in self._parts}
        return "\n".join(f"{name}:\n{tail}" for name, tail in tails.items() if tail.strip())

    def close(self) -> None:
        """As of Half."""
        for part in self._parts:
            part.half.close()


def _part(member: Member, half: Half, interface: Interface) -> _Part:
    own, share = member.solved, member.interface
    surface = member.nodes[share.contact_nodes]
    pair_nodes = np.empty(len(share.pair_nodes), dtype=np.intp)
    for side in share.pair_sides:
        there = interface.side_of(side.pair, side.surface).at
        pair_nodes[side.at] = np.arange(there.start, there.stop)
    rows = {"nodes": _Rows(member.nodes, own), "cells": _Rows(member.cells, member.solved_cells),
            "contact_nodes": _Rows(np.searchsorted(interface.contact_nodes, surface), own[share.contact_nodes]),
            "pair_nodes": _Rows(pair_nodes, own[share.pair_nodes]),
            "surface": _Rows(surface, own[share.contact_nodes])}
    return _Part(member, half, rows, member.nodes[~own])


def _check(part: _Part, can_save: bool) -> None:
    """Raises HalfError for a half of another share, and for one that cannot be one of several."""
    half, share = part.half, part.member.interface
    for name, value in (("mesh.hash", share.mesh_hash), ("geometry", share.geometry)):
        if half.strings.get(name, value) != value:
            raise HalfError(f"was built for another scene ({name} is {half.strings[name]}, that of its bodies is "
                            f"{value})", half=half.name)
    if not part.elsewhere.size:
        return
    if missing := [n for n in (COURSE, COURSE_ELSEWHERE, DAMPED) if n not in half.blocks]:
        raise HalfError(f"has no {' and no '.join(missing)}: it cannot exchange heat with bodies of another half; "
                        "docs/several_halves.md says what they are", half=half.name)
    if not can_save:
        raise HalfError("one of the halves of its role cannot save its state, so they cannot take a substep until they "
                        "agree", half=half.name)


def _stale(parts: Sequence[_Part]) -> NDArray[np.intp]:
    """Nodes of the scene whose temperatures a half is given before the half has found them that solves for them."""
    found = [np.intersect1d(part.elsewhere, later.told) for k, part in enumerate(parts) for later in parts[k + 1:]]
    return np.unique(np.concatenate([np.empty(0, np.intp), *found]))


def place_of(block: Block) -> str:
    """Return what the rows of a block are on; empty for numbers, and for rows of which that is not known."""
    if not block.shape:
        return ""
    on = block.on or PLACES.get(block.name, "")
    return on if on in ("nodes", "cells", "contact_nodes", "pair_nodes") else ""


def size_of(place: str, interface: Interface) -> int:
    """Return how many rows a block on a place has."""
    return {"nodes": len(interface.nodes), "cells": len(interface.quads) + len(interface.triangles),
            "contact_nodes": len(interface.contact_nodes), "pair_nodes": len(interface.pair_nodes)}[place]


OF_BODIES = (PREFIX, "condition.heat.", T_MISSED, HIGH_OFF, LOW_OFF)


def _adds_up(name: str) -> bool:
    # What is told of a body's mesh one half alone tells.
    # fault: what several halves tell of their meshes is not had -> return name.startswith((PREFIX, "condition.heat."))
    #   or name in (*SUMS, *LARGEST, *LEAST) | coupler/test_trust_heat_mesh::test_however_bodies_are_divided_it_is_told
    return name.startswith(OF_BODIES) or name in (*SUMS, *LARGEST, *LEAST)

