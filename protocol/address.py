"""Addresses that programs listen at: `ipc://PATH` or `tcp://127.0.0.1:PORT`; with keys, others of tcp too."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Final

from .errors import AddressError

LOOPBACK: Final = ("127.0.0.1", "localhost")


def private_directory() -> Path:
    """A new directory that only this user can enter, for ipc sockets."""
    return Path(tempfile.mkdtemp(prefix="cablecosim-"))


def check_address(address: str, *, encrypted: bool = False) -> None:
    """Refuse an address that is malformed, or that others could reach without keys.

    Raises:
        AddressError: Names the address and what would be right.
    """
    scheme, _, rest = address.partition("://")
    if scheme == "ipc" and rest:
        if len(rest.encode()) > 100:
            raise AddressError(f"address '{address}': an ipc path may have at most 100 bytes; use a shorter one", key=address)
        return
    host, port = _host_and_port(address) if scheme == "tcp" else (None, None)
    if (host in LOOPBACK or (encrypted and host is not None)) and port is not None:
        return
    if host not in (None, *LOOPBACK) and not encrypted:
        raise AddressError(
            f"address '{address}': {host} can be reached by others; give keys with --keys DIR (see cablecosim keys), or use "
            "tcp://127.0.0.1:PORT",
            key=address,
        )
    raise AddressError(f"address '{address}': must be ipc://PATH or tcp://127.0.0.1:PORT", key=address)


def _host_and_port(address: str) -> tuple[str | None, str | None]:
    """Host and port of a tcp address; None for a port that is none."""
    host, colon, port = address.removeprefix("tcp://").rpartition(":")
    if not colon:
        return (port or None), None
    is_port = port == "*" or (port.isascii() and port.isdigit() and int(port) <= 65535)
    return (host or None), (port if is_port else None)
