"""An environment that only answers and sends what a test tells it to."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

from protocol import VERSION
from protocol.channel import Publisher, Server
from protocol.codec import encode
from protocol.messages import AnyMessage, Done, Error, FrameRequest, Snapshot, SnapshotRequest, Statistics, StatisticsRequest, Welcome


class StandIn:
    """Answers on `control` in a thread of its own, sends frames on `frames`; use in a `with` statement."""

    def __init__(self, box: Path, snapshot: Snapshot | None, *, state: str = "running") -> None:
        self.snapshot = snapshot
        self.state = state
        self.mute = False
        self.asked = threading.Event()  # for a snapshot that was there
        self._server = Server(f"ipc://{box}/control", lambda: Welcome(version=VERSION, role="env_server"))
        self._stream = Publisher(f"ipc://{box}/frames", lossless=True)
        self.control, self.frames = self._server.address, self._stream.address
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._answer)

    def send(self, *messages: AnyMessage | bytes) -> None:
        """Send once somebody listens."""
        assert self._stream.wait_for(1, 10.0)
        for message in messages:
            self._stream.publish(message if isinstance(message, bytes) else encode(message))

    def send_later(self, *messages: AnyMessage | bytes, then: Callable[[], object] = lambda: None) -> None:
        threading.Thread(target=lambda: (self.send(*messages), then())).start()

    def __enter__(self) -> StandIn:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()
        self._server.close()
        self._stream.close()

    def _answer(self) -> None:
        while not self._over.is_set():
            if self.mute:
                self._over.wait(0.02)
            elif (asked := self._server.receive(0.02)) is not None:
                self._server.send(asked[0], self._reply(asked[1]))
                if isinstance(asked[1], SnapshotRequest) and self.snapshot is not None:
                    self.asked.set()

    def _reply(self, question: AnyMessage) -> AnyMessage:
        if isinstance(question, SnapshotRequest):
            return self.snapshot or Error(code="state", sentence="no scene yet")
        if isinstance(question, StatisticsRequest):
            return Statistics(step=0, steps=1, state=self.state, sentence="as told")
        return Error(code="state", sentence="nothing is kept") if isinstance(question, FrameRequest) else Done()
