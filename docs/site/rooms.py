"""Draws the rooms of the packages and who imports whom: `python docs/site/rooms.py` writes docs/images/rooms.svg.

A room is a folder of the packages; an entry file is one that only the outside imports or runs, drawn by itself above
its room.  An arrow is an import; those that others imply are left out.  tests/test_imports.py compares ROOMS and ARROWS
with the imports of the sources, and the picture with them.
"""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from pathlib import Path

PICTURE = Path(__file__).resolve().parents[1] / "images" / "rooms.svg"


@dataclass(frozen=True)
class Room:
    """A box of the picture.  floor : from the top.  column : from the left.  says : one sentence in two lines."""

    floor: int
    column: int
    says: tuple[str, str]
    entry: bool = False


ROOMS = {
    "coupler/__init__.py": Room(0, 1, ("the public names of a run:", "from coupler import run"), entry=True),
    "coupler/cli": Room(0, 0, ("the command slideline,", "its options and its messages")),
    "coupler/init": Room(2, 0, ("a new scenario from", "a template or a deck")),
    "coupler/experiments": Room(3, 1, ("many runs of one scenario:", "studies and advice")),
    "coupler/deck": Room(3, 0, ("an Abaqus or CalculiX deck", "becomes a scenario")),
    "coupler/running": Room(4, 0, ("a run as its user holds it:", "set up, stepped, resumed")),
    "coupler/verify": Room(5, 1, ("checks a half against", "the interface specification")),
    "coupler/report": Room(5, 0, ("the HTML page of a run", "and of a comparison")),
    "coupler/record": Room(6, 0, ("what a run writes, keeps", "and gives back")),
    "coupler/control": Room(7, 0, ("window after window: sizes,", "events, errors, acceptance")),
    "coupler/trust/table": Room(7, 2, ("what can be wrong in a run,", "asked in every window")),
    "coupler/trust/in_time": Room(8, 0, ("errors in time: of windows,", "exchange, instants")),
    "coupler/trust/in_space": Room(8, 1, ("errors in space: what cells", "are too large for")),
    "coupler/trust/laws": Room(8, 2, ("balances, equations solved,", "data not left")),
    "coupler/trust/surfaces": Room(8, 3, ("what surfaces do to each other,", "and skip on their way")),
    "coupler/trust": Room(9, 1, ("a check: its number, limit,", "verdict and remedy")),
    "coupler/rules": Room(9, 0, ("conditions on monitors,", "and what they change")),
    "coupler/schemes": Room(10, 0, ("one window: order, exchange,", "iteration, acceleration")),
    "coupler/fmu": Room(11, 0, ("halves behind FMI, in this", "process or another")),
    "coupler/scenario": Room(12, 0, ("YAML, checked and meshed;", "the files of each half, in SI")),
    "coupler": Room(13, 0, ("errors.py: the errors that", "a user may see")),
    "thermal_fmu/build.py": Room(11, 1, ("python -m thermal_fmu.build:", "the FMU of heat"), entry=True),
    "thermal_fmu/stations": Room(12, 1, ("heat on columns of rods", "and on whole bodies")),
    "thermal_fmu": Room(13, 1, ("heat on cells", "")),
    "mechanical_fmu/build.py": Room(11, 2, ("python -m mechanical_fmu.build:", "the FMU of mechanics"), entry=True),
    "mechanical_fmu": Room(12, 2, ("equilibrium and motion", "of bodies")),
    "mechanical_fmu/laws": Room(13, 2, ("how materials flow: hardening,", "creep, liquid")),
    "contact/half/__init__.py": Room(13, 3, ("what a half is made with:", "from contact.half import Done"), entry=True),
    "contact/half": Room(14, 1, ("what every half is made of,", "and its FMI face")),
    "contact/rpc": Room(15, 1, ("calls that reach the service", "once, here or over zenoh")),
    "contact": Room(16, 1, ("geometry, laws, forces, and", "the service that answers")),
    "contact/problem": Room(17, 1, ("the one declaration of a", "scene: keys, units, bounds")),
}

ARROWS = (
    ("coupler/__init__.py", "coupler/running"),
    ("coupler/cli", "coupler/experiments"),
    ("coupler/cli", "coupler/init"),
    ("coupler/running", "coupler/verify"),
    ("coupler/verify", "coupler/trust"),
    ("coupler/verify", "coupler/fmu"),
    ("coupler/init", "coupler/deck"),
    ("coupler/deck", "coupler/running"),
    ("coupler/experiments", "coupler/running"),
    ("coupler/experiments", "coupler/report"),
    ("coupler/running", "coupler/record"),
    ("coupler/report", "coupler/record"),
    ("coupler/record", "coupler/control"),
    ("coupler/record", "coupler/trust/table"),
    ("coupler/control", "coupler/trust/in_time"),
    ("coupler/control", "coupler/trust/surfaces"),
    ("coupler/trust/table", "coupler/trust/in_time"),
    ("coupler/trust/table", "coupler/trust/in_space"),
    ("coupler/trust/table", "coupler/trust/laws"),
    ("coupler/trust/table", "coupler/trust/surfaces"),
    ("coupler/trust/in_time", "coupler/trust"),
    ("coupler/trust/in_time", "coupler/schemes"),
    ("coupler/trust/in_space", "coupler/trust"),
    ("coupler/trust/in_space", "coupler/schemes"),
    ("coupler/trust/laws", "coupler/trust"),
    ("coupler/trust/laws", "coupler/schemes"),
    ("coupler/trust/surfaces", "coupler/trust"),
    ("coupler/trust/surfaces", "coupler/schemes"),
    ("coupler/control", "coupler/rules"),
    ("coupler/rules", "coupler/schemes"),
    ("coupler/schemes", "coupler/fmu"),
    ("coupler/fmu", "coupler/scenario"),
    ("coupler/scenario", "coupler"),
    ("coupler/scenario", "contact/half"),
    ("thermal_fmu/build.py", "thermal_fmu/stations"),
    ("thermal_fmu/stations", "thermal_fmu"),
    ("thermal_fmu", "contact/half"),
    ("mechanical_fmu/build.py", "mechanical_fmu"),
    ("mechanical_fmu", "mechanical_fmu/laws"),
    ("mechanical_fmu/laws", "contact/half"),
    ("contact/half/__init__.py", "contact/half"),
    ("contact/half", "contact/rpc"),
    ("contact/rpc", "contact"),
    ("contact", "contact/problem"),
)

LEGEND = ("An arrow is an import. A room may import", "every room it reaches along the arrows,", "and no other.",
          "Dashed: an entry file, which users import", "or run, and no other file imports.")

# [px]
WIDTH, HEIGHT, GAP_X, GAP_Y, MARGIN = 226, 56, 22, 22, 8
PAPER, LINE, INK, FADED, FILL = "#ffffff", "#546e7a", "#263238", "#5a6b73", "#eceff1"


def left_top(room: Room) -> tuple[int, int]:
    """The upper left corner of a box [px]."""
    return MARGIN + room.column * (WIDTH + GAP_X), MARGIN + room.floor * (HEIGHT + GAP_Y)


def route(source: Room, target: Room) -> str:
    """The path of an arrow: down from its source, past boxes in the way, and down into its target."""
    (x0, y0), (x1, y1) = left_top(source), left_top(target)
    x0, y0, x1 = x0 + WIDTH // 2, y0 + HEIGHT, x1 + WIDTH // 2
    if x0 == x1 and target.floor == source.floor + 1:
        return f"M{x0} {y0}V{y1}"
    blocked = any(r.column == source.column and source.floor < r.floor < target.floor for r in ROOMS.values())
    lane = x0 + (WIDTH + GAP_X) // 2 if blocked else x0
    return f"M{x0} {y0}V{y0 + GAP_Y // 2}H{lane}V{y1 - GAP_Y // 2}H{x1}V{y1}"


def svg() -> str:
    """The picture."""
    corners = [left_top(room) for room in ROOMS.values()]
    width, height = max(x for x, _ in corners) + WIDTH + MARGIN, max(y for _, y in corners) + HEIGHT + MARGIN
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        'font-family="Helvetica, Arial, sans-serif" font-size="13">',
        "<title>The rooms of the packages, and who imports whom</title>",
        f'<defs><marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        f'<path d="M0 0L8 4L0 8Z" fill="{LINE}"/></marker></defs>',
        f'<rect width="{width}" height="{height}" fill="{PAPER}"/>',
    ]
    for source, target in ARROWS:
        lines.append(f'<path d="{route(ROOMS[source], ROOMS[target])}" fill="none" stroke="{LINE}" stroke-width="1.2" '
                     'marker-end="url(#head)"/>')
    for name, room in ROOMS.items():
        x, y = left_top(room)
        dashes, fill = (' stroke-dasharray="5 3"', PAPER) if room.entry else ("", FILL)
        lines.append(f'<rect x="{x}" y="{y}" width="{WIDTH}" height="{HEIGHT}" rx="4" fill="{fill}" '
                     f'stroke="{LINE}"{dashes}/>')
        lines.append(f'<text x="{x + 9}" y="{y + 18}" font-weight="bold" font-size="14" fill="{INK}">'
                     f"{escape(name)}</text>")
        lines += [f'<text x="{x + 9}" y="{y + 34 + 15 * i}" fill="{FADED}">{escape(line)}</text>'
                  for i, line in enumerate(room.says) if line]
    x, y = left_top(Room(0, 2, ("", "")))
    lines += [f'<text x="{x + 9}" y="{y + 16 + 18 * i}" fill="{INK}">{escape(line)}</text>'
              for i, line in enumerate(LEGEND)]
    return "\n".join([*lines, "</svg>", ""])


if __name__ == "__main__":
    PICTURE.write_text(svg(), encoding="utf-8")
