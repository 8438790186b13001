"""How smoothly force and heat vary while a surface slides over facets that do not match: both forms of contact.

    python benchmarks/contact_ripple.py [--quick] [--chart FILE.svg] [--json FILE]

Flat: a block of 7 cells slides over one of 11 and off its end, pressed 1e-4 deep, h = 1000 W/m2K, 100 K: force and
heat must be those of the covered width at every place.  Round: a bowl of 9 facets turns around a shaft of 23, so that
corners pass under edges at constant approach; the resultant should not feel them.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scene import pin, table

from contact.half.interface import Interface, Pair
from contact.half.register import register_message
from contact.messages import Facing, Project, Registered, Traction, Tractions
from contact.service import ContactService

Floats = NDArray[np.float64]
DEPTH, EPS, H, JUMP = 1e-4, 1e12, 1000.0, 100.0
FORMS = {"cut edges": False, "one point a node": True}


@dataclass(frozen=True)
class Ride:
    """at : (n,) places.  force, heat : (n,) over what they should be."""

    at: Floats
    force: Floats
    heat: Floats

    def ripple(self, values: Floats) -> float:
        """Largest distance from the mean, relative to it."""
        return float(np.abs(values / values.mean() - 1.0).max())


def main() -> None:
    pin()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer places")
    parser.add_argument("--chart", type=Path)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    n = 60 if options.quick else 1200
    rides = {scene: {form: ride(by_node, n) for form, by_node in FORMS.items()}
             for scene, ride in (("flat", flat), ("round", rounded))}
    print(table([{"scene": scene, "form": form, "ripple of force %": f"{100 * r.ripple(r.force):.2g}",
                  "ripple of heat %": f"{100 * r.ripple(r.heat):.2g}"}
                 for scene, forms in rides.items() for form, r in forms.items()]))
    if options.chart:
        draw(rides, options.chart)
    if options.json:
        options.json.write_text(json.dumps({scene: {form: {"force": r.ripple(r.force), "heat": r.ripple(r.heat)}
                                                    for form, r in forms.items()} for scene, forms in rides.items()}))


def flat(by_node: bool, n: int) -> Ride:
    """The block slides from its place to .9 of its width beyond the end."""
    slave = np.column_stack([np.linspace(0.0, 1.0, 8), np.full(8, -DEPTH)])
    master = np.column_stack([np.linspace(1.0, 0.0, 12), np.zeros(12)])
    at = np.linspace(0.0, 0.9, n)
    return ridden(slave, master, by_node, at, lambda s: slave + [s, 0.0], 1.0 - at)


def rounded(by_node: bool, n: int) -> Ride:
    """The bowl turns by three facets of the shaft."""
    def arc(first: float, last: float, facets: int, radius: float) -> Floats:
        a = np.linspace(first, last, facets + 1)
        return radius * np.column_stack([np.cos(a), np.sin(a)])

    # Each body on the left of its edges.  The bowl is so narrow that its corners touch the shaft's flats.
    shaft, bowl = arc(3.5, 5.9, 23, 1.0), arc(5.3, 4.1, 9, 0.997)
    at = np.linspace(0.0, 3 * 2.4 / 23, n)

    def turned(angle: float) -> Floats:
        c, s = np.cos(angle), np.sin(angle)
        return shaft @ np.array([[c, s], [-s, c]])

    return ridden(shaft, bowl, by_node, at, turned, np.ones(n))


def ridden(slave: Floats, master: Floats, by_node: bool, at: Floats, moved: Callable[[float], Floats],
           expected: Floats) -> Ride:
    """Force and heat at every place, over those expected of a unit width."""
    interface = interface_of(slave, master, by_node)
    service = ContactService()
    known = service.handle(register_message(interface))
    assert isinstance(known, Registered), known
    force, heat = np.empty(at.size), np.empty(at.size)
    nothing = np.zeros(len(slave) + len(master))
    for i, place in enumerate(at):
        x = np.concatenate([moved(float(place)), master])
        pushed = service.handle(Traction(known.surfaces, x, nothing, x, nothing, nothing))
        facing = service.handle(Project(known.surfaces, x))
        assert isinstance(pushed, Tractions), pushed
        assert isinstance(facing, Facing), facing
        force[i] = np.hypot(*pushed.force[: len(slave)].sum(axis=0)) / (EPS * DEPTH)
        heat[i] = H * JUMP * facing.area[facing.gap <= 0.0].sum() / (H * JUMP)
    return Ride(at, force / expected, heat / expected)


def interface_of(slave: Floats, master: Floats, by_node: bool) -> Interface:
    """Two chains of edges as a contact pair; what cells are behind them is not asked."""
    def chain(n: int, first: int) -> NDArray[np.int32]:
        return (np.column_stack([np.arange(n - 1), np.arange(1, n)]) + first).astype(np.int32)

    none = np.empty(0, np.int32)
    return Interface("plane", np.concatenate([slave, master]), none.reshape(0, 4), none.reshape(0, 3), none, none,
                     ("a", "b"), ("m", "m"), {"s": chain(len(slave), 0), "m": chain(len(master), len(slave))}, {},
                     (Pair("p", "s", "m", 0.1, EPS, by_node=by_node),))


def draw(rides: dict[str, dict[str, Ride]], path: Path) -> None:
    """Two scenes side by side, force above, heat below."""
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(9, 5), sharex="col", layout="constrained")
    for column, (scene, forms) in enumerate(rides.items()):
        for form, ride in forms.items():
            style = {"lw": 1.0, "label": form}
            axes[0, column].plot(ride.at, ride.force / ride.force.mean(), **style)
            axes[1, column].plot(ride.at, ride.heat / ride.heat.mean(), **style)
        axes[0, column].set_title({"flat": "a block slides off the other's end",
                                   "round": "a faceted shaft turns in a faceted bowl"}[scene])
        axes[1, column].set_xlabel({"flat": "slid / width", "round": "turned [rad]"}[scene])
    axes[0, 0].set_ylabel("relative force")
    axes[1, 0].set_ylabel("relative heat")
    axes[0, 0].legend(frameon=False)
    figure.savefig(path)


if __name__ == "__main__":
    main()
