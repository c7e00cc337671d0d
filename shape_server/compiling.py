"""Compiling in two processes at once, each loading from numba's cache on disk what the other has put there.

A function contains all that it calls, so that what is compiled twice costs twice: the order says who compiles what, and who waits.

    here      linear system, border, readings  ->  Newton step  ->  both iterations as one  ->  a check of everything
    beside    friction's dense system, margin                   ->  settling alone
"""

from __future__ import annotations

import multiprocessing
import os
import time
from multiprocessing.process import BaseProcess
from multiprocessing.synchronize import Event
from typing import Final

import numpy as np

from protocol.codec import decode, encode
from protocol.messages import ShapeRequest

from . import effects, kernels, numpy_path
from .border import SOFTNESS
from .cold import curve_frames
from .descent import begun
from .equilibrium import EXACT
from .mesh import even, stops
from .newton import newton_step
from .paths import compile_kernels, forget_stale_kernels, is_compiled, sample
from .rod import Rod, State, View
from .stick_slip import close_rubbing
from .task import Task

SEGMENTS: Final = 24
POLL: Final = 0.2  # s


def warm_up() -> float:
    """Compile everything to the cache on disk; returns the seconds it took."""
    start = time.perf_counter()
    if is_compiled() or (os.cpu_count() or 1) < 2:
        compile_kernels()
        return time.perf_counter() - start
    forget_stale_kernels()
    context = multiprocessing.get_context("spawn")
    is_stepping, has_rubbed, has_settled = context.Event(), context.Event(), context.Event()
    beside = context.Process(target=_compile_beside, args=(is_stepping, has_rubbed, has_settled), daemon=True)
    beside.start()
    rod, state, view = _begun()
    kernels.linear_system(rod, state, view)
    kernels.border_rows(rod, state, view, EXACT, np.inf)
    kernels.mend(rod, state, view)
    kernels.section_forces(rod, state, view)
    kernels.energy(rod, state, view)
    _wait(has_rubbed, beside)
    newton_step(rod, state, view, EXACT, 0.0)
    is_stepping.set()
    kernels.iterate(rod, begun(kernels, rod, state), 1, True)
    _wait(has_settled, beside)
    compile_kernels()
    beside.join()
    return time.perf_counter() - start


def _compile_beside(is_stepping: Event, has_rubbed: Event, has_settled: Event) -> None:
    """Compile what the Newton step needs of friction, and the margin; then, with the Newton step, what settles."""
    rod, state, view = _begun()
    border = numpy_path.border_rows(rod, state, view, EXACT, np.inf)
    rows = len(border.element)
    close_rubbing(rod, state, np.eye(rows), np.zeros(rows), border, SOFTNESS / rod.force_scale)
    has_rubbed.set()
    kernels.smallest_stiffness(rod, state, view)
    parent = multiprocessing.parent_process()
    assert parent is not None
    _wait(is_stepping, parent)
    kernels.settle(rod, state, 0.0)
    has_settled.set()


def _wait(event: Event, other: BaseProcess) -> None:
    """Wait for the other process to have come so far; without it, whoever waits compiles that too."""
    while not event.wait(POLL) and other.is_alive():
        pass


def _begun() -> tuple[Rod, State, View]:
    """A rod, a state and a view of the types that requests have: their arrays have come out of a message."""
    request = decode(encode(sample()))
    assert isinstance(request, ShapeRequest)
    problem = request.problems[0]
    used = effects.asked_for(problem, request.gravity)
    task = Task(problem, request.gravity, request.tolerance, None, True, True, used, kernels, lambda iteration, residual: None)
    system = task.system(even(stops(problem), problem.grasps.s, SEGMENTS))
    start = system.start(curve_frames(system.mesh, problem, np.asarray(request.gravity), numpy_path))
    state, view = numpy_path.look(system.rod, start, np.ascontiguousarray(system.rod.touch["normal"]))
    return system.rod, state, view
