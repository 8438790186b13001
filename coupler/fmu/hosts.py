"""Where the roles of a run live on other machines: the hosts file, and certificates for its roles."""

from __future__ import annotations

import ipaddress
import re
import secrets
import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from contact.rpc.calls import LinkSpecError
from contact.rpc.seal import SECRET_BYTES
from contact.rpc.tls import CA, CERTIFICATE, ENDPOINT, KEY, SECRET, Tls, is_tls
from coupler.errors import ScenarioError

CONTACT, COUPLER = "contact", "coupler"
HALVES = ("thermal", "mechanical")
ROLES = (*HALVES, CONTACT)
_SEVERAL = re.compile(r"thermal\.[A-Za-z_][A-Za-z0-9_-]{0,55}")  # one of several in the role; the name of a certificate
DAYS = 825  # of a certificate
MOST = 10_000  # bytes of a hosts file


@dataclass(frozen=True)
class Hosts:
    """file : where it was read.  addresses : role -> `tls/HOST:PORT`.  tls : folder with a folder for each role."""

    file: Path
    addresses: dict[str, str]
    tls: Path

    @property
    def halves(self) -> tuple[str, ...]:
        """The roles that are halves."""
        return tuple(role for role in self.addresses if role != CONTACT)

    def tls_of(self, role: str) -> Tls:
        """What a role shows, and whom it speaks with.  Raises ScenarioError."""
        # fault: a half serves the other half too -> callers = (COUPLER, *self.halves) |
        #   coupler/test_hosts::test_a_role_that_is_not_expected_is_shut_out_though_it_has_the_secret
        callers = (COUPLER, *self.halves) if role == CONTACT else (COUPLER,)
        servers = tuple(self.addresses) if role == COUPLER else () if role == CONTACT else (CONTACT,)
        try:
            return Tls(self.tls / role, () if role == COUPLER else callers, servers)
        except LinkSpecError as exc:
            raise ScenarioError(str(exc), file=str(self.file), key="tls") from exc


def read_hosts(path: Path, halves: Iterable[str] = ()) -> Hosts:
    """Read a hosts file.  Raises ScenarioError.

        thermal: tls/10.0.0.2:7447
        mechanical: tls/10.0.0.3:7447
        contact: tls/10.0.0.3:7448
        tls: certificates      # a folder, beside this file
    Several thermal halves each have a line, `thermal.NAME: tls/...`, in the place of `thermal`.
    halves : that a run has; where the file has others that is an error.
    """
    try:
        text = path.read_bytes()
        raw = YAML(typ="safe", pure=True).load(text) if len(text) <= MOST else None
    except OSError as exc:
        raise ScenarioError(f"cannot be read ({exc.strerror})", file=str(path),
                            remedy="Give the file of hosts with --hosts; docs/hosts.md shows one") from exc
    except YAMLError as exc:
        raise ScenarioError(f"is not YAML: {str(exc).splitlines()[0]}", file=str(path)) from exc
    several = tuple(key for key in raw if isinstance(key, str) and _SEVERAL.fullmatch(key)) \
        if isinstance(raw, dict) else ()
    roles = (*several, *ROLES[1:]) if several else ROLES
    keys = (*roles, "tls")
    if not isinstance(raw, dict) or set(raw) != set(keys) or not all(isinstance(v, str) for v in raw.values()):
        raise ScenarioError("a hosts file says where each role runs, and where the certificates are: "
                            + ", ".join(keys), file=str(path),
                            remedy="For example `thermal: tls/10.0.0.2:7447` and `tls: certificates`")
    for role in roles:
        if not is_tls(raw[role]):
            raise ScenarioError("this is not `tls/HOST:PORT`: what leaves a machine is encrypted, or not sent",
                                file=str(path), key=role, value=raw[role],
                                remedy="`slideline host --init-tls` makes the certificates")
    if len({raw[role] for role in roles}) < len(roles):
        raise ScenarioError("two roles have one address", file=str(path), remedy="Give each a port of its own")
    hosts = Hosts(path, {role: raw[role] for role in roles}, path.parent / raw["tls"])
    wanted = set(halves)
    # fault: a hosts file of other halves than the scene's is taken -> if False: |
    #   coupler/test_several_hosts::test_a_hosts_file_has_a_line_for_each_half
    if wanted and wanted != set(hosts.halves):
        raise ScenarioError(f"it says where {' and '.join(hosts.halves)} run; the scenario has "
                            f"{' and '.join(sorted(wanted))}", file=str(path), remedy="Give each half a line")
    return hosts


def init_tls(hosts: Hosts) -> Path:
    """Make a certificate authority and a folder for each role: its certificate, key and secret.  Returns the folder.

    By the `openssl` command: zenoh brings its own TLS and needs no more than these files, once.
    Raises ScenarioError where the folder is there already, or openssl is not or fails.
    """
    folder = hosts.tls
    if folder.exists():
        raise ScenarioError("this is there already; nothing was written", file=str(folder),
                            remedy="Remove it first: certificates of another authority are not believed")
    if shutil.which("openssl") is None:
        raise ScenarioError("the command `openssl` is not there", key="--init-tls", remedy="Install it, once, here")
    folder.parent.mkdir(parents=True, exist_ok=True)
    # Whole or not at all, and for no moment open to others.
    made = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    try:
        _authority(made)
        for role in (COUPLER, *hosts.addresses):
            _certificate(made, role, hosts.addresses.get(role, ""))
        (made / "ca.key").unlink()  # who has it can be anybody; more roles are a new authority
        made.rename(folder)
    finally:
        shutil.rmtree(made, ignore_errors=True)
    return folder


def _authority(made: Path) -> None:
    _openssl("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", str(DAYS),
             "-subj", "/CN=slideline hosts", "-keyout", str(made / "ca.key"), "-out", str(made / CA),
             "-addext", "keyUsage=critical,keyCertSign")


def _certificate(made: Path, role: str, address: str) -> None:
    own = made / role
    own.mkdir(mode=0o700)
    names = f"{_name_of(address)}," if address else ""
    (own / "extensions").write_text(f"subjectAltName={names}DNS:{role}\nbasicConstraints=CA:FALSE\n"
                                    "extendedKeyUsage=serverAuth,clientAuth\n")
    _openssl("req", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-subj", f"/CN={role}",
             "-keyout", str(own / KEY), "-out", str(own / "request"))
    _openssl("x509", "-req", "-in", str(own / "request"), "-CA", str(made / CA), "-CAkey", str(made / "ca.key"),
             "-set_serial", str(secrets.randbits(64)), "-days", str(DAYS), "-extfile", str(own / "extensions"),
             "-out", str(own / CERTIFICATE))
    shutil.copy(made / CA, own / CA)
    (own / SECRET).touch(mode=0o600)
    (own / SECRET).write_text(secrets.token_bytes(SECRET_BYTES).hex() + "\n")
    (own / KEY).chmod(0o600)
    for done in ("request", "extensions"):
        (own / done).unlink()
    if role != COUPLER:
        # The coupler asks each role by the secret that the two have in common.
        shutil.copy(own / SECRET, made / COUPLER / f"{SECRET}.{role}")


def _name_of(address: str) -> str:
    match = ENDPOINT.fullmatch(address)
    assert match is not None
    host = match["six"] or match["host"]
    try:
        return f"IP:{ipaddress.ip_address(host)}"
    except ValueError:
        return f"DNS:{host}"


def _openssl(*arguments: str) -> None:
    done = subprocess.run(["openssl", *arguments], capture_output=True, text=True, errors="replace",
                          stdin=subprocess.DEVNULL, check=False)
    if done.returncode != 0:
        raise ScenarioError(f"openssl {arguments[0]} failed: {done.stderr.strip()}", key="--init-tls")
