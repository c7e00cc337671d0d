"""Stands between the environment and the shape server, passes everything on, and keeps what went by."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field

import zmq

from protocol.codec import decode
from protocol.messages import AnyMessage, Beat, Error, Hello, ShapeReply, ShapeRequest, Welcome


@dataclass
class Listener:
    """Use in a `with` statement; `heard` holds (sender, bytes) in the order in which they went by."""

    front: str  # address for the environment
    back: str  # address of the shape server
    heard: list[tuple[str, bytes]] = field(default_factory=list)

    def __enter__(self) -> Listener:
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._pass_on)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def lines(self) -> list[str]:
        """What went by as text; a greeting that was repeated once, and no beats, for both depend on the speed of the machine."""
        lines: list[str] = []
        for sender, data in self.heard:
            message = decode(data)
            line = f"{sender} {_text(message)}"
            if not isinstance(message, Beat) and not (isinstance(message, Hello | Welcome) and line in lines):
                lines.append(line)
        return lines

    def _pass_on(self) -> None:
        context = zmq.Context.instance()
        with context.socket(zmq.ROUTER) as front, context.socket(zmq.DEALER) as back:
            front.bind(self.front)
            back.connect(self.back)
            poller, peer = zmq.Poller(), b""
            for socket in (front, back):
                socket.setsockopt(zmq.LINGER, 0)
                poller.register(socket, zmq.POLLIN)
            while not self._over.is_set():
                for socket, _ in poller.poll(50):
                    if socket is front:
                        peer, data = front.recv_multipart()
                        self.heard.append(("env -> shape", data))
                        back.send(data)
                    else:
                        data = back.recv()
                        self.heard.append(("shape -> env", data))
                        front.send_multipart([peer, data])


def _text(message: AnyMessage) -> str:
    kind = type(message).__name__
    match message:
        case ShapeRequest():
            problem = message.problems[0]
            start = "cold" if problem.start is None else f"from {len(problem.start.s)} nodes"
            contacts = 0 if problem.contacts is None else len(problem.contacts.s)
            return f"{kind} step {message.step} round {message.round} grasps {len(problem.grasps.s)} contacts {contacts} {start}"
        case ShapeReply():
            shape = message.shapes[0]
            ending = f"{shape.outcome.value} {shape.model} nodes {len(shape.s)} contacts {len(shape.contact_s)}"
            return f"{kind} step {message.step} round {message.round} {ending}"
        case Hello() | Welcome():
            return f"{kind} {message.role} version {message.version} of {message.project}"
        case Error():
            return f"{kind} {message.code}: {message.sentence}"
    return kind
