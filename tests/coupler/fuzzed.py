"""Messages that nobody would send: what the contact service and a half answer to damaged ones.

    python tests/coupler/fuzzed.py [MESSAGES] [SEED]

Signatures end every forgery before this (contact.rpc.seal); here whoever sends has the secret.  A damaged message is
refused, or happens to be another whole one: then it is carried out.  No bug, no long work, no large answer.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from contact.codec import REQUESTS, Kinds, decode, encode
from contact.messages import Coupling, Project, Refused, Traction
from contact.records import MAX_MESSAGE_HEADER, WireError, decode_record, encode_record
from contact.service import ContactService
from coupler.fmu.host import Hosted
from coupler.fmu.remote import VERBS, Ahead, Deserialise, Failed, Initialise, Read, Release, Restore, Save, Step

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "contact")]
from contact_scenes import flat  # noqa: E402
from counting_half import CountingHalf  # noqa: E402

LONGEST = 5.0  # s of an answer, beside other loads
LARGEST = 16 << 20  # bytes of an answer
MOST_CHANGES = 4  # of a message
ODD = [np.nan, np.inf, -np.inf, 0.0, -1.0, 1e300, -1e-300, 5e-324]
ODD_WHOLE = [-1, 0, 1, 127, 10**5, 2**31 - 1, -(2**31)]
BUG = "bug"


@dataclass(frozen=True)
class Target:
    """Who is asked.  seeds : whole messages, which damaged ones are made of."""

    name: str
    kinds: Kinds
    handle: Callable[[Any], Any]
    seeds: tuple[bytes, ...]


def contact() -> Target:
    """The contact service with two surfaces that press."""
    service = ContactService()
    register, x = flat(5, 7, slide=0.1, gap=-1e-3)
    key = service.handle(register).surfaces
    zeros = np.zeros(len(x))
    with_history = key, x, zeros - 1.0, x - 1e-4, zeros - 1.0, zeros
    seeds = (register, Project(key, x), Traction(*with_history), Coupling(*with_history))
    for seed in seeds:
        assert not isinstance(service.handle(seed), Refused), service.handle(seed)
    return Target("contact", REQUESTS, service.handle, tuple(map(encode, seeds)))


def half() -> Target:
    """A half that counts, behind the process's own reading of verbs."""
    step = Step(0.0, 0.5, {"x": np.arange(8.0).reshape(4, 2)}, ("y",))
    seeds = (Initialise(0.0, 1.0, {"a": "b"}, {}, ("y",)), step, Read(("y",)), Save(1), Restore(1), Release(1),
             Deserialise(2, b"1.0"), Ahead((Save(3), Restore(3), Release(3)), step))
    return Target("half", VERBS, Hosted(CountingHalf()).answer, tuple(map(encode, seeds)))


def damaged(seeds: tuple[bytes, ...], chance: np.random.Generator) -> bytes:
    """A message with bits flipped, bytes set, cut short, made longer, or with a piece of another one."""
    data = bytearray(seeds[chance.integers(len(seeds))])
    for _ in range(chance.integers(1, MOST_CHANGES + 1)):
        at = int(chance.integers(len(data) + 1))
        match int(chance.integers(6)):
            case 0 if data:
                data[at % len(data)] ^= 1 << int(chance.integers(8))
            case 1 if data:
                data[at % len(data)] = int(chance.choice([0x00, 0x7F, 0x80, 0xC0, 0xDC, 0xDF, 0xF0, 0xFF]))
            case 2:
                del data[at:]
            case 3:
                data[at:at] = chance.bytes(int(chance.integers(1, 40)))
            case 4:
                other = seeds[chance.integers(len(seeds))]
                begin = int(chance.integers(len(other)))
                data[at:at] = other[begin:begin + int(chance.integers(1, 200))]
            case _:
                del data[at:at + int(chance.integers(1, 40))]
    return bytes(data)


def twisted(seeds: tuple[bytes, ...], chance: np.random.Generator) -> bytes:
    """A message that is whole as a record, with values, shapes and types of its arrays that nobody meant."""
    name, meta, arrays = decode_record(seeds[chance.integers(len(seeds))], MAX_MESSAGE_HEADER)
    arrays = {path: np.array(value) for path, value in arrays.items()}
    for path in list(arrays):
        value = arrays[path]
        if chance.random() < 0.5 or value.dtype.kind not in "if":
            continue
        match int(chance.integers(6)):
            case 0 | 1 | 2 if value.size:
                odd = ODD if value.dtype.kind == "f" else [n for n in ODD_WHOLE if np.iinfo(value.dtype).max >= abs(n)]
                value.reshape(-1)[chance.integers(value.size)] = chance.choice(odd)
            case 3:
                value = np.resize(value, int(chance.integers(0, 3 * value.size + 2)))
            case 4:
                value = value.reshape(-1) if value.ndim > 1 else value[:, None]
            case _:
                value = value.astype(chance.choice(["<f4", "<i8", "|b1"]))
        arrays[path] = value
    return encode_record(name, meta, arrays)


def answer_to(target: Target, data: bytes) -> str:
    """What becomes of a message: unreadable, refused, answered, or a bug and its text."""
    begun = time.perf_counter()
    try:
        request = decode(data, target.kinds, MAX_MESSAGE_HEADER)
    except WireError:
        request = None
    except Exception as exc:  # noqa: BLE001  what is looked for
        return f"{BUG}: {type(exc).__name__} while reading: {exc}"
    reply: Any = None
    if request is not None:
        try:
            reply = target.handle(request)
        except Exception as exc:  # noqa: BLE001  what is looked for
            return f"{BUG}: {type(exc).__name__} from {type(request).__name__}: {exc}"
        if isinstance(reply, Refused) and reply.code == BUG:
            return f"{BUG}: {reply.message}"
        if len(encode(reply)) > LARGEST:
            return f"{BUG}: {len(encode(reply))} bytes of an answer to {len(data)}"
    if (took := time.perf_counter() - begun) > LONGEST:
        return f"{BUG}: {took:.1f} s for {len(data)} bytes"
    return "unreadable" if request is None else "refused" if isinstance(reply, Refused | Failed) else "answered"


def fuzz(messages: int, seed: int) -> tuple[dict[str, Counter[str]], list[str]]:
    """Send damaged messages to each target in turn; what became of them, and every bug."""
    chance, found, bugs = np.random.default_rng(seed), {}, []
    with np.errstate(all="ignore"):
        for target in (contact(), half()):
            counts = found.setdefault(target.name, Counter())
            for _ in range(messages // 2):
                make = twisted if chance.random() < 0.5 else damaged
                what = answer_to(target, make(target.seeds, chance))
                counts[what.partition(":")[0]] += 1
                if what.startswith(BUG):
                    bugs.append(f"{target.name}: {what}")
            # After all that it still answers as before.
            for data in target.seeds[:2]:
                if (what := answer_to(target, data)) != "answered":
                    bugs.append(f"{target.name}: {BUG}: a whole message is {what} afterwards")
    return found, bugs


def main(messages: int = 100_000, seed: int = 1) -> int:
    """Tell what became of damaged messages; 1 where one was more than refused."""
    found, bugs = fuzz(messages, seed)
    for name, counts in found.items():
        print(f"{name}: " + ", ".join(f"{n} {what}" for what, n in counts.most_common()))
    for bug in bugs[:20]:
        print(bug)
    return 1 if bugs else 0


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
