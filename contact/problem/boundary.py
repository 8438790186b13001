"""Where a boundary condition stands, of either half; and where radiation fades."""

from __future__ import annotations

from typing import Annotated

from pydantic import model_validator

from contact.problem.part import Entry, Part
from contact.problem.values import Name, NotNegative, Positive, Text, problem

FORMAT = 2  # of model.json
UNEVEN = 3  # of one in which a body starts unevenly: a half that reads only 2 must not take it for another
# Keys of conditions of the elastic half, by kind; their place is the component.
MOTIONS, TRACTIONS, FORCES, WEIGHTS = ("u_x", "u_y", "angle"), ("t_x", "t_y"), ("f_x", "f_y", "moment"), ("b_x", "b_y")
# All that prescribes a displacement.
HELD = (*MOTIONS, "rotation")


class Supported(Part):
    """What a boundary condition stands on: a surface or named points; and its name."""

    on: Annotated[Text | None, Entry("the place, a surface; or", kind="surface")] = None
    at: Annotated[Text | None, Entry("the place, a point", kind="point")] = None
    name: Annotated[Name | None, Entry(
        "makes the condition an input of the half, and its heat or force an output; each name only once",
                                       kind="name")] = None

    @property
    def where(self) -> str:
        """The surface or node set."""
        return self.on if self.on is not None else str(self.at)

    def only_on(self, kind: str) -> None:
        """Refuse points where an area is needed.  Raises PydanticCustomError."""
        if self.on is None:
            raise problem(f"{kind} acts on a surface, not at points", "Use `on: body.surface`.", at=("at",))


class RadiationGap(Part):
    """Near radiation up to a gap of d_near, far radiation from d_far on, a blend between. After Eq. (12)."""

    d_near: Annotated[NotNegative, Entry("gap up to which only the facing surface is seen", "m")]
    d_far: Annotated[Positive, Entry("gap from which only the surroundings are seen", "m")]

    @model_validator(mode="after")
    def _in_order(self) -> RadiationGap:
        if self.d_far <= self.d_near:
            raise problem("d_far must be greater than d_near", at=("d_far",))
        return self

    @property
    def ends(self) -> tuple[float, float]:
        """The gaps at which it begins and ends to fade."""
        return self.d_near, self.d_far
