"""A quick look at a large message before it is built: is it typed as it should be, and does no list in it run away?

The decoder builds whatever stands in the place of an array before it can look at it, 72 bytes for every empty map. So a message
beyond LOOK_FROM bytes is first read into twins of its types, in which an array is a map of three typed fields and every list has
a most; what does not fit is refused while next to nothing has been built. Smaller messages cannot grow to more than 10 MB.
"""

from __future__ import annotations

from dataclasses import is_dataclass
from functools import cache
from types import UnionType
from typing import Annotated, Any, Final, Union, get_args, get_origin, get_type_hints

import msgspec
import numpy as np

from .checks import CONTACTS_MAX
from .messages import AnyMessage, Message

LOOK_FROM: Final = 2**17  # bytes
ENTRIES_MAX: Final = CONTACTS_MAX  # of any list or map that is no array


class _Array(msgspec.Struct, forbid_unknown_fields=True):
    dtype: Annotated[str, msgspec.Meta(max_length=3)]
    shape: Annotated[list[int], msgspec.Meta(max_length=2)]
    data: memoryview  # of the message itself, not a copy


def look(data: bytes) -> None:
    """Refuse a message that would be refused anyway, before it takes memory.

    Raises:
        msgspec.DecodeError: Names the field.
    """
    if len(data) > LOOK_FROM:
        _decoder().decode(data)


@cache
def _decoder() -> msgspec.msgpack.Decoder[Any]:
    return msgspec.msgpack.Decoder(_twin(AnyMessage))


@cache
def _twin(kind: Any) -> Any:
    """The same type, with arrays typed and lists bounded."""
    origin, inner = get_origin(kind), get_args(kind)
    if kind is np.ndarray:
        return _Array
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        tag = kind.__name__ if issubclass(kind, Message) else None
        return msgspec.defstruct(f"{kind.__name__}Twin", _fields(kind), tag=tag, forbid_unknown_fields=True, kw_only=True)
    if isinstance(kind, type) and is_dataclass(kind):
        return msgspec.defstruct(f"{kind.__name__}Twin", _fields(kind), kw_only=True)
    if origin is Annotated:
        return _twin(inner[0])
    if origin in (Union, UnionType):
        return Union[tuple(_twin(one) for one in inner)]  # noqa: UP007 - of types that are known only now
    if origin is tuple and inner[-1] is Ellipsis:
        return Annotated[list[_twin(inner[0])], msgspec.Meta(max_length=ENTRIES_MAX)]  # type: ignore[misc]
    if origin is tuple:
        return tuple[tuple(_twin(one) for one in inner)]  # type: ignore[misc]
    if origin is dict:
        return Annotated[kind, msgspec.Meta(max_length=ENTRIES_MAX)]
    return kind


def _fields(kind: Any) -> list[tuple[str, Any, Any]]:
    """Name, type and default of each field; whether one may be missing is for the decoder proper."""
    hints = get_type_hints(kind, include_extras=True)
    return [(name, _or_missing(_twin(hint)), msgspec.UNSET) for name, hint in hints.items() if not name.startswith("__")]


def _or_missing(kind: Any) -> Any:
    return Union[kind, None, msgspec.UnsetType]  # noqa: UP007 - of a type that is known only now
