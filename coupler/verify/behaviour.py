"""Drives a half on a bench, and checks how it behaves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from contact.half.start import start_coordinates
from coupler.errors import HalfError
from coupler.fmu.bounds import BorderScene, wrong_blocks, wrong_start, wrong_values
from coupler.fmu.half import Advance, Array, Block, Half, Status
from coupler.fmu.names import THERMAL, role_of
from coupler.verify.border import Finding, failed, not_applicable, passed

# Drives a half on a bench: new instances, and inputs that change a little from substep to substep.

HALVINGS = 20
END = 1e9  # s, stop time given to the half
NUMBERS = ("Real", "Integer", "Boolean")
MOVING = 3  # substeps after which inputs stay
LONG = 12  # substeps of what is looked at for longer


@dataclass(frozen=True)
class Bench:
    """A half on a bench.

    make : returns a new instance, loaded and not initialised.  h : size of a substep [s].

    starts : the Real inputs as a new instance has them, x as the scene has it.  blocks : all of the half's.
    scene : it is held against; None where nobody knows.
    """

    make: Callable[[], Half]
    h: float
    starts: Mapping[str, Array]
    blocks: Mapping[str, Block]
    scene: BorderScene | None = None

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

    def steps(self, half: Half, n: int = LONG) -> Iterator[dict[str, Array]]:
        """Take substeps 1 to n, or as many as it takes, and yield the outputs of each as they come."""
        for k in range(1, n + 1):
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


def settled(make: Callable[[], Half], h: float, scene: BorderScene | None = None) -> Bench:
    """Return a bench with a substep that the half takes three times: h, or h/2, h/4, ...  Raises HalfError.

    scene : that it is held against, where it is known.
    """
    half = make()
    try:
        blocks = dict(half.blocks)
        starts = half.read([name for name, b in blocks.items() if b.causality == "input" and b.kind == "Real"])
    finally:
        half.close()
    if scene is not None and "x" in starts and starts["x"].shape == scene.interface.nodes.shape:
        starts["x"] = start_coordinates(scene.interface)
    for _ in range(HALVINGS):
        bench = Bench(make, h, starts, blocks, scene)
        with bench.half() as half:
            done = [half.advance((k - 1) * h, h, bench.inputs(k), ()) for k in (1, 2, 3)]
        if all(d.status is Status.OK for d in done):
            return bench
        h *= 0.5
    raise HalfError(f"it takes no substep, not even of {2 * h:.3g} s: {done[0].message}")


def differing(a: Mapping[str, Array], b: Mapping[str, Array]) -> list[str]:
    """Return the names whose values are not equal to the bit.

    a : any shape and unit each, by name.  b : same shape and unit for what is to be equal.
    """
    # fault: verify-half: outputs nearly the same pass for the same -> return [name for name in a if name not in b or
    #   not np.allclose(a[name], b[name])] | coupler/test_verify
    return [name for name in a if name not in b or np.asarray(a[name]).tobytes() != np.asarray(b[name]).tobytes()]


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


# Checks how a half behaves when it runs: new instances for each check, numbers compared to the bit.

Check = Callable[[Bench, str], Finding]  # its name is the second, as CHECKS has it
BALANCE = 1e-10  # of the sum of |terms|, as in the energy balance of a run
LISTED = 5  # names in a reason


def behaviour_findings(bench: Bench) -> Iterator[Finding]:
    """Run every check in turn.  A half that raises in one fails it; the next begins with a new instance."""
    for name, check in CHECKS.items():
        try:
            yield check(bench, name)
        except HalfError as exc:
            first = str(exc).splitlines()[0]
            yield failed(name, f"it failed: {first}", "A step that cannot be made is a Discard; nothing else may fail")


def same_twice(bench: Bench, check: str) -> Finding:
    """Check that two instances with the same inputs give the same bits."""
    with bench.half() as a, bench.half() as b:
        # fault: verify-half: what changes after the third substep is not seen -> for k, (one, other) in enumerate(
        #   zip(bench.steps(a, MOVING), bench.steps(b, MOVING), strict=False), start=1): | coupler/test_broken_halves
        for k, (one, other) in enumerate(zip(bench.steps(a), bench.steps(b), strict=False), start=1):
            if wrong := differing(one, other):
                return failed(check, f"two new instances differ after substep {k} in {_some(wrong)}",
                              "No random numbers, clocks, or memory that instances share; sums in a fixed order")
    return passed(check)


def scene_start(bench: Bench, check: str) -> Finding:
    """Check that the half starts as its scene does: the first T is T0, the first x the mesh."""
    if bench.scene is None:
        return not_applicable(check, "no scene is known", "a run looks at it; here give one with --scenario")
    role = role_of(bench.blocks)
    if wrong := list(wrong_blocks(role, bench.blocks, bench.scene)):
        return failed(check, wrong[0].text, wrong[0].remedy)
    breach = wrong_start(role, _first(bench), bench.scene)
    return passed(check) if breach is None else failed(check, breach.text, breach.remedy)


def possible(bench: Bench, check: str) -> Finding:
    """Check that every number at the border can be: T above 0 K, pressures that press, shares of 0 to 1."""
    role = role_of(bench.blocks)
    breach = wrong_values(role, _first(bench), bench.scene)
    with bench.half() as half:
        for k, got in enumerate(bench.steps(half), start=1):
            breach = breach or wrong_values(role, got, bench.scene)
            if breach is not None:
                return failed(check, f"substep {k}: {breach.text}", breach.remedy)
    return passed(check)


def _first(bench: Bench) -> dict[str, Array]:
    half = bench.make()
    try:
        return half.initialise(0.0, END, {}, bench.starts, bench.outputs)
    finally:
        half.close()


def takes_time(bench: Bench, check: str) -> Finding:
    """Check that a thermal half changes less in a short substep: one that ignores h changes as much."""
    if role_of(bench.blocks) != THERMAL:
        return not_applicable(check, "a body in equilibrium knows no time", "")
    first = _first(bench)["T"]
    with bench.half() as whole, bench.half() as short:
        dT = bench.step(whole, 1)["T"] - first
        little = took(short.advance(0.0, SHORT * bench.h, bench.inputs(1), bench.outputs))["T"] - first
    moved = np.abs(dT) > CHANGED * max(float(np.abs(dT).max()), 1e-9)
    # Prescribed temperatures jump at once, so some nodes may; that all do is a half that knows no time.
    if 2 * moved.sum() <= len(dT):
        return not_applicable(check, "next to nothing happens in a substep", "")
    if (np.abs(little) >= ALMOST * np.abs(dT))[moved].all():
        i = int(np.argmax(np.abs(dT)))
        return failed(check, f"a substep of {SHORT * bench.h:.3g} s changes T[{i + 1}] by {little[i]:.4g} K, one of "
                      f"{bench.h:.3g} s by {dT[i]:.4g} K", "A substep goes from t to t + h: its h is an argument")
    return passed(check)


SHORT = 1e-3  # of a substep
CHANGED = 1e-6  # of the largest change: less is none
ALMOST = 0.9  # of a change: as much


def answers_pressure(bench: Bench, check: str) -> Finding:
    """Check that a thermal half lets more heat through a pair that is pressed than through one that is pulled.

    The difference of temperature between the sides of a pair after one substep, under 10 MPa either way: conductance
    does not fall with pressure, and t_N is a pressure where it is below 0.
    """
    t_N = bench.starts.get("contact.t_N")
    if role_of(bench.blocks) != THERMAL:
        return not_applicable(check, "it takes no heat through contact", "")
    if bench.scene is None or t_N is None:
        return not_applicable(check, "no scene is known, or it takes no contact.t_N", "give one with --scenario")
    i, first = bench.scene.interface, _first(bench)["T"]
    sides = [(np.unique(i.surfaces[pair.slave]), np.unique(i.surfaces[pair.master])) for pair in i.pairs]
    left: list[Array] = []
    # fault: verify-half: pressure is offered with one sign alone -> for sign in (-1.0, -1.0): |
    #   coupler/test_broken_halves
    for sign in (-1.0, 1.0):
        with bench.half() as half:
            inputs = {**bench.starts, "contact.t_N": np.full(t_N.shape, sign * PRESSED)}
            done = half.advance(0.0, bench.h, inputs, bench.outputs)
        T = first if done.status is not Status.OK else done.outputs["T"]  # it may refuse a pull
        left.append(np.array([abs(T[a].mean() - T[b].mean()) for a, b in sides]))
    begun = np.array([abs(first[a].mean() - first[b].mean()) for a, b in sides])
    off = np.where(begun > 1.0, left[0] - left[1], 0.0)
    if not off.size or np.abs(off).max() <= CHANGED * max(float(begun.max()), 1.0):
        return not_applicable(check, "nothing that faces each other at the start answers to pressure", "")
    k = int(np.argmax(off))
    if off[k] > CHANGED * begun[k]:
        return failed(check, f"pair {i.pairs[k].name}: pressed by {PRESSED:g} Pa its sides are {left[0][k]:.6g} K "
                      f"apart after a substep, pulled as much {left[1][k]:.6g} K",
                      "t_N is <= 0 where sides press: p = -t_N")
    return passed(check)


PRESSED = 1e7  # Pa


def reading(bench: Bench, check: str) -> Finding:
    """Check that a half that is read again and again ends where one ends that is not read at all."""
    with bench.half() as read, bench.half() as unread:
        for k in (1, 2):
            read.advance((k - 1) * bench.h, bench.h, bench.inputs(k), bench.outputs)
            first, again = read.read(bench.outputs), read.read(bench.outputs)
            if wrong := differing(first, again):
                return failed(check, f"read twice, {_some(wrong)} changed", "Outputs are computed in the step")
            took(unread.advance((k - 1) * bench.h, bench.h, bench.inputs(k), ()))
        if wrong := differing(bench.step(read, 3), bench.step(unread, 3)):
            return failed(check, f"a half that was read goes on differently in {_some(wrong)}",
                          "Outputs are computed in the step, and getters change nothing")
    return passed(check)


def restoring(bench: Bench, check: str) -> Finding:
    """Check that a restored half has its outputs back, and that the same substeps give the same bits."""
    with bench.half() as half:
        if not half.can_save:
            return _no_state(check)
        bench.step(half, 1)
        token, there = half.save(), half.read(bench.outputs)
        first = [bench.step(half, k) for k in (2, 3)]
        for turn in ("first", "second"):
            half.restore(token)
            if wrong := differing(there, half.read(bench.outputs)):
                return failed(check, f"after the {turn} restore {_some(wrong)} is not as it was saved",
                              "Outputs are part of the state")
            again = [bench.step(half, k) for k in (2, 3)]
            # fault: verify-half: nobody looks what a restore gives again -> for k, (a, b) in enumerate(zip(first,
            #   first, strict=True), start=2): | coupler/test_verify
            for k, (a, b) in enumerate(zip(first, again, strict=True), start=2):
                if wrong := differing(a, b):
                    return failed(check, f"after the {turn} restore substep {k} gives another {_some(wrong)}",
                                  "All that evolves belongs to the state, copied on save and on restore: histories, "
                                  "counters, last increments; what is kept beside it must change no bits")
    return passed(check)


def remembers_inputs(bench: Bench, check: str) -> Finding:
    """Check that inputs set before a save hold again after the restore: only what changed is sent."""
    with bench.half() as half:
        if not half.can_save:
            return _no_state(check)
        bench.step(half, 1)
        token = half.save()
        given = took(half.advance(bench.h, bench.h, bench.inputs(1), bench.outputs))
        half.restore(token)
        bench.step(half, 2)
        half.restore(token)
        again = took(half.advance(bench.h, bench.h, {}, bench.outputs))
    if wrong := differing(given, again):
        return failed(check, f"restored and stepped without setting inputs, {_some(wrong)} comes from later inputs",
                      "Save the inputs with the state, and put them back with it")
    return passed(check)


def caches(bench: Bench, check: str) -> Finding:
    """Check that a new instance continues from a state like the one that saved it, with its caches empty."""
    with bench.half() as hot:
        if not (hot.can_save and hot.can_serialise):
            return not_applicable(check, "it cannot write its state down", "no resume of a run that stopped")
        bench.step(hot, 1)
        data = hot.serialise(hot.save())
        with bench.half() as cold:
            cold.restore(cold.deserialise(data))
            for k in (2, 3):
                if wrong := differing(bench.step(hot, k), bench.step(cold, k)):
                    return failed(check, f"taken over by a new instance, substep {k} gives another {_some(wrong)}",
                                  "What changes bits (first guesses, old factors, counters) is state, or is made anew "
                                  "at every step")
    return passed(check)


def discards(bench: Bench, check: str) -> Finding:
    """Check that an impossible substep is discarded, with a reason, and that the half survives it."""
    with bench.half() as half:
        bench.step(half, 1)
        reason = _refused(bench, half)
        if not reason:
            return not_applicable(check, "it takes every step it was offered (inputs that are no numbers, no length)",
                                  "its numbers are then checked by the coupler alone")
        if not reason.strip():
            return failed(check, "it gives no reason", "Set status.message, or log why")
    return passed(check, reason)


def no_trace(bench: Bench, check: str) -> Finding:
    """Check that a discard changes no output, and that the restored half continues as if it had not been."""
    with bench.half() as half, bench.half() as undisturbed:
        if not half.can_save:
            return _no_state(check)
        bench.step(half, 1)
        token, before = half.save(), half.read(bench.outputs)
        if not _refused(bench, half):
            return not_applicable(check, "it takes every step it was offered")
        values = [name for name in bench.outputs if not name.startswith("status.")]
        if wrong := [n for n in differing(before, half.read(bench.outputs)) if n in values]:
            return failed(check, f"the rejected substep changed {_some(wrong)}",
                          "Take new state and outputs over only when the step has succeeded")
        half.restore(token)
        bench.step(undisturbed, 1)
        if wrong := differing(bench.step(undisturbed, 2), bench.step(half, 2)):
            return failed(check, f"put back after a rejected substep it gives another {_some(wrong)}",
                          "A step works on copies; whatever it kept on its way out must not change the next one")
    return passed(check)


def substeps(bench: Bench, check: str) -> Finding:
    """Check a window in one substep, in two, and in one again."""
    t, h = bench.h, bench.h
    with bench.half() as half:
        if not half.can_save:
            return _no_state(check)
        bench.step(half, 1)
        token = half.save()
        whole = took(half.advance(t, h, bench.inputs(2), bench.outputs))
        half.restore(token)
        for part in (0.0, 0.5):
            took(half.advance(t + part * h, 0.5 * h, bench.inputs(2), bench.outputs))
        half.restore(token)
        if wrong := differing(whole, took(half.advance(t, h, bench.inputs(2), bench.outputs))):
            return failed(check, f"a window gives another {_some(wrong)} once it was tried in two substeps",
                          "What depends on the size of a substep (rates, factors) belongs to the substep")
    return passed(check)


def heat_balance(bench: Bench, check: str) -> Finding:
    """Check the half's own energy balance: the sum of heat.* without stored equals that of heat.stored.*"""
    terms = [name for name in bench.outputs if name.startswith("heat.")]
    if not any(name.startswith("heat.stored") for name in terms):
        return not_applicable(check, "it gives no heat terms", "the energy balance of a run does not include it")
    with bench.half() as half:
        for k in (1, 2, 3):
            gap = _imbalance(bench.step(half, k), terms)
            if gap > BALANCE:
                return failed(check, f"substep {k}: {gap:.1e} of the sum of |terms| is missing (at most {BALANCE:g})",
                              "Every heat.* is an energy of the substep into the bodies [J], at temperatures it used")
    return passed(check)


CHECKS: Mapping[str, Check] = {
    "starts as the scene": scene_start, "numbers that can be": possible, "time passes": takes_time,
    "answers to pressure": answers_pressure,
    "same inputs, same bits": same_twice, "reading has no side effect": reading,
    "save and restore to the bit": restoring, "inputs are part of the state": remembers_inputs,
    "hot and cold caches, same bits": caches, "a bad substep is discarded": discards,
    "a rejected substep leaves no trace": no_trace, "substeps of one window": substeps,
    "heat terms close": heat_balance}


def _refused(bench: Bench, half: Half) -> str:
    """Offer impossible substeps; return the reason of the first that is refused, " " without one, "" if none is."""
    name = next((n for n in ("T", "x", *bench.starts) if n in bench.starts and bench.starts[n].size), "")
    bad = {name: np.full(bench.starts[name].shape, np.nan)} if name else {}
    for inputs, h in ((bad, bench.h), ({}, 0.0)):
        if h and not inputs:
            continue
        done = half.advance(bench.h, h, {**bench.inputs(2), **inputs}, ())
        # fault: verify-half: a rejected substep is not offered -> if False: | coupler/test_verify
        if done.status is Status.DISCARD:
            return done.message or " "
    return ""


def _imbalance(values: Mapping[str, Array], terms: list[str]) -> float:
    """Return |terms - stored| over the sum of |terms|; 0 where there are none."""
    heats = {name: float(np.sum(values[name])) for name in terms}
    total = sum(-v if name.startswith("heat.stored") else v for name, v in heats.items())
    size = sum(abs(v) for v in heats.values())
    return abs(total) / size if size else 0.0


def _no_state(check: str) -> Finding:
    return not_applicable(check, "it cannot keep its state", "no iteration, no second try of a window")


def _some(names: list[str]) -> str:
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return ", ".join(names[:LISTED]) + more
