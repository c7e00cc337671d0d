"""What an enemy, or a broken program, could send to a server on loopback; every amount is given, every wait bounded."""

from __future__ import annotations

import random
import socket
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import msgpack
import numpy as np
import zmq
from programs import LIMIT

from protocol.codec import decode, encode
from protocol.errors import CablecosimError
from protocol.messages import AnyMessage, Pause, Resume, ShapeRequest, StartRun, Stop

sys.path.append(str(Path(__file__).parents[1] / "protocol"))
from every_message import every_message, places, replaced
from every_message import request as request

WINDOW = 10  # messages under way; a server keeps twenty of one peer
ARRAYS = [
    ("O", [1], bytes(8)), ("<f8", [-1, 3], bytes(24)), ("<f8", [2**40], b""), ("<i8", [1], bytes(8)), ("<f8", [2, 2, 2], bytes(64)),
    ("<f8", [1], np.array([np.nan]).tobytes()), ("<f8", [2], np.array([1e300, -1e300]).tobytes()), ("f8,f8", [1], bytes(16)),
]  # fmt: skip
STRANGE = [
    *(None, True, -1, 2**63, float("nan"), float("inf"), -1e308, "", "\x00", b"", [], [[[]]], {}),
    *({"dtype": dtype, "shape": shape, "data": data} for dtype, shape, data in ARRAYS),
]
OBEYED = (Stop, StartRun, Pause, Resume)
"""Messages that a server would rightly obey; left out where a mutation has kept them whole."""
WORK = (*OBEYED, ShapeRequest)
"""The same, and what would be worked on."""


def is_left_out(data: bytes, kinds: tuple[type, ...]) -> bool:
    """Whether it is a whole message of one of these kinds."""
    try:
        return isinstance(decode(data), kinds)
    except CablecosimError:
        return False


def mutated(
    count: int, seed: int, messages: Sequence[AnyMessage] = tuple(every_message()), left_out: tuple[type, ...] = WORK
) -> Iterator[bytes]:
    """So many messages with bits, bytes or whole values changed."""
    chance = random.Random(seed)
    encoded = [encode(message) for message in messages]
    plain = [msgpack.unpackb(data) for data in encoded]
    paths = [[path for path, _ in places(message)] for message in plain]
    while count:
        which = chance.randrange(len(encoded))
        if chance.randrange(3) == 0:
            value = replaced(plain[which], chance.choice(paths[which]), chance.choice(STRANGE))
            data = msgpack.packb(value)
        else:
            changed = bytearray(encoded[which])
            for _ in range(chance.choice((1, 1, 2, 8))):
                place = chance.randrange(len(changed))
                changed[place : place + chance.choice((0, 1, 1, 4))] = chance.randbytes(chance.choice((0, 1, 1, 4)))
                changed = changed or bytearray(1)
            data = bytes(changed)
        if not is_left_out(data, left_out):
            count -= 1
            yield data


def monsters() -> Iterator[bytes]:
    """Messages that are large, deep or full of nothing."""
    maps = b"\xdd" + (4_000_000).to_bytes(4, "big") + b"\x80" * 4_000_000
    pairs = b"\xdd" + (1_500_000).to_bytes(4, "big") + b"\x92\xa0\xa0" * 1_500_000
    heads = (b"", b"\x82\xa4type\xacShapeRequest\xa8problems", b"\x82\xa4type\xa4Stop\xa6behind", b"\x82\xa4type\xa5Frame\xa6joints")
    yield from (head + maps for head in heads)
    yield b"\x82\xa4type\xa5Frame\xaacollisions" + pairs
    for nested in (b"\x91", b"\x81\xa1x"):
        yield from (head + nested * 100_000 + b"\xc0" for head in heads)
    yield from (
        head + announced for announced in (b"\xdd\xff\xff\xff\xff", b"\xdf\xff\xff\xff\xff", b"\xc6\xff\xff\xff\xff") for head in heads
    )
    yield bytes(200_000_000)


class Wild:
    """A peer without manners, at one address."""

    def __init__(self, address: str) -> None:
        self._address = address
        self._socket = self._new()
        self.sent = self.answered = self.errors = 0

    def send_all(self, messages: Iterator[bytes]) -> None:
        """Send them, a few under way at a time, and count what comes back."""
        under_way = 0
        for data in messages:
            self._socket.send(data)
            self.sent += 1
            under_way += 1
            if under_way == WINDOW:
                self._receive()
                under_way -= 1
        for _ in range(under_way):
            self._receive()

    def send_monster(self, data: bytes) -> bool:
        """Send it over a connection of its own; whether it got an answer rather than being hung up on."""
        self._socket.close(0)
        self._socket = self._new()
        monitor = self._socket.get_monitor_socket(zmq.EVENT_DISCONNECTED)
        poller = zmq.Poller()
        poller.register(self._socket, zmq.POLLIN)
        poller.register(monitor, zmq.POLLIN)
        self._socket.send(data)
        self.sent += 1
        ready = dict(poller.poll(1000 * LIMIT))
        assert ready, "neither an answer nor a hang-up"
        is_answered = self._socket in ready
        if is_answered:
            self._receive()
        self._socket.disable_monitor()
        monitor.close(0)
        return is_answered

    def close(self) -> None:
        self._socket.close(0)

    def _new(self) -> zmq.Socket[bytes]:
        made: zmq.Socket[bytes] = zmq.Context.instance().socket(zmq.DEALER)
        made.connect(self._address)
        return made

    def _receive(self) -> None:
        data = b"Beat"
        while b"Beat" in data[:20]:
            assert self._socket.poll(1000 * LIMIT), f"{self.sent} sent, {self.answered} answered"
            data = self._socket.recv()
        self.answered += 1
        self.errors += b"Error" in data[:20]


def junk_connections(address: str, count: int, between: Callable[[], None]) -> None:
    """So many TCP connections that speak something else or nothing, a hundred of them open at a time."""
    chance = random.Random(7)
    host, port = address.removeprefix("tcp://").split(":")
    greeting = b"\xff" + bytes(8) + b"\x7f\x03\x00NULL" + bytes(48)
    words = (
        b"GET / HTTP/1.1\r\n\r\n" * 20,
        b"",
        b"\xff",
        greeting[:20],
        greeting,
        greeting + b"\x04\x19\x05READY" + bytes(300),
        b"\x01\x00",
    )
    held: list[socket.socket] = []
    for number in range(count):
        wild = socket.create_connection((host, int(port)), timeout=LIMIT)
        wild.sendall(chance.choice((*words, chance.randbytes(chance.randrange(2000)))))
        held.append(wild)
        if len(held) == 100:
            between()
            for one in held:
                one.close()
            held.clear()
        elif number % 3 == 0:
            held.pop().close()
    for one in held:
        one.close()


def memory(pid: int) -> int:
    """The most physical memory that a process has used since `forget_memory` [kB]."""
    (line,) = (line for line in Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1])


def forget_memory(pid: int) -> int:
    """Measure the most memory anew from now on; what is used now [kB]."""
    Path(f"/proc/{pid}/clear_refs").write_text("5", encoding="ascii")
    return memory(pid)
