"""The rows of random scenes as a table in Markdown: outcomes, laws, features, reasons, and keys that were drawn."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from coupler.scenario.versions import json_schema

CRASHED, HUNG = "crashed", "hung"
OUTCOMES = ("completed", "failed", "refused", CRASHED, HUNG)
NAME = "NAME"
ROWS_OF_REASONS, ROWS_OF_FINDINGS = 25, 60
Row = Mapping[str, Any]


def written(rows: Sequence[Row]) -> str:
    """All tables of these rows (random_scenes.py), as one page."""
    parts = [_outcomes(rows), _laws(rows), _findings(rows)]
    parts += [_reasons(rows, outcome, title) for outcome, title in (
        ("refused", "Refused by the check"), ("failed", "Failed with a message"), (CRASHED, "Crashed"), (HUNG, "Hung"))]
    parts += [_features(rows), _coverage(rows)]
    return "\n\n".join(p for p in parts if p)


def compared(before: Sequence[Row], after: Sequence[Row]) -> str:
    """Outcomes, laws and features of the same seeds before and after, side by side; keys that were drawn, once."""
    sides = (before, after)
    outcomes = [[name, len(rows), *(Counter(row["outcome"] for row in rows)[o] for o in OUTCOMES),
                 sum(verdict(row) == "warned" for row in rows), _share(rows)]
                for name, rows in zip(("before", "after"), sides, strict=True)]
    laws = []
    for name in sorted({r["invariant"] for rows in sides for row in rows for r in row["rows"]}):
        own = [Counter(r["verdict"] for row in rows for r in row["rows"] if r["invariant"] == name) for rows in sides]
        laws.append([name, *(cell for count in own for cell in (count.total(), count["warned"], count["silent"]))])
    features = []
    for name in sorted({f for rows in sides for row in rows for f in row["features"]}):
        own_rows = [[row for row in rows if name in row["features"]] for rows in sides]
        features.append([name, *(cell for rows in own_rows for cell in (
            len(rows), sum(row["outcome"] == "completed" for row in rows), _share(rows)))])
    both = [f"{what} {when}" for when in ("before", "after") for what in ("asked", "warned", "SILENT")]
    each = [f"{what} {when}" for when in ("before", "after") for what in ("scenes", "completed", "SILENT")]
    return "\n\n".join([_table(["", "scenes", *OUTCOMES, "warned", "SILENT"], outcomes), _table(["law", *both], laws),
                        _table(["feature", *each], features), _coverage([*before, *after])])


def _share(rows: Sequence[Row]) -> str:
    silent = sum(verdict(row) == "silent" for row in rows)
    return f"{silent} ({100 * silent / len(rows):.0f} %)" if silent else "0"


def verdict(row: Row) -> str:
    """The worst of a scene: silent, warned or holds; "" where no law was asked."""
    found = {r["verdict"] for r in row["rows"]}
    return next((v for v in ("silent", "warned", "holds") if v in found), "")


def _table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell).replace("|", "\\|").replace("\n", " ") for cell in line) + " |"
                     for line in lines)


def _outcomes(rows: Sequence[Row]) -> str:
    seeds = [row["seed"] for row in rows]
    title = f"# Random scenes: seeds {min(seeds)} to {max(seeds)}" if seeds else "# Random scenes: none"
    count = Counter(row["outcome"] for row in rows)
    worst = Counter(verdict(row) for row in rows)
    return title + "\n\n" + _table(
        ["scenes", *OUTCOMES, "with a law that was warned of", "SILENT", "CPU s a scene"],
        [[len(rows), *(count[o] for o in OUTCOMES), worst["warned"], worst["silent"],
          f"{sum(row['seconds'] for row in rows) / max(len(rows), 1):.1f}"]])


def _laws(rows: Sequence[Row]) -> str:
    asked = [(row["seed"], r) for row in rows for r in row["rows"] if r["verdict"] != "not drawn"]
    lines = []
    for name in sorted({r["invariant"] for _, r in asked}):
        own = [(seed, r) for seed, r in asked if r["invariant"] == name]
        count = Counter(r["verdict"] for _, r in own)
        seed, worst = max(own, key=lambda found: found[1]["size"])
        lines.append([name, len(own), count["holds"], count["warned"], count["silent"],
                      f"{worst['size']:.3g} (seed {seed})" if worst["size"] > 0.0 else ""])
    return "## Laws\n\n" + _table(["law", "asked", "holds", "warned", "SILENT", "worst, in tolerances"], lines)


def _findings(rows: Sequence[Row]) -> str:
    found = sorted((r["invariant"], -r["size"], row["seed"], r["what"]) for row in rows for r in row["rows"]
                   if r["verdict"] == "silent")
    if not found:
        return ""
    more = f"\n\nand {len(found) - ROWS_OF_FINDINGS} more" if len(found) > ROWS_OF_FINDINGS else ""
    return "## Broken in silence\n\n" + _table(["law", "seed", "size", "what"], [
        [name, seed, f"{-size:.3g}", what] for name, size, seed, what in found[:ROWS_OF_FINDINGS]]) + more


def reason(message: str) -> str:
    """A message without its numbers, quoted values and places, so that equal reasons are one."""
    text = re.sub(r"/\S+/", "", message.strip().splitlines()[0] if message.strip() else "no message")
    text = re.sub(r"'[^']*'|\"[^\"]*\"", "'...'", text)
    return re.sub(r"[-+]?\d+(\.\d*)?([eE][-+]?\d+)?", "#", text)[:160]


def _reasons(rows: Sequence[Row], outcome: str, title: str) -> str:
    own = [row for row in rows if row["outcome"] == outcome]
    if not own:
        return ""
    seeds: dict[str, list[int]] = {}
    for row in own:
        seeds.setdefault(reason(row["message"]), []).append(row["seed"])
    lines = sorted(seeds.items(), key=lambda item: -len(item[1]))
    more = f"\n\nand {len(lines) - ROWS_OF_REASONS} more reasons" if len(lines) > ROWS_OF_REASONS else ""
    table = _table(["reason", "scenes", "seeds"], [
        [text, len(found), ", ".join(map(str, found[:5]))] for text, found in lines[:ROWS_OF_REASONS]])
    return f"## {title}: {len(own)}\n\n{table}{more}"


def _features(rows: Sequence[Row]) -> str:
    lines = []
    for name in sorted({f for row in rows for f in row["features"]}):
        own = [row for row in rows if name in row["features"]]
        count, worst = Counter(row["outcome"] for row in own), Counter(verdict(row) for row in own)
        lines.append([name, len(own), *(count[o] for o in OUTCOMES[:3]), worst["warned"], worst["silent"]])
    return "## Features\n\n" + _table(["feature", "scenes", *OUTCOMES[:3], "warned", "SILENT"], lines) if lines else ""


def declared(schema: Mapping[str, Any] | None = None) -> set[str]:
    """The dotted keys that a scenario may have: NAME for what its author names, lists without numbers.

    schema : a JSON Schema; default: that of a scenario file.
    """
    schema = json_schema() if schema is None else schema
    return set(_keys(schema, schema.get("$defs", {}), "", ()))


def _keys(node: Any, classes: Mapping[str, Any], way: str, inside: tuple[str, ...]) -> Iterator[str]:
    """Keys below a node.  inside : classes it is part of; one that holds itself is gone into once."""
    if isinstance(node, list):
        for part in node:
            yield from _keys(part, classes, way, inside)
        return
    if not isinstance(node, Mapping):
        return
    if "$ref" in node and (name := node["$ref"].rpartition("/")[2]) not in inside:
        yield from _keys(classes[name], classes, way, (*inside, name))
    for word in ("anyOf", "oneOf", "allOf", "items", "prefixItems"):
        yield from _keys(node.get(word, []), classes, way, inside)
    for key, value in node.get("properties", {}).items():
        yield (here := f"{way}.{key}" if way else key)
        yield from _keys(value, classes, here, inside)
    named = [node["additionalProperties"]] if isinstance(node.get("additionalProperties"), Mapping) else []
    for value in (*node.get("patternProperties", {}).values(), *named):
        yield (here := f"{way}.{NAME}" if way else NAME)
        yield from _keys(value, classes, here, inside)


def _matching(keys: set[str]) -> Callable[[str], set[str]]:
    """From a key that was drawn, with names that its author chose, to the declared ones it may be."""
    patterns = {key: re.compile(r"\.".join(r"[^.]+" if part == NAME else re.escape(part) for part in key.split(".")))
                for key in keys if NAME in key}

    def found(drawn: str) -> set[str]:
        return {drawn} if drawn in keys else {key for key, pattern in patterns.items() if pattern.fullmatch(drawn)}

    return found


def _coverage(rows: Sequence[Row]) -> str:
    keys = declared()
    matching = _matching(keys)
    drawn = set().union(*(matching(key) for key in {k for row in rows for k in row["keys"]}))
    never = sorted(keys - drawn)
    groups: dict[str, list[str]] = {}
    for key in never:
        if key.rpartition(".")[0] not in never:  # what is below a key that was not drawn goes without saying
            groups.setdefault(key.split(".")[0], []).append(key)
    of_all, of_drawn = (Counter(k.split(".")[0] for k in some) for some in (keys, drawn))
    lines = [[name, of_all[name], of_drawn[name], ", ".join(f"`{k}`" for k in groups.get(name, ()))]
             for name in sorted(of_all)]
    return (f"## Keys: {len(drawn)} of {len(keys)} drawn\n\n"
            + _table(["part", "declared", "drawn", "never drawn (and all below)"], lines))
