"""The part of the schema that says how a material flows: plasticity, creep, melting (docs/materials.md)."""

from __future__ import annotations

from enum import StrEnum
from itertools import pairwise

from pydantic import StrictBool, model_validator

from coupler.scenario.base import Part, PropertySpec
from coupler.scenario.property_checks import not_negative, numbers_in, positive
from coupler.scenario.quantity import NotNegative, Number, Positive, problem


class HardeningLaw(StrEnum):
    """How the yield stress grows with plastic strain."""

    LINEAR = "linear"
    VOCE = "voce"
    TABLE = "table"


class Form(StrEnum):
    """Between the points of a table."""

    LINEAR = "linear"
    CUBIC = "cubic"


class Beyond(StrEnum):
    """Beyond the last point of a table."""

    FLAT = "flat"
    SLOPE = "slope"


class Hardening(Part):
    """linear: H [Pa]; voce: Q (1 - exp(-b e)) + H e; table: stress [Pa] over plastic strain, of several T if given."""

    law: HardeningLaw
    H: PropertySpec | None = None
    Q: PropertySpec | None = None
    b: Positive | None = None
    strain: tuple[Number, ...] | None = None
    stress: tuple[Number | tuple[Number, ...], ...] | None = None
    T: tuple[Number, ...] | None = None
    form: Form = Form.LINEAR
    beyond: Beyond = Beyond.FLAT

    @model_validator(mode="after")
    def _complete(self) -> Hardening:
        needed = {"linear": ("H",), "voce": ("Q", "b"), "table": ("strain", "stress")}[self.law.value]
        allowed = {"linear": ("H",), "voce": ("Q", "b", "H"),
                   "table": ("strain", "stress", "T", "form", "beyond")}[self.law.value]
        for key in needed:
            if getattr(self, key) is None:
                raise problem(f"the law {self.law.value} needs {key}", at=("law",))
        for key in sorted(self.model_fields_set - {"law", *allowed}):
            raise problem(f"the law {self.law.value} has no {key}", at=(key,))
        if self.strain is not None and (len(self.strain) < 2 or self.strain[0] != 0.0
                                        or any(b <= a for a, b in zip(self.strain, self.strain[1:], strict=False))):
            raise problem("must begin at 0, increase, and have at least two values", at=("strain",))
        if self.T is not None and any(b <= a for a, b in zip(self.T, self.T[1:], strict=False)):
            raise problem("temperatures must increase", at=("T",))
        if self.strain is not None and self.stress is not None:
            self._rows_fit(self.strain, self.stress)
        return self

    @property
    def falls(self) -> bool:
        """Whether its numbers say that the flow stress falls with strain; tables over T are left to the half."""
        if self.law is HardeningLaw.LINEAR:
            return any(H < 0.0 for _, H in numbers_in(self.H, ()))
        if self.law is HardeningLaw.VOCE:
            Q, b, H = self.Q, self.b, self.H or 0.0
            return isinstance(Q, float) and isinstance(H, float) and b is not None and min(H, H + b * Q) < 0.0
        rows = (self.stress,) if self.T is None else self.stress
        values = [[v for v in row if isinstance(v, float)] for row in rows or () if isinstance(row, tuple)]
        return any(after < before for row in values for before, after in pairwise(row))

    def _rows_fit(self, strain: tuple[float, ...], stress: tuple[float | tuple[float, ...], ...]) -> None:
        rows = stress if self.T is not None else (stress,)
        if self.T is not None and len(rows) != len(self.T):
            raise problem(f"one list for each of the {len(self.T)} temperatures is needed", at=("stress",))
        for row in rows:
            if not isinstance(row, tuple) or len(row) != len(strain) or any(
                    isinstance(v, tuple) or v <= 0.0 for v in row):
                raise problem(f"{len(strain)} positive values are needed, one for each strain", at=("stress",))


class Kinematic(Part):
    """Backstress: dX = 2/3 C d(ep) - gamma X de [Pa], [1]."""

    C: PropertySpec
    gamma: PropertySpec | None = None

    @model_validator(mode="after")
    def _physical(self) -> Kinematic:
        positive(self.C, ("C",))
        not_negative(self.gamma, ("gamma",))
        return self


class Overstress(Part):
    """Stress beyond yield K rate^m, K [Pa s^m]."""

    K: PropertySpec
    m: Positive

    @model_validator(mode="after")
    def _exponent(self) -> Overstress:
        if self.m > 1.0:
            raise problem("must be at most 1", at=("m",))
        not_negative(self.K, ("K",))
        return self


class Plastic(Part):
    """s_y: yield stress [Pa]; factor: times all of the flow stress; chi: share of the work that becomes heat."""

    s_y: PropertySpec | None = None
    hardening: Hardening | None = None
    factor: PropertySpec | None = None
    kinematic: Kinematic | None = None
    overstress: Overstress | None = None
    chi: NotNegative = 0.9
    softening: StrictBool = False

    @model_validator(mode="after")
    def _one_yield(self) -> Plastic:
        table = self.hardening is not None and self.hardening.law is HardeningLaw.TABLE
        if table == (self.s_y is not None):
            raise problem("a table begins with the yield stress" if table else "the yield stress is missing",
                          "Leave s_y out." if table else "Write s_y, in Pa.", at=("hardening",) if table else ())
        if self.chi > 1.0:
            raise problem("is a share, from 0 to 1", at=("chi",))
        if self.s_y is not None:
            positive(self.s_y, ("s_y",))
        not_negative(self.factor, ("factor",))
        # fault: a flow stress that falls goes unnoticed -> if self.hardening is not None and False: |
        #   coupler/test_scenario_mechanical
        if self.hardening is not None and self.hardening.falls and not self.softening:
            raise problem("its flow stress falls with plastic strain", "If that is meant, write softening: true.",
                          at=("hardening",))
        return self


class Creep(Part):
    """Norton: rate = A s^n exp(-Q/RT), A [1/(Pa^n s)], Q [J/mol]; or superplastic: s = K rate^m, K [Pa s^m]."""

    A: PropertySpec | None = None
    n: Positive | None = None
    Q: NotNegative = 0.0
    K: PropertySpec | None = None
    m: Positive | None = None
    heat: NotNegative = 1.0

    @model_validator(mode="after")
    def _one_law(self) -> Creep:
        norton, power = (self.A is not None, self.n is not None), (self.K is not None, self.m is not None)
        if not (all(norton) and not any(power)) and not (all(power) and not any(norton)):
            raise problem("either A and n, or K and m are needed")
        if any(power) and "Q" in self.model_fields_set:
            raise problem("goes with A and n", at=("Q",))
        not_negative(self.A, ("A",))
        if self.K is not None:
            positive(self.K, ("K",))
        for key, most in (("m", 1.0), ("heat", 1.0)):
            if (getattr(self, key) or 0.0) > most:
                raise problem(f"must be at most {most:g}", at=(key,))
        return self


class Liquid(Part):
    """Above T_l: viscous eta [Pa s], bulk [Pa]; T_s, T_l in the scenario's unit; shrinkage: linear strain."""

    eta: PropertySpec
    bulk: PropertySpec
    T_s: Number
    T_l: Number
    shrinkage: Number = 0.0
    heat: NotNegative = 1.0

    @model_validator(mode="after")
    def _in_order(self) -> Liquid:
        if self.T_s > self.T_l:
            raise problem("melting must not begin above where it ends", at=("T_s",))
        positive(self.eta, ("eta",))
        positive(self.bulk, ("bulk",))
        if not -0.5 < self.shrinkage < 0.5:
            raise problem("is a linear strain, between -0.5 and 0.5", "6.6 % of the volume is a shrinkage of 0.0225.",
                          at=("shrinkage",))
        if self.heat > 1.0:
            raise problem("is a share, from 0 to 1", at=("heat",))
        return self
