"""The latest of a series of values on disk, whole: what a program needs to go on where it was killed.

Two files are written in turn, each with a count, its length and a checksum before it, so that who is killed on the way has the value
before. (Replacing one file by a rename does the same, and takes five times as long.) The values are typed dataclasses, in plain
MessagePack, read back into the types that the reader names; nothing in a file says what code to run. Arrays keep every bit.
"""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path
from typing import Any, Final, TypeVar

import msgspec
import numpy as np

from .errors import RecordingError

_Value = TypeVar("_Value")
_KINDS: Final = "fiub"  # of arrays that may be stored: numbers and truth values, never objects
_HEAD: Final = struct.Struct("<QQI")  # count, bytes, checksum
SUFFIXES: Final = (".0", ".1")


class Writer:
    """Keeps the latest value under a name; made again, it goes on with the count.

    Args:
        path: Of the two files, without their suffixes; the folder must exist.

    Raises:
        RecordingError: If they cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._count = max((count for count, _ in _whole(path)), default=0)
        flags = os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC
        try:
            self._files = [os.open(_file(path, suffix), flags, 0o600) for suffix in SUFFIXES]
        except OSError as error:
            raise RecordingError(f"checkpoint {path} cannot be made: {error.strerror}", key=str(path)) from error

    def write(self, value: Any) -> None:
        """Put a value in the place of the one before the last.

        Raises:
            RecordingError: If the disk takes no more; the last one is still there.
        """
        data = _ENCODER.encode(value)
        self._count += 1
        head = _HEAD.pack(self._count, len(data), zlib.crc32(data))
        try:
            done = os.pwrite(self._files[self._count % 2], head + data, 0)
        except OSError as error:
            raise RecordingError(f"checkpoint {self._path} cannot be written: {error.strerror}", key=str(self._path)) from error
        if done < len(head) + len(data):
            raise RecordingError(f"checkpoint {self._path} cannot be written: the disk is full", key=str(self._path))

    def close(self) -> None:
        """Close the files."""
        for file in self._files:
            os.close(file)


def read(path: Path, kind: type[_Value]) -> _Value | None:
    """The latest whole value; None if there is none.

    Raises:
        RecordingError: If it is of another kind.
    """
    try:
        whole = max(_whole(path), default=None)
        return msgspec.msgpack.decode(whole[1], type=kind, dec_hook=_decode) if whole is not None else None
    except OSError as error:
        raise RecordingError(f"checkpoint {path} cannot be read ({error.strerror})", key=str(path)) from error
    except (msgspec.DecodeError, ValueError, TypeError, KeyError, RecursionError) as error:
        raise RecordingError(f"checkpoint {path} is none of this program ({error}); give an empty folder", key=str(path)) from error


def _file(path: Path, suffix: str) -> Path:
    return path.with_name(path.name + suffix)


def _whole(path: Path) -> list[tuple[int, bytes]]:
    """Count and bytes of each value that was written to its end."""
    found = []
    for suffix in SUFFIXES:
        file = _file(path, suffix)
        data = file.read_bytes() if file.exists() else b""
        if len(data) >= _HEAD.size:
            count, size, check = _HEAD.unpack_from(data)
            value = data[_HEAD.size : _HEAD.size + size]
            if len(value) == size and zlib.crc32(value) == check:
                found.append((count, value))
    return found


def _encode(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    if not isinstance(value, np.ndarray) or value.dtype.kind not in _KINDS:
        raise TypeError(f"a {type(value).__name__} has no place in a checkpoint")
    array = np.ascontiguousarray(value)
    return {"dtype": array.dtype.str, "shape": value.shape, "data": array.data if array.size else b""}


def _decode(kind: type, value: Any) -> Any:
    if kind is not np.ndarray or np.dtype(value["dtype"]).kind not in _KINDS:
        raise ValueError(f"a {kind.__name__} has no place in a checkpoint")
    return np.frombuffer(value["data"], np.dtype(value["dtype"])).reshape(value["shape"])


_ENCODER: Final = msgspec.msgpack.Encoder(enc_hook=_encode)
