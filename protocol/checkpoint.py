"""A value of typed dataclasses on disk, whole or not at all: what a program needs to go on where it was killed.

Plain MessagePack, read back into the types that its reader names; nothing in the file says what code to run. The arrays keep
dtype, shape and every bit.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Final, TypeVar

import msgspec
import numpy as np

from .errors import RecordingError

_Value = TypeVar("_Value")
_KINDS: Final = "fiub"  # of arrays that may be stored: numbers and truth values, never objects


def write(path: Path, value: Any) -> None:
    """Replace the file; who is killed on the way leaves the old one.

    Raises:
        RecordingError: If the disk takes no more.
    """
    fresh = path.with_name(f"{path.name}.new")
    try:
        fresh.write_bytes(_ENCODER.encode(value))
        os.replace(fresh, path)
    except OSError as error:
        raise RecordingError(f"checkpoint {path} cannot be written: {error.strerror}", key=str(path)) from error


def read(path: Path, kind: type[_Value]) -> _Value | None:
    """What the file holds; None if there is no file.

    Raises:
        RecordingError: If it holds something else.
    """
    try:
        data = path.read_bytes()
        return msgspec.msgpack.decode(data, type=kind, dec_hook=_decode)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise RecordingError(f"checkpoint {path} cannot be read ({error.strerror})", key=str(path)) from error
    except (msgspec.DecodeError, ValueError, TypeError, KeyError, RecursionError) as error:
        raise RecordingError(f"checkpoint {path} is none of this program ({error}); give an empty folder", key=str(path)) from error


def _encode(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    if not isinstance(value, np.ndarray) or value.dtype.kind not in _KINDS:
        raise TypeError(f"a {type(value).__name__} has no place in a checkpoint")
    return {"dtype": value.dtype.str, "shape": value.shape, "data": np.ascontiguousarray(value).tobytes()}


def _decode(kind: type, value: Any) -> Any:
    if kind is not np.ndarray or np.dtype(value["dtype"]).kind not in _KINDS:
        raise ValueError(f"a {kind.__name__} has no place in a checkpoint")
    return np.frombuffer(value["data"], np.dtype(value["dtype"])).reshape(value["shape"])


_ENCODER: Final = msgspec.msgpack.Encoder(enc_hook=_encode)
