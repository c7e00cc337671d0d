"""Where every message of a run goes: into the journal first, if there is one, and then out on the two streams."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from protocol.channel import Publisher
from protocol.errors import RecordingError
from protocol.keys import Keys

from .journal import Journal
from .loop import Loop
from .memory import Checkpoint, checkpoint


class Outlet:
    """The streams of a run, and its journal.

    Attributes:
        journal: None if nothing is kept.
    """

    def __init__(self, frames: str, live: str, session: str, folder: Path | None, keys: Keys | None) -> None:
        self._session = session
        self._record = Publisher(frames, lossless=True, keys=keys)
        self._live = Publisher(live, lossless=False, keys=keys)
        # Opened last: a second program at these addresses is refused before it could touch the journal of the first.
        self.journal = Journal(folder, session) if folder is not None else None

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

    @property
    def frames(self) -> int:
        """How many frames an earlier program has sent that are kept."""
        return self.journal.frames if self.journal is not None else 0

    def step(self, frame: bytes, loop: Loop, step: int, late: float) -> None:
        """Send the frame of a step from which the loop goes on, `late` [s] behind the path.

        Raises:
            RecordingError: If the journal's disk is full; nothing is sent then.
        """
        if self.journal is not None:
            self.journal.add(frame)
            self.journal.keep(checkpoint(loop, self._session, step, late, self.journal.size))
        self._send(frame)

    def between(self, frame: bytes) -> None:
        """Send a frame between two steps, from which nothing goes on.

        Raises:
            RecordingError: If the journal's disk is full; nothing is sent then.
        """
        if self.journal is not None:
            self.journal.add(frame)
        self._send(frame)

    def last(self, message: bytes) -> None:
        """Send a message after which the loop does not go on; it is not kept if the journal's disk is full."""
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
