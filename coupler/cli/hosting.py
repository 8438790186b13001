"""`slideline host`: a role of runs on this machine, one run after the other, and the certificates of all."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from coupler.errors import HalfError, ScenarioError
from coupler.fmu.children import ChildError, python, ready_line, reap, start
from coupler.fmu.hosts import init_tls, read_hosts
from coupler.fmu.scratch import scratch_folder

START_PATIENCE = 60.0  # s for imports on a busy machine
PAUSE = 0.5  # s between one that ended and the next


def host_command(role: Annotated[str, typer.Argument(
                     help="thermal, mechanical or contact; thermal.NAME of several thermal halves.")] = "",
                 hosts: Annotated[Path, typer.Option("--hosts", metavar="FILE", help="Where each role runs.")] = Path(
                     "hosts.yaml"),
                 init: Annotated[bool, typer.Option(
                     "--init-tls", help="Make the certificates for all roles, once, on one machine.")] = False,
                 patience: Annotated[float, typer.Option(
                     "--patience", metavar="SECONDS", help="How long a coupler may be unreachable.")] = 120.0,
                 once: Annotated[bool, typer.Option("--once", help="End after one run.")] = False) -> None:
    """Run one role for runs on other machines; --init-tls makes the certificates."""
    if init:
        folder = init_tls(read_hosts(hosts))
        typer.echo(f"{folder}: a folder for each role.  Copy {hosts.name} and {folder.name}/ROLE to the machine of "
                   "ROLE, by a way that nobody can read, and start `slideline host ROLE` there")
        return
    known = read_hosts(hosts)
    if role not in known.addresses:
        raise ScenarioError("this is no role", key="slideline host", value=role,
                            remedy=f"There are {', '.join(known.addresses)}")
    known.tls_of(role)
    typer.echo(f"{role} at {known.addresses[role]}: Ctrl-C ends it")
    serve(role, hosts, patience, once=once)


def serve(role: str, file: Path, patience: float, *, once: bool) -> None:
    """Serve runs until interrupted: each in a process of its own, so that none can harm the next.

    Raises HalfError where a process cannot begin at all.
    """
    last = ""
    with scratch_folder() as folder:
        while True:
            child = start(role, [*python(), "-m", "coupler.fmu.lobby", role, str(file.absolute()), str(patience)],
                          folder)
            try:
                child.tell(last.replace("\n", "\x00"))
                try:
                    ready_line(child, time.monotonic() + START_PATIENCE)
                except ChildError as exc:
                    raise HalfError(str(exc), half=role, log=exc.log) from exc
                print(f"{role}: waiting for a run", file=sys.stderr, flush=True)
                while not child.death():
                    time.sleep(PAUSE)
                    child.trim()
            finally:
                reap([child])
            last = f"{child.death()}\n{child.log_tail()}" if child.process.returncode else ""
            print(f"{role}: {child.death()}", file=sys.stderr, flush=True)
            child.log.unlink(missing_ok=True)
            if once:
                return

