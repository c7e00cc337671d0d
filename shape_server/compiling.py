"""Compiling in two processes: the Newton step in one, what only reads a state in the other; then the iterations, which need both.

Each loads from numba's cache on disk what the other has put there, so that both together take three quarters of the time of one.
"""

from __future__ import annotations

import multiprocessing
import os
import time

import numpy as np

from protocol.codec import decode, encode
from protocol.messages import ShapeRequest

from . import effects, kernels, numpy_path
from .cold import curve_frames
from .equilibrium import EXACT
from .mesh import even, stops
from .newton import newton_step
from .paths import compile_kernels, forget_stale_kernels, is_compiled, sample
from .rod import Rod, State, View
from .task import Task

SEGMENTS = 24


def warm_up() -> float:
    """Compile everything to the cache on disk; returns the seconds it took."""
    begun = time.perf_counter()
    if is_compiled() or (os.cpu_count() or 1) < 2:
        compile_kernels()
        return time.perf_counter() - begun
    forget_stale_kernels()
    beside = multiprocessing.get_context("spawn").Process(target=_compile_readings, daemon=True)
    beside.start()
    newton_step(*_begun(), EXACT, 0.0)
    compile_kernels()
    beside.join()
    return time.perf_counter() - begun


def _compile_readings() -> None:
    """Compile what reads a state and solves nothing."""
    rod, state, view = _begun()
    kernels.look(rod, state, np.ascontiguousarray(rod.touch["normal"]))
    kernels.section_forces(rod, state, view)
    kernels.smallest_stiffness(rod, state, view)
    kernels.energy(rod, state, view)


def _begun() -> tuple[Rod, State, View]:
    """A rod, a state and a view of the types that requests have: their arrays have come out of a message."""
    request = decode(encode(sample()))
    assert isinstance(request, ShapeRequest)
    problem = request.problems[0]
    used = effects.asked_for(problem, request.gravity)
    task = Task(problem, request.gravity, request.tolerance, None, True, True, used, kernels, lambda iteration, residual: None)
    system = task.system(even(stops(problem), problem.grasps.s, SEGMENTS))
    begun = system.start(curve_frames(system.mesh, problem, np.asarray(request.gravity), numpy_path))
    state, view = numpy_path.look(system.rod, begun, np.ascontiguousarray(system.rod.touch["normal"]))
    return system.rod, state, view
