"""A process that runs jobs: one line of JSON in, one out; it ends when its input does."""

from __future__ import annotations

import json
import os
import signal
import sys

from coupler.experiments.trial import solve


def main() -> None:
    """Serve until standard input ends."""
    # What native code prints must not come between the answers.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    # Ctrl-C is for the one who started this process; a run that sees it would stop half-way.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for line in sys.stdin:
        print(json.dumps(solve(json.loads(line)), allow_nan=False), file=answers, flush=True)


if __name__ == "__main__":
    main()
