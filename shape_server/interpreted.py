"""Compiled functions as plain Python, for as long as their compiled code is not ready."""

from __future__ import annotations

from types import FunctionType
from typing import Any


def interpreted(function: Any) -> Any:
    """The Python function that numba would compile, calling the Python functions of its module in its turn."""
    source = function.py_func
    names = dict(source.__globals__)
    for name, value in source.__globals__.items():
        if hasattr(value, "py_func"):
            inner = value.py_func
            names[name] = FunctionType(inner.__code__, names, inner.__name__, inner.__defaults__)
    return names[source.__name__]
