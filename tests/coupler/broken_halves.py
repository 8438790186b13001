"""Halves that break the border, each in one way of wrong physics: a half that is right, and what is done to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from coupler.fmu.half import Advance, Half, Status

Values = dict[str, np.ndarray]
SCENE = """
slideline: 2
title: Two blocks, pressed
units: {temperature: degC}
geometry: plane
materials:
  steel: {rho: 8000, c: 500, k: 30, E: 2.0e11, nu: 0.3, alpha: 1.2e-5, T_ref: 20}
bodies:
  lower: {mesh: {rectangle: {origin: [0, 0], size: [0.02, 0.01], cells: [3, 2]}}, material: steel, T0: 20}
  upper: {mesh: {rectangle: {origin: [0, 0.01], size: [0.02, 0.01], cells: [2, 2]}}, material: steel, T0: 400}
contact:
  joint:
    slave: upper.bottom
    master: lower.top
    gap_max: 0.002
    penalty: 1.0e14
    conduction: {closed: {law: power, h0: 500, h1: 5000, p0: 1.0e7, exponent: 0.95, p_max: 1.0e8}, open: null}
thermal:
  boundary: [{on: lower.bottom, temperature: 20}]
mechanical:
  half: elastic
  elastic:
    boundary:
      - {on: lower.bottom, u_x: 0, u_y: 0}
      - {on: upper.top, u_x: 0, u_y: -1.0e-6}
coupling: {scheme: staggered, end: 12, windows: [{until: 12, size: 1}]}
probes: {T: {T: {mean: lower}}}
"""

# Bodies that are free to expand, apart by more than they do.
FREE = SCENE.replace("open: null", "open: {law: gas, k_g: 0.06, g_m: 30.0e-6}").replace(
    "origin: [0, 0.01]", "origin: [0, 0.012]").replace("gap_max: 0.002", "gap_max: 0.003").replace(
    "{on: lower.bottom, u_x: 0, u_y: 0}", "{on: lower.bottom, u_y: 0}\n      - {on: lower.left, u_x: 0}").replace(
    "{on: upper.top, u_x: 0, u_y: -1.0e-6}", "{on: upper.top, u_y: 1.0e-4}\n      - {on: upper.left, u_x: 0}")


def as_told(half: Broken, name: str, value: Any) -> Any:
    return value


def the_step(h: float) -> float:
    return h


@dataclass
class Broken:
    """A half that is another one, but for `rule(self, outputs, h) -> outputs` on all it gives out.

    made : substeps so far, which no restore takes back.  seed : of what is random.
    """

    half: Half
    rule: Callable[[Broken, Values, float], Values]
    made: int = 0
    takes: Callable[[float], float] = the_step
    random: Any = field(default_factory=np.random.default_rng)
    hears: Callable[[Broken, str, Any], Any] = as_told

    def __getattr__(self, name: str) -> Any:
        return getattr(self.half, name)

    def initialise(self, t_start: float, t_end: float, parameters: Mapping[str, str], inputs: Mapping[str, Any],
                   outputs: Sequence[str]) -> Values:
        return self.rule(self, self.half.initialise(t_start, t_end, parameters, inputs, outputs), 0.0)

    def advance(self, t: float, h: float, inputs: Mapping[str, Any], outputs: Sequence[str]) -> Advance:
        heard = {name: self.hears(self, name, value) for name, value in inputs.items()}
        done = self.half.advance(t, self.takes(h), heard, outputs)
        if done.status is not Status.OK:
            return done
        self.made += 1
        return Advance(done.status, done.message, self.rule(self, dict(done.outputs), h), done.seconds)

    def read(self, names: Sequence[str], finite: bool = True) -> Values:
        return self.rule(self, self.half.read(names, finite), 0.0)


@dataclass
class Forgetful(Broken):
    """It counts its substeps in the states it keeps, but not in those it writes down."""

    kept: dict[int, int] = field(default_factory=dict)

    def save(self) -> int:
        token = self.half.save()
        self.kept[token] = self.made
        return token

    def restore(self, token: int) -> None:
        self.half.restore(token)
        self.made = self.kept.get(token, 0)


def told(name: str, change: Callable[[Broken, np.ndarray], np.ndarray]) -> Callable[[Broken, str, Any], Any]:
    return lambda half, n, value: change(half, value) if n == name else value


def on(name: str, change: Callable[[Broken, np.ndarray], np.ndarray]) -> Callable[[Broken, Values, float], Values]:
    def rule(half: Broken, got: Values, h: float) -> Values:
        return {n: change(half, v) if n == name else v for n, v in got.items()}
    return rule


def swapped(x: np.ndarray) -> np.ndarray:
    return x[np.roll(np.arange(len(x)), 1)]


def cold(half: Broken, T: np.ndarray) -> np.ndarray:
    return np.where(np.arange(len(T)) == 4, -5.0, T) if half.made >= 3 else T


def holed(half: Broken, T: np.ndarray) -> np.ndarray:
    return np.where(np.arange(len(T)) == 1, np.nan, T) if half.made >= 2 else T


@dataclass(frozen=True)
class Case:
    """role : of the broken half.  rule : what is wrong.  says : of a run, "" where a run cannot see it.

    check : the row of verify-half that fails.  takes : the step it takes for h.  hears : what it takes an input for.
    scene : pressed or free.  cause : what a plain run says beside that row: block, number or cause.
    """

    role: str
    rule: Callable[[Broken, Values, float], Values]
    says: str
    check: str
    takes: Callable[[float], float] = the_step
    hears: Callable[[Broken, str, Any], Any] = as_told
    scene: str = "pressed"
    kind: type[Broken] = Broken
    cause: str = field(kw_only=True)


def as_it_is(half: Broken, got: Values, h: float) -> Values:
    return got


START, NUMBERS = "starts as the scene", "numbers that can be"
CASES = {
    "degrees Celsius": Case("thermal", on("T", lambda _, T: T - 273.15),
                            r"half 'thermal': its first T\[\d+\] is 20 K, but body 'lower' .*293.15 K.*degrees Celsius",
                            START, cause=r"its first T\[\d+\] is .*degrees Celsius"),
    "below absolute zero": Case("thermal", on("T", cold), r"thermal: T\[5\] is -5 K.*above 0", NUMBERS,
                                cause=r"T\[5\] is -5 K"),
    "not a number": Case("thermal", on("T", holed), r"thermal: T\[2\] is nan K", NUMBERS,
                         cause="output T is not finite"),
    "runs away": Case("thermal", on("T", lambda half, T: T * 10.0 ** min(half.made, 30)),
                      r"thermal: T\[\d+\] is .*e\+\d+ K.*below 100000 K", NUMBERS,
                      cause=r"T\[\d+\] is .* K; it must be above 0 and below 100000 K"),
    "ignores h": Case("thermal", as_it_is, "", "time passes", lambda h: 1.0, cause=r"a substep of 0\.001 s changes T"),
    "wrong sign of pressure": Case("thermal", as_it_is, "", "answers to pressure",
                                   hears=lambda half, name, value: -value if name == "contact.t_N" else value,
                                   cause=r"pair joint: pressed by 1e\+07 Pa"),
    "random after step 8": Case("thermal", on("T", lambda half, T: T + 1e-3 * half.random.random(T.shape)
                                              if half.made > 8 else T), "", "same inputs, same bits",
                                cause="two new instances differ after substep"),
    "hidden state": Case("thermal", on("T", lambda half, T: T + 1e-3 * half.made), "", "save and restore to the bit",
                         cause="gives another T"),
    "millimetres": Case("mechanical", on("x", lambda _, x: 1e3 * x),
                        r"half 'mechanical': its first x\[\d+,1\.\.2\].*quad 1 .*It is mm", START, cause="It is mm"),
    "displacements": Case("mechanical", on("x", lambda half, x: x - half.X),
                          r"half 'mechanical': its first x\[\d+,1\.\.2\].*not how far they moved", START,
                          cause="not how far they moved"),
    "renumbered": Case("mechanical", on("x", lambda _, x: swapped(x)),
                       r"half 'mechanical': its first x.*order of interface\.h5", START,
                       cause=r"order of interface\.h5"),
    "pressures that pull": Case("mechanical", on("contact.t_N", lambda _, t_N: -t_N),
                                r"contact\.t_N\[\d\] \(pair joint, node \d+\) is .* Pa, a pull.*t_N = -p", NUMBERS,
                                cause="a pull"),
    "covered in percent": Case("mechanical", on("contact.covered", lambda _, c: 100.0 * c),
                               r"contact\.covered\[\d\] \(pair joint, node \d+\) is .*share, 0 to 1", NUMBERS,
                               cause="share, 0 to 1"),
    "counts its substeps": Case("thermal", on("T", lambda half, T: T + 1e-3 if half.made % 16 == 15 else T), "",
                                "20 substeps after a restore", cause="gives another T"),
    "writes half of its state": Case("thermal", on("T", lambda half, T: T + 1e-3 if half.made > 5 else T), "",
                                     "hot and cold caches, same bits", kind=Forgetful,
                                     cause="taken over by a new instance"),
    "each substep is a little longer": Case("thermal", as_it_is, "", "substeps converge", lambda h: h + 1e-3,
                                            cause="two halves of it still differ"),
    "heat in millijoules": Case("thermal", as_it_is, "", "heat warms a body",
                                hears=told("E_M", lambda half, E: 1e-3 * E), cause=r"not Q/\(rho c V\)"),
    "cells renumbered": Case("thermal", as_it_is, "", "cells in order",
                             hears=told("E_M", lambda half, E: np.roll(E, 1)), cause="none of its nodes"),
    "wrong sign of gap": Case("thermal", as_it_is, "", "answers to a gap", scene="free",
                              hears=told("x", lambda half, x: 2.0 * half.X - x), cause="apart its sides are"),
    "takes kelvin for Celsius": Case("mechanical", as_it_is, "", "expands freely", scene="free",
                                     hears=told("T", lambda half, T: T - 273.15 + 20.0),
                                     cause="free and warm all over"),
    "expands by half": Case("mechanical", on("x", lambda half, x: half.X + 0.5 * (x - half.X)), "", "expands freely",
                            scene="free", cause="free and warm all over"),
    "strains without a cause": Case("mechanical", on("x", lambda half, x: x + 1e-5 * half.X), "", "moves rigidly",
                                    scene="free", cause="has a strain of"),
    "presses across a gap": Case("mechanical", on("contact.t_N", lambda _, t_N: t_N - 1e5), "", "moves rigidly",
                                 scene="free", cause="across a gap of"),
    "hears another order": Case("mechanical", as_it_is, "", "nodes in order", scene="free",
                                hears=told("T", lambda half, T: swapped(T)),
                                cause="grows most, which does not have it"),
    "gaps in millimetres": Case("mechanical", on("contact.gap", lambda _, g: 1e3 * g + 5.0),
                                r"contact\.gap\[\d\] \(pair joint, node \d+\) .*gap_max \(0\.002", NUMBERS,
                                cause="gap_max"),
}
