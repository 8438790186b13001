"""The service behind zenoh on loopback: parity, and every fault by the name it deserves."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from contact.codec import REPLIES, REQUESTS, encode
from contact.messages import Project, Refused, Registered, Traction
from contact.rpc import zenoh_session
from contact.rpc.calls import Envelope, LinkError, LinkProtocolError, LinkSpecError, LinkTimeoutError, ServiceDownError
from contact.rpc.client import Client, ZenohLink
from contact.rpc.link import DirectLink, open_link
from contact.rpc.seal import forget_secret, keep_secret, seal_of
from contact.rpc.server import Server, question_label
from contact.rpc.zenoh_session import check_loopback, close_session, open_session

sys.path.insert(0, str(Path(__file__).parent))
from fake_contact import BUG, DIE, SECRET, SLOW, FakeContact, register

# A wait ends when what is awaited is there: these only end a test that would hang, on a machine however busy.
SOON = 30.0  # s; half of what waiting in vain takes
LONG = 60.0  # s
RUNS = ("r", "other", "here")
FAKE = str(Path(__file__).parent / "fake_contact.py")
rng = np.random.default_rng(5)


def tell_secret(process: subprocess.Popen[bytes]) -> None:
    assert process.stdin is not None
    process.stdin.write(SECRET.hex().encode() + b"\n")
    process.stdin.flush()


@pytest.fixture(autouse=True)
def secrets() -> Iterator[None]:
    """This process has the secrets of the runs of this file."""
    for run in RUNS:
        keep_secret(run, SECRET)
    yield
    for run in RUNS:
        forget_secret(run)


class Service:
    """A contact service in its own process."""

    def __init__(self, listen: str = "tcp/127.0.0.1:0", run: str = "r") -> None:
        self.process = subprocess.Popen(
            [sys.executable, FAKE, "--listen", listen, "--run", run, "--child"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        tell_secret(self.process)
        assert self.process.stdout is not None
        word, self.endpoint, self.instance = self.process.stdout.readline().decode().split()
        assert word == "ready"

    def kill(self) -> None:
        self.process.kill()
        self.process.communicate()

    def end(self) -> bytes:
        """Close its input; returns its standard error."""
        return self.process.communicate(timeout=SOON)[1]


@pytest.fixture
def service() -> Iterator[Service]:
    s = Service()
    yield s
    s.kill()


@pytest.fixture
def link(service) -> Iterator[ZenohLink]:
    link = ZenohLink(service.endpoint, "r", deadline=LONG, grace=0.3)
    yield link
    link.close()


def x_of(first: float, n: int = 4) -> np.ndarray:
    x = np.zeros((n, 2))
    x[0, 0] = first
    return x


def bits(reply: object) -> dict[str, object]:
    return {k: (v.dtype, v.shape, v.tobytes()) if isinstance(v, np.ndarray) else v for k, v in vars(reply).items()}


def test_zenoh_and_direct_agree_to_the_bit(link):
    direct = DirectLink(FakeContact().handle)
    for n in (4, 1000, 30000):  # the last one beyond zenoh's shared-memory and fragment sizes
        x = rng.standard_normal((n, 2))
        x[1] = np.nan, -0.0
        for request in (register(n), Project(f"surfaces-{n}", x),
                        Traction(f"surfaces-{n}", x, -x[:, 0], x, -x[:, 0], x[:, 1]), Project("unknown", x)):
            assert bits(link.ask(request)) == bits(direct.ask(request))


def test_a_process_has_one_session(service, link):
    other = open_link(f"zenoh:{service.endpoint}/r")
    assert len(zenoh_session._sessions) == 1
    other.close()
    assert isinstance(link.ask(register()), Registered)


def test_nobody_there_is_said_soon(monkeypatch):
    monkeypatch.setattr("contact.rpc.zenoh_session.CONNECT_TIMEOUT", 1.0)
    started = time.monotonic()
    with pytest.raises(ServiceDownError, match="nobody answers"):
        open_link("zenoh:tcp/127.0.0.1:9/r")
    assert time.monotonic() - started < SOON


def test_another_run_is_not_there(service, monkeypatch):
    monkeypatch.setattr("contact.rpc.client.CONNECT_TIMEOUT", 0.3)
    with pytest.raises(ServiceDownError, match="no contact in run other"):
        open_link(f"zenoh:{service.endpoint}/other")
    assert not zenoh_session._sessions


def test_a_service_that_dies_in_mid_call_is_gone(link):
    link.ask(register())
    started = time.monotonic()
    with pytest.raises(ServiceDownError):
        link.ask(Project("surfaces-4", x_of(DIE)))
    assert time.monotonic() - started < SOON


def test_a_late_answer_is_a_timeout_that_says_what_is_going_on(link):
    link.ask(register())
    link._client._deadline = 1.5  # of the 3 s the answer takes
    with pytest.raises(LinkTimeoutError, match="busy with Project for"):
        link.ask(Project("surfaces-4", x_of(SLOW)))
    # The late answer goes nowhere: the next call gets its own.
    link._client._deadline = LONG
    x = rng.random((4, 2))
    reply = link.ask(Project("surfaces-4", x))
    assert reply.xi_s.tobytes() == np.sin(x[:, 0]).tobytes()


def test_a_stopped_service_is_gone_within_its_lease(service, link):
    link.ask(register())
    os.kill(service.process.pid, signal.SIGSTOP)
    started = time.monotonic()
    with pytest.raises(ServiceDownError):
        link.ask(Project("surfaces-4", x_of(0.0)))
    assert time.monotonic() - started < SOON
    service.kill()  # zenoh would wait ten seconds for a stopped peer when the link is closed


def test_a_bug_in_the_service_arrives_as_text_and_it_lives_on(service, link):
    link.ask(register())
    with pytest.raises(LinkProtocolError, match="ZeroDivisionError: planted"):
        link.ask(Project("surfaces-4", x_of(BUG)))
    assert isinstance(link.ask(register()), Registered)
    assert b"Traceback" in service.end()


def test_a_service_started_anew_is_told_the_surfaces_again(service):
    link = ZenohLink(service.endpoint, "r", grace=10.0)
    link.ask(register())
    x = rng.random((4, 2))
    before = bits(link.ask(Project("surfaces-4", x)))
    service.kill()
    again = Service(service.endpoint)
    assert again.instance != service.instance
    assert bits(link.ask(Project("surfaces-4", x))) == before
    assert isinstance(link.ask(Project("never", x)), Refused)
    link.close()
    again.kill()


def said(client, payload, envelope):
    """What the server says to a signed message."""
    heard = []
    label = question_label(client._seal, client._keys.ask, envelope, payload)
    asked = client._session.ask(client._keys.ask, payload, label, SOON)
    asked.answers(lambda: None, lambda a: heard.append(a) or True)
    return heard[0]


def test_bad_bytes_are_refused_by_text(service, link):
    assert said(link._client, b"rubbish", Envelope(service.instance, "me", 1)).payload.startswith(b"bad_request")
    assert isinstance(link.ask(register()), Registered)


def test_a_call_repeated_on_the_wire_is_carried_out_once(service, link):
    link.ask(register())
    client = link._client
    payload = encode(Project("surfaces-4", x_of(0.5)))
    first, second, third = (said(client, payload, Envelope(service.instance, "me", 7, n)) for n in (1, 2, 2))
    assert first.payload == second.payload
    assert client.status().endswith("2 served")
    assert third.payload.startswith(b"replayed")
    assert not third.label


def test_two_owners_are_refused(service, monkeypatch):
    monkeypatch.setattr("contact.rpc.client.CONNECT_TIMEOUT", 2.0)
    session = open_session(connect=(service.endpoint,))
    with Server(session, seal_of("r"), "contact", REQUESTS), \
            pytest.raises(LinkProtocolError, match="2 of contact, not one"):
        Client(session, seal_of("r"), "contact", REPLIES)
    close_session(session)


def test_a_watch_ends_the_wait(service):
    def watch() -> None:
        raise KeyboardInterrupt

    link = ZenohLink(service.endpoint, "r", watch=watch)
    link.ask(register())
    with pytest.raises(KeyboardInterrupt):
        link.ask(Project("surfaces-4", x_of(SLOW)))
    assert "busy with Project" in link._client.status()  # it has not waited for the answer
    link.close()


def test_a_server_in_this_process_is_reached_without_a_second_session():
    session = open_session(listen=("tcp/127.0.0.1:0",))
    with Server(session, seal_of("here"), "contact", REQUESTS) as server:
        worker = threading.Thread(target=server.work, args=(FakeContact().handle,))
        worker.start()
        link = open_link(f"zenoh:{session.listen[0]}/here")
        assert isinstance(link.ask(register()), Registered)
        assert len(zenoh_session._sessions) == 1
        link.close()
        with pytest.raises(LinkError, match="closed"):
            link.ask(register())
        server.stop()
        worker.join(SOON)
    close_session(session)
    assert not zenoh_session._sessions


@pytest.mark.parametrize("endpoint", ["tcp/0.0.0.0:1", "tcp/192.168.1.2:1", "tcp/[::]:1", "tcp/:1", "tls/127.0.0.1:1",
                                      "tcp/127.0.0.1:70000", "unixsock-stream//tmp/x.sock",
                                      "unixsock-stream//no/such/x.sock", "tcp/127.0.0.1:1?x", "tcp/127.0.0.1",
                                      "tcp/127.0.0.1:1\n"])
def test_only_loopback(endpoint):
    with pytest.raises(LinkSpecError):
        check_loopback(endpoint)
    with pytest.raises(LinkSpecError):
        open_session(listen=(endpoint,))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="counts what Linux shows of a process")
def test_a_closed_session_leaves_nothing_behind():
    """In a process of its own: files that stay open, and shared memory, of which a killed process would leave all."""
    done = run_script("""
import os
import time
from contact.rpc.zenoh_session import Session, open_session, close_session

def held():
    files = [os.readlink(f"/proc/self/fd/{fd.name}") for fd in os.scandir("/proc/self/fd") if os.path.lexists(fd.path)]
    return len(files), sum("/dev/shm/" in file for file in files)

counts = []
for _ in range(6):
    here = open_session(listen=("tcp/127.0.0.1:0",))
    there = Session((), here.listen)
    token = here.show_token("here")
    until = time.monotonic() + 20.0
    while not there.tokens("here", lambda: None) and time.monotonic() < until:
        pass
    there.close()
    close_session(here)
    counts.append(held())
print(counts)
assert counts[-1][0] <= counts[1][0] and counts[-1][1] == 0, counts
""")
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_taken_port_is_an_error(service):
    with pytest.raises(LinkError, match="Address already in use"):
        open_session(listen=(service.endpoint,))


def run_script(code: str, *args: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code, *args], timeout=LONG, text=True, capture_output=True,
                          check=False)


def test_a_program_that_forgets_to_close_ends_all_the_same(service):
    code = ("import sys; from contact.rpc.link import open_link; sys.path.insert(0, sys.argv[2]);"
            "from contact.rpc.seal import keep_secret; from fake_contact import SECRET, register;"
            "keep_secret('r', SECRET); l = open_link(sys.argv[1]); print(l.ask(register()).surfaces)")
    done = run_script(code, f"zenoh:{service.endpoint}/r", str(Path(FAKE).parent))
    assert (done.returncode, done.stdout) == (0, "surfaces-4\n")


def test_a_server_that_forgets_to_close_ends_all_the_same():
    code = ("from contact.rpc.server import Server; from contact.rpc.zenoh_session import open_session;"
            "from contact.rpc.seal import Seal;"
            "s = Server(open_session(listen=('tcp/127.0.0.1:0',)), Seal('r', bytes(32)), 'contact', {}); print('done')")
    done = run_script(code)
    assert (done.returncode, done.stdout) == (0, "done\n")


def test_a_session_is_not_used_after_a_fork(service, link):
    code = """
import os, sys
from contact.rpc.calls import LinkError
from contact.rpc.link import open_link
from contact.messages import Project
from contact.rpc.seal import keep_secret
import numpy as np
keep_secret("r", bytes(range(32)))
link = open_link(sys.argv[1])
if (pid := os.fork()) == 0:
    try:
        link.ask(Project("s", np.zeros((1, 2))))
    except LinkError as exc:
        os._exit(7 if "fork" in str(exc) else 8)
    os._exit(9)
print(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
link.close()
"""
    assert run_script(code, f"zenoh:{service.endpoint}/r").stdout == "7\n"


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_the_service_listens_on_loopback_alone(service):
    inodes = {link.split("[")[1][:-1] for fd in Path(f"/proc/{service.process.pid}/fd").iterdir()
              if (link := os.readlink(fd)).startswith("socket:[")}
    rows = [line.split() for kind in ("tcp", "tcp6", "udp", "udp6")
            for line in Path(f"/proc/net/{kind}").read_text().splitlines()[1:]]
    mine = [row[1] for row in rows if row[9] in inodes]
    assert mine
    assert all(address.startswith("0100007F:") for address in mine)


def test_an_answer_that_came_in_time_is_there_for_who_looks_late():
    asked = zenoh_session.Asked(time.monotonic() - 1.0)
    asked.arrived("yes")
    asked.arrived(None)
    assert list(asked.replies(lambda: None)) == ["yes"]
    assert list(zenoh_session.Asked(time.monotonic() - 1.0).replies(lambda: None)) == []


def test_the_service_ends_on_ctrl_c_when_it_is_nobodys_child():
    process = subprocess.Popen([sys.executable, FAKE, "--run", "r"], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    tell_secret(process)
    assert process.stdout is not None
    assert process.stdout.readline().startswith(b"ready tcp/127.0.0.1:")
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=SOON)
    assert process.returncode == 0


def test_the_service_hears_a_signal_that_interrupts_none_of_its_waits():
    code = """
import signal, sys, threading, time
sys.path.insert(0, sys.argv[1])
import fake_contact
from contact.rpc import serve
def strike():
    time.sleep(1.0)
    signal.pthread_kill(threading.get_ident(), signal.SIGINT)  # this thread notes it; the one that waits sleeps on
work = serve.Server.work
def watched(server, handle):
    threading.Thread(target=strike, daemon=True).start()
    work(server, handle)
serve.Server.work = watched
sys.exit(serve.main(fake_contact.FakeContact().handle, ["--run", "r"]))
"""
    done = subprocess.run([sys.executable, "-c", code, str(Path(FAKE).parent)], input=f"{SECRET.hex()}\n", timeout=SOON,
                          text=True, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_child_outlives_ctrl_c_but_not_its_parent(service, link):
    service.process.send_signal(signal.SIGINT)
    assert isinstance(link.ask(register()), Registered)
    service.end()
    assert service.process.returncode == 1
