"""The contact service asked by a program that has nothing of ours but the secret of the run, on its standard input.

    python open_client.py ENDPOINT RUN
"""

import hmac
import json
import math
import struct
import sys
import zlib

import msgpack
import numpy as np
import zenoh

endpoint, run = sys.argv[1:3]
secret = bytes.fromhex(sys.stdin.readline())


def sign(about, payload=b""):
    return hmac.new(secret, b"\0".join([run.encode(), about.encode(), payload]), "sha256").hexdigest()


def encode(name, fields):
    arrays, meta = {}, {}

    def walk(given, into, path):
        for key, value in given.items():
            if isinstance(value, dict):
                into[key] = {}
                walk(value, into[key], f"{path}.{key}")
            elif isinstance(value, np.ndarray):
                arrays[f"{path}.{key}"], into[key] = value, None
            else:
                into[key] = value

    walk(fields, meta, name)
    table, body = [], b""
    for key, a in arrays.items():
        table.append([key, a.dtype.str, list(a.shape), len(body), a.nbytes])
        body += a.tobytes() + bytes(-a.nbytes % 64)
    head = msgpack.packb({"version": 8, "name": name, "meta": meta, "arrays": table})
    front = struct.pack("<4sII", b"SLDW", len(head), zlib.crc32(head)) + head
    return front + bytes(-len(front) % 64) + body


def decode(data):
    end = 12 + struct.unpack("<I", data[4:8])[0]
    head, start = msgpack.unpackb(data[12:end]), end + -end % 64
    out = dict(head["meta"])
    for key, kind, shape, offset, _ in head["arrays"]:
        out[key] = np.frombuffer(data, kind, math.prod(shape), start + offset).reshape(shape)
    return head["name"], out


def ask(number, name, fields):
    payload, envelope = encode(name, fields), f"{instance}/me/{number}/1"
    for reply in session.get(key, payload=payload, attachment=f"{envelope}/{sign(f'ask {key} {envelope}', payload)}",
                             encoding="application/x-slideline", timeout=60.0, target=zenoh.QueryTarget.ALL):
        data, label = reply.ok.payload.to_bytes(), reply.ok.attachment.to_string()
        for said in (f"{envelope}/ok", f"{envelope}/failed"):
            if hmac.compare_digest(label, f"{said}/{sign(f'answer {key} {said}', data)}"):
                return decode(data) if said.endswith("ok") else data.decode()
    return "nobody who has the secret answered"


config = zenoh.Config()
for setting, value in {"mode": "client", "connect/endpoints": [endpoint], "scouting/multicast/enabled": False}.items():
    config.insert_json5(setting, json.dumps(value))
with zenoh.open(config) as session:
    role = sign("role contact")[:24]
    lives = [str(r.ok.key_expr).rpartition("/")[2] for r in session.liveliness().get(f"slideline/{run}/alive/{role}/*")]
    (instance,) = [life for life in lives if life[17:] == sign("life contact", life[:16].encode())[:24]]
    key = f"slideline/{run}/{role}/{instance}/v1/ask"
    i, f = (lambda *v: np.array(v, "<i4")), (lambda *v: np.array(v, "<f8"))
    passes = {"pair": i(0), "slave": i(1), "master": i(0), "weight": f(1), "by_node": i(0), "gap_max": f(1),
              "eps_N": f(1e9), "eps_T": f(1e9), "mu": f(0), "depth": None, "tied": None,
              "smooth": None}
    _, known = ask(1, "Register", {
        "n_nodes": 4, "edges": np.array([[1, 0], [2, 3]], "<i4"), "edge_surface": i(0, 1), "axisymmetric": False,
        "passes": passes, "stiffness": None, "offset": None, "x": None})
    _, facing = ask(2, "Project", {"surfaces": known["surfaces"],
                                   "x": np.array([[0, 0], [1, 0], [0.25, 0.1], [1.5, 0.1]])})
    print(json.dumps({"gap": facing["Facing.gap"].tolist(), "again": ask(2, "Project", {})}))
