"""Boundary conditions in, cable shape out; no clock, no bodies, no memory."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from . import blas as blas  # before numba, which would import all of scipy.linalg
from .solve import solve as solve

if TYPE_CHECKING:
    from .follower import Follower as Follower
    from .many import FollowerBatch as FollowerBatch
    from .many import solve_many as solve_many
    from .sensitivity import Sensitivities as Sensitivities
    from .sensitivity import sensitivities as sensitivities

WHERE = {
    "Follower": "follower",
    "FollowerBatch": "many",
    "solve_many": "many",
    "Sensitivities": "sensitivity",
    "sensitivities": "sensitivity",
}
"""Names that are imported when they are asked for, and the files they are in: each has kernels that `solve` does not need."""


def __getattr__(name: str) -> Any:
    if name not in WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; there are solve, {', '.join(WHERE)}")
    return getattr(import_module(f".{WHERE[name]}", __name__), name)
