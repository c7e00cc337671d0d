"""Asking the shape server, so that a lost message or a restarted server costs time and nothing else.

Every request has a key (session, step, round). It is sent again, over a new connection, when neither the reply nor a beat
has come for `SILENCE` seconds; a reply with another key is an old one and is dropped. A request is complete, so a server
that has just been started answers it like one that has been there all the time.
"""

from __future__ import annotations

import time
from typing import Final

from protocol.channel import Client
from protocol.codec import decode, encode
from protocol.errors import CablecosimError, MessageError, PeerLostError, SceneError
from protocol.keys import Keys
from protocol.kinds import Outcome
from protocol.messages import Beat, Error, ShapeReply, ShapeRequest

SILENCE: Final = 2.0  # s without a sign of life before a request is sent again


class Asker:
    """Sends shape requests, one at a time, and waits for their replies."""

    def __init__(self, address: str, *, patience: float, silence: float = SILENCE, keys: Keys | None = None) -> None:
        self._address = address
        self._keys = keys
        self._silence, self._patience = silence, patience
        self._client = Client(address, "env_server", keys)
        self._waiting: float | None = None  # when the server was last heard, while it is waited for
        self._request: ShapeRequest | None = None
        self._data = b""
        self.coding = 0.0  # s spent on messages to bytes and back, so far
        self.resent = 0  # requests sent again, so far

    @property
    def silent(self) -> float:
        """Seconds since the server, while it is waited for, gave a sign of life; 0 while it is not. May be asked by any thread."""
        waiting = self._waiting
        return 0.0 if waiting is None else time.monotonic() - waiting

    def greet(self, timeout: float) -> str:
        """Agree on the version of the protocol; returns the state of the server's kernels."""
        self._waiting = self._waiting or time.monotonic()
        kernels = self._client.greet(timeout).kernels
        self._waiting = None
        return kernels

    def send(self, request: ShapeRequest) -> None:
        """Send a request; `receive` waits for its reply."""
        begun = time.perf_counter()
        self._request, self._data = request, encode(request)
        self.coding += time.perf_counter() - begun
        self._client.send_bytes(self._data)

    def receive(self) -> ShapeReply:
        """The reply to the request that was sent last.

        Raises:
            PeerLostError: If the server stayed silent through every retry.
            SceneError: If the server refused the request.
        """
        assert self._request is not None
        heard = sent = self._waiting = time.monotonic()
        while True:
            now = time.monotonic()
            if now - heard > self._patience:
                raise PeerLostError(
                    f"the shape server at {self._address} has been silent for {self._patience:g} s; see its log, or start it again",
                    key=self._address,
                )
            if now - max(heard, sent) > self._silence:
                self._reconnect()
                sent = time.monotonic()
            data = self._client.receive_bytes(self._silence / 4)
            if data is None:
                continue
            reply = self._read(data)
            if isinstance(reply, ShapeReply):
                self._waiting = None
                return reply
            heard = self._waiting = time.monotonic() if reply is not None else heard

    def close(self) -> None:
        """Hang up."""
        self._client.close()

    def _read(self, data: bytes) -> ShapeReply | Beat | None:
        """The reply, or a beat of the present request, or None for anything old."""
        assert self._request is not None
        begun = time.perf_counter()
        try:
            message = decode(data)
        except MessageError:
            return None
        self.coding += time.perf_counter() - begun
        if isinstance(message, Error):
            raise SceneError(f"the shape server refused the request: {message.sentence}", key=message.key)
        if not isinstance(message, ShapeReply | Beat):
            return None
        key = (self._request.session, self._request.step, self._request.round)
        if (message.session, message.step, message.round) != key:
            return None
        if isinstance(message, ShapeReply):
            _check_reply(self._request, message)
        return message

    def _reconnect(self) -> None:
        self._client.close()
        self._client = Client(self._address, "env_server", self._keys)
        self._client.send_bytes(self._data)
        self.resent += 1


def _check_reply(request: ShapeRequest, reply: ShapeReply) -> None:
    """Refuse a reply that does not fit the request, before anything is computed from it."""
    if len(reply.shapes) != len(request.problems):
        raise CablecosimError(f"the shape server sent {len(reply.shapes)} shapes for {len(request.problems)} cables")
    for problem, shape in zip(request.problems, reply.shapes, strict=True):
        if len(shape.grasp_wrenches) != len(problem.grasps.s):
            raise CablecosimError(f"the shape server sent {len(shape.grasp_wrenches)} wrenches for {len(problem.grasps.s)} grasps")
        contacts = len(problem.contacts.s) if problem.contacts is not None else 0
        if shape.outcome is Outcome.CONVERGED and (len(shape.s) < 2 or len(shape.contact_s) != contacts):
            raise CablecosimError(
                f"the shape server sent a shape of {len(shape.s)} nodes with {len(shape.contact_s)} of {contacts} contacts"
            )
