"""The gallery of the README: `python docs/images/make_gallery.py FOLDER`, from runs FOLDER/NAME.h5 of all scenes.

Writes gallery/NAME.png beside this file and the table between the marks in README.md: a picture of each scene where its
field says most, one sentence, and one number of that run beside its reference.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from coupler import Results

HERE = Path(__file__).resolve().parent
README = HERE.parents[1] / "README.md"
BEGIN, END = "<!-- gallery: made by docs/images/make_gallery.py -->", "<!-- end of gallery -->"
SIZE, DPI = (3.2, 2.0), 100  # inches, pixels an inch


@dataclass(frozen=True)
class Scene:
    """field, t [s] : what is drawn, None: at the last frame.  number : of a run, in words.  reference : beside it."""

    name: str
    says: str
    field: str
    t: float | None
    number: Callable[[Results], str]
    reference: str


def at(results: Results, probe: str, t: float, unit: str | None = None) -> float:
    return float(np.interp(t, *results.probe(probe, unit)))


def friction(results: Results) -> float:
    return results.ledger["friction.slave"] + results.ledger["friction.master"]


def number(value: float) -> str:
    return f"{value:.1e}" if value else "below round-off"


SCENES = (
    Scene("sliding_blocks", "A hot block is lowered on a cold one, pressed and slid off (PALM2D paper, section 3.1).",
          "thermal.T", 13600.0, lambda r: f"lower block at rest: {at(r, 'lower.top.left', 25000, 'degC'):.3f} °C",
          "18.446 °C, closed form"),
    Scene("aluminium_can", "Aluminium freezes in a steel can and shrinks away from its wall.", "thermal.T", 150.0,
          lambda r: f"relative energy-balance error: {number(r.heat_imbalance)}", "0"),
    Scene("brake_pad", "A steel pad is pressed on a moving disc.", "thermal.T", 1.1,
          lambda r: f"share of the friction heat into the pad: {r.ledger['friction.slave'] / friction(r):.5f}",
          "0.36492, half-spaces"),
    Scene("casting_1d", "Aluminium freezes against a mould; the gap it leaves slows its freezing.", "thermal.f_s", 20.0,
          lambda r: f"solid at 20 s: {at(r, 'rod.solid', 20.0):.4f}", "0.3062, fine one-dimensional solution"),
    Scene("heated_bars", "Two bars in series, pressed together.", "thermal.T", None,
          lambda r: f"face of the hot bar at the end: {r.probe('hot.top')[1][-1]:.5f} K", "454.37262 K, closed form"),
    Scene("hot_upsetting", "A hot billet is upset by 40 % in one second between colder dies.", "thermal.T", 1.1,
          lambda r: f"relative energy-balance error: {number(r.heat_imbalance)}", "0"),
    Scene("lumped_gap", "One temperature and one gap that feed back on each other.", "thermal.T", None,
          lambda r: f"temperature at 20 s: {at(r, 'T', 20.0):.3f} K", "831.719 K, exact solution"),
    Scene("rubbing_block", "A block is dragged along a bar; friction heats both.", "thermal.T", 9.0,
          lambda r: f"friction heat: {friction(r):.0f} J", "3509 J, mu N s"),
    Scene("sealed_container_fire", "Salt in a steel canister grows in a fire and lifts the lid.", "thermal.T", 1200.0,
          lambda r: f"widest gap under the lid: {1e3 * r.probe('seat.gap')[1].max():.3f} mm",
          "1.637 mm, windows of a quarter of the size"),
    Scene("superplastic_bulge", "Gas blows a hot sheet into a die at a constant rate of strain.", "mechanical.sigma_v",
          300.0, lambda r: f"height at 300 s: {1e3 * at(r, 'apex', 300.0):.2f} mm", "34.79 mm, a circular arc"),
)


def main(folder: Path) -> None:
    """Draw all pictures and write the table."""
    (HERE / "gallery").mkdir(exist_ok=True)
    rows = []
    for scene in SCENES:
        results = Results(folder / f"{scene.name}.h5")
        draw(results, scene)
        rows.append((scene, scene.number(results)))
    text = README.read_text("utf-8")
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    lines = ["| scene | | one number | reference |", "|---|---|---|---|"]
    lines += [f"| <img src=\"docs/images/gallery/{s.name}.png\" width=\"200\" alt=\"{s.says}\"> | "
              f"[`{s.name}`](scenarios/{s.name}.yaml) {s.says} | {number} | {s.reference} |" for s, number in rows]
    README.write_text(f"{before}{BEGIN}\n" + "\n".join(lines) + f"\n{END}{after}", encoding="utf-8")


def draw(results: Results, scene: Scene) -> None:
    """The bodies at one time, coloured by a field."""
    t = float(results.field("thermal.T")[0][-1]) if scene.t is None else scene.t
    mesh = results.mesh()
    x, value = mesh.nodes + results.fields("mechanical.u", t=t), results.fields(scene.field, t=t)
    figure = Figure(figsize=SIZE, dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.02, 0.02, 0.96, 0.96))
    on_nodes = len(value) == len(x)
    low, high = float(value.min()), float(value.max())
    first = 0
    if on_nodes:
        halves = np.concatenate([mesh.quads[:, [0, 1, 2]], mesh.quads[:, [0, 2, 3]], mesh.triangles])
        axes.tripcolor(*x.T, halves, value, shading="gouraud", cmap="inferno", vmin=low, vmax=high)
    else:
        for cells in (mesh.quads, mesh.triangles):
            axes.add_collection(PolyCollection(list(x[cells]), array=value[first:first + len(cells)], clim=(low, high),
                                               edgecolors="face", linewidths=0.2, cmap="viridis"))
            first += len(cells)
    axes.add_collection(LineCollection(list(x[mesh.outline()]), colors="#333333", linewidths=0.8))
    axes.autoscale_view()
    axes.set_aspect("equal" if np.ptp(x[:, 0]) < 12 * np.ptp(x[:, 1]) < 144 * np.ptp(x[:, 0]) else "auto")
    axes.axis("off")
    figure.savefig(HERE / "gallery" / f"{scene.name}.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
