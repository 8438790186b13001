"""What friction remembers: a surface that is held keeps its shear to the bit, however often it is asked."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact.half.interface import register_message
from contact.messages import Registered, Traction, Tractions
from contact.service import ContactService

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from contact_ripple import DEPTH, interface_of

MU = 0.3


@pytest.mark.parametrize("two_pass", [False, True])
def test_held_still_shear_stays_and_makes_no_heat(two_pass):
    """Uneven along the surface, below the bound: a mean of interpolated values would smooth it at every request."""
    slave = np.column_stack([np.linspace(0.0, 1.0, 8), np.full(8, -DEPTH)])
    master = np.column_stack([np.linspace(1.2, -0.2, 12), np.zeros(12)])
    interface = interface_of(slave, master, by_node=False)
    interface = replace(interface, pairs=tuple(replace(p, mu=MU, two_pass=two_pass) for p in interface.pairs))
    service = ContactService()
    known = service.handle(register_message(interface))
    assert isinstance(known, Registered)
    x = interface.nodes
    mobilised = np.zeros(len(x))
    mobilised[:8] = 0.9 * MU * np.random.default_rng(1).uniform(-1.0, 1.0, 8)
    nothing = np.zeros(len(x))
    again = service.handle(Traction(known.surfaces, x, nothing, x, nothing, mobilised))
    assert isinstance(again, Tractions)
    assert again.mobilised.tobytes() == mobilised.tobytes()
    assert not again.E_friction.any()
    assert again.n_slipping == 0
    assert again.n_touching > 0
