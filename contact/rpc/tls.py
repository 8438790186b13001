"""TLS between machines: certificates by the name of a role, and who may say what to whom.

Both ends show a certificate of one small authority (mTLS).  The name in it (CN) is the role of its owner, and each end
lets in only the roles that it expects, and only for what they do: everything else is denied, in silence.  A role has,
besides, a secret that only it and the coupler know, with which they sign what they say before there is a run.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from contact.rpc.calls import LinkSpecError
from contact.rpc.seal import secret_line

ENDPOINT = re.compile(r"tls/(?:\[(?P<six>[0-9a-fA-F:.]+)\]|(?P<host>[A-Za-z0-9.-]+)):(?P<port>[0-9]{1,5})")
CA, CERTIFICATE, KEY, SECRET = "ca.pem", "certificate.pem", "key.pem", "secret"
KEYS = "slideline/**"
# What passes, by who opens the talk: questions and their answers, and tokens both ways.
_TO_SERVER = ("query", "liveliness_query", "declare_liveliness_subscriber", "liveliness_token")
_FROM_SERVER = ("reply", "declare_queryable", "liveliness_token")


@dataclass(frozen=True)
class Tls:
    """What a process shows and whom it believes.

    folder : of its role, with ca.pem, certificate.pem, key.pem and secret.  callers : roles that may ask it.
    servers : roles that it asks.
    """

    folder: Path
    callers: tuple[str, ...] = ()
    servers: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in (CA, CERTIFICATE, KEY):
            if not (self.folder / name).is_file():
                raise LinkSpecError(f"{self.folder / name} is not there; `slideline host --init-tls` makes it, and the "
                                    "folder of a role is copied to the machine of that role")
        if others := self.open_files():
            raise LinkSpecError(f"others may read {', '.join(map(str, others))}: `chmod 600` it")

    def open_files(self) -> list[Path]:
        """Its key and secrets (of the coupler, those of all roles) that others than their owner may read."""
        # fault: a secret that others may read is used -> kept = [self.folder / KEY] |
        #   coupler/test_hosts::test_certificates_are_made_once_and_their_keys_are_their_owners
        kept = [self.folder / KEY, *sorted(self.folder.glob(f"{SECRET}*"))]
        # fault: a key that others may read is used -> return [] |
        #   coupler/test_hosts::test_certificates_are_made_once_and_their_keys_are_their_owners
        return [path for path in kept if path.stat().st_mode & 0o077]

    def settings(self) -> dict[str, object]:
        """The settings of zenoh."""
        own = {n: str(self.folder / f) for n, f in (("certificate", CERTIFICATE), ("private_key", KEY))}
        keys: dict[str, object] = {
            "root_ca_certificate": str(self.folder / CA), "enable_mtls": True, "verify_name_on_connect": True,
            **{f"{way}_{n}": file for way in ("listen", "connect") for n, file in own.items()}}
        return {**{f"transport/link/tls/{n}": value for n, value in keys.items()},
                # Shared memory would carry what is large past the encryption.
                "transport/shared_memory/enabled": False,
                "access_control": self.access()}

    def access(self) -> dict[str, object]:
        """Who may do what: nobody anything but what is said here."""
        rules, subjects, policies = [], [], []
        ways = (("callers", self.callers, _TO_SERVER, _FROM_SERVER),
                ("servers", self.servers, _FROM_SERVER, _TO_SERVER))
        for name, roles, hears, says in ways:
            if roles:
                own = [{"id": f"{name}-{flow}", "permission": "allow", "flows": [flow], "key_exprs": [KEYS],
                        "messages": list(messages)} for flow, messages in (("ingress", hears), ("egress", says))]
                rules += own
                subjects.append({"id": name, "cert_common_names": list(roles)})
                policies.append({"rules": [rule["id"] for rule in own], "subjects": [name]})
        allowed = {"rules": rules, "subjects": subjects, "policies": policies}
        # fault: whoever has a certificate may do anything -> return {"enabled": False} |
        #   coupler/test_hosts::test_a_role_that_is_not_expected_is_shut_out_though_it_has_the_secret
        return {"enabled": True, "default_permission": "deny", **allowed}


def is_tls(endpoint: str) -> bool:
    """Whether an address is `tls/HOST:PORT`."""
    match = ENDPOINT.fullmatch(endpoint)
    return match is not None and int(match["port"]) <= 65535


def secret_of(folder: Path) -> bytes:
    """Return the secret of a role from its folder.  Raises LinkSpecError."""
    try:
        return secret_line((folder / SECRET).read_text(encoding="ascii", errors="replace"))
    except OSError as exc:
        raise LinkSpecError(f"{folder / SECRET} cannot be read ({exc.strerror}); `slideline host --init-tls` makes it"
                            ) from exc
