"""The first guess of a scene in which a body rests on another, their gap 0: nothing presses yet, so nothing holds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from contact.half.sparse import SingularMatrixError
from mechanical_fmu.advance import predicted
from mechanical_fmu.asking import Asking
from mechanical_fmu.system import Balance, Loading, System
from mechanical_fmu.tangent import refuse_loose

Floats = NDArray[np.float64]

# Surfaces nearer than this share of a body's size touch as drawn: the round-off of coordinates in a file.
AS_DRAWN = 1e-9


def resting(system: System, u: Floats, loading: Loading) -> Balance:
    """The balance to begin with at u : (n, 2) [m], with its tangent.

    Where a body is loose, surfaces that touch as drawn count as closed, under a pressure that lasts for this one
    guess: it says where contact can hold, and the equilibrium found from it knows nothing of it.
    """
    first = predicted(system, u, loading, True)
    if not isinstance(loading.ask, Asking):
        return first
    try:
        refuse_loose(system, first)
    except SingularMatrixError:
        pressure = AS_DRAWN * float(system.size.min()) * max(pair.eps_N for pair in system.interface.pairs)
        slaves = system.contact.on_slaves([pair.name for pair in system.interface.pairs])
        # fault: bodies that touch as drawn fall -> history = replace(loading.ask.history, multipliers=np.where(slaves,
        #   0.0, 0.0)) | mechanical_fmu/test_solution_loads
        history = replace(loading.ask.history, multipliers=np.where(slaves, -pressure, 0.0))
        return predicted(system, u, replace(loading, ask=replace(loading.ask, history=history)), True)
    return first
