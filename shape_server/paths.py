"""Which implementation solves: the compiled kernels, or numpy and LAPACK until they are compiled.

Compiling takes several seconds once per installation; numba keeps the result on disk. It is done in a child process, so
that requests are answered meanwhile, and the server changes over when the child is done.
"""

from __future__ import annotations

import importlib
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import numpy as np

from . import numpy_path

CHOICES: Final = ("auto", "compiled", "numpy")


class Paths:
    """The implementation to use now; `kernels` is one of `CHOICES`."""

    def __init__(self, kernels: str) -> None:
        self._child: subprocess.Popen[bytes] | None = None
        self.current: ModuleType = numpy_path
        if kernels == "numpy":
            return
        if kernels == "compiled" or is_compiled():
            self.current = compile_kernels()
        else:
            self._child = subprocess.Popen([sys.executable, "-m", "shape_server", "--warm-up"], stdout=subprocess.DEVNULL)

    @property
    def state(self) -> str:
        """One of "compiled", "compiling" and "numpy"."""
        if self._child is not None:
            return "compiling"
        return "numpy" if self.current is numpy_path else "compiled"

    def update(self) -> None:
        """Change over if the child has finished; with an error in the child, stay with numpy."""
        if self._child is not None and self._child.poll() is not None:
            done, self._child = self._child, None
            if done.returncode == 0:
                self.current = compile_kernels()

    def close(self) -> None:
        """End the child, if there is one."""
        if self._child is not None:
            self._child.terminate()
            self._child.wait()


def is_compiled() -> bool:
    """Whether numba's cache on disk holds the kernels as they are now."""
    from . import contact_geometry, kernels

    functions: tuple[Any, ...] = (kernels.assemble, kernels.factor_and_solve, kernels.retract, contact_geometry.contact_geometry)
    return all(_has_index(function) for function in functions)


def _has_index(function: Any) -> bool:
    """Whether the cache on disk has an index for the function that is newer than its source."""
    source = Path(function.py_func.__code__.co_filename)
    indices = Path(function.stats.cache_path).glob(f"{source.stem}.{function.__name__}-*.nbi")
    return any(index.stat().st_mtime >= source.stat().st_mtime for index in indices)


def compile_kernels() -> ModuleType:
    """The compiled kernels, after a first call of each; from the cache on disk this takes 0.3 s."""
    kernels = importlib.import_module(".kernels", __package__)
    geometry = importlib.import_module(".contact_geometry", __package__).contact_geometry
    lengths, clamps = np.full(3, 0.1), np.array([0, -1, -1, 1])
    frames, ends = np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)), np.tile([0.0, 0.0, 0.0, 1.0], (2, 1))
    law = np.ones(3)
    axes = kernels.directors(frames)
    nodes = kernels.positions(axes[:, 2], lengths, 0, np.zeros(3))
    carried = kernels.carried_forces(np.ones((4, 3)), 0)
    kernels.elastic_energy(frames, lengths, law, clamps, ends)
    _, diagonal, upper = kernels.assemble(frames, axes, lengths, law, clamps, ends, carried)
    segment, half, up = np.array([1]), np.array([0.5]), np.array([[0.0, 0.0, 1.0]])
    border = kernels.columns(axes, lengths, 0, segment, half, up, np.array([0]))
    kernels.factor_and_solve(diagonal, upper, border)
    kernels.retract(frames, np.zeros((3, 3)))
    geometry(
        nodes, axes, lengths, segment, half, np.array([1]), up, up, np.array([[1.0, 0.0, 0.0]]), np.array([[-1.0, 1.0]]), np.array([0.1])
    )
    return kernels


def warm_up() -> float:
    """Compile everything to the cache on disk; returns the seconds it took."""
    begun = time.perf_counter()
    compile_kernels()
    return time.perf_counter() - begun
