"""Where every message of a run goes: into the journal first, if there is one, and then out on the two streams."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from protocol.channel import Publisher
from protocol.codec import encode
from protocol.errors import RecordingError
from protocol.keys import Keys
from protocol.messages import Frame

from .journal import Journal
from .memory import Checkpoint


class Outlet:
    """The streams of a run, and its journal.

    Attributes:
        journal: None if nothing is kept.
        sent: How many frames, by earlier programs too.
        spent: [s] What it took to send the last frame of a step; goes on the bill of the next.
    """

    def __init__(self, frames: str, live: str, session: str, folder: Path | None, keys: Keys | None) -> None:
        self._record = Publisher(frames, lossless=True, keys=keys)
        self._live = Publisher(live, lossless=False, keys=keys)
        self._due: tuple[Frame, Checkpoint] | None = None
        self.spent = 0.0
        # Opened last: a second program at these addresses is refused before it could touch the journal of the first.
        self.journal = Journal(folder, session) if folder is not None else None
        self.sent = self.journal.frames if self.journal is not None else 0

    @property
    def addresses(self) -> dict[str, str]:
        """Where it publishes, by purpose."""
        return {"frames": self._record.address, "live": self._live.address}

    @property
    def recorders(self) -> int:
        """How many follow the lossless stream."""
        return self._record.subscribers

    @property
    def kept(self) -> Checkpoint | None:
        """Where an earlier program was when it was killed."""
        return self.journal.kept if self.journal is not None else None

    def wait_for(self, recorders: int, timeout: float) -> bool:
        """Whether so many recorders have joined within `timeout` seconds."""
        return self._record.wait_for(recorders, timeout)

    def begin(self, snapshot: bytes) -> None:
        """Have the journal ready."""
        if self.journal is not None:
            self.journal.begin(snapshot)

    def step(self, frame: Frame, state: Checkpoint) -> None:
        """Have the frame of a step from which the run goes on ready to be sent, at a time when there is nothing else to do."""
        self._due = (frame, state)

    def send_due(self) -> None:
        """Send the frame that is ready, if there is one.

        Raises:
            RecordingError: If the journal's disk is full; nothing is sent then.
        """
        if self._due is None:
            return
        begun, (frame, state), self._due = time.perf_counter(), self._due, None
        data = encode(frame)
        if self.journal is not None:
            self.journal.add(data)
            self.journal.keep(replace(state, size=self.journal.size))
        self._send(data)
        self.sent += 1
        self.spent = time.perf_counter() - begun

    def between(self, frame: bytes) -> None:
        """Send a frame between two steps, from which nothing goes on.

        Raises:
            RecordingError: If the journal's disk is full; nothing is sent then.
        """
        if self.journal is not None:
            self.journal.add(frame)
        self._send(frame)
        self.sent += 1

    def last(self, frame: bytes) -> None:
        """Send a frame after which the run does not go on; it is not kept if the journal's disk is full."""
        self.end(frame)
        self.sent += 1

    def end(self, message: bytes) -> None:
        """Send the end of the run; it is not kept if the journal's disk is full."""
        if self.journal is not None:
            with suppress(RecordingError):
                self.journal.add(message)
        self._send(message)

    def close(self) -> None:
        """End the streams."""
        for part in (self._record, self._live, self.journal):
            if part is not None:
                part.close()

    def _send(self, data: bytes) -> None:
        self._record.publish(data)
        self._live.publish(data)
