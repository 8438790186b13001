"""Writes docs/scenes/*.md and docs/cases.md: `python docs/site/scenes.py`.

A scene's page is what the comment at the head of its file says, with the picture and the number that
docs/images/make_gallery.py put into README.md.  The table of cases has names and sources from here, expected values and
tolerances from tests/expected.toml, and the tests that read them; what a run of ours gave is that of README.md.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
SCENES, PAGE = ROOT / "docs/scenes", ROOT / "docs/cases.md"
ROW = re.compile(r"^\| <img [^>]*> \| \[`(?P<name>\w+)`\]\(\S+\) (?P<says>.*?) \| (?P<number>.*?) \| "
                 r"(?P<reference>.*?) \|$", re.M)
LABEL = re.compile(r"[A-Z][\w ]*:\s")
MADE = "<!-- made by docs/site/scenes.py -->"


@dataclass(frozen=True)
class Row:
    """A scene of the gallery: what it is, one number of a run of ours, and what it is compared with."""

    name: str
    says: str
    number: str
    reference: str

    @property
    def error(self) -> str:
        """The relative difference of the two numbers, where both are one."""
        ours, theirs = (re.search(r"-?\d+(?:\.\d+)?(?= ?(?:°C|K|mm|J|,|$))", text)
                        for text in (self.number.rpartition(":")[2], self.reference))
        if ours is None or theirs is None or float(theirs[0]) == 0.0:
            return ""
        off = abs(float(ours[0]) / float(theirs[0]) - 1.0)
        return f"{off:.1g}" if off else "none in the digits shown"


@dataclass(frozen=True)
class Case:
    """A case with a known answer.  code : its part of tests/expected.toml.  values : what is compared -> its key."""

    name: str
    source: str
    code: str
    values: tuple[tuple[str, str], ...]
    tolerance: str = "tolerance"


CASES = (
    Case("slab cooled by convection", "Heisler's charts; series", "A1",
         (("theta at centre and surface, Bi 1, Fo 0.5 and 1", "Bi_1.theta"), ("Bi 10, Fo 0.2 and 0.5", "Bi_10.theta"))),
    Case("slab, its faces stepped", "series", "A2", (("theta at the centre, Fo 0.05 to 0.5", "centre"),)),
    Case("radiating rod", "NAFEMS T2", "A4", (("cold end [K]", "T_B"), ("flux [W/m2]", "q"))),
    Case("rod under an oscillating temperature", "NAFEMS T3", "A5", (("T at 0.08 m, 32 s [°C]", "expected"),),
         "tolerance_refined"),
    Case("plate with films on two sides", "NAFEMS T4", "A6", (("T at (0.6, 0.2) m [°C]", "expected"),)),
    Case("slab, k rises with T", "closed form", "A7", (("flux [W/m2]", "q"), ("T in the middle", "T_half"))),
    Case("freezing half-space", "two-phase Stefan problem, closed form", "A9",
         (("front at 10 s [m]", "front"), ("flux into the wall [W/m2]", "q_wall")), "tolerance_front"),
    Case("lumped body that radiates", "closed form", "A10", (("T at 100, 500, 2000 s, to 0 K", "to_0"),
                                                            ("to 300 K", "to_300"))),
    Case("lumped body in free convection", "closed form", "A11", (("difference of temperatures [K]", "dT"),)),
    Case("flux into a body whose k and c rise with T", "Kirchhoff's transformation and series", "A17",
         (("T at 0, 1, 2 m; t 0.5 and 1", "T"),)),
    Case("thermal shock of a wall", "series", "A18", (("T at 0.2", "T_02"), ("T at 0.8", "T_08"))),
    Case("half-space under a constant flux", "closed form", "A20", (("T at 25 mm, 30 s [°C]", "expected"),)),
    Case("validation problems of TOPAZ2D", "TOPAZ2D manual", "A21", (("slope under radiation", "slope"),
                                                                   ("T where k = 1 + T", "T_0")), ""),
    Case("two bars in series", "closed form", "D1", (("flux [W/m2]", "q"), ("faces [K]", "T1"), ("", "T2"))),
    Case("two half-spaces with a conductance", "closed form", "D2", (("flux at 1, 10, 100 s [W/m2]", "q"),
                                                                    ("faces at 10 s [K]", "T_10"))),
    Case("conductance under pressure", "Cooper, Mikic and Yovanovich", "D6",
         (("h at 0.1, 1, 10 MPa [W/m2K]", "expected"),)),
    Case("rarefied gas in a gap", "temperature jump at the walls", "D7", (("h at 0 to 500 µm [W/m2K]", "expected"),)),
    Case("radiation of parallel planes", "closed form", "D8", (("flux [W/m2]", "q"),)),
    Case("rod with a clearance law", "closed form", "D9", (("free end [K]", "T_B"), ("gap [m]", "d"))),
    Case("frictional heat of two half-spaces", "closed form", "D10", (("rise at 1 and 10 s [K]", "dT"),
                                                                     ("share to the steel", "share")), ""),
    Case("rod that closes its gap", "solution of the one-dimensional problem", "D13",
         (("touch [s]", "t_touch"), ("tip at 50 to 400 s [K]", "T")), "event_tolerance"),
    Case("thick cylinder, hot inside", "closed form", "B1", (("hoop stress inside and outside [Pa]", "s_th_a"),
                                                            ("", "s_th_b"))),
    Case("thick cylinder, nearly incompressible", "Lamé", "B2", (("u(a), nu 0.3 to 0.499999 [m]", "u_a"),)),
    Case("tapered cylinder and sphere, heated", "NAFEMS LE11", "B3", (("axial stress at A [Pa]", "s_zz_A"),), ""),
    Case("bimetal strip", "Timoshenko", "B5", (("curvature [1/m]", "curvature"),)),
    Case("elastica", "elliptic integrals", "B6", (("deflection over length, PL²/EI 1, 2, 10", "w_L"),)),
    Case("Cook's membrane", "converged value", "B8", (("deflection", "v"),)),
    Case("bar heated between walls, plastic", "closed form", "B9", (("stress hot and cooled [Pa]", "heated"),
                                                                   ("", "cooled")), ""),
    Case("necking bar", "Considère's construction", "B10", (("greatest load [N]", "load"),)),
    Case("plastic heating", "closed form", "B11", (("rise [K]", "rise"), ("with softening", "rise_softening")), ""),
    Case("relaxation by creep", "Norton, closed form", "B12", (("stress at 1e3, 1e5, 1e6 s [Pa]", "stress"),), ""),
    Case("superplastic sheet", "membrane, a circular arc", "B14", (("height at 100 and 300 s [m]", "height"),
                                                                  ("pressure [Pa]", "p"))),
    Case("steel cylinder on a steel plane", "Hertz", "C3.steel", (("half-width [m]", "a"), ("pressure [Pa]", "p0"))),
    Case("aluminium cylinder on a rigid plane", "Hertz", "C3.aluminium", (("half-width [m]", "a"),
                                                                         ("pressure [Pa]", "p0"))),
    Case("partial slip under a shear force", "Cattaneo", "Cattaneo", (("stick over contact width", "c_over_a"),)),
    Case("wedge with friction", "NAFEMS CGS-4", "C5", (("force over weight", "F_over_G"),)),
    Case("lumped body and its gap", "closed form", "E4", (("T at rest [K]", "T"), ("gap [m]", "g")), ""),
    Case("the same, from 840 K", "exact solution", "E8", (("T at 20 s [K]", "T"),), ""),
    Case("thermal shock of an elastic half-space", "Danilovskaya", "E2", (("position, time, stress", "stress"),)),
    Case("rod in contact that loses stability", "Barber", "E3a", (("growth rates", "l1"),), ""),
    Case("sliding blocks at rest", "PALM2D paper, section 3.1; closed form", "F1",
         (("lower block at 2500 s [°C]", "closed_form_2500"),), ""),
)


def gallery() -> list[Row]:
    """The scenes of README.md."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return [Row(**match.groupdict()) for match in ROW.finditer(text)]


def head(path: Path) -> list[str]:
    """The comment at the head of a scenario."""
    found = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        found.append(line[1:].removeprefix(" ").rstrip())
    return found


def told(lines: list[str]) -> Iterator[str]:
    """The comment as a page has it: prose as it is, what is laid out by blanks as it stands."""
    paragraph: list[str] = []
    for line in [*lines, ""]:
        if line:
            paragraph.append(line)
        elif paragraph:
            laid_out = any(one.startswith(" ") or LABEL.match(one) for one in paragraph)
            yield "\n".join(["```text", *paragraph, "```"] if laid_out else paragraph)
            paragraph = []


def scene_page(row: Row) -> str:
    """The page of one scene."""
    file = f"../../scenarios/{row.name}.yaml"
    table = ["| number of a run | reference | relative difference |", "|---|---|---|",
             f"| {row.number} | {row.reference} | {row.error or 'not a number beside another'} |"]
    return "\n\n".join([MADE, f"# {row.name}", f"![{row.says}](../images/gallery/{row.name}.png)", row.says,
                        *told(head(ROOT / "scenarios" / f"{row.name}.yaml")), "\n".join(table),
                        f"The whole scenario: [{row.name}.yaml]({file}). Run it, and open its page:",
                        f"```\nslideline run scenarios/{row.name}.yaml --report\n```"]) + "\n"


def looked_up(expected: dict[str, Any], case: Case, key: str) -> Any:
    """A value of tests/expected.toml."""
    found: Any = expected
    for part in filter(None, f"{case.code}.{key}".split(".")):
        found = found[part]
    return found


def written(value: Any) -> str:
    """A value, or a list of values, in words."""
    if isinstance(value, list):
        return ", ".join(f"({written(one)})" if isinstance(one, list) else written(one) for one in value)
    return f"{value:.10g}"


def tests_of(code: str) -> list[str]:
    """The files of tests that read a case, by name."""
    name = f'"{code.partition(".")[0]}"'
    return sorted(str(path.relative_to(ROOT)) for path in (ROOT / "tests").rglob("test_*.py")
                  if name in path.read_text(encoding="utf-8"))


def cases_page() -> str:
    """The page of all cases."""
    expected = tomllib.loads((ROOT / "tests/expected.toml").read_text(encoding="utf-8"))
    lines = ["| case | source | expected | tolerance in its test | tests |", "|---|---|---|---|---|"]
    for case in CASES:
        values = "; ".join(f"{name}: {written(looked_up(expected, case, key))}" if name else
                           written(looked_up(expected, case, key)) for name, key in case.values)
        tolerance = written(looked_up(expected, case, case.tolerance)) if (
            case.tolerance and case.tolerance in looked_up(expected, case, "")) else "in the test"
        tests = ", ".join(f"`{name}`" for name in tests_of(case.code))
        lines.append(f"| {case.name} | {case.source} | {values} | {tolerance} | {tests} |")
    ours = ["| scene | ours | reference | relative difference |", "|---|---|---|---|"]
    ours += [f"| [`{row.name}`](scenes/{row.name}.md) | {row.number} | {row.reference} | {row.error} |"
             for row in gallery()]
    return "\n\n".join([
        MADE, "# Cases with known answers",
        "Each case of the first table has an answer that does not come from Slideline: a closed form, a published "
        "value, or a fine solution of a simpler problem. Values and tolerances are those of `tests/expected.toml`, "
        "which the tests read; what a "
        "test compares, and why its tolerance is what it is, stands in the test.", "\n".join(lines),
        "## Numbers of the scenes\n\nWhat the runs gave that made the pictures of [the first page](../README.md):",
        "\n".join(ours)]) + "\n"


def pages() -> dict[Path, str]:
    """Every page that is made here, by its path."""
    return {**{SCENES / f"{row.name}.md": scene_page(row) for row in gallery()}, PAGE: cases_page()}


if __name__ == "__main__":
    SCENES.mkdir(exist_ok=True)
    for path, text in pages().items():
        path.write_text(text, encoding="utf-8")
