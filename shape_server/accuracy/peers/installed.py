"""Which of the programs to compare with are here; none of them is needed for anything else."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version
from types import ModuleType
from typing import Final

from . import peer_cabledyn, peer_mujoco, peer_pyelastica, peer_scipy

FOLLOWING: Final = (peer_scipy, peer_mujoco, peer_cabledyn, peer_pyelastica)  # those that can follow a rod's clamps


def is_installed(peer: ModuleType) -> bool:
    """Whether a peer is installed, in the version it was set up for or a later one."""
    try:
        found = tuple(int(part) for part in version(peer.DISTRIBUTION).split(".")[:2])
    except PackageNotFoundError:
        return False
    return bool(found >= peer.VERSION)


def missing(peer: ModuleType) -> str:
    """What to say of a peer that is not here."""
    return f"{peer.NAME} is not installed and left out. {peer.INSTALL}"
