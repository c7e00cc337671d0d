"""How messages travel: ZeroMQ sockets with limits, time-outs and addresses that only their owner can reach.

Requests go from a `Client` (DEALER) to a `Server` (ROUTER), streams from a `Publisher` (XPUB) to a `Subscriber` (SUB).
There is no REQ/REP, which hangs for ever when its peer dies. Every wait takes a time-out. A message that does not decode
is answered with an `Error` and changes nothing. Addresses are `ipc://PATH` or `tcp://127.0.0.1:PORT` (port 0 or `*`
takes a free one); tcp beyond loopback needs keys (`keys.py`), and is refused without them.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Final

import zmq

from . import PROJECT, VERSION
from .codec import decode, encode
from .errors import CablecosimError, MessageError, PeerLostError, VersionError
from .keys import Keys
from .messages import AnyMessage, Error, Hello, Message, Welcome
from .sockets import HEARTBEAT as HEARTBEAT
from .sockets import SEND_LIMIT, Bound, connected

SIZE_MAX: Final = 32 * 2**20  # bytes of a request or reply; 20 000 nodes take 4.2 MB
SNAPSHOT_SIZE_MAX: Final = 256 * 2**20  # bytes of a message from the environment, which may hold meshes
QUEUE: Final = 20  # messages from or to one peer of a server; who asks waits for the answer, so that more is abuse
SUBSCRIPTION_MAX: Final = 1024  # bytes of what a subscriber may say; the greeting with keys takes 300


class Server:
    """Answers peers; speaks first only to those that have spoken.

    A `Hello` is answered here, with the `Welcome` given, or with an `Error` if its version or project differs.
    """

    def __init__(self, address: str, welcome: Callable[[], Welcome], *, size_max: int = SIZE_MAX, keys: Keys | None = None) -> None:
        self._bound = Bound(zmq.ROUTER, address, size_max=size_max, send_queue=QUEUE, receive_queue=QUEUE, keys=keys)
        self._bound.socket.setsockopt(zmq.ROUTER_MANDATORY, 1)
        self._welcome = welcome
        self.address = self._bound.address
        self.rejected = 0  # messages that were no messages, so far

    def receive(self, timeout: float) -> tuple[bytes, AnyMessage] | None:
        """Next message and its sender; None after `timeout` seconds without one."""
        socket = self._bound.socket
        if not socket.poll(int(1000 * timeout), zmq.POLLIN):
            return None
        parts = socket.recv_multipart()
        peer = parts[0]
        try:
            if len(parts) != 2:
                raise MessageError(f"a message has one part, not {len(parts) - 1}")
            message = decode(parts[1])
        except CablecosimError as error:
            self.rejected += 1
            self.send(peer, Error(code="message", sentence=str(error), key=error.key))
            return None
        if isinstance(message, Hello):
            self._greet(peer, message)
            return None
        return peer, message

    def send(self, peer: bytes, message: Message) -> None:
        """Send to a peer; nothing happens if it has gone."""
        self.send_bytes(peer, encode(message))

    def send_bytes(self, peer: bytes, data: bytes) -> None:
        """Send an encoded message to a peer; nothing happens if it has gone."""
        try:
            self._bound.socket.send_multipart([peer, data], zmq.NOBLOCK)
        except zmq.ZMQError as error:
            if error.errno not in (zmq.EHOSTUNREACH, zmq.EAGAIN):
                raise

    def close(self) -> None:
        """Stop listening."""
        self._bound.close()

    def _greet(self, peer: bytes, hello: Hello) -> None:
        if hello.project != PROJECT or hello.version != VERSION:
            sentence = (
                f"the peer '{hello.role}' speaks version {hello.version} of {hello.project!r}, "
                f"this program version {VERSION} of {PROJECT!r}; install the same version on both sides"
            )
            self.send(peer, Error(code="version", sentence=sentence))
        else:
            self.send(peer, self._welcome())


class Client:
    """Asks one server."""

    def __init__(self, address: str, role: str, keys: Keys | None = None) -> None:
        self.address = address
        self.role = role
        self._socket = connected(zmq.DEALER, address, size_max=SNAPSHOT_SIZE_MAX, queue=1000, keys=keys, options={})
        self._advice = "is the program started?" if keys is None else "is the program started, and are our keys known there?"

    def send(self, message: Message) -> None:
        """Send a message; it waits here until the server is there."""
        self.send_bytes(encode(message))

    def send_bytes(self, data: bytes) -> None:
        """Send an encoded message.

        Raises:
            MessageError: If it is larger than any server takes; ZeroMQ would drop it without a word.
            PeerLostError: If so many messages wait for the server already that there is no room for one more.
        """
        if len(data) > SIZE_MAX:
            raise MessageError(f"the message has {len(data) / 2**20:.1f} MiB; at most {SIZE_MAX / 2**20:g} can be sent, use fewer nodes")
        try:
            self._socket.send(data)
        except zmq.Again as error:
            raise PeerLostError(
                f"nobody at {self.address} has taken a message for {SEND_LIMIT / 1000:g} s; is the program started?", key=self.address
            ) from error

    def receive_bytes(self, timeout: float) -> bytes | None:
        """Next message undecoded; None after `timeout` seconds without one."""
        if not self._socket.poll(math.ceil(1000 * timeout), zmq.POLLIN):
            return None
        return self._socket.recv()

    def receive(self, timeout: float) -> AnyMessage | None:
        """Next message; None after `timeout` seconds without one."""
        data = self.receive_bytes(timeout)
        return None if data is None else decode(data)

    def greet(self, timeout: float) -> Welcome:
        """Say hello, and again every second, until the server answers.

        Raises:
            VersionError: If the server speaks another version.
            PeerLostError: If nobody answered within `timeout` seconds.
        """
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0:
            self.send(Hello(version=VERSION, role=self.role))
            answer = self.receive(max(0.01, min(1.0, left)))
            if isinstance(answer, Welcome):
                self._drain()
                return answer
            if isinstance(answer, Error):
                raise VersionError(answer.sentence, key=answer.key)
        raise PeerLostError(f"nobody answered at {self.address} within {timeout:g} s; {self._advice}", key=self.address)

    def ask(self, message: Message, timeout: float) -> AnyMessage:
        """Send a message and wait for its answer, which may be an `Error`.

        Raises:
            PeerLostError: If no answer came within `timeout` seconds.
        """
        self.send(message)
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0:
            answer = self.receive(left)
            if answer is not None and not isinstance(answer, Welcome):
                return answer
        raise PeerLostError(f"{self.address} did not answer a {type(message).__name__} within {timeout:g} s; see its log", key=self.address)

    def close(self) -> None:
        """Hang up."""
        self._socket.close(linger=0)

    def _drain(self) -> None:
        """Forget the answers to greetings that were said more than once."""
        while self._socket.poll(0, zmq.POLLIN):
            self._socket.recv()


class Publisher:
    """Sends a stream to whoever has joined; a viewer that cannot follow is never waited for.

    With `lossless`, what a subscriber has not read yet is kept for it without limit; otherwise only the newest two are.
    """

    def __init__(self, address: str, *, lossless: bool, keys: Keys | None = None) -> None:
        queue = 0 if lossless else 2
        self._bound = Bound(zmq.XPUB, address, size_max=SUBSCRIPTION_MAX, send_queue=queue, receive_queue=QUEUE, keys=keys)
        # Every subscriber is to be counted, though all ask for the same.
        self._bound.socket.setsockopt(zmq.XPUB_VERBOSER, 1)
        self.address = self._bound.address
        self.subscribers = 0

    def publish(self, data: bytes) -> None:
        """Send an encoded message to all."""
        self._bound.socket.send(data)

    def wait_for(self, count: int, timeout: float) -> bool:
        """Whether `count` subscribers have joined within `timeout` seconds; what is sent from then on reaches them all."""
        end = time.monotonic() + timeout
        while self.subscribers < count:
            left = end - time.monotonic()
            if left <= 0 or not self._bound.socket.poll(int(1000 * left), zmq.POLLIN):
                return False
            self.subscribers += {b"\x01": 1, b"\x00": -1}.get(self._bound.socket.recv(), 0)  # anything else is no subscription to all
        return True

    def close(self) -> None:
        """End the stream."""
        self._bound.close()


class Subscriber:
    """Follows a stream: every message in order, or with `latest_only` just the newest one."""

    def __init__(self, address: str, *, latest_only: bool = False, keys: Keys | None = None) -> None:
        self.address = address
        options: dict[int, int | bytes] = {zmq.CONFLATE: int(latest_only), zmq.RECONNECT_IVL: 5, zmq.SUBSCRIBE: b""}
        self._socket = connected(zmq.SUB, address, size_max=SNAPSHOT_SIZE_MAX, queue=0, keys=keys, options=options)

    def receive(self, timeout: float) -> bytes | None:
        """Next message undecoded; None after `timeout` seconds without one."""
        if not self._socket.poll(int(1000 * timeout), zmq.POLLIN):
            return None
        return self._socket.recv()

    def close(self) -> None:
        """Leave the stream."""
        self._socket.close(linger=0)
