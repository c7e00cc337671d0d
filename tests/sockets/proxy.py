"""A bad line between two programs: it loses messages, holds them up, doubles them, changes their order and brings back old ones."""

from __future__ import annotations

import random
import threading
from collections import Counter
from dataclasses import dataclass, field

import zmq

LATE = 3  # messages by which one is held up
HELD_MAX = 300  # ms after which what is held up goes on anyway


@dataclass
class Proxy:
    """Use in a `with` statement. With `stream`, from a publisher to its subscribers; else requests there and replies back."""

    front: str  # address for those who connect
    back: str  # address of the one who listens
    seed: int
    stream: bool = False
    share: float = 0.04  # of the messages, for each kind of trouble
    troubles: Counter[str] = field(default_factory=Counter)

    def __enter__(self) -> Proxy:
        self._over = threading.Event()
        self._chance = random.Random(self.seed)
        self._lines = {name: _Line(self._chance, self.troubles, self.share) for name in ("there", "back")}
        self._thread = threading.Thread(target=self._carry)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _carry(self) -> None:
        context = zmq.Context.instance()
        kinds = (zmq.XPUB, zmq.XSUB) if self.stream else (zmq.ROUTER, zmq.DEALER)
        with context.socket(kinds[0]) as front, context.socket(kinds[1]) as back:
            for socket in (front, back):
                socket.setsockopt(zmq.LINGER, 0)
                socket.setsockopt(zmq.SNDHWM, 0)
                socket.setsockopt(zmq.RCVHWM, 0)
            front.bind(self.front)
            back.connect(self.back)
            poller = zmq.Poller()
            for socket in (front, back):
                poller.register(socket, zmq.POLLIN)
            peer: list[bytes] = []
            while not self._over.is_set():
                ready = dict(poller.poll(HELD_MAX))
                if not ready:
                    for data in self._lines["there"].rest():
                        back.send(data)
                    for data in self._lines["back"].rest():
                        front.send_multipart([*peer, data])
                if front in ready:
                    *peer_now, data = front.recv_multipart()
                    peer = peer_now
                    for passed in [data] if self.stream else self._lines["there"].through(data):
                        back.send(passed)
                if back in ready:
                    data = back.recv()
                    for passed in self._lines["back"].through(data):
                        front.send_multipart([*peer, passed])


class _Line:
    """One direction."""

    def __init__(self, chance: random.Random, troubles: Counter[str], share: float) -> None:
        self._chance, self._troubles, self._share = chance, troubles, share
        self._held: list[tuple[int, bytes]] = []
        self._past: list[bytes] = []
        self._count = 0

    def through(self, data: bytes) -> list[bytes]:
        """What comes out when a message goes in."""
        self._count += 1
        self._past = [*self._past[-50:], data]
        passed = {"lost": [], "doubled": [data, data], "late": [], "stale": [data, self._chance.choice(self._past)], "": [data]}
        kinds = ["lost", "doubled", "late", "stale", ""]
        (kind,) = self._chance.choices(kinds, [self._share] * 4 + [1 - 4 * self._share])
        if b"Hello" in data[:30] or b"Welcome" in data[:30]:
            kind = ""  # greetings are said again after a second, which would only make the test longer
        self._troubles[kind] += 1
        if kind == "late":
            self._held.append((self._count + LATE, data))
        out = passed[kind] + [held for due, held in self._held if due <= self._count]
        self._held = [(due, held) for due, held in self._held if due > self._count]
        return out

    def rest(self) -> list[bytes]:
        """What was held up, when nothing else comes."""
        out, self._held = [held for _, held in self._held], []
        return out
