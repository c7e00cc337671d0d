"""ZeroMQ sockets with limits on everything that a stranger could send, encrypted where there are keys.

With keys every socket speaks CURVE, over ipc too: who listens proves that it holds the secret of `server.pub`, and lets in
only those whose key it knows. Others see nothing but a connection that is closed again.
"""

from __future__ import annotations

import fcntl
import os
import threading
from typing import Final

import zmq
from zmq.utils import z85

from .address import check_address
from .errors import AddressError
from .keys import Keys

HEARTBEAT: Final = 500  # ms between ZMTP heartbeats; a frozen or vanished peer is dropped after three
SEND_LIMIT: Final = 5000  # ms to wait for room in a queue that is full
HANDSHAKE: Final = 2000  # ms for a new connection to speak ZMTP
DOMAIN: Final = b"cablecosim"  # of the doorkeeper; with it, no connection is let in unasked


class Bound:
    """A socket bound to its address, with a lock file beside an ipc path: a second bind would steal it silently.

    Args:
        kind: Of ZeroMQ.
        address: Where to listen.
        size_max: [bytes] Of a message that is received; who sends a larger one is hung up on.
        send_queue: Messages kept for each peer that does not read; 0 for no limit.
        receive_queue: Messages kept from each peer.
        keys: To listen with; None for an open socket, which only loopback and ipc may be.
    """

    def __init__(self, kind: int, address: str, *, size_max: int, send_queue: int, receive_queue: int, keys: Keys | None) -> None:
        check_address(address, encrypted=keys is not None)
        self._lock: int | None = None
        if address.startswith("ipc://"):
            self._lock = _take_lock(address)
        self.socket = new_socket(kind, size_max, send_queue, receive_queue)
        before = os.umask(0o177)  # nobody but its owner may connect to an ipc path, whatever folder it is in
        try:
            if keys is not None:
                _guard(self.socket, keys)
            self.socket.bind(address.replace("://localhost", "://127.0.0.1").replace(":*", ":0"))
        except zmq.ZMQError as error:
            self.close()
            raise AddressError(f"address '{address}': cannot be bound ({error.strerror}); give a free one", key=address) from error
        except AddressError:
            self.close()
            raise
        finally:
            os.umask(before)
        self.address: str = self.socket.getsockopt_string(zmq.LAST_ENDPOINT)

    def close(self) -> None:
        """Give the address back."""
        self.socket.close(linger=1000)
        if self._lock is not None:
            os.close(self._lock)


def connected(
    kind: int, address: str, *, size_max: int, queue: int, keys: Keys | None, options: dict[int, int | bytes]
) -> zmq.Socket[bytes]:
    """A socket that goes to an address, whether anybody listens there yet or not."""
    check_address(address, encrypted=keys is not None)
    socket = new_socket(kind, size_max, queue, queue)
    for option, value in options.items():
        socket.setsockopt(option, value)
    if keys is not None:
        socket.curve_serverkey = keys.server_public.encode()
        socket.curve_publickey, socket.curve_secretkey = keys.client_public.encode(), keys.client_secret.encode()
    socket.connect(address)
    return socket


def key_pair() -> tuple[str, str]:
    """A new public key and its secret."""
    public, secret = zmq.curve_keypair()
    return public.decode(), secret.decode()


def new_socket(kind: int, size_max: int, send_queue: int, receive_queue: int) -> zmq.Socket[bytes]:
    """A socket with every limit set."""
    socket: zmq.Socket[bytes] = zmq.Context.instance().socket(kind)
    socket.setsockopt(zmq.MAXMSGSIZE, size_max)
    socket.setsockopt(zmq.SNDHWM, send_queue)
    socket.setsockopt(zmq.SNDTIMEO, SEND_LIMIT)
    socket.setsockopt(zmq.RCVHWM, receive_queue)
    if kind in (zmq.ROUTER, zmq.DEALER):
        # Not for streams: a recorder that is held up for a while must not lose what is kept for it.
        socket.setsockopt(zmq.HEARTBEAT_IVL, HEARTBEAT)
        socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, 3 * HEARTBEAT)
    socket.setsockopt(zmq.HANDSHAKE_IVL, HANDSHAKE)
    return socket


def _guard(socket: zmq.Socket[bytes], keys: Keys) -> None:
    if not keys.server_secret:
        raise AddressError(
            "--keys: the folder has no server.key, so it can connect and not listen; see: cablecosim keys --help", key="--keys"
        )
    _Doorkeeper.admit(keys.known)
    socket.curve_server = True
    socket.curve_publickey, socket.curve_secretkey = keys.server_public.encode(), keys.server_secret.encode()
    socket.setsockopt(zmq.ZAP_DOMAIN, DOMAIN)


class _Doorkeeper:
    """Answers ZeroMQ's question whether a key is known (ZAP, RFC 27); one for each process, as ZeroMQ asks at one place."""

    _known: frozenset[str] = frozenset()
    _thread: threading.Thread | None = None

    @classmethod
    def admit(cls, known: frozenset[str]) -> None:
        """Let in these from now on, beside those of before."""
        cls._known |= known
        if cls._thread is None:
            socket: zmq.Socket[bytes] = zmq.Context.instance().socket(zmq.REP)
            socket.bind("inproc://zeromq.zap.01")
            cls._thread = threading.Thread(target=cls._answer, args=(socket,), name="doorkeeper", daemon=True)
            cls._thread.start()

    @classmethod
    def _answer(cls, socket: zmq.Socket[bytes]) -> None:
        while True:
            version, request, domain, _address, _identity, mechanism, *credentials = socket.recv_multipart()
            is_known = domain == DOMAIN and mechanism == b"CURVE" and z85.encode(credentials[0]).decode() in cls._known
            verdict = (b"200", b"OK", b"known") if is_known else (b"400", b"unknown key", b"")
            socket.send_multipart([version, request, *verdict, b""])


def _take_lock(address: str) -> int:
    path = address.removeprefix("ipc://") + ".lock"
    try:
        lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
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
