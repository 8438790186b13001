"""Random scenes against laws that hold in any scene: which are broken, and which without a word.

    python benchmarks/random_scenes.py --seeds 500 --out scenes.jsonl

Each seed is a scene (tests/random_scenes); it is run and judged in a worker process, one a core, that is ended after
`--limit` seconds of CPU, or several times as many by the clock in which it used none: other work makes nothing hang.
A line of JSON a seed goes to FILE; started again, seeds that stand there are not run anew.  What is printed is a table
in Markdown (random_scenes_table.py); with `--before FILE` what such lines say stands beside it.
"""

from __future__ import annotations

import argparse
import json
import os
import queue
import selectors
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from random_scenes_clock import Clock, LateError
from random_scenes_table import CRASHED, HUNG, compared, written

WORKER = Path(__file__).with_name("random_scenes_worker.py")
JUDGE = "random_scenes.judge:judged"
LOG_BYTES = 2000
LOOK = 1.0  # s between two looks at what a worker has used


class EndedError(Exception):
    """A worker is no more."""


@dataclass(frozen=True)
class Limits:
    """A seed may use so many seconds of CPU; the first of a worker more, for kernels are compiled or loaded then."""

    seed: float
    warm_up: float


class Worker:
    """A process that judges seeds, and another in its place where it does not come back."""

    def __init__(self, judge: str, limits: Limits, log: Path) -> None:
        self._judge, self._limits, self._log = judge, limits, log
        self._process: subprocess.Popen[bytes] | None = None
        self._fresh = True
        self._used = 0.0

    def judge(self, seed: int) -> dict[str, Any]:
        """A seed's row: what the judge says, or that it crashed or hung."""
        self._used = 0.0
        try:
            return self._asked(seed)
        except LateError as error:
            outcome, message = HUNG, str(error)
        except (EndedError, json.JSONDecodeError) as error:
            outcome, message = CRASHED, str(error)
        seconds = self._used
        self.end()
        return {"seed": seed, "features": [], "keys": [], "outcome": outcome, "message": message, "rows": [],
                "seconds": seconds}

    def _asked(self, seed: int) -> dict[str, Any]:
        if self._process is None:
            with self._log.open("wb") as log:
                self._process = subprocess.Popen([sys.executable, str(WORKER), self._judge], stdin=subprocess.PIPE,
                                                 stdout=subprocess.PIPE, stderr=log)
            self._fresh = True
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            process.stdin.write(f"{seed}\n".encode())
            process.stdin.flush()
        except BrokenPipeError as error:
            raise EndedError(self._last_words()) from error
        clock = Clock(process.pid, self._limits.seed + self._limits.warm_up * self._fresh)
        self._fresh, line = False, b""
        with selectors.DefaultSelector() as selector:
            selector.register(process.stdout, selectors.EVENT_READ)
            while not line.endswith(b"\n"):
                if not selector.select(LOOK):
                    self._used = clock.used
                    clock.look()
                    continue
                chunk = os.read(process.stdout.fileno(), 65536)
                if not chunk:
                    raise EndedError(self._last_words())
                line += chunk
        row: dict[str, Any] = json.loads(line)
        return row

    def _last_words(self) -> str:
        assert self._process is not None
        code = self._process.wait(10.0)
        with self._log.open("rb") as f:
            f.seek(max(0, f.seek(0, os.SEEK_END) - LOG_BYTES))
            lines = f.read().decode(errors="replace").strip().splitlines()
        how = f"ended by signal {-code}" if code < 0 else f"ended with code {code}"
        return ": ".join([how, *lines[-1:]])

    def end(self) -> None:
        """End its process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for pipe in (self._process.stdin, self._process.stdout):
                if pipe is not None:
                    _close(pipe)
            self._process = None


def _close(pipe: Any) -> None:
    try:
        pipe.close()
    except BrokenPipeError:
        return  # a seed that nobody read


def judge_all(seeds: Sequence[int], jobs: int, limits: Limits, judge: str, out: Path | None) -> list[dict[str, Any]]:
    """The rows of seeds, those that stand in a file already and those that were judged now, which are added to it."""
    rows = {row["seed"]: row for row in _read(out)} if out is not None and out.exists() else {}
    waiting: queue.SimpleQueue[int] = queue.SimpleQueue()
    for seed in seeds:
        if seed not in rows:
            waiting.put(seed)
    done: queue.SimpleQueue[Mapping[str, Any]] = queue.SimpleQueue()
    missing = waiting.qsize()
    stop = threading.Event()

    def serve(worker: Worker) -> None:
        while not stop.is_set():
            try:
                seed = waiting.get_nowait()
            except queue.Empty:
                break
            done.put(worker.judge(seed))
        worker.end()

    with tempfile.TemporaryDirectory(prefix="slideline-random-") as logs:
        threads = [threading.Thread(target=serve, args=(Worker(judge, limits, Path(logs) / f"{k}.log"),))
                   for k in range(min(jobs, missing))]
        for thread in threads:
            thread.start()
        try:
            for number in range(missing):
                row = dict(done.get())
                rows[row["seed"]] = row
                if out is not None:
                    with out.open("a", encoding="utf-8") as f:
                        f.write(json.dumps(row) + "\n")
                silent = [r["invariant"] for r in row["rows"] if r["verdict"] == "silent"]
                print(f"{number + 1}/{missing} seed {row['seed']}: {row['outcome']}, {row['seconds']:.1f} s",
                      *(f"SILENT {name}" for name in silent), file=sys.stderr, flush=True)
        finally:
            stop.set()
            for thread in threads:
                thread.join()
    return [rows[seed] for seed in seeds]


def _read(path: Path) -> list[dict[str, Any]]:
    """The rows of a file; a last line that was cut while it was written is left out, and ended there."""
    rows, text = [], path.read_text(encoding="utf-8")
    if text and not text.endswith("\n"):
        with path.open("a", encoding="utf-8") as f:
            f.write("\n")
    for line in text.splitlines():
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=500, help="how many")
    parser.add_argument("--first", type=int, default=0, help="the first of them")
    parser.add_argument("--out", type=Path, help="a line of JSON a seed; read first, then added to")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="worker processes")
    parser.add_argument("--limit", type=float, default=60.0, help="s of CPU a seed may take")
    parser.add_argument("--warm-up", type=float, default=120.0, help="s more for the first seed of a worker")
    parser.add_argument("--before", type=Path, help="lines of the same seeds by other code, to stand beside them")
    parser.add_argument("--judge", default=JUDGE, help="MODULE:FUNCTION of a seed")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.seeds)
    limits = Limits(options.limit, options.warm_up)
    rows = judge_all(seeds, options.jobs, limits, options.judge, options.out)
    if options.before is None:
        print(written(rows))
    else:
        print(compared([row for row in _read(options.before) if row["seed"] in seeds], rows))


if __name__ == "__main__":
    main()
