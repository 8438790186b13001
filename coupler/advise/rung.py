"""A rung of the ladder: one thing that a scene could do without."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from coupler.advise.edit import Edit


class Kind(Enum):
    """What a rung changes; at most one rung of MECHANICS, HEAT, SCHEME, WINDOWS, MESH is taken."""

    SCHEME = "coupling"
    MECHANICS = "mechanics"
    HEAT = "heat"
    EFFECT = "effect"
    WINDOWS = "windows"
    MESH = "mesh"


@dataclass(frozen=True, eq=False)
class Rung:
    """name : what is left out or made simpler, in words.  edit : how, in the scenario.

    deforms : it only says something while deformation is computed.  misses : what such a model cannot show at all.
    windows, mesh : factors on the scenario's windows and on its cells along an edge, on those of the ladder's trials.
    """

    name: str
    kind: Kind
    edit: Edit = field(default_factory=Edit)
    deforms: bool = False
    misses: str = ""
    windows: float = 1.0
    mesh: float = 1.0

    @property
    def rigid(self) -> bool:
        """Whether bodies keep their shape with it."""
        return self.edit.put.get(("mechanical", "half")) == "rigid"

    @property
    def simpler(self) -> bool:
        """Whether it takes physics out: worth it though it saves nothing; all else must save something."""
        return self.kind in (Kind.EFFECT, Kind.MECHANICS, Kind.HEAT)
