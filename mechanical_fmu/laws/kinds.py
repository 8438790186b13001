"""What a point can do, and what it remembers of its past."""

from __future__ import annotations

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
