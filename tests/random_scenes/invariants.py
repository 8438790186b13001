"""All invariants there are."""

from __future__ import annotations

from random_scenes.invariant import Invariant

INVARIANTS: tuple[Invariant, ...] = ()
