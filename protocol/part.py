"""What every part of a message is."""

from __future__ import annotations

import copy
from typing import Self

import msgspec


class Part(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Anything that crosses the wire inside a message."""

    def altered(self, **fields: object) -> Self:
        """The part with other fields that are known to fit: it asks no checks, unlike `msgspec.structs.replace`, and so costs little."""
        out = copy.copy(self)
        for name, value in fields.items():
            msgspec.structs.force_setattr(out, name, value)
        return out
