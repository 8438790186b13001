"""Charts of benchmarks/atlas.py: a panel a case, a row a scheme, a column a window; and the limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

# Okabe and Ito's colours, told apart by every kind of eye; a mark besides, for prints in grey.
COLOURS = {"right": "#0072B2", "iterates": "#56B4E9", "cycles": "#F0E442", "wrong": "#D55E00", "failed": "#000000"}
MARKS = {"right": "", "iterates": "i", "cycles": "~", "wrong": "!", "failed": "x"}
MEANING = {"right": "right", "iterates": "right, some window takes more than 15 iterations",
           "cycles": "goes up and down from window to window", "wrong": "at rest elsewhere, too slow, or growing",
           "failed": "60 iterations do not end, or no number"}
A_FIGURE = 4  # panels


def draw(numbers: Mapping[str, Sequence[Mapping[str, Any]]], titles: Mapping[str, str], folder: Path) -> None:
    """Write atlas_1.svg, atlas_2.svg ... and atlas_limits.svg."""
    import matplotlib

    matplotlib.use("svg")
    from matplotlib import pyplot as plt

    plt.rcParams.update({"font.size": 9, "svg.hashsalt": "atlas"})
    names = list(dict.fromkeys(c["case"] for c in numbers["cells"]))
    for i in range(0, len(names), A_FIGURE):
        part = names[i:i + A_FIGURE]
        figure, axes = plt.subplots((len(part) + 1) // 2, 2, figsize=(10.0, 3.3 * ((len(part) + 1) // 2) + 0.5),
                                    squeeze=False, layout="constrained")
        for axis, name in zip(axes.flat, part, strict=False):
            _panel(axis, [c for c in numbers["cells"] if c["case"] == name], titles[name])
        for axis in axes.flat[len(part):]:
            axis.set_axis_off()
        _legend(figure)
        figure.savefig(folder / f"atlas_{i // A_FIGURE + 1}.svg", metadata={"Date": None})
        plt.close(figure)
    if numbers["limits"]:
        _limits(plt, numbers["limits"], folder / "atlas_limits.svg")


def _panel(axis: Any, cells: Sequence[Mapping[str, Any]], title: str) -> None:
    """Each cell is two halves: left the small disturbance, right the large one."""
    from matplotlib.patches import Rectangle

    ways = list(dict.fromkeys(c["way"] for c in cells))
    factors = sorted({c["factor"] for c in cells})
    for c in cells:
        x = factors.index(c["factor"]) + (0.0 if c["disturbance"] == "small" else 0.47)
        y = len(ways) - 1 - ways.index(c["way"])
        axis.add_patch(Rectangle((x, y), 0.45, 0.9, color=COLOURS[c["outcome"]], linewidth=0))
        axis.text(x + 0.225, y + 0.42, MARKS[c["outcome"]], ha="center", va="center", fontsize=8,
                  color="white" if c["outcome"] in ("failed", "right") else "black")
    axis.set_xlim(-0.1, len(factors) + 0.05)
    axis.set_ylim(-0.1, len(ways))
    axis.set_xticks([i + 0.46 for i in range(len(factors))], [f"{f:g}" for f in factors])
    axis.set_yticks([len(ways) - 1 - i + 0.45 for i in range(len(ways))], ways)
    axis.set_title(title, loc="left", fontsize=9)
    axis.set_xlabel("window / limit" if title[:2] in ("E1", "E4", "E5") or title[:3] == "E3c" else
                    "window / time of conduction")
    axis.tick_params(length=0)
    for side in axis.spines.values():
        side.set_visible(False)


def _legend(figure: Any) -> None:
    from matplotlib.patches import Patch

    figure.legend(handles=[Patch(color=COLOURS[n], label=f"{MARKS[n]}  {MEANING[n]}".strip()) for n in COLOURS],
                  loc="outside lower center", ncols=2, frameon=False,
                  title="left half: disturbance 1e-3 of the range; right half: .3", title_fontsize=9)


def _limits(plt: Any, limits: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Measured over predicted, a row each."""
    figure, axis = plt.subplots(figsize=(7.0, 0.32 * len(limits) + 1.0), layout="constrained")
    rows = range(len(limits))[::-1]
    axis.axvspan(-2.0, 2.0, color="#dddddd", linewidth=0)
    axis.plot([100.0 * (x["measured"] / x["predicted"] - 1.0) for x in limits], list(rows), "o", color="#0072B2")
    axis.set_yticks(list(rows), [f"{x['case']}, {x['scheme']}, {x['method']}: {x['predicted']:.4g}" for x in limits])
    axis.set_xlim(-3.0, 3.0)
    axis.set_xlabel("measured limit less predicted [%]; grey: what is asked for")
    axis.grid(True, axis="x", alpha=0.3)
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)
