"""The shape server's loop: a request in, the shapes out; the last reply is kept for a peer that asks again."""

from __future__ import annotations

import time
from typing import Final

from protocol import VERSION
from protocol.channel import Server
from protocol.codec import encode
from protocol.errors import CablecosimError
from protocol.keys import Keys
from protocol.messages import AnyMessage, Beat, Done, Error, ShapeReply, ShapeRequest, Stop, Welcome

from .paths import Paths
from .together import answers

BEAT_PERIOD: Final = 0.1  # s between proofs of life during a long solve


class ShapeServer:
    """Answers shape requests at an address until it is told to stop."""

    def __init__(self, address: str, kernels: str, keys: Keys | None = None) -> None:
        self._channel = Server(address, self._welcome, keys=keys)
        self._paths = Paths(kernels)
        self._cached: tuple[tuple[str, int, int], ShapeRequest, bytes] | None = None
        self._beaten = 0.0
        self._is_stopped = False
        self.address = self._channel.address

    def stop(self) -> None:
        """End `run` after the present message; for a handler of signals, which may not raise: numba does not survive that in its calls."""
        self._is_stopped = True

    def run(self) -> None:
        """Serve until a `Stop` arrives, or `stop` is called."""
        try:
            while not self._is_stopped and self.serve_one(timeout=0.2):
                pass
        finally:
            self._paths.close()
            self._channel.close()

    def serve_one(self, timeout: float) -> bool:
        """Answer one message, if one comes within `timeout` seconds; False after a `Stop`."""
        self._paths.update()
        received = self._channel.receive(timeout)
        if received is None:
            return True
        peer, message = received
        if isinstance(message, Stop):
            self._channel.send(peer, Done())
            return False
        if isinstance(message, ShapeRequest):
            self._answer(peer, message)
        else:
            self._channel.send(peer, _unexpected(message))
        return True

    def _answer(self, peer: bytes, request: ShapeRequest) -> None:
        # Without the peer: who has waited in vain asks again by a new connection, and would have the same solved for ever.
        key = (request.session, request.step, request.round)
        if self._cached is not None and self._cached[0] == key and encode(self._cached[1]) == encode(request):
            self._channel.send_bytes(peer, self._cached[2])
            return
        begun = self._beaten = time.perf_counter()

        def progress(iteration: int, residual: float) -> None:
            now = time.perf_counter()
            if now - self._beaten > BEAT_PERIOD:
                self._beaten = now
                beat = Beat(session=request.session, step=request.step, round=request.round, iterations=iteration, residual=residual)
                self._channel.send(peer, beat)

        try:
            shapes, crossings = answers(request, self._paths.current, progress)
        except CablecosimError as error:
            self._channel.send(peer, Error(code="message", sentence=str(error), key=error.key))
            return
        except (ArithmeticError, ValueError, IndexError) as error:
            # A request that passed every check and still breaks the solver must not end the service for the others.
            sentence = f"the solver failed on this request ({type(error).__name__}: {error}); please report it with the request"
            self._channel.send(peer, Error(code="state", sentence=sentence))
            return
        reply = ShapeReply(
            session=request.session,
            step=request.step,
            round=request.round,
            shapes=shapes,
            busy=time.perf_counter() - begun,
            crossings=crossings,
        )
        data = encode(reply)
        self._cached = (key, request, data)
        self._channel.send_bytes(peer, data)

    def _welcome(self) -> Welcome:
        return Welcome(version=VERSION, role="shape_server", kernels=self._paths.state)


def _unexpected(message: AnyMessage) -> Error:
    kind = type(message).__name__
    return Error(
        code="message", sentence=f"a {kind} means nothing to the shape server; it answers ShapeRequest, Hello and Stop", key="type"
    )
