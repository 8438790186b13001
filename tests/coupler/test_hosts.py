"""Halves and contact on other machines: the embedded run's bits, and nobody let in who does not belong there."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from contact.rpc.calls import LinkError, LinkSpecError
from contact.rpc.client import Client
from contact.rpc.seal import Seal, secret_line
from contact.rpc.tls import Tls
from contact.rpc.zenoh_session import Session, close_session, open_session
from coupler import Results, ScenarioError, load_scenario, run
from coupler.fmu.at_hosts import Away
from coupler.fmu.children import ChildError
from coupler.fmu.hosts import COUPLER, init_tls, read_hosts
from coupler.fmu.lobby_messages import LOBBY, TOLD, Has, Knock, Take

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from host_scene import ROLES, SCENARIO, host, wait_for, write_hosts  # noqa: E402
from killed_runs import differences  # noqa: E402

SOON = 6.0  # s for a stranger to find somebody: who belongs there takes less than one


def namespaces() -> str:
    """Why there are no network namespaces here; empty where there are."""
    try:
        done = subprocess.run(["unshare", "-rnm", "ip", "link", "add", "to-a", "type", "veth", "peer", "name", "to-b"],
                              capture_output=True, text=True, check=False)
    except OSError as exc:
        return str(exc)
    return done.stderr.strip() if done.returncode else ""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("whole") / "run.h5"
    run(load_scenario(SCENARIO, {"coupling.end": 0.5}), out)
    return out


@pytest.mark.few("plain", "cut")
@pytest.mark.parametrize("scene", ["plain", "killed", "cut", "bad"])
def test_three_machines_around_a_router_give_the_bits_of_one_process(whole, tmp_path, scene):
    command = [sys.executable, str(HERE / "host_scene.py"), str(tmp_path), scene]
    why = namespaces()
    if scene == "plain" and not why:
        pytest.skip("the same over a bad line asks for more")
    if why:
        if scene in ("cut", "bad"):
            pytest.skip(f"no line between machines: this kernel gives no network namespaces ({why})")
        command.append("--loopback")
    else:
        command[:0] = ["unshare", "-rnm"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=500, check=False)
    said = (tmp_path / "run.log").read_text()
    assert done.returncode == 0, f"{done.stderr}\n{said}"
    found = Results(tmp_path / "run.h5")
    # coupling.restart stands in the header.
    assert [d for d in differences(whole, tmp_path / "run.h5") if scene != "killed" or not d.startswith("header")] == []
    restarts = found.totals["restarts"]
    if scene == "killed":
        assert len(restarts) == 1
        assert "half 'mechanical': its process at tls/" in restarts[0]
        assert "ended (its process was ended by signal 9)" in restarts[0]
    else:
        assert restarts == []


def test_a_coupler_that_was_killed_leaves_hosts_that_are_free_again(tmp_path):
    command = [sys.executable, str(HERE / "host_scene.py"), str(tmp_path), "left", "--loopback"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 256 - 9, done.stderr
    for role in ROLES:
        log = (tmp_path / f"{role}.log").read_text()
        assert log.count("waiting for a run") == 2
        assert "its process ended with code 3" in log


@dataclass(frozen=True)
class Scene:
    """A host that serves as the thermal half.  other : certificates of another authority."""

    folder: Path
    address: str
    tls: Path
    other: Path


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Scene]:
    folder = tmp_path_factory.mktemp("hosts")
    file = write_hosts(folder, dict.fromkeys(ROLES, "127.0.0.1"), 17500)
    elsewhere = folder / "elsewhere"
    elsewhere.mkdir()
    write_hosts(elsewhere, dict.fromkeys(ROLES, "127.0.0.1"), 17500)
    process = host(folder, "thermal", [], "--patience", "5")
    try:
        wait_for(lambda: "waiting for a run" in (folder / "thermal.log").read_text(), "no host")
        yield Scene(folder, read_hosts(file).addresses["thermal"], folder / "certificates", elsewhere / "certificates")
    finally:
        process.terminate()
        process.wait(20)


def seal(folder: Path) -> Seal:
    """Of the thermal half's lobby, by the secret that the coupler has."""
    return Seal(LOBBY, secret_line((folder / COUPLER / "secret.thermal").read_text()))


@contextmanager
def session(scene: Scene, tls: Tls) -> Iterator[Session]:
    opened = open_session(connect=(scene.address,), tls=tls)
    try:
        yield opened
    finally:
        close_session(opened)


def enters(scene: Scene, opened: Session, by: Seal) -> Client:
    """Find the lobby and ask something there."""
    client = Away("thermal", scene.address, opened, by).enter(time.monotonic() + SOON, lambda: None)
    assert client.call(Knock(), SOON).text == ""
    return client


def test_the_coupler_is_let_in_and_what_it_hands_over_is_there_by_its_content(scene):
    with session(scene, Tls(scene.tls / COUPLER, (), ("thermal",))) as opened:
        client = enters(scene, opened, seal(scene.tls))
        assert client.call(Has("0" * 64)).text == ""


def test_a_role_that_is_not_expected_is_shut_out_though_it_has_the_secret(scene):
    """Its certificate is of the same authority: who may do what goes by the name in it."""
    with session(scene, Tls(scene.tls / "mechanical", (), ("thermal",))) as opened, \
            pytest.raises(ChildError, match="nobody serves as thermal"):
        enters(scene, opened, seal(scene.tls))


def test_a_certificate_of_another_authority_is_shut_out(scene):
    with session(scene, Tls(scene.other / COUPLER, (), ("thermal",))) as opened, \
            pytest.raises(ChildError, match="with a certificate of the authority that made ours"):
        enters(scene, opened, seal(scene.tls))


class NoCertificate(Tls):
    """Believes the authority, shows nothing."""

    def settings(self) -> dict[str, object]:
        kept = ("root_ca_certificate", "verify_name_on_connect")
        return {k: v for k, v in super().settings().items() if k.rpartition("/")[2] in kept}


def test_no_certificate_is_shut_out(scene):
    with session(scene, NoCertificate(scene.tls / COUPLER, (), ("thermal",))) as opened, \
            pytest.raises(ChildError, match="nobody serves as thermal"):
        enters(scene, opened, seal(scene.tls))


def test_the_right_certificate_without_the_secret_is_not_heard(scene):
    with session(scene, Tls(scene.tls / COUPLER, (), ("thermal",))) as opened:
        life = enters(scene, opened, seal(scene.tls))._instance
        liar = Client(opened, seal(scene.other), "thermal", TOLD, instance=life, deadline=3.0)
        with pytest.raises(LinkError):
            liar.call(Take(b"not an FMU"))


def test_a_role_at_the_address_of_another_is_not_believed(scene):
    """Mechanical's folder, at an address where the coupler looks for thermal: it has not the secret of that."""
    file = scene.folder / "impostor.yaml"
    file.write_text("thermal: tls/127.0.0.1:17601\nmechanical: tls/127.0.0.1:17600\ncontact: tls/127.0.0.1:17602\n"
                    "tls: certificates\n")
    with (scene.folder / "impostor.log").open("wb") as log:
        process = subprocess.Popen([sys.executable, "-m", "coupler.cli", "host", "mechanical", "--hosts", str(file)],
                                   stdout=log, stderr=log)
    try:
        wait_for(lambda: "waiting for a run" in (scene.folder / "impostor.log").read_text(), "no impostor")
        tls = Tls(scene.tls / COUPLER, (), ("thermal", "mechanical"))
        at = Scene(scene.folder, "tls/127.0.0.1:17600", scene.tls, scene.other)
        with session(at, tls) as opened:
            with pytest.raises(ChildError, match="nobody serves as thermal"):
                enters(at, opened, seal(scene.tls))
            own = Seal(LOBBY, secret_line((scene.tls / COUPLER / "secret.mechanical").read_text()))
            Away("mechanical", at.address, opened, own).enter(time.monotonic() + SOON, lambda: None)  # it is there
    finally:
        process.terminate()
        process.wait(20)


def test_what_leaves_the_machine_is_encrypted_or_not_sent(tmp_path):
    file = tmp_path / "hosts.yaml"
    file.write_text("thermal: tcp/10.0.0.2:7447\nmechanical: tls/10.0.0.3:7447\ncontact: tls/10.0.0.3:7448\ntls: c\n")
    with pytest.raises(ScenarioError, match="what leaves a machine is encrypted, or not sent") as refused:
        read_hosts(file)
    assert refused.value.key == "thermal"
    with pytest.raises(LinkSpecError, match="other addresses need TLS"):
        open_session(connect=("tcp/10.0.0.2:7447",))
    with pytest.raises(LinkSpecError, match="other addresses need TLS"):
        open_session(connect=("tls/10.0.0.2:7447",))


@pytest.mark.parametrize("text", ["", "[]", "thermal: 3", "a: b", "thermal: [",
                                  "thermal: tls/a:1\nmechanical: tls/a:1\ncontact: tls/a:2\ntls: c"])
def test_a_hosts_file_that_is_none_is_refused_by_its_name(tmp_path, text):
    file = tmp_path / "hosts.yaml"
    file.write_text(text)
    with pytest.raises(ScenarioError, match=r"hosts\.yaml"):
        read_hosts(file)


def test_certificates_are_made_once_and_their_keys_are_their_owners(tmp_path, scene):
    file = tmp_path / "hosts.yaml"
    shutil.copy(scene.folder / "hosts.yaml", file)
    folder = init_tls(read_hosts(file))
    assert not list(folder.glob("ca.key"))
    assert {p.name for p in folder.iterdir()} == {"ca.pem", COUPLER, *ROLES}
    for role in (COUPLER, *ROLES):
        assert (folder / role).stat().st_mode & 0o077 == 0
        assert (folder / role / "key.pem").stat().st_mode & 0o077 == 0
    with pytest.raises(ScenarioError, match="nothing was written"):
        init_tls(read_hosts(file))
    for role, name in (("thermal", "key.pem"), ("mechanical", "secret"), (COUPLER, "secret.contact")):
        assert read_hosts(file).tls_of(role)
        (folder / role / name).chmod(0o644)
        with pytest.raises(ScenarioError, match=f"others may read .*{role}/{name}: "):
            read_hosts(file).tls_of(role)
