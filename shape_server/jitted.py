"""How numba compiles the kernels: kept on disk, division by zero as in numpy, and callable from Python and each other, not from C.

Without the entry points for C a first start takes a quarter less time (the search of `env_server`: 23 s for 30 s).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from numba import njit

OPTIONS: Final[dict[str, Any]] = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True}


def kernel(function: Callable[..., Any]) -> Any:
    """Compile on first use."""
    return njit(**OPTIONS)(function)


def inlined(function: Callable[..., Any]) -> Any:
    """Compile as part of whatever calls it, where LLVM would leave a call."""
    return njit(**OPTIONS, inline="always")(function)
