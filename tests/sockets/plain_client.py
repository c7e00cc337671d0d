"""A client written from docs/protocol.md alone, with nothing but pyzmq and msgpack; prints what it found as JSON.

Usage: python -I plain_client.py shape ADDRESS, or python -I plain_client.py env CONTROL FRAMES
"""

import json
import math
import struct
import sys

import msgpack
import zmq

LIMIT = 60_000  # ms


def connect(kind, address):
    socket = zmq.Context.instance().socket(kind)
    socket.setsockopt(zmq.LINGER, 0)
    if kind == zmq.SUB:
        socket.setsockopt(zmq.RCVHWM, 0)
        socket.setsockopt(zmq.SUBSCRIBE, b"")
    socket.connect(address)
    return socket


def receive(socket):
    if not socket.poll(LIMIT):
        sys.exit("no answer")
    return msgpack.unpackb(socket.recv())


def ask(socket, **message):
    socket.send(msgpack.packb(message))
    return receive(socket)


def pack(shape, *values):
    return {"dtype": "<f8", "shape": shape, "data": struct.pack(f"<{len(values)}d", *values)}


def unpack(array):
    code = {"<f8": "d", "<i8": "q"}[array["dtype"]]
    return struct.unpack(f"<{math.prod(array['shape'])}{code}", array["data"])


def rows(array):
    flat, width = unpack(array), array["shape"][1]
    return [flat[place : place + width] for place in range(0, len(flat), width)]


def shape(address):
    socket = connect(zmq.DEALER, address)
    welcome = ask(socket, type="Hello", version=5, role="plain client", project="cablecosim")
    half = math.sqrt(0.5)
    request = {
        "type": "ShapeRequest", "session": "plain", "step": 0, "round": 0, "gravity": [0.0, 0.0, -9.81], "tolerance": 1e-3,
        "problems": [{
            "cable": {"name": "cable", "length": 1.0, "diameter": 0.008, "mass_per_length": 0.06, "bending": 0.01, "twist": 0.008},
            "grasps": {
                "s": pack([2], 0.0, 1.0),
                "position": pack([2, 3], -0.4, 0.0, 0.0, 0.4, 0.0, 0.0),
                "quaternion": pack([2, 4], 0.0, half, 0.0, half, 0.0, half, 0.0, half),
                "hold": ["clamp", "hinge"],
            },
        }],
    }  # fmt: skip
    reply = ask(socket, **request)
    while reply["type"] == "Beat":
        reply = receive(socket)
    key = [reply[name] for name in ("session", "step", "round")]
    again = ask(socket, **request)
    wrong = ask(socket, **{**request, "tolerance": -1.0})
    return {
        "welcome": welcome, "key": key, "again": again == reply, "error": [wrong["type"], wrong["code"], wrong["key"]],
        "outcome": reply["shapes"][0]["outcome"], "nodes": rows(reply["shapes"][0]["nodes"]),
        "force": [sum(column) for column in zip(*rows(reply["shapes"][0]["grasp_wrenches"]), strict=True)][:3],
    }  # fmt: skip


def env(control, frames):
    stream, socket = connect(zmq.SUB, frames), connect(zmq.DEALER, control)
    welcome = ask(socket, type="Hello", version=5, role="plain client", project="cablecosim")
    while (statistics := ask(socket, type="StatisticsRequest"))["state"] != "ready":
        if statistics["state"] == "failed":
            sys.exit(statistics["sentence"])
    snapshot = ask(socket, type="SnapshotRequest")
    started = ask(socket, type="StartRun", recorders=1)
    sequences, lowest = [], math.inf
    while (message := receive(stream))["type"] == "Frame":
        sequences.append(message["sequence"])
        lowest = min(lowest, *(node[2] for node in rows(message["shapes"][0]["nodes"])))
    while (statistics := ask(socket, type="StatisticsRequest"))["state"] == "running":
        pass  # the stream may be a moment ahead of the statistics
    stopped = ask(socket, type="Stop")
    return {
        "welcome": welcome, "title": snapshot["scene"]["title"], "solids": [solid["name"] for solid in snapshot["solids"]],
        "steps": snapshot["steps"], "started": started, "sequences": sequences, "lowest": lowest, "finished": message,
        "state": statistics["state"], "stopped": stopped,
    }  # fmt: skip


if __name__ == "__main__":
    found = {"shape": shape, "env": env}[sys.argv[1]](*sys.argv[2:])
    found["ours"] = sorted({"protocol", "shape_server", "env_server", "viz_client", "scenarios", "msgspec", "numpy"} & set(sys.modules))
    json.dump(found, sys.stdout)
