"""Roles on hosts: network namespaces around a router where the kernel has them, loopback addresses elsewhere.

    unshare -rnm python host_scene.py FOLDER SCENE        three hosts and a coupler around a router, all namespaces
    python host_scene.py FOLDER SCENE --loopback          the same on 127.0.0.1
SCENE : plain, killed (a half), cut (a line), left (the coupler killed), bad (lines), or several (thermal halves).
FOLDER gets hosts.yaml, certificates, run.h5 and the logs of all.
"""

from __future__ import annotations

import atexit
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Mapping
from pathlib import Path

import psutil

ROOT = Path(__file__).resolve().parents[2]
SCENARIO = ROOT / "scenarios/casting_1d.yaml"
ROLES = ("thermal", "mechanical", "contact")
SLIDELINE = [sys.executable, "-m", "coupler.cli"]
SETS = {"plain": {"coupling.end": "0.5"}, "killed": {"coupling.end": "0.5", "coupling.restart": "3"},
        "cut": {"coupling.end": "0.5"}, "left": {"coupling.end": "0.5"}, "bad": {"coupling.end": "0.5"}}
SEVERAL_ROLES = ("thermal.rod", "thermal.die", *ROLES[1:])
SEVERAL_SETS = {"thermal.halves.rod.bodies": ["rod"], "thermal.halves.die.bodies": ["mould"], "coupling.end": 0.5}
SETS["several"] = {key: json.dumps(value) for key, value in SEVERAL_SETS.items()}
BAD_LINE = {"delay": 0.002, "rate": 1e7, "loss": 0.01, "double": 0.01, "late": 0.02}  # of bad_line.Line
PATIENCE = "4"  # s, of a host for a coupler that is gone


def sh(*words: str) -> None:
    subprocess.run(words, check=True)


def router(roles: Iterable[str] = ROLES, line: Mapping[str, float] | None = None) -> dict[str, str]:
    """Make a network of its own for each role and the coupler, joined by this one, which forwards; their addresses.

    line : of bad_line.Line, between this one and each of the others.
    """
    sh("mount", "-t", "tmpfs", "none", "/run")
    Path("/run/netns").mkdir()
    sh("ip", "link", "set", "lo", "up")
    Path("/proc/sys/net/ipv4/ip_forward").write_text("1")
    addresses = {}
    for k, name in enumerate((*roles, "coupler"), 1):
        sh("ip", "netns", "add", name)
        near = f"to-{name}"[:15]
        if line is None:
            sh("ip", "link", "add", near, "type", "veth", "peer", "name", "eth0", "netns", name)
        else:
            sh("ip", "link", "add", near, "type", "veth", "peer", "name", f"left{k}")
            sh("ip", "link", "add", f"right{k}", "type", "veth", "peer", "name", "eth0", "netns", name)
            for end in (f"left{k}", f"right{k}"):  # nobody here answers what only passes through
                sh("ip", "link", "set", end, "arp", "off", "up")
            carrier = subprocess.Popen([sys.executable, str(Path(__file__).with_name("bad_line.py")), f"left{k}",
                                        f"right{k}", json.dumps(line)])
            atexit.register(carrier.kill)
        sh("ip", "addr", "add", f"10.77.{k}.1/24", "dev", near)
        sh("ip", "link", "set", near, "up")
        sh("ip", "-n", name, "addr", "add", f"10.77.{k}.2/24", "dev", "eth0")
        sh("ip", "-n", name, "link", "set", "eth0", "up")
        sh("ip", "-n", name, "link", "set", "lo", "up")
        sh("ip", "-n", name, "route", "add", "default", "via", f"10.77.{k}.1")
        addresses[name] = f"10.77.{k}.2"
    return addresses


def write_hosts(folder: Path, addresses: dict[str, str], port: int = 17450) -> Path:
    file = folder / "hosts.yaml"
    roles = [role for role in addresses if role != "coupler"]
    file.write_text("".join(f"{role}: tls/{addresses[role]}:{port + k}\n" for k, role in enumerate(roles))
                    + "tls: certificates\n")
    subprocess.run([*SLIDELINE, "host", "--init-tls", "--hosts", str(file)], check=True, stdout=subprocess.DEVNULL)
    return file


def host(folder: Path, role: str, inside: list[str], *options: str) -> subprocess.Popen[bytes]:
    with (folder / f"{role}.log").open("ab") as log:
        return subprocess.Popen([*inside, *SLIDELINE, "host", role, "--hosts", str(folder / "hosts.yaml"), *options],
                                stdout=log, stderr=log)


def wait_for(done, what: str, seconds: float = 60.0) -> None:
    until = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < until, what
        time.sleep(0.02)


def waiting(folder: Path, roles: Iterable[str], times: int = 1) -> bool:
    return all((folder / f"{role}.log").read_text().count("waiting for a run") >= times for role in roles)


def run_scene(folder: Path, scene: str, addresses: dict[str, str], inside) -> int:
    write_hosts(folder, addresses)
    roles = SEVERAL_ROLES if scene == "several" else ROLES
    options = ("--patience", PATIENCE) if scene == "left" else ()
    hosts = [host(folder, role, inside(role), *options) for role in roles]
    try:
        wait_for(lambda: waiting(folder, roles), "no host came up")
        sets = [word for key, value in SETS[scene].items() for word in ("--set", f"{key}={value}")]
        with (folder / "run.log").open("wb") as log:
            run = subprocess.Popen([*inside("coupler"), *SLIDELINE, "run", str(SCENARIO), "-o", str(folder / "run.h5"),
                                    "--hosts", str(folder / "hosts.yaml"), *sets], stdout=log, stderr=log)
        wait_for(lambda: b"window 5/" in (folder / "run.log").read_bytes() or run.poll() is not None, "no window", 200)
        if scene == "killed":
            victim = next(p for p in psutil.Process().children(recursive=True)
                          if {"coupler.fmu.lobby", "mechanical"} <= set(p.cmdline()))
            victim.send_signal(signal.SIGKILL)
        if scene == "cut":
            sh("ip", "link", "set", "to-thermal", "down")
            time.sleep(6.0)  # beyond the lease of three
            sh("ip", "link", "set", "to-thermal", "up")
        if scene == "left":
            run.kill()
        code = run.wait(300)
        # Each is free again, whatever became of the run.
        wait_for(lambda: waiting(folder, roles, 2), "a host is not free again")
        return code
    finally:
        for process in hosts:
            process.terminate()
            process.wait(20)


def main() -> int:
    folder, scene = Path(sys.argv[1]), sys.argv[2]
    os.environ.setdefault("PYTHONPATH", str(ROOT))
    roles = SEVERAL_ROLES if scene == "several" else ROLES
    if "--loopback" in sys.argv:
        return run_scene(folder, scene, dict.fromkeys(roles, "127.0.0.1"), lambda role: [])
    addresses = router(roles, BAD_LINE if scene == "bad" else None)
    return run_scene(folder, scene, addresses, lambda role: ["ip", "netns", "exec", role])


if __name__ == "__main__":
    sys.exit(main())
