"""What companions say of a run, in its results file: one group a probe, and a row of the trust table."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import h5py

from coupler.errors import ResultsError
from coupler.record.checksums import FORMAT_BOUNDS, close_texts, put
from coupler.trust.in_time.confidence import NAME, ProbeConfidence, check

GROUP = "confidence"
ATTRIBUTES = ("by", "order", "expected", "range", "unit", "failed")


def write_confidence(path: Path, found: Mapping[str, ProbeConfidence]) -> None:
    """Put the errors of probes into a results file, in the place of earlier ones.

    Raises ResultsError where it cannot be written.
    """
    try:
        with h5py.File(path, "r+", libver=FORMAT_BOUNDS) as f:
            if GROUP in f:
                del f[GROUP]
            group = f.create_group(GROUP, track_order=True)
            for name, of in found.items():
                put(group, name, of.error).attrs.update({a: getattr(of, a) for a in ATTRIBUTES})
            totals = json.loads(f.attrs["totals"])
            rows = [row for row in totals.get("trust", ()) if row["name"] != NAME]
            f.attrs["totals"] = json.dumps({**totals, "trust": [check(found).as_dict(), *rows]})
            close_texts(f)
    except OSError as exc:
        raise ResultsError(f"{path}: what companions say of it cannot be written ({exc})") from exc


def read_confidence(f: h5py.File) -> dict[str, ProbeConfidence]:
    """Return the errors of probes, by probe; empty where no companion ran."""
    return {name: ProbeConfidence(str(d.attrs["by"]), d[()], float(d.attrs["order"]), int(d.attrs["expected"]),
                                  float(d.attrs["range"]), str(d.attrs["unit"]), str(d.attrs["failed"]))
            for name, d in f.get(GROUP, {}).items()}
