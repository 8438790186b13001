"""The table of coupling schemes.  A new one is a file of its own, a row here, and its name in `Scheme`.

`auto` is no scheme but a choice among them, window by window: coupler.control.auto.
"""

from __future__ import annotations

from coupler.scenario.options import Scheme
from coupler.schemes.adiabatic import ADIABATIC
from coupler.schemes.along_heat import ALONG_HEAT
from coupler.schemes.iterate import ITERATED
from coupler.schemes.once import EXTRAPOLATING, MECHANICAL_FIRST, PARALLEL, STAGGERED
from coupler.schemes.scheme import CouplingScheme

SCHEMES: tuple[CouplingScheme, ...] = (
    STAGGERED,
    MECHANICAL_FIRST,
    PARALLEL,
    EXTRAPOLATING,
    ALONG_HEAT,
    ITERATED,
    ADIABATIC,
)
_BY_NAME = {scheme.name: scheme for scheme in SCHEMES}


def scheme_of(name: Scheme) -> CouplingScheme:
    """Returns the scheme of a name.  Raises KeyError for `auto`, which is none."""
    return _BY_NAME[name]
