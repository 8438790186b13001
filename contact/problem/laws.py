"""Thermal contact laws: conductance h [W/m2K] from pressure, gap and temperature.  Eqs. (7)-(10).

A law is a pure function of (p_N, g_N, T): touching points give it their pressure and the gap 0,
open points the pressure
0 and their gap.  So one law may serve both branches; then they join.  A new law is one class here.
"""

from __future__ import annotations

from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Discriminator, Tag, model_validator

from contact.problem.curves import Form, increasing
from contact.problem.part import Entry, Part, law_known, law_tag
from contact.problem.values import Number, problem

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

Array = NDArray[np.float64]
Two = tuple[Array, Array]

CMY_FACTOR = 1.25  # Cooper-Mikic-Yovanovich, h = 1.25 k_s (m/sigma) (p/H)^0.95
CMY_EXPONENT = 0.95
LEAST_LAYER = 1e-9  # [m] of g + g_m of a gas: far below the free path of any, and h stays a number at the touch


class Constant(Part):
    """h."""

    law: Literal["constant"]
    h: Annotated[Number, Entry("conductance", "W/m2K", least=0.0)]

    def conductance(self, p: Array, g: Array, T: Array) -> Two:
        """Return h [W/m2K] and its derivative by temperature dh/dT [W/m2K2], same shape each.

        p : any shape, p_N >= 0 [Pa].  g : same shape, g_N >= 0 [m].  T : same shape [K].
        """
        return np.full(p.shape, self.h), np.zeros(p.shape)


class Power(Part):
    """h0 + h1 (min(p, p_max)/p0)^exponent."""

    law: Literal["power"]
    h0: Annotated[Number, Entry("conductance without pressure", "W/m2K", least=0.0)]
    h1: Annotated[Number, Entry("what p0 adds", "W/m2K", least=0.0)]
    p0: Annotated[Number, Entry("reference pressure", "Pa", above=0.0)]
    exponent: Annotated[Number, Entry("exponent of the pressure", above=0.0)]
    p_max: Annotated[Number | None, Entry("no more pressure than this counts", "Pa", above=0.0,
                                          default="no end")] = None

    def conductance(self, p: Array, g: Array, T: Array) -> Two:
        """Return h [W/m2K] and its derivative by temperature dh/dT [W/m2K2], same shape each.

        p : any shape, p_N >= 0 [Pa].  g : same shape, g_N >= 0 [m].  T : same shape [K].
        """
        p_max = np.inf if self.p_max is None else self.p_max
        return self.h0 + self.h1 * (np.minimum(p, p_max) / self.p0) ** self.exponent, np.zeros(p.shape)


class Cmy(Part):
    """1.25 k_s (m/sigma) (p/H)^0.95, with k_s = 2 k_1 k_2/(k_1 + k_2)."""

    law: Literal["cmy"]
    k_s: Annotated[Number, Entry("harmonic mean of the conductivities", "W/mK", least=0.0)]
    m: Annotated[Number, Entry("mean slope of the asperities", least=0.0)]
    sigma: Annotated[Number, Entry("roughness of the two surfaces together", "m", above=0.0)]
    H: Annotated[Number, Entry("hardness of the softer side", "Pa", above=0.0)]

    def conductance(self, p: Array, g: Array, T: Array) -> Two:
        """Return h [W/m2K] and its derivative by temperature dh/dT [W/m2K2], same shape each.

        p : any shape, p_N >= 0 [Pa].  g : same shape, g_N >= 0 [m].  T : same shape [K].
        """
        factor = CMY_FACTOR * self.k_s * self.m / self.sigma
        return factor * (p / self.H) ** CMY_EXPONENT, np.zeros(p.shape)


class Gas(Part):
    """k_g/(g + g_m): the jump distance g_m keeps h finite at g = 0; where it is 0, the least gap does."""

    law: Literal["gas"]
    k_g: Annotated[Number, Entry("conductivity of the gas", "W/mK", least=0.0)]
    g_m: Annotated[Number, Entry("jump distance; g + g_m counts as 1 nm at least", "m", least=0.0)]

    def conductance(self, p: Array, g: Array, T: Array) -> Two:
        """Return h [W/m2K] and its derivative by temperature dh/dT [W/m2K2], same shape each.

        p : any shape, p_N >= 0 [Pa].  g : same shape, g_N >= 0 [m].  T : same shape [K].
        """
        # fault: nothing keeps a gas layer finite -> return self.k_g / (g + self.g_m), np.zeros(p.shape) |
        #   contact/test_laws
        return self.k_g / np.maximum(g + self.g_m, LEAST_LAYER), np.zeros(p.shape)


class TableVariable(StrEnum):
    """What a table of conductance is over."""

    X = "x"
    T = "T"


class Table(Part):
    """Through points (x, h), ends held; x is p_N (touching) or g_N (open), or T by `variable`."""

    law: Literal["table"]
    x: Annotated[tuple[Number, ...], Entry("pressure [Pa] if closed, gap [m] if open; with `variable: T` temperature")]
    h: Annotated[tuple[Number, ...], Entry("conductance", "W/m2K", least=0.0)]
    variable: Annotated[TableVariable, Entry("`T`: over the mean temperature of the two sides")] = TableVariable.X
    form: Annotated[Form, Entry("between the points: straight lines, or a monotone cubic")] = Form.LINEAR

    @model_validator(mode="after")
    def _in_order(self) -> Table:
        if len(self.x) != len(self.h) or len(self.x) < 2:
            raise problem("x and h must be equally long lists of 2 or more numbers, "
                          f"here are {len(self.x)} and {len(self.h)}")
        increasing(self.x, "x", "x")
        if self.variable is TableVariable.X and self.x[0] < 0.0:
            raise problem("must not be negative: a pressure if closed, a gap if open", at=("x", 0))
        return self

    @cached_property
    def _curve(self) -> PPoly:
        from scipy.interpolate import PchipInterpolator, PPoly  # 0.2 s, and most scenes have no table

        x, h = np.asarray(self.x, dtype=float), np.asarray(self.h, dtype=float)
        if self.form is Form.CUBIC or x.size == 2:
            return PchipInterpolator(x, h)
        return PPoly(np.stack([np.diff(h) / np.diff(x), h[:-1]]), x)

    @cached_property
    def _slope(self) -> PPoly:
        return self._curve.derivative()

    def conductance(self, p: Array, g: Array, T: Array) -> Two:
        """Return h [W/m2K] and its derivative by temperature dh/dT [W/m2K2], same shape each.

        p : any shape, p_N >= 0 [Pa].  g : same shape, g_N >= 0 [m].  T : same shape [K].
        """
        low, high = self.x[0], self.x[-1]
        if self.variable is TableVariable.X:
            # The other of p and g is zero, whichever branch asks, so their sum is the one meant.
            # fault: a table that ends at 0 conducts less than nothing there -> h =
            #   np.asarray(self._curve(np.clip(p + g, low, high))) | contact/test_laws
            h = np.maximum(self._curve(np.clip(p + g, low, high)), 0.0)
            return h, np.zeros(p.shape)
        inner = np.clip(T, low, high)
        return np.asarray(self._curve(inner)), np.where(inner == T, self._slope(inner), 0.0)


class Sum(Part):
    """Laws side by side, as solid spots and gas between them."""

    law: Literal["sum"]
    of: Annotated[tuple[LawSpec, ...], Entry("the laws")]

    @model_validator(mode="after")
    def _has_a_part(self) -> Sum:
        if not self.of:
            raise problem("at least one law is needed", at=("of",))
        return self

    def conductance(self, p: Array, g: Array, T: Array) -> Two:
        """Return h [W/m2K] and its derivative by temperature dh/dT [W/m2K2], same shape each.

        p : any shape, p_N >= 0 [Pa].  g : same shape, g_N >= 0 [m].  T : same shape [K].
        """
        parts = [law.conductance(p, g, T) for law in self.of]
        return sum((h for h, _ in parts), np.zeros(p.shape)), sum((d for _, d in parts), np.zeros(p.shape))


LAWS = ("constant", "power", "cmy", "gas", "table", "sum")
LawSpec = Annotated[
    Annotated[Annotated[Constant, Tag("<constant>")] | Annotated[Power, Tag("<power>")] | Annotated[Cmy, Tag("<cmy>")]
              | Annotated[Gas, Tag("<gas>")] | Annotated[Table, Tag("<table>")] | Annotated[Sum, Tag("<sum>")],
              Discriminator(law_tag)],
    BeforeValidator(law_known(LAWS, "a contact law is needed here, or null where no heat crosses",
                              "For example {law: constant, h: 2000}."))]
