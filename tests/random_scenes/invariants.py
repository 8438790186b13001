"""All invariants there are."""

from __future__ import annotations

from random_scenes.invariant import Invariant
from random_scenes.invariants_contact import INVARIANTS as CONTACT
from random_scenes.invariants_cycles import CYCLES
from random_scenes.invariants_frame import FRAME
from random_scenes.invariants_monolithic import ONE_SYSTEM, STEADY
from random_scenes.invariants_motion import MOTION
from random_scenes.invariants_refine import ESTIMATE, SETTLES
from random_scenes.invariants_rest import FREE, REST
from random_scenes.invariants_roles import ROLES
from random_scenes.invariants_signs import INVARIANTS as SIGNS
from random_scenes.invariants_thermal import MAXIMUM, WITHIN
from random_scenes.invariants_work import SAME_BITS

INVARIANTS: tuple[Invariant, ...] = (*FRAME, *ROLES, *MOTION, WITHIN, MAXIMUM, CYCLES, *CONTACT, REST, FREE, *SIGNS,
                                     ESTIMATE, SETTLES, ONE_SYSTEM, STEADY, SAME_BITS)
