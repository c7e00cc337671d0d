"""A run's own record, from which frames are sent again, and from which the run goes on after its program was killed.

In a folder: `frames.msgpack`, every message of the stream in order as a recording, and `checkpoint.0` and `.1`, what the last
two steps left. A frame is written before its checkpoint, and both before the frame is published. So whatever was published is here;
what was written without its checkpoint is cut off and computed again, to the same bits but for the measured times.
"""

from __future__ import annotations

import fcntl
import os
from array import array
from pathlib import Path
from typing import Final

from protocol import checkpoint, recording
from protocol.errors import RecordingError

from .memory import Checkpoint

FRAMES: Final = "frames.msgpack"
CHECKPOINT: Final = "checkpoint"


class Journal:
    """Keeps messages and the last checkpoint; one thread writes, others may read.

    Attributes:
        kept: Where an earlier program was when it ended; None if it had not begun.
        ending: The sentence with which it had ended the run, in the form (failed, sentence); None if it had not.
    """

    def __init__(self, folder: Path, session: str) -> None:
        """Open the journal of a folder, to go on from it if it holds a run that has begun.

        Raises:
            RecordingError: If the folder holds the journal of another scene, or of another program.
        """
        self._folder = folder
        self._file = -1
        self._writer: recording.Writer | None = None
        self._checkpoint: checkpoint.Writer | None = None
        self._is_broken = False  # an append has failed, so that nothing may follow it
        self._ends = array("Q")  # of every message after the snapshot, in bytes from the beginning
        self.kept: Checkpoint | None = checkpoint.read(folder / CHECKPOINT, Checkpoint)
        self.ending: tuple[bool, str] | None = None
        if self.kept is None:
            return
        if self.kept.session != session:
            raise RecordingError(f"journal {folder}: is of another scene; give an empty folder", key=str(folder))
        record = recording.read(folder / FRAMES)
        if record.finished is not None:
            self.ending = (record.finished.failed, record.finished.sentence)
        size = record.size if self.ending else self.kept.size
        self._ends.extend(end for end in record.ends if end <= size)
        self._open(size)

    def begin(self, snapshot: bytes) -> None:
        """Write the first message, unless an earlier program has."""
        if self._writer is None:
            self._folder.mkdir(parents=True, exist_ok=True)
            (self._folder / FRAMES).unlink(missing_ok=True)  # of a program that was killed before its first checkpoint
            self._open(None)
            self.add(snapshot)

    @property
    def size(self) -> int:
        """Bytes written so far."""
        return self._ends[-1] if self._ends else 0

    @property
    def frames(self) -> int:
        """How many messages follow the snapshot."""
        return max(len(self._ends) - 1, 0)

    def add(self, message: bytes) -> None:
        """Append a message; nothing is appended any more once that has failed.

        Raises:
            RecordingError: If the disk takes no more; what was written before stays readable.
        """
        if self._writer is None or self._is_broken:
            return
        try:
            self._writer.write(message)
        except RecordingError:
            self._is_broken = True
            raise
        self._ends.append(self.size + len(message))

    def keep(self, state: Checkpoint) -> None:
        """Replace the checkpoint.

        Raises:
            RecordingError: If the disk takes no more; the run cannot be resumed from here, and what is there stays readable.
        """
        if self._checkpoint is not None:
            self._checkpoint.write(state)

    def message(self, sequence: int) -> bytes | None:
        """The bytes of a frame, or of the end of the run after the last one; None if it is not there yet."""
        if sequence + 1 >= len(self._ends):
            return None
        begin, end = self._ends[sequence], self._ends[sequence + 1]
        return os.pread(self._file, end - begin, begin)

    def close(self) -> None:
        """Bring everything to the disk."""
        if self._writer is not None and self._checkpoint is not None:
            self._writer.close()
            self._checkpoint.close()
            os.close(self._file)
            self._writer = None

    def _open(self, size: int | None) -> None:
        path = self._folder / FRAMES
        if size is None:
            self._writer = recording.Writer(path)
        self._file = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise RecordingError(
                f"journal {self._folder}: another program writes it; give another folder", key=str(self._folder)
            ) from error
        if size is not None:
            self._writer = recording.Writer(path, keep=size)
        self._checkpoint = checkpoint.Writer(self._folder / CHECKPOINT)
