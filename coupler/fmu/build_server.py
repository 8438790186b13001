"""A process that builds FMUs of halves, as many at a time as it is asked for:  python -m coupler.fmu.build_server

It imports once what every builder imports, most of what a build costs, and forks for each build.  Builders are named by
their modules, whose `main` reads sys.argv as on a command line.  One line of JSON in, one line out for each build:
    {"id": N, "module": "PACKAGE.MODULE", "words": [ARGUMENT ...], "log": FILE}  ->  {"id": N, "code": EXIT CODE}
What a builder prints goes to its log.  A first line names what is imported: {"modules": [MODULE ...]}.  It ends with
its input, or when nothing was asked of it for a while.
"""

from __future__ import annotations

import json
import os
import selectors
import signal
import sys
import traceback
from importlib import import_module
from typing import Any

from contact.half.papers import installed

IDLE = 10.0  # s without a build, after which it ends
# Half of what a build costs that needs it, and most scenes do not: imported here once a build did.
SOMETIMES = ("scipy.interpolate",)


def main() -> None:
    """Serve builds until the input is closed, or nothing is asked for IDLE seconds."""
    from contact.compiled import interpret

    interpret()  # as builders do
    woken, wake = os.pipe()
    os.set_blocking(wake, False)
    told, tell = os.pipe()
    signal.set_wakeup_fd(wake)
    signal.signal(signal.SIGCHLD, lambda number, frame: None)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever asked for a build says when it is to end
    running: dict[int, int] = {}  # process -> build
    rest, late = b"", set[str]()
    with selectors.DefaultSelector() as selector:
        selector.register(0, selectors.EVENT_READ)
        selector.register(woken, selectors.EVENT_READ)
        selector.register(told, selectors.EVENT_READ)
        while True:
            ready = selector.select(None if running else IDLE)
            if not ready and not running:
                return
            for key, _ in ready:
                data = os.read(key.fd, 1 << 16)
                if key.fd == woken:
                    _tell_ended(running)
                    continue
                if key.fd == told:
                    late.update(data.decode().split())
                    continue
                if not data:
                    for pid in running:
                        os.kill(pid, signal.SIGKILL)
                    return
                *lines, rest = (rest + data).split(b"\n")
                for line in lines:
                    asked = json.loads(line)
                    if "modules" in asked:
                        _load(asked["modules"])
                    else:
                        running[_begin(asked, tell)] = asked["id"]
            if not running:  # nobody waits for this
                # fault: what many builds need is imported by each -> late.clear() | coupler/test_builders
                _import(late)


def _import(late: set[str]) -> None:
    while late:
        import_module(late.pop())


def _load(modules: list[str]) -> None:
    """Import builders, and the halves that they build."""
    for name in modules:
        loads = getattr(import_module(name), "LOADS", {})
        for load in {loads} if isinstance(loads, str) else loads.values():
            import_module(load.partition(":")[0])
    import_module("skfem")  # which every half with a mesh needs
    installed()


def _begin(asked: dict[str, Any], tell: int) -> int:
    """Begin a build in a process of its own; return that.  tell : to be told what the next builds may need, too."""
    if pid := os.fork():
        return pid
    code = 1
    try:
        log = os.open(asked["log"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        os.dup2(log, 1)
        os.dup2(log, 2)
        sys.argv = [asked["module"], *asked["words"]]
        import_module(asked["module"]).main()
        code = 0
    except SystemExit as exc:
        code = exc.code if isinstance(exc.code, int) else 1
        if isinstance(exc.code, str):
            print(exc.code, file=sys.stderr)
    except BaseException:  # noqa: BLE001  the process border: a bug is told by the log
        traceback.print_exc()
    finally:
        os.write(tell, "".join(f"{name}\n" for name in SOMETIMES if name in sys.modules).encode())
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _tell_ended(running: dict[int, int]) -> None:
    """Say which builds have ended, and with which code."""
    for pid in list(running):
        ended, status = os.waitpid(pid, os.WNOHANG)
        if ended:
            said = {"id": running.pop(pid), "code": os.waitstatus_to_exitcode(status)}
            os.write(1, f"{json.dumps(said)}\n".encode())


if __name__ == "__main__":
    main()
