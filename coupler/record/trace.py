"""A run as a Chrome trace: what ran when, for Perfetto (ui.perfetto.dev) and chrome://tracing.

Format: Trace Event Format, complete events ("X") in microseconds; a thread is a half or the coupler.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from coupler.errors import ResultsError
from coupler.fmu.metered import CALLS, SIDES
from coupler.record.results import Results

COUPLER = 0  # its thread; the halves come after it, in the order of SIDES
STEP = CALLS.index("advance")
TO_US = 1e6  # seconds to microseconds


def trace_of(results: Results) -> dict[str, Any]:
    """Return the trace of a run: windows, records and the calls of both halves, over the seconds of the run.

    When a message was on its way is not known, but for how long: half of it stands before a step's work and
    half behind it.  Raises ResultsError for a run of which no calls are known.
    """
    if not len(results.timings):
        raise ResultsError(f"{results.path}: it holds no timings (its run was made by an earlier version, or ended "
                           "before its second window)")
    events: list[dict[str, Any]] = [
        {"ph": "M", "name": "process_name", "pid": 1, "tid": COUPLER, "args": {"name": results.header["title"]}},
        *({"ph": "M", "name": "thread_name", "pid": 1, "tid": k, "args": {"name": name}}
          for k, name in enumerate(("coupler", *(f"{side} half" for side in SIDES))))]
    w, timings = results.windows, results.timings
    for k in np.flatnonzero(np.isfinite(timings.begun)):
        row, begun = timings[k], float(timings.begun[k])
        events.append(_event("window" if w.taken[k] else f"window, {w.verdict[k]}", COUPLER, begun, row.seconds, {
            "row": int(k), "t [s]": float(w.t[k]), "H [s]": float(w.H[k]), "scheme": str(w.scheme[k]),
            "verdict": str(w.verdict[k]), "iterations": int(w.iterations[k]), "requests": int(row.requests)}))
        events.append(_event("record", COUPLER, begun + row.seconds, row.record))
    for call in results.calls:
        tid, begun = int(call.side) + 1, float(timings.begun[call.window]) + float(call.begun)
        name = CALLS[call.call]
        events.append(_event(name, tid, begun, call.seconds, {"window": int(call.window)}))
        if call.call == STEP:
            inside = float(call.work + call.contact)
            # fault: the work of a step begins with its call -> at = begun | coupler/test_timings
            at = begun + 0.5 * (float(call.seconds) - inside)
            events.append(_event("work and contact", tid, at, inside, {
                f"{n} [ms]": round(1e3 * float(call[n]), 6) for n in ("work", "contact", "border", "transport")}))
    return {"traceEvents": events, "displayTimeUnit": "ms"}


def trace_text(results: Results) -> str:
    """Return the trace as JSON, an event a line."""
    trace = trace_of(results)
    lines = ",\n".join(json.dumps(event) for event in trace["traceEvents"])
    return f'{{"displayTimeUnit": "ms", "traceEvents": [\n{lines}\n]}}\n'


def _event(name: str, thread: int, begun: float, seconds: float, about: dict[str, Any] | None = None) -> dict[str, Any]:
    """A complete event.  begun : [s] since the first window.  seconds : it took."""
    return {"name": name, "ph": "X", "ts": round(begun * TO_US, 3), "dur": round(float(seconds) * TO_US, 3), "pid": 1,
            "tid": thread, **({"args": about} if about else {})}
