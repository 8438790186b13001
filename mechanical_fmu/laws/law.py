"""What a law of flow is: data that fills the parameters of points at their temperature, and kernels that read them.

The parameters of a point are a record with names (`POINT` in catalogue.py), made of the FIELDS of all laws.  A law is a
frozen value; compiled code knows it by its number in the catalogue, which stands in the record.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Property
from contact.problem.flow import Plastic

Floats = NDArray[np.float64]
Points = NDArray[Any]


# What a point can do, and what it remembers of its past.

# The kind of a point is a sum of these; 0 is elastic.
PLASTIC, CREEP, KINEMATIC, OVERSTRESS, LIQUID = 1, 2, 4, 8, 16

# Where a point's history begins to hold: its inelastic strain (4 components 11, 22, 12, 33), plastic and creep
# equivalent strain; with KINEMATIC or LIQUID the backstress (4); with LIQUID the deviator of E (4) and the solid
# fraction.
H_INELASTIC, H_PLASTIC, H_CREEP, H_BACK, H_STRAIN, H_SOLID = 0, 4, 5, 6, 10, 14


def history_size(kind: int) -> int:
    """Count the numbers a point of a kind remembers."""
    return 15 if kind & LIQUID else 10 if kind & KINEMATIC else 6 if kind else 0


def has_skew_tangent(kind: int) -> bool:
    """Say whether W D is unsymmetric: a backstress that forgets (gamma > 0) turns the direction of flow."""
    return bool(kind & KINEMATIC)


"""(n,) records of POINT, one a cell."""
Point = np.record
"""One of them, as kernels read it: `p.shear_modulus`."""
Fields = Mapping[str, type]
"""Parameters by name, each a float or an int."""
NOTHING, ONE = Property(0.0), Property(1.0)


class IsotropicHardening(ABC):
    """Isotropic hardening: the flow stress R(e) [Pa], e the plastic equivalent strain.

    NAME : in the scenario.  FIELDS : the parameters it fills.
    FLOW_STRESS : inner kernel (p, tables, e) -> R [Pa] and dR/de [Pa], for e >= 0.
    """

    NAME: ClassVar[str]
    FIELDS: ClassVar[Fields]
    FLOW_STRESS: ClassVar[Callable[..., tuple[float, float]]]

    @classmethod
    @abstractmethod
    def made(cls, stated: Plastic) -> Self:
        """Make the law of a material that states this one, its curves of temperature with it."""

    @abstractmethod
    def fill(self, p: Points, T: Floats, factor: Floats, start: int) -> None:
        """Fill the FIELDS of p : (n,) at T : (n,) [K], with all of R times factor : (n,) [1].

        start : where `data` stands in the tables of all materials.
        """

    @abstractmethod
    def refusal(self, T: Floats) -> str:
        """Say what is wrong with the law at T : (n,) [K], or ""."""

    @abstractmethod
    def softens(self, T: Floats) -> bool:
        """Say whether R falls with e somewhere, at T : (n,) [K]."""

    @property
    def data(self) -> Floats:
        """Return (n_t,) numbers the kernel reads from `tables`; none unless a law has some."""
        return np.empty(0)


class CreepKernels(NamedTuple):
    """Inner kernels of a creep law; dt : [s].

    relaxed : (p, Q, dt) -> stress q [Pa] at the end of a step and the creep strain made in it, from the trial stress
        Q > 0 [Pa], so that q + 3 G (creep strain) = Q.
    strain : (p, q, dt) -> creep strain of a step that ends at q.
    exponent : (p, q) -> d ln(rate) / d ln(q).
    """

    relaxed: Callable[..., tuple[float, float]]
    strain: Callable[..., float]
    exponent: Callable[..., float]


class CreepLaw(ABC):
    """Creep under the equivalent stress q [Pa], whatever its size.

    FIELDS : the parameters it fills.  KERNELS : of two laws the same where they are one equation in other numbers.
    """

    FIELDS: ClassVar[Fields]
    KERNELS: ClassVar[CreepKernels]

    @abstractmethod
    def fill(self, p: Points, T: Floats) -> None:
        """Fill the FIELDS of p : (n,) at T : (n,) [K]."""

    @abstractmethod
    def refusal(self, T: Floats) -> str:
        """Say what is wrong with the law at T : (n,) [K], or ""."""


def lowest(value: Floats, T: Floats, unit: str = "") -> str:
    """Write the least of value : (n,) and its temperature, T : (n,) [K]; unit : with a blank before it."""
    return f"{value.min():.6g}{unit} at {T[int(np.argmin(value))]:.6g} K"
