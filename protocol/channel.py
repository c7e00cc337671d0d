"""How messages travel: ZeroMQ sockets with limits, time-outs and addresses that only their owner can reach.

Requests go from a `Client` (DEALER) to a `Server` (ROUTER), streams from a `Publisher` (XPUB) to a `Subscriber` (SUB).
There is no REQ/REP, which hangs for ever when its peer dies. Every wait takes a time-out. A message that does not decode
is answered with an `Error` and changes nothing. Addresses are `ipc://PATH` or `tcp://127.0.0.1:PORT` (port 0 or `*`
takes a free one); tcp beyond loopback would need encryption, which is not built, and is refused.
"""

from __future__ import annotations

import fcntl
import math
import os
import time
from collections.abc import Callable
from typing import Final

import zmq

from . import PROJECT, VERSION
from .address import check_address
from .codec import decode, encode
from .errors import AddressError, CablecosimError, MessageError, PeerLostError, VersionError
from .messages import AnyMessage, Error, Hello, Message, Welcome

SIZE_MAX: Final = 32 * 2**20  # bytes of a request or reply; 20 000 nodes take 4.2 MB
SNAPSHOT_SIZE_MAX: Final = 256 * 2**20  # bytes of a message from the environment, which may hold meshes
HEARTBEAT: Final = 500  # ms between ZMTP heartbeats; a frozen or vanished peer is dropped after three
SEND_LIMIT: Final = 5000  # ms to wait for room in a queue that is full
HANDSHAKE: Final = 2000  # ms for a new connection to speak ZMTP


class _Bound:
    """A socket bound to its address, with a lock file beside an ipc path: a second bind would steal it silently."""

    def __init__(self, kind: int, address: str, *, queue: int) -> None:
        check_address(address)
        self._lock: int | None = None
        if address.startswith("ipc://"):
            self._lock = _take_lock(address)
        self.socket = _socket(kind, SIZE_MAX, queue)
        try:
            self.socket.bind(address.replace("://localhost", "://127.0.0.1").replace(":*", ":0"))
        except zmq.ZMQError as error:
            self.close()
            raise AddressError(f"address '{address}': cannot be bound ({error.strerror}); give a free one", key=address) from error
        self.address: str = self.socket.getsockopt_string(zmq.LAST_ENDPOINT)

    def close(self) -> None:
        """Give the address back."""
        self.socket.close(linger=1000)
        if self._lock is not None:
            os.close(self._lock)


class Server:
    """Answers peers; speaks first only to those that have spoken.

    A `Hello` is answered here, with the `Welcome` given, or with an `Error` if its version or project differs.
    """

    def __init__(self, address: str, welcome: Callable[[], Welcome]) -> None:
        self._bound = _Bound(zmq.ROUTER, address, queue=1000)
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

    def __init__(self, address: str, role: str) -> None:
        check_address(address)
        self.address = address
        self.role = role
        self._socket = _socket(zmq.DEALER, SNAPSHOT_SIZE_MAX, 1000)
        self._socket.connect(address)

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
        raise PeerLostError(f"nobody answered at {self.address} within {timeout:g} s; is the program started?", key=self.address)

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

    def __init__(self, address: str, *, lossless: bool) -> None:
        self._bound = _Bound(zmq.XPUB, address, queue=0 if lossless else 2)
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
            self.subscribers += 1 if self._bound.socket.recv()[:1] == b"\x01" else -1
        return True

    def close(self) -> None:
        """End the stream."""
        self._bound.close()


class Subscriber:
    """Follows a stream: every message in order, or with `latest_only` just the newest one."""

    def __init__(self, address: str, *, latest_only: bool = False) -> None:
        check_address(address)
        self.address = address
        self._socket = _socket(zmq.SUB, SNAPSHOT_SIZE_MAX, 0)
        if latest_only:
            self._socket.setsockopt(zmq.CONFLATE, 1)
        self._socket.setsockopt(zmq.RECONNECT_IVL, 5)
        self._socket.setsockopt(zmq.SUBSCRIBE, b"")
        self._socket.connect(address)

    def receive(self, timeout: float) -> bytes | None:
        """Next message undecoded; None after `timeout` seconds without one."""
        if not self._socket.poll(int(1000 * timeout), zmq.POLLIN):
            return None
        return self._socket.recv()

    def close(self) -> None:
        """Leave the stream."""
        self._socket.close(linger=0)


def _socket(kind: int, size_max: int, queue: int) -> zmq.Socket[bytes]:
    socket: zmq.Socket[bytes] = zmq.Context.instance().socket(kind)
    socket.setsockopt(zmq.MAXMSGSIZE, size_max)
    socket.setsockopt(zmq.SNDHWM, queue)
    socket.setsockopt(zmq.SNDTIMEO, SEND_LIMIT)
    socket.setsockopt(zmq.RCVHWM, queue)
    if kind in (zmq.ROUTER, zmq.DEALER):
        # Not for streams: a recorder that is held up for a while must not lose what is kept for it.
        socket.setsockopt(zmq.HEARTBEAT_IVL, HEARTBEAT)
        socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, 3 * HEARTBEAT)
    socket.setsockopt(zmq.HANDSHAKE_IVL, HANDSHAKE)
    return socket


def _take_lock(address: str) -> int:
    path = address.removeprefix("ipc://") + ".lock"
    try:
        lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as error:
        raise AddressError(
            f"address '{address}': {path} cannot be made ({error.strerror}); give a path in your own folder", key=address
        ) from error
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(lock)
        raise AddressError(
            f"address '{address}': another program answers there; give another address, or end that program", key=address
        ) from error
    return lock
