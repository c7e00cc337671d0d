"""What a run was made with."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from typing import Final

from protocol import VERSION

LIBRARIES: Final = ("numpy", "scipy", "numba", "pyzmq", "pybullet", "trimesh", "manifold3d", "msgspec")


def versions() -> dict[str, str]:
    """Versions of this project, of the protocol, of Python, and of every library that a run depends on."""
    own = {"cablecosim": _version("cablecosim"), "protocol": str(VERSION), "python": platform.python_version()}
    return own | {name: _version(name) for name in LIBRARIES}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
