"""How a material flows: plasticity, creep, melting (docs/materials.md)."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Tag, model_validator

from contact.problem.curves import Beyond, Form, PropertySpec, PropertyTable, increasing
from contact.problem.part import Entry, Part, law_known, law_tag
from contact.problem.values import Flag, NotNegative, Number, Positive, problem


class LinearHardening(Part):
    """s_y + H e, e the plastic strain."""

    law: Literal["linear"]
    H: Annotated[PropertySpec, Entry("slope of the flow stress", "Pa")]

    @property
    def falls(self) -> bool:
        """Whether its numbers say that the flow stress falls with strain."""
        return any(H < 0.0 for H in _numbers(self.H))


class VoceHardening(Part):
    """s_y + Q (1 - exp(-b e)) + H e, e the plastic strain."""

    law: Literal["voce"]
    Q: Annotated[PropertySpec, Entry("hardening at saturation", "Pa")]
    b: Annotated[Positive, Entry("rate of saturation")]
    H: Annotated[PropertySpec, Entry("slope of the flow stress after saturation", "Pa")] = 0.0

    @property
    def falls(self) -> bool:
        """Whether its numbers say that the flow stress falls with strain."""
        Q, H = self.Q, self.H
        return isinstance(Q, float) and isinstance(H, float) and min(H, H + self.b * Q) < 0.0


class TableHardening(Part):
    """Flow stress over plastic strain, of several temperatures if given."""

    law: Literal["table"]
    strain: Annotated[tuple[Number, ...], Entry("plastic strain, from 0, increasing", kind="[0, ...]")]
    stress: Annotated[tuple[Number | tuple[Number, ...], ...],
                      Entry("flow stress at each strain; with `T`, one list for each temperature", "Pa", kind="[...]")]
    T: Annotated[tuple[Number, ...] | None, Entry(
        "temperatures of the lists in `stress`, increasing", "K", temperature=True,
        default="one list for all")] = None
    form: Annotated[Form, Entry("between the points: straight lines, or a monotone cubic")] = Form.LINEAR
    beyond: Annotated[Beyond, Entry(
        "beyond the last point: the last stress, or extrapolated with the last slope")] = Beyond.FLAT

    @model_validator(mode="after")
    def _in_order(self) -> TableHardening:
        strain = self.strain
        if len(strain) < 2 or strain[0] != 0.0 or any(b <= a for a, b in pairwise(strain)):
            raise problem("must begin at 0, increase, and have at least two values", at=("strain",))
        increasing(self.T or (), "temperatures", "T")
        rows = self.rows
        if self.T is not None and len(rows) != len(self.T):
            raise problem(f"one list for each of the {len(self.T)} temperatures is needed", at=("stress",))
        for row in rows:
            if not isinstance(row, tuple) or len(row) != len(strain) or any(
                    isinstance(v, tuple) or v <= 0.0 for v in row):
                raise problem(f"{len(strain)} positive values are needed, one for each strain", at=("stress",))
        return self

    @property
    def rows(self) -> tuple[Any, ...]:
        """The lists of stresses, one a temperature."""
        return (self.stress,) if self.T is None else self.stress

    @property
    def falls(self) -> bool:
        """Whether its numbers say that the flow stress falls with strain."""
        return any(after < before for row in self.rows for before, after in pairwise(row))


HARDENING = ("linear", "voce", "table")
HardeningSpec = Annotated[
    Annotated[Annotated[LinearHardening, Tag("<linear>")] | Annotated[VoceHardening, Tag("<voce>")]
              | Annotated[TableHardening, Tag("<table>")], Discriminator(law_tag)],
    BeforeValidator(law_known(HARDENING, "a mapping is needed here, with a law and its numbers",
                              f"Laws: {', '.join(HARDENING)}."))]


class Kinematic(Part):
    """Backstress: dX = 2/3 C d(ep) - gamma X de."""

    C: Annotated[PropertySpec, Entry("modulus of the backstress", "Pa", above=0.0)]
    gamma: Annotated[PropertySpec | None, Entry(
        "recall of the backstress (Armstrong and Frederick); 0 is Prager's law", "1", least=0.0, default="0")] = None


class Overstress(Part):
    """Stress beyond yield: K rate^m."""

    K: Annotated[PropertySpec, Entry("viscosity", "Pa s^m", least=0.0)]
    m: Annotated[Number, Entry("exponent of the rate", above=0.0, most=1.0)]


class Plastic(Part):
    """Plastic flow beyond a yield stress."""

    s_y: Annotated[PropertySpec | None, Entry("yield stress", "Pa", above=0.0,
                                            default="required, unless a table begins with it")] = None
    hardening: Annotated[HardeningSpec | None, Entry("how it grows with plastic strain",
                                                   default="none: it stays at `s_y`")] = None
    factor: Annotated[PropertySpec | None, Entry("multiplies all of the flow stress: softening by heat", least=0.0,
                                               default="1")] = None
    kinematic: Annotated[Kinematic | None, Entry("backstress")] = None
    overstress: Annotated[Overstress | None, Entry("stress above yield, by the rate")] = None
    chi: Annotated[Number, Entry("share of the plastic work that becomes heat", least=0.0, most=1.0,
                               why="0.9 is the value of Taylor and Quinney for metals at large strain.")] = 0.9
    softening: Annotated[Flag, Entry("permits flow stress that falls with strain",
                                   why="Where it falls the answer depends on the mesh.")] = False

    @model_validator(mode="after")
    def _one_yield(self) -> Plastic:
        table = isinstance(self.hardening, TableHardening)
        if table == (self.s_y is not None):
            raise problem("a table begins with the yield stress" if table else "the yield stress is missing",
                          "Leave s_y out; factor scales the table by temperature." if table else "Write s_y, in Pa.",
                          at=("hardening",) if table else ())
        # fault: a flow stress that falls goes unnoticed -> if False: | coupler/test_scenario_mechanical
        if self.hardening is not None and self.hardening.falls and not self.softening:
            raise problem("its flow stress falls with plastic strain", "If that is meant, write softening: true.",
                          at=("hardening",))
        return self


class Creep(Part):
    """Norton: rate = A s^n exp(-Q/RT); or superplastic: s = K rate^m."""

    A: Annotated[PropertySpec | None, Entry("rate = A s^n exp(-Q/RT)", "1/(Pa^n s)", least=0.0)] = None
    n: Annotated[Positive | None, Entry("exponent of the stress")] = None
    Q: Annotated[NotNegative | None, Entry("activation energy; goes with A and n", "J/mol", default="0")] = None
    K: Annotated[PropertySpec | None, Entry("instead: s = K rate^m, superplastic", "Pa s^m", above=0.0)] = None
    m: Annotated[Number | None, Entry("exponent of the rate", above=0.0, most=1.0)] = None
    heat: Annotated[Number, Entry("share of the viscous work that becomes heat", least=0.0, most=1.0)] = 1.0

    @model_validator(mode="after")
    def _one_law(self) -> Creep:
        norton, power = (self.A is not None, self.n is not None), (self.K is not None, self.m is not None)
        if not (all(norton) and not any(power)) and not (all(power) and not any(norton)):
            raise problem("either A and n, or K and m are needed")
        if any(power) and self.Q is not None:
            raise problem("goes with A and n", at=("Q",))
        return self


class Liquid(Part):
    """The melt: viscous, with a bulk modulus."""

    eta: Annotated[PropertySpec, Entry("viscosity above `T_l`", "Pa s", above=0.0)]
    bulk: Annotated[PropertySpec, Entry("bulk modulus above `T_l`", "Pa", above=0.0)]
    T_s: Annotated[Number, Entry("melting begins", "K", temperature=True)]
    T_l: Annotated[Number, Entry("melting ends", "K", temperature=True)]
    shrinkage: Annotated[Number, Entry("linear strain of solidification, from the shape that was poured", above=-0.5,
                                     below=0.5, remedy="6.6 % of the volume is a shrinkage of 0.0225.")] = 0.0
    heat: Annotated[Number, Entry("share of the viscous work that becomes heat", least=0.0, most=1.0)] = 1.0

    @model_validator(mode="after")
    def _in_order(self) -> Liquid:
        if self.T_s > self.T_l:
            raise problem("melting must not begin above where it ends", at=("T_s",))
        return self


def _numbers(spec: Any) -> tuple[float, ...]:
    return spec.value if isinstance(spec, PropertyTable) else (spec,) if isinstance(spec, float) else ()
