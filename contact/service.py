"""The contact service: a request in, a reply out.

A reply depends on its request and on surfaces registered by content hash, on nothing else; so rollback, retry and
restart of a caller need no care.
"""

from __future__ import annotations

import traceback
from collections import OrderedDict

import numpy as np

from contact.facing import project
from contact.messages import Coupling, Project, Refused, Register, Registered, Reply, Request, Traction
from contact.multipliers import coupling
from contact.surfaces import RegisteredSurfaces, surfaces_of
from contact.traction import traction

MAX_REPEATS = 4  # passes that search one surface from one other
MAX_SCENES = 64  # scenes kept registered; the one unused longest goes first, and its caller registers it again


def _check_repeats(register: Register) -> None:
    """Check that no two surfaces face each other in many passes.  Raises ValueError.

    A pass is 60 bytes of a request and may be megabytes of every reply: a hundred of the same two surfaces would be
    work without bound.  In earnest there is one, or two of unlike pairs.
    """
    sides = np.stack(np.broadcast_arrays(np.ravel(register.passes.slave), np.ravel(register.passes.master)))
    if sides.size == 0:
        return
    faced, passes = np.unique(sides, axis=1, return_counts=True)
    # fault: passes of the same two surfaces without limit -> if False: | contact/test_service
    if passes.max() > MAX_REPEATS:
        slave, master = faced[:, passes.argmax()]
        raise ValueError(f"{passes.max()} passes search surface {master} from surface {slave}, "
                         f"at most {MAX_REPEATS} are allowed")


class ContactService:
    """Answer Register, Project, Traction and Coupling; wrong requests get a Refused, never an exception."""

    def __init__(self) -> None:
        self._scenes: OrderedDict[str, RegisteredSurfaces] = OrderedDict()

    def handle(self, request: Request) -> Reply:
        """Answer one request."""
        try:
            return self._answer(request)
        except ValueError as exc:
            return Refused("bad_request", str(exc))
        except Exception:  # noqa: BLE001 - the caller may be in another process: the reply must carry the fault there
            return Refused("bug", traceback.format_exc())

    def _answer(self, request: Request) -> Reply:
        if isinstance(request, Register):
            _check_repeats(request)
            scene = surfaces_of(request)
            self._scenes[scene.key] = scene
            while len(self._scenes) > MAX_SCENES:
                self._scenes.popitem(last=False)
            return Registered(scene.key)
        if not isinstance(request, (Project, Traction, Coupling)):
            return Refused("bad_request", f"{type(request).__name__} is not a request of the contact service")
        surfaces = self._scenes.get(request.surfaces)
        if surfaces is None:
            return Refused("unknown_surfaces", f"no surfaces are registered as {request.surfaces!r}")
        self._scenes.move_to_end(request.surfaces)
        if isinstance(request, Project):
            return project(surfaces, request.x)
        if isinstance(request, Coupling):
            return coupling(surfaces, request)
        return traction(surfaces, request)
