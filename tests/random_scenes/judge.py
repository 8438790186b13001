"""What becomes of a seed: its scene is run, and the laws that its story breaks are told from those a warning names."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from random_scenes.draw import generator, scene_of
from random_scenes.invariant import Invariant
from random_scenes.scene import Scene
from random_scenes.story import COMPLETED, Story, told

HOLDS, WARNED, SILENT = "holds", "warned", "silent"
DRAWN = 2  # laws that run scenes of their own, a seed; of those with several forms (frame: shift, turn, ...) one


@dataclass(frozen=True)
class Row:
    """An invariant in a scene.  verdict : holds, warned or silent.  what, size : of the worst that does not hold."""

    invariant: str
    verdict: str
    what: str = ""
    size: float = 0.0


@dataclass(frozen=True)
class Judgement:
    """A seed.  features : words for its table.  keys : dotted keys that its scenario has.

    outcome, message : of its story.  seconds : of CPU that it took.
    """

    seed: int
    features: tuple[str, ...]
    keys: tuple[str, ...]
    outcome: str
    message: str
    rows: tuple[Row, ...]
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)

    @property
    def silent(self) -> tuple[Row, ...]:
        """What was wrong without a word."""
        return tuple(r for r in self.rows if r.verdict == SILENT)


def judged(seed: int, invariants: Sequence[Invariant] | None = None) -> Judgement:
    """Judge the scene of a seed.  invariants : only these; default: all that run nothing, and DRAWN of the others."""
    started = time.process_time()
    scene = scene_of(seed)
    story = told(scene)
    rows: tuple[Row, ...] = ()
    if story.outcome == COMPLETED:
        rng = generator(seed)
        chosen = drawn(scene, rng) if invariants is None else [i for i in invariants if i.applies(scene)]
        rows = tuple(row_of(i, scene, story, rng) for i in chosen)
    return Judgement(seed, features(scene), tuple(sorted(set(keys(scene.doc)))), story.outcome, story.message, rows,
                     time.process_time() - started)


def drawn(scene: Scene, rng: np.random.Generator) -> list[Invariant]:
    """Those that are checked in a scene."""
    from random_scenes.invariants import INVARIANTS  # they import what this file needs

    fit = [i for i in INVARIANTS if i.applies(scene)]
    families: dict[str, list[Invariant]] = {}
    for i in fit:
        if i.runs:
            families.setdefault(i.name.partition(":")[0], []).append(i)
    laws = list(families.values())
    weights = np.array([max(i.weight for i in family) for family in laws])
    picked = []
    if laws:
        for k in rng.choice(len(laws), min(DRAWN, len(laws)), replace=False, p=weights / weights.sum()):
            own = np.array([i.weight for i in laws[k]])
            picked.append(laws[k][rng.choice(len(own), p=own / own.sum())])
    return [i for i in fit if not i.runs] + picked


def row_of(invariant: Invariant, scene: Scene, story: Story, rng: np.random.Generator) -> Row:
    """What an invariant says of a story."""
    found = invariant.check(scene, story, rng)
    if not found:
        return Row(invariant.name, HOLDS)
    silent = [f for f in found if not (f.told_by or story).says(*f.named_by)]
    worst = max(silent or found, key=lambda f: f.size)
    return Row(invariant.name, SILENT if silent else WARNED, worst.what, float(worst.size))


def features(scene: Scene) -> tuple[str, ...]:
    """Words of a scene, by which findings are counted."""
    doc = scene.doc
    coupling, thermal, mechanical = doc["coupling"], doc["thermal"], doc["mechanical"]
    elastic = mechanical.get("elastic", {})
    pairs = scene.pairs.values()
    found = [f"layout {doc['title'].removeprefix('random: ')}", doc["geometry"], f"thermal {thermal['half']}",
             f"mechanical {mechanical['half']}", f"method {thermal['method']}", f"scheme {coupling['scheme']}",
             "adaptive windows" if "adaptive" in coupling else "given windows", f"{len(doc['bodies'])} bodies"]
    found += [f"pair {k}" for k in ("friction", "augmented", "two_pass", "radiation", "penalty", "tied")
              if any(k in p for p in pairs)]
    found += ["pair nodes"] if any(p.get("form") == "nodes" for p in pairs) else []
    found += [f"elastic {k}" for k in ("gravity", "thermoelastic_heat", "dynamics", "element") if k in elastic]
    found += [f"material {k}" for k in ("plastic", "creep", "latent") if any(k in m for m in doc["materials"].values())]
    found += [f"boundary {k}" for k in ("temperature", "flux", "convection", "radiation")
              if any(k in b for b in thermal.get("boundary", ()))]
    found += ["thermal adaptive"] if "adaptive" in thermal else []
    found += ["source"] if any("Q_T" in b for b in doc["bodies"].values()) else []
    return tuple(found)


NAMED = ("materials", "bodies", "contact", "signals", "probes")


def keys(doc: Any, way: tuple[str, ...] = ()) -> Iterator[str]:
    """The dotted keys of a scenario, with NAME for names that its author chose and no numbers of lists."""
    if isinstance(doc, Mapping):
        for key, value in doc.items():
            here = (*way, "NAME" if way and way[-1] in NAMED and len(way) == 1 else str(key))
            yield ".".join(here)
            yield from keys(value, here)
    elif isinstance(doc, (list, tuple)):
        for value in doc:
            yield from keys(value, way)
