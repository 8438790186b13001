"""docs/contact_service.md is what programs of others are written by: its tables, its bytes and its client are held."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
import pytest

from contact import messages
from contact.codec import encode
from contact.messages import WIRE_VERSION, Project, Refused
from contact.rpc.seal import Seal
from contact.service import ContactService

PAGE = (Path(__file__).resolve().parents[2] / "docs/contact_service.md").read_text(encoding="utf-8")
TABLE = re.compile(r"^### (?P<name>\w+)\n[^#]*?^\|---\|---\|---\|\n(?P<rows>(?:\|[^\n]*\n)+)", re.M)
ROW = re.compile(r"\| `(\w+)` \| (.*?) \| (.+) \|")
TABLES = {found["name"]: ROW.findall(found["rows"]) for found in TABLE.finditer(PAGE)}
LIFE, RUN, SECRET = "0011223344556677", "mine", bytes(range(32))
SEAL = Seal(RUN, SECRET)


def kind(hint: Any) -> str:
    """What a type is called on the page, without its shape."""
    if get_origin(hint) is UnionType or type(None) in get_args(hint):
        inner = next(a for a in get_args(hint) if a is not type(None))
        return f"{kind(inner)} or nil"
    if hint == messages.Floats:
        return "f8"
    return "i4" if hint == messages.Ints else "map" if hint is messages.Passes else str(hint.__name__)


@pytest.mark.parametrize("message", ["Passes", *(m.__name__ for m in (*get_args(messages.Request),
                                                                      *get_args(messages.Reply)))])
def test_every_field_of_every_message_is_on_the_page_in_its_order(message: str) -> None:
    hints = get_type_hints(getattr(messages, message))
    told = [(name, re.sub(r" \([^)]*\)", "", type_)) for name, type_, _ in TABLES[message]]
    assert told == [(name, kind(hint)) for name, hint in hints.items()]


def test_shapes_are_those_that_the_service_gives() -> None:
    """Two edges that face each other: n_s 4, n_q 4, no ties; n_p, n_b as they come, but one number for all fields."""
    i, f = (lambda *v: np.array(v, np.int32)), (lambda *v: np.array(v, np.float64))
    service = ContactService()
    passes = messages.Passes(i(0), i(1), i(0), f(1), i(0), f(1), f(1e9), f(1e9), f(0))
    known = service.handle(messages.Register(4, np.array([[1, 0], [2, 3]], np.int32), i(0, 1), False, passes))
    assert isinstance(known, messages.Registered)
    x, zeros = np.array([[0, 0], [1, 0], [0.25, -1e-3], [1.5, -1e-3]]), np.zeros(4)
    traction = (known.surfaces, x, zeros, x, zeros, zeros)
    for request in (Project(known.surfaces, x), messages.Traction(*traction), messages.Coupling(*traction)):
        reply, sizes = service.handle(request), {"n_s": 4, "n_q": 4, "n_m": 4}
        for name, type_, _ in TABLES[type(reply).__name__]:
            if shape := re.search(r"\((.*)\)", type_):
                got = getattr(reply, name).shape
                words = [word.strip() for word in shape[1].split(",") if word.strip()]
                assert len(got) == len(words), name
                for size, word in zip(got, words, strict=True):
                    letters, _, more = word.partition(" + ")
                    want = int(letters) if letters.isdigit() else sizes.setdefault(letters, size)
                    assert size == want + int(more or 0), (name, word)
        assert "n_p" in sizes or "n_b" in sizes


def test_the_version_is_the_one_that_is_spoken() -> None:
    assert f'"version": {WIRE_VERSION},' in PAGE
    assert PAGE.count(f'"version": {WIRE_VERSION}') == 2  # the layout and the client


def value_of(what: str) -> str:
    found = re.search(rf"^\| {re.escape(what)} \| `([^`]*)` \|$", PAGE, re.M)
    assert found
    return found[1]


def hexadecimal(after: str) -> bytes:
    found = re.search(r"```text\n([0-9a-f\n]+)```", PAGE[PAGE.index(after):])
    assert found
    return bytes.fromhex(found[1])


def test_the_vectors_are_what_this_side_says() -> None:
    question = encode(Project("ab12", np.array([[0.0, 0.0], [1.0, 0.5]])))
    answer = encode(Refused("unknown_surfaces", "no surfaces are registered as 'ab12'"))
    assert hexadecimal("The question, Project") == question
    assert hexadecimal("The answer, Refused") == answer
    role, instance = value_of("ROLE"), value_of("INSTANCE")
    assert role == SEAL.name("contact")
    assert instance.startswith(LIFE)
    assert SEAL.made("contact", instance)
    key, envelope = f"slideline/{RUN}/{role}/{instance}/v1/ask", f"{instance}/me/1/1"
    assert SEAL.signed(f"ask {key} {envelope}", question, value_of("signature of the question"))
    assert SEAL.signed(f"answer {key} {envelope}/ok", answer, value_of("signature of the answer, `ok`"))
    assert SECRET.hex() in PAGE


def client(folder: Path, more: str = "") -> Path:
    found = re.search(r"<!-- file: client.py -->\n```python\n(.*?)```", PAGE, re.S)
    assert found
    (folder / "client.py").write_text(found[1] + more)
    return folder / "client.py"


def test_the_client_of_the_page_is_answered_and_needs_nothing_of_ours(tmp_path: Path) -> None:
    """A gap of 0.1 m; with another secret nobody; a message sent twice is not answered twice."""
    asks, again = client(tmp_path).read_text(), '    ask(session, 2, "Project", surfaces="", x=f(0))\n'
    assert not re.search(r"\b(contact|coupler|slideline)\b[. ]*(import|rpc)", asks)
    with subprocess.Popen([sys.executable, "-m", "contact.rpc.serve", "--run", RUN, "--child"], stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE, text=True) as service:
        assert service.stdin is not None
        assert service.stdout is not None
        service.stdin.write(SECRET.hex() + "\n")
        service.stdin.flush()
        endpoint = service.stdout.readline().split()[1]

        def done(secret: bytes, more: str = "") -> subprocess.CompletedProcess[str]:
            return subprocess.run([sys.executable, str(client(tmp_path, more)), endpoint, RUN], input=secret.hex(),
                                  text=True, capture_output=True, timeout=120, check=False)

        right, stranger, replay = done(SECRET), done(bytes(32)), done(SECRET, again)
        service.kill()
    assert right.returncode == 0, right.stderr
    gaps = json.loads(re.sub(r"\s+", ",", right.stdout.strip().replace("[ ", "[")))
    np.testing.assert_allclose(gaps, 0.1, rtol=1e-12)
    assert len(gaps) >= 2
    assert stranger.returncode == 1
    assert "nobody who has the secret is there" in stranger.stderr
    # It begins anew under one name: what it sent before was heard, so nothing of it is new.
    assert replay.returncode == 1
    assert "nobody who has the secret answered" in replay.stderr
