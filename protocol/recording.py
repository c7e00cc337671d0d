"""A run on disk: one file, a plain MessagePack stream of the very bytes that crossed the wire.

First comes a `Snapshot`, then every `Frame` in order, at last `Finished`. There is no header, no index and no footer, so
a file whose writer was killed is readable up to its last whole message, and any MessagePack library reads it:

    for message in msgpack.Unpacker(open("recording.msgpack", "rb"), max_buffer_size=0): print(message["type"])
"""

from __future__ import annotations

import mmap
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Final, overload

import msgpack

from .codec import decode
from .errors import MessageError, RecordingError
from .messages import AnyMessage, Finished, Frame, Snapshot

FILE_NAME: Final = "recording.msgpack"

_MESSAGE_MAX: Final = 2**31 - 1  # bytes; the most that `msgpack.Unpacker` takes
_READ_SIZE: Final = 2**20  # bytes


class Writer:
    """Appends whole messages to a new recording, or to one that was broken off.

    One `os.write` a message and no buffer in this process: when it is killed, every message written so far is in the
    file. The disk is waited for (`fsync`) only in `close`, so a loss of power can cost the last seconds of a run.

    Args:
        path: File to make; its folder must exist.
        keep: [bytes] Go on with an existing file after so many bytes, and cut off what follows; see `Recording.size`.

    Raises:
        RecordingError: If the file exists, for a recording is never overwritten, or cannot be made.
    """

    def __init__(self, path: Path, *, keep: int | None = None) -> None:
        flags = os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC
        try:
            self._file = os.open(path, flags | (os.O_CREAT | os.O_EXCL if keep is None else 0), 0o644)
            if keep is not None:
                os.ftruncate(self._file, keep)
        except FileExistsError as error:
            raise RecordingError(f"recording {path} exists and is never overwritten; choose another folder", key=str(path)) from error
        except OSError as error:
            raise RecordingError(f"recording {path} cannot be made: {error.strerror}", key=str(path)) from error
        self._path = path

    def write(self, message: bytes) -> None:
        """Append the bytes of one message, as they were received.

        Raises:
            RecordingError: If the disk takes no more; what was written before stays readable.
        """
        rest = memoryview(message)
        try:
            while rest:  # more than once only when the disk is full or the message exceeds 2 GB
                rest = rest[os.write(self._file, rest) :]
        except OSError as error:
            raise RecordingError(f"recording {self._path} cannot be continued: {error.strerror}", key=str(self._path)) from error

    def close(self) -> None:
        """Bring everything to the disk; further calls do nothing."""
        if self._file >= 0:
            os.fsync(self._file)
            os.close(self._file)
            self._file = -1

    def __enter__(self) -> Writer:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


class Frames(Sequence[Frame]):
    """The frames of a recording, decoded when asked for, so that a long run needs little memory."""

    def __init__(self, data: bytes | mmap.mmap, bounds: list[tuple[int, int]]) -> None:
        self._data = data
        self._bounds = bounds

    def __len__(self) -> int:
        return len(self._bounds)

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> Frames: ...
    def __getitem__(self, index: int | slice) -> Frame | Frames:
        if isinstance(index, slice):
            return Frames(self._data, self._bounds[index])
        start, end = self._bounds[index]
        frame = decode(self._data[start:end])
        assert isinstance(frame, Frame)  # `read` has decoded it once
        return frame


@dataclass(frozen=True)
class Recording:
    """What a file holds: all of a run, or its beginning.

    Attributes:
        snapshot: What does not change during the run.
        frames: Every whole frame, in the order written.
        finished: How the run ended; None if its end is not in the file.
        ending: Sentence that says where and why reading stopped before the end; empty if it did not.
        ends: [bytes] Where every message that can be used ends, from the snapshot on.
    """

    snapshot: Snapshot
    frames: Frames
    finished: Finished | None
    ending: str
    ends: list[int]

    @property
    def size(self) -> int:
        """Bytes up to the end of the last message that can be used."""
        return self.ends[-1]

    @property
    def complete(self) -> bool:
        """Whether the file reaches to the end of the run."""
        return self.finished is not None


def read(path: Path) -> Recording:
    """Read a recording up to its last whole message.

    Raises:
        RecordingError: If the file cannot be opened, or does not begin with a whole snapshot.
    """
    try:
        with path.open("rb") as file:
            data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except ValueError as error:
        raise RecordingError(f"recording {path} is empty; give the recording of a run that has begun", key=str(path)) from error
    except OSError as error:
        raise RecordingError(f"recording {path} cannot be read ({error.strerror}); give the recording of a run", key=str(path)) from error
    whole = _whole_messages(data)
    snapshot = _decode_at(data, whole[0]) if whole else "it is cut off in its first message"
    if not isinstance(snapshot, Snapshot):
        reason = snapshot if isinstance(snapshot, str) else f"it begins with a {type(snapshot).__name__}"
        raise RecordingError(f"recording {path} does not begin with a snapshot: {reason}", key=str(path))
    bounds: list[tuple[int, int]] = []
    ends = [whole[0][1]]
    for bound in whole[1:]:
        message = _decode_at(data, bound)
        if isinstance(message, Finished):
            return Recording(snapshot, Frames(data, bounds), message, ending="", ends=[*ends, bound[1]])
        if not isinstance(message, Frame):
            reason = message if isinstance(message, str) else f"a {type(message).__name__} does not belong there"
            return Recording(snapshot, Frames(data, bounds), None, f"message {len(bounds) + 1} cannot be used: {reason}", ends)
        bounds.append(bound)
        ends.append(bound[1])
    cut = len(data) - whole[-1][1]
    ending = f"{cut} bytes of an unfinished message follow" if cut else "the run was not finished"
    return Recording(snapshot, Frames(data, bounds), None, f"after {len(bounds)} frames, {ending}", ends)


def _whole_messages(data: mmap.mmap) -> list[tuple[int, int]]:
    """Start and end of every whole MessagePack object, without building any of them."""
    data.seek(0)
    unpacker = msgpack.Unpacker(data, read_size=_READ_SIZE, max_buffer_size=_MESSAGE_MAX)
    bounds: list[tuple[int, int]] = []
    start = 0
    while True:
        try:
            unpacker.skip()
        except (msgpack.OutOfData, msgpack.UnpackException, ValueError):
            return bounds
        bounds.append((start, unpacker.tell()))
        start = unpacker.tell()


def _decode_at(data: mmap.mmap, bound: tuple[int, int]) -> AnyMessage | str:
    """The message there, or why there is none."""
    try:
        return decode(data[bound[0] : bound[1]])
    except MessageError as error:
        return str(error)
