"""The environment's ear: hello, start, pause, stop, snapshot and statistics, answered at any time, in a thread of its own.

The thread owns the socket; the run and the thread share nothing but the fields of `Control`, under its lock.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Final

import msgspec

from protocol import VERSION
from protocol.channel import Server
from protocol.codec import encode
from protocol.keys import Keys
from protocol.messages import (
    AnyMessage,
    Done,
    Error,
    FrameRequest,
    Message,
    Pause,
    Resume,
    Snapshot,
    SnapshotRequest,
    StartRun,
    Statistics,
    StatisticsRequest,
    Stop,
    Welcome,
)

POLL: Final = 0.05  # s between looks at whether the program ends
SIZE_MAX: Final = 2**16  # bytes of a control message; all are tiny


class Control:
    """Answers control messages, and tells the run what was asked of it."""

    def __init__(
        self,
        address: str,
        scene_hash: str,
        *,
        silent: Callable[[], float] = lambda: 0.0,
        frame: Callable[[int], bytes | None] | None = None,
        keys: Keys | None = None,
        audits: Callable[[], bool] = lambda: False,
    ) -> None:
        """Begin to listen.

        Args:
            address: Where.
            scene_hash: For whoever says hello.
            silent: Says for how many seconds the shape server has been waited for in vain.
            frame: Finds the bytes of a frame that was published; None if nothing is kept.
            keys: To listen with.
            audits: Says whether a shape server that audits has work to do.
        """
        welcome = Welcome(version=VERSION, role="env_server", scene_hash=scene_hash)
        self._server = Server(address, lambda: welcome, size_max=SIZE_MAX, keys=keys)
        self._silent, self._frame, self._audits = silent, frame, audits
        self.address = self._server.address
        self._lock = threading.Lock()
        self._statistics = Statistics(step=0, steps=0, state="starting", sentence="starting")
        self._snapshot: bytes | None = None
        self._start: StartRun | None = None
        self._wake = threading.Event()
        self._is_paused = False
        self._is_stopped = False
        self._is_closing = False
        self._heard = time.monotonic()
        self._thread = threading.Thread(target=self._listen, name="control", daemon=True)
        self._thread.start()

    def say(self, sentence: str) -> None:
        """Tell whoever asks what is being done."""
        with self._lock:
            self._statistics = Statistics(
                step=self._statistics.step, steps=self._statistics.steps, state=self._statistics.state, sentence=sentence
            )

    def report(self, step: int, steps: int, state: str, sentence: str = "") -> None:
        """Tell whoever asks how far the run is."""
        with self._lock:
            self._statistics = Statistics(step=step, steps=steps, state=state, sentence=sentence)

    def offer(self, snapshot: Snapshot) -> None:
        """Have the snapshot ready for viewers."""
        data = encode(snapshot)
        with self._lock:
            self._snapshot = data

    def wait_for_start(self) -> int | None:
        """Wait until the run is started; how many recorders to wait for, or None if it is stopped instead."""
        while not self._is_stopped:
            if self._start is not None:
                return self._start.recorders
            self._wake.wait(POLL)
            self._wake.clear()
        return None

    def hold(self) -> float:
        """Wait while the run is paused; the seconds it was."""
        if not self._is_paused:
            return 0.0
        begun = time.perf_counter()
        before = self._statistics
        self.report(before.step, before.steps, "paused", "paused")
        while self._is_paused and not self._is_stopped:
            self._wake.wait(POLL)
            self._wake.clear()
        self.report(before.step, before.steps, before.state, before.sentence)
        return time.perf_counter() - begun

    @property
    def is_stopped(self) -> bool:
        """Whether the run was asked to stop."""
        return self._is_stopped

    def stop(self) -> None:
        """Ask the run to stop, as a `Stop` message does."""
        self._is_stopped = True
        self._wake.set()

    def wait_for_stop(self, limit: float) -> None:
        """Go on answering until somebody says stop, or nobody has said anything for `limit` seconds."""
        self._heard = time.monotonic()
        while not self._is_stopped and time.monotonic() - self._heard < limit:
            self._wake.wait(POLL)
            self._wake.clear()

    def close(self) -> None:
        """Stop listening."""
        self._is_closing = True
        self._thread.join()
        self._server.close()

    def _listen(self) -> None:
        while not self._is_closing:
            received = self._server.receive(POLL)
            if received is not None:
                self._heard = time.monotonic()
                peer, message = received
                answer = self._answer(message)
                if isinstance(answer, bytes):
                    self._server.send_bytes(peer, answer)
                else:
                    self._server.send(peer, answer)

    def _answer(self, message: AnyMessage) -> Message | bytes:
        with self._lock:
            if isinstance(message, StatisticsRequest):
                now = self._statistics
                return msgspec.structs.replace(now, silent=self._silent(), wants_audits=self._audits())
            if isinstance(message, FrameRequest):
                return self._frame_again(message.sequence)
            if isinstance(message, SnapshotRequest):
                return self._snapshot or Error(code="state", sentence="the scene is still being set up; ask again", key="snapshot")
            if isinstance(message, StartRun):
                if self._start is not None or self._statistics.state != "ready":
                    state = "running already" if self._start is not None else self._statistics.state
                    return Error(code="state", sentence=f"the run cannot be started, it is {state}; start it once, when it is ready")
                self._start = message
            elif isinstance(message, Pause):
                self._is_paused = True
            elif isinstance(message, Resume):
                self._is_paused = False
            elif isinstance(message, Stop):
                self._is_stopped = True
            else:
                kind = type(message).__name__
                return Error(code="message", sentence=f"a {kind} means nothing to the environment", key="type")
        self._wake.set()
        return Done()

    def _frame_again(self, sequence: int) -> Message | bytes:
        if self._frame is None:
            return Error(code="state", sentence="no frame is kept here; start the environment with --journal DIR", key="sequence")
        return self._frame(sequence) or Error(code="state", sentence=f"frame {sequence} is not there yet; ask again", key="sequence")
