"""What a run kept of its conditions, sorted and in words: heat and force by name."""

from __future__ import annotations

from collections.abc import Sequence

from coupler.record.results import ConditionSeries, Results, depth_of

WORDS = {"temperature": "prescribed temperature", "convection": "convection", "radiation": "radiation", "flux": "flux",
         "source": "heat source", "contact pair": "contact pair", "pressure": "pressure",
         "moment": "moment", "angle": "prescribed angle", "gravity": "gravity"}
BY_LETTER = {"u": "prescribed displacement", "t": "traction", "f": "force", "b": "body force"}
# Heat by mechanism that conditions and sources give.
GIVEN = ("temperature.in", "temperature.out", "flux", "convection", "radiation", "source")
NOT_NAMED = 1e-9  # of the largest heat: less is round-off, not a condition without a name
LISTED = 8  # conditions of a line on the console


def by_kind(results: Results) -> tuple[list[ConditionSeries], ...]:
    """Return heats of conditions and sources, heats of pairs, forces, moments."""
    found: tuple[list[ConditionSeries], ...] = ([], [], [], [])
    for series in results.conditions.values():
        start, _, _ = series.of.name.partition(".")
        pair = start == "heat" and len(series.of.parts) > 1
        found[1 if pair else ("heat", "", "reaction", "reaction_moment").index(start)].append(series)
    return found


def kind_of(series: ConditionSeries) -> str:
    """Return what a condition is, in words."""
    return WORDS.get(series.of.kind) or BY_LETTER[series.of.kind[0]]


def short_name(series: ConditionSeries) -> str:
    """Return the name that the scenario gives it."""
    return series.of.name.rpartition(".")[2]


def not_named(results: Results) -> float:
    """Return what conditions without a name gave [J]; 0 where they gave nothing."""
    given = [results.ledger.get(n, 0.0) for n in GIVEN]
    rest = sum(given) - sum(float(c.values[-1]) for c in by_kind(results)[0])
    return rest if abs(rest) > NOT_NAMED * max(abs(v) for v in given) else 0.0


def condition_lines(results: Results) -> list[str]:
    """Return a line on heat and one on force, of the conditions that have a name; none where nothing has one."""
    if not len(results.t):
        return []
    heats, _, forces, moments = by_kind(results)
    depth, lines = depth_of(results), []
    if heats:
        said = [f"{_where(c)} {c.values[-1]:.5g} J" for c in heats]
        lines.append(f"  heat into the bodies, {depth}: {_listed(said)}")
    if forces or moments:
        said = [f"{_where(c)} {c.values[-1][0]:.5g}, {c.values[-1][1]:.5g} N" for c in forces]
        said += [f"{_where(c)} {c.values[-1]:.5g} N m" for c in moments]
        lines.append(f"  force on the bodies at the end, {depth}: {_listed(said)}")
    return lines


def _where(series: ConditionSeries) -> str:
    name = short_name(series)
    return f"source of {name}" if series.of.kind == "source" else f"{name} ({series.of.place})"


def _listed(said: Sequence[str]) -> str:
    more = f"; {len(said) - LISTED} more in the report" if len(said) > LISTED else ""
    return "; ".join(said[:LISTED]) + more
