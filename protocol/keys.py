"""Who may talk to whom beyond this machine: a folder of CURVE keys, each a file of 40 characters (Z85).

    server.key  client.key      secret, readable for their owner only; of the programs that listen, and of those that connect
    server.pub                  of the programs that listen, for those that connect
    known/*.pub                 of everybody who may connect

`cablecosim keys DIR` makes all of them. Another machine gets a copy of the folder; or, so that no secret travels, one of its
own, from which its `client.pub` goes into `known/` here, and our `server.pub` takes the place of its own.

Source: Bernstein's CurveCP as ZeroMQ has it (CurveZMQ, RFC 26), with clients asked for by their keys (ZAP, RFC 27).
"""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from .errors import AddressError

LENGTH: Final = 40  # characters of a key


@dataclass(frozen=True)
class Keys:
    """What a program needs to listen, and to connect."""

    server_public: str
    server_secret: str = field(repr=False)  # empty where only the client's half of the folder is
    client_public: str
    client_secret: str = field(repr=False)
    known: frozenset[str]  # public keys of those who may connect


def make(folder: Path, pair: Callable[[], tuple[str, str]]) -> None:
    """Make a folder of new keys.

    Args:
        folder: Must not exist, or be empty.
        pair: Gives a new public key and its secret.

    Raises:
        AddressError: If the folder holds something already, or cannot be made.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise AddressError(f"{folder}: is not empty; give a new folder, for no key is overwritten", key=str(folder))
        folder.chmod(0o700)
        (folder / "known").mkdir(mode=0o700)
        for role in ("server", "client"):
            public, secret = pair()
            _write(folder / f"{role}.key", secret)
            _write(folder / f"{role}.pub", public)
        _write(folder / "known" / "client.pub", public)
    except OSError as error:
        raise AddressError(f"{folder}: no keys can be made there ({error.strerror}); give another folder", key=str(folder)) from error


def read(folder: Path) -> Keys:
    """The keys of a folder.

    Raises:
        AddressError: If one is missing or is none, or a secret may be read by others.
    """
    known = frozenset(_read(path) for path in sorted((folder / "known").glob("*.pub")))
    server_secret = _read_secret(folder / "server.key") if (folder / "server.key").exists() else ""
    return Keys(
        server_public=_read(folder / "server.pub"),
        server_secret=server_secret,
        client_public=_read(folder / "client.pub"),
        client_secret=_read_secret(folder / "client.key"),
        known=known,
    )


def _write(path: Path, key: str) -> None:
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="ascii") as file:
        file.write(f"{key}\n")


def _read_secret(path: Path) -> str:
    key = _read(path)
    if path.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise AddressError(f"{path}: may be read by others; say: chmod 600 {path}, or make new keys", key=str(path))
    return key


def _read(path: Path) -> str:
    try:
        key = path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise AddressError(f"{path}: cannot be read as a key; make keys with: cablecosim keys DIR", key=str(path)) from error
    if len(key) != LENGTH:
        raise AddressError(f"{path}: {len(key)} characters are no key of {LENGTH}; make keys with: cablecosim keys DIR", key=str(path))
    return key
