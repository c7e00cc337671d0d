"""Messages to bytes and back: plain MessagePack, so that any `msgpack` library can read and write it.

An array is a map {"dtype": "<f8" or "<i8", "shape": [...], "data": bytes}, C order, little-endian. Decoding is typed:
what is not exactly a message of ours raises `MessageError`.
"""

from __future__ import annotations

import math
import re
from dataclasses import fields
from typing import Any, Final

import msgspec
import numpy as np

from .errors import CablecosimError, MessageError
from .messages import AnyMessage, Message, ShapeRequest
from .scene import Cable, LumpedMass, Section
from .skeleton import look

_DTYPES: Final = {"<f8": np.dtype("<f8"), "<i8": np.dtype("<i8")}


def encode(message: Message) -> bytes:
    """Bytes of one message."""
    return _ENCODER.encode(message)


def decode(data: bytes) -> AnyMessage:
    """The message that the bytes hold.

    Raises:
        MessageError: If the bytes are no message of ours, or one of its values is out of range; names the field.
    """
    try:
        look(data)
        message: AnyMessage = _DECODER.decode(data)
        if isinstance(message, ShapeRequest):
            _check_cable_fields(data)
    except CablecosimError:
        raise
    except (msgspec.DecodeError, ValueError, RecursionError, OverflowError) as error:
        place = re.search(r"`\$\.(.+?)`", str(error))
        raise MessageError(f"not a message of this protocol: {error}", key=place.group(1) if place else "") from error
    return message


def _check_cable_fields(data: bytes) -> None:
    """Refuse an unknown field of a cable or of a part of it, which a dataclass would take no notice of."""
    for index, problem in enumerate(_NAMES.decode(data).problems):
        key = f"problems[{index}].cable"
        _check_names(key, problem.cable, Cable)
        for name, kind in (("sections", Section), ("masses", LumpedMass)):
            for place, part in enumerate(problem.cable.get(name, ())):
                _check_names(f"{key}.{name}[{place}]", part, kind)


def _check_names(key: str, given: dict[str, Any], kind: type) -> None:
    known = {field.name for field in fields(kind)}
    for name in given.keys() - known:
        raise MessageError(f"{key}.{name}: unknown field; there are {', '.join(sorted(known))}", key=f"{key}.{name}")


class _ProblemNames(msgspec.Struct):
    cable: dict[str, Any]


class _RequestNames(msgspec.Struct):
    problems: tuple[_ProblemNames, ...]


def _encode_array(value: Any) -> Any:
    if not isinstance(value, np.ndarray):
        raise TypeError(f"a {type(value).__name__} has no place in a message")
    array = np.ascontiguousarray(value)
    if array.dtype.str not in _DTYPES:
        raise TypeError(f"an array of {array.dtype.str} has no place in a message; use <f8 or <i8")
    return {"dtype": array.dtype.str, "shape": array.shape, "data": array.data if array.size else b""}


def _decode_array(kind: type, value: Any) -> Any:
    if kind is not np.ndarray:
        raise TypeError(f"a {kind.__name__} has no place in a message")
    if not isinstance(value, dict) or value.keys() != {"dtype", "shape", "data"}:
        raise ValueError("an array must be a map of dtype, shape and data")
    dtype, shape, data = _DTYPES.get(str(value["dtype"])), value["shape"], value["data"]
    if dtype is None or not isinstance(data, bytes) or not isinstance(shape, list) or len(shape) > 2:
        raise ValueError("an array must be <f8 or <i8, of at most two dimensions, with its data as bytes")
    if not all(type(size) is int and size >= 0 for size in shape) or math.prod(shape) * dtype.itemsize != len(data):
        raise ValueError(f"an array of shape {shape} does not fit {len(data)} bytes")
    # A view of the received bytes: read-only, as every array that has left its owner.
    return np.frombuffer(data, dtype).reshape(shape)


_ENCODER: Final = msgspec.msgpack.Encoder(enc_hook=_encode_array)
_NAMES: Final = msgspec.msgpack.Decoder(_RequestNames)
_DECODER: Final = msgspec.msgpack.Decoder(AnyMessage, dec_hook=_decode_array)
