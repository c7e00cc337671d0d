"""Many cables at once: over the cores of a machine by processes, and over the lanes of one core's vector registers.

`solve_many` and `SolverPool` take any problems, and answer each as `solve` does, to the bit. `FollowerBatch` takes cables that are clamped
at both ends and follows their clamps, as `Follower` does for one cable, at a tenth of its time per cable.
"""

from __future__ import annotations

import importlib
import math
import os
from collections.abc import Callable, Iterator, Sequence
from multiprocessing import get_context
from multiprocessing.connection import wait
from types import ModuleType, TracebackType
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np

from protocol.errors import CablecosimError
from protocol.messages import Problem, Shape
from protocol.scene import Vector

from . import effects, kernels
from .descent import settle_or_relax
from .equilibrium import WHY, Settled
from .first_shape import from_grasps
from .follower import chain_of, is_clamped
from .following import SHORT, STEPS
from .lane_rows import LANES
from .lanes import follow_lanes
from .mesh import even, stops
from .solve import solve
from .system import System
from .task import Task

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from multiprocessing.context import SpawnProcess

    Pipe = Connection[Any, Any]

CHUNKS: Final = 4  # for each worker, so that one with easy problems takes over from others
Array = np.ndarray
Done = Callable[[int, int], None]  # told how many problems are solved, and of how many


def solve_many(
    problems: Sequence[Problem],
    gravity: Vector,
    *,
    tolerance: float = 1e-3,
    extrapolate: bool = True,
    margin: bool = False,
    path: ModuleType = kernels,
    workers: int | None = None,
    progress: Done = lambda done, total: None,
) -> list[Shape]:
    """Shapes of many problems, in their order, each the same as from `solve`.

    Processes are started and ended here, which takes some seconds; keep a `SolverPool` for more than one sweep. As every program that
    starts processes, a script that calls this needs `if __name__ == "__main__":` around its main part.

    Args:
        problems: Cables with their boundary conditions.
        gravity: [m/s^2].
        tolerance: [m] See `solve`.
        extrapolate: See `solve`.
        margin: See `solve`.
        path: `numpy_path`, or the compiled `kernels`.
        workers: Processes; one for each core unless given. With 1 all is done in this process.
        progress: Told how many are solved, and of how many.

    Raises:
        CablecosimError: If a problem is wrong, or a worker ended before its time.
    """
    count = _cores() if workers is None else workers
    if count == 1 or len(problems) < 2:
        shapes = []
        for problem in problems:
            shapes.append(solve(problem, gravity, tolerance=tolerance, extrapolate=extrapolate, margin=margin, path=path))
            progress(len(shapes), len(problems))
        return shapes
    with SolverPool(min(count, len(problems))) as pool:
        return pool.solve_many(problems, gravity, tolerance=tolerance, extrapolate=extrapolate, margin=margin, path=path, progress=progress)


class SolverPool:
    """Processes that solve, kept from sweep to sweep: `with SolverPool() as pool: pool.solve_many(...)`.

    Every worker has a pipe of its own, so that one that dies, even in the middle of an answer, is seen at once.
    """

    def __init__(self, workers: int | None = None) -> None:
        """Start the processes, one for each core unless their number is given."""
        count = _cores() if workers is None else workers
        if count < 1:
            raise CablecosimError(f"workers: {count} must be 1 or more")
        # Not forked: a fork of a process with the threads of a BLAS in it can hang.
        context = get_context("spawn")
        self._workers: list[tuple[SpawnProcess, Pipe]] = []
        for _ in range(count):
            ours, theirs = context.Pipe()
            process = context.Process(target=_work, args=(theirs,), daemon=True)
            process.start()
            theirs.close()  # or the end of the worker would not end its pipe
            self._workers.append((process, ours))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """End the processes."""
        for process, pipe in self._workers:
            pipe.close()
            process.terminate()
            process.join()
        self._workers = []

    def solve_many(
        self,
        problems: Sequence[Problem],
        gravity: Vector,
        *,
        tolerance: float = 1e-3,
        extrapolate: bool = True,
        margin: bool = False,
        path: ModuleType = kernels,
        progress: Done = lambda done, total: None,
    ) -> list[Shape]:
        """Shapes of many problems, as from the function of this name; after an error the pool is closed."""
        if not self._workers:
            raise CablecosimError("the pool is closed; make another SolverPool")
        size = max(1, math.ceil(len(problems) / (CHUNKS * len(self._workers))))
        options = {"tolerance": tolerance, "extrapolate": extrapolate, "margin": margin}
        chunks = [(first, (problems[first : first + size], gravity, options, path.__name__)) for first in range(0, len(problems), size)]
        shapes: dict[int, list[Shape]] = {}
        try:
            for first, answer in self._answers(chunks):
                shapes[first] = answer
                progress(sum(map(len, shapes.values())), len(problems))
        except (EOFError, OSError) as error:
            self.close()
            raise CablecosimError(
                "a worker process ended before it had solved its problems: out of memory, killed, or started by a script without "
                "'if __name__ == \"__main__\":'; begin anew, with fewer workers if memory is short"
            ) from error
        except BaseException:
            self.close()  # what its workers still answer would be taken for the next sweep's
            raise
        return [shape for first in sorted(shapes) for shape in shapes[first]]

    def _answers(self, chunks: list[tuple[int, Any]]) -> Iterator[tuple[int, list[Shape]]]:
        """Chunks by their first number as they are solved, every worker with one in hand."""
        idle, left = [pipe for _, pipe in self._workers], chunks[::-1]
        busy: dict[Pipe, int] = {}
        while busy or left:
            while idle and left:
                pipe, (first, chunk) = idle.pop(), left.pop()
                pipe.send(chunk)
                busy[pipe] = first
            ready = wait(list(busy))
            for pipe in [pipe for pipe in busy if pipe in ready]:
                answer = pipe.recv()
                if isinstance(answer, CablecosimError):
                    raise answer
                idle.append(pipe)
                yield busy.pop(pipe), answer


def _work(pipe: Pipe) -> None:
    """What a worker does: chunks of problems in, lists of shapes out, until the pipe ends."""
    try:
        while True:
            problems, gravity, options, path = pipe.recv()
            implementation = importlib.import_module(path)
            try:
                pipe.send([solve(problem, gravity, path=implementation, **options) for problem in problems])
            except CablecosimError as error:
                pipe.send(error)
    except (EOFError, OSError, KeyboardInterrupt):
        return


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class FollowerBatch:
    """The shapes of many cables, kept up with their clamps as these move by a little; a `Follower` of all of them."""

    def __init__(self, problems: Sequence[Problem], gravity: Vector, *, segments: int = 40) -> None:
        """Find the first shapes.

        Args:
            problems: Cables clamped at both ends, without contacts, stretch and micro-structure length, with a start shape on any mesh if
                a branch is meant.
            gravity: [m/s^2].
            segments: Of every mesh.

        Raises:
            CablecosimError: If a problem cannot be followed, or has no first shape; names its number.
        """
        self._count = len(problems)
        if not problems:
            raise CablecosimError("problems: none given; a FollowerBatch needs one cable or more")
        ready = [_first(number, problem, gravity, segments) for number, problem in enumerate(problems)]
        ready += [ready[-1]] * (-len(ready) % LANES)  # the last lanes of the last block repeat a cable
        rods, states = [system.rod for system, _ in ready], [found.state for _, found in ready]
        self.s = np.array([system.mesh.s for system, _ in ready[: self._count]])  # (k, n) m
        self.is_stable = np.ones(self._count, dtype=bool)  # (k,) whether the last equilibria are
        chains = [chain_of(rod) for rod in rods]
        self._vertex, self._lengths = _blocks([chain.vertex for chain in chains]), _blocks([chain.lengths[:, None] for chain in chains])
        self._weight = _blocks([chain.weight for chain in chains])
        pairs = zip(rods, states, strict=True)
        self._frames = _blocks([np.vstack([rod.clamp_frames[0], state.frames, rod.clamp_frames[1]]) for rod, state in pairs])
        self._force = _blocks([state.force for state in states])

    def move(self, position: Array, quaternion: Array) -> Array:
        """Nodes (k, n, 3) [m] after the clamps of all cables have moved to `position` (k, 2, 3) [m] and `quaternion` (k, 2, 4).

        Raises:
            CablecosimError: If Newton's method does not get there for one of them: move by less. All shapes are then as they were.
        """
        origin, chord = _spread(position[:, 0]), _spread(position[:, 1] - position[:, 0])
        frames, force = self._frames.copy(), self._force.copy()
        frames[:, 0], frames[:, -1] = _spread(quaternion[:, 0]), _spread(quaternion[:, 1])
        nodes, verdict = follow_lanes(self._vertex, self._lengths, self._weight, origin, chord, frames, force, SHORT, STEPS)
        lost = np.flatnonzero(verdict[: self._count] < 0)
        if len(lost):
            raise CablecosimError(f"the motion of cable {lost[0]} is too large to follow; move the grasps by less, or solve anew")
        self._frames, self._force, self.is_stable = frames, force, verdict[: self._count] > 0
        out: Array = nodes[: self._count]
        return out


def _first(number: int, problem: Problem, gravity: Vector, segments: int) -> tuple[System, Settled]:
    """The equations of one cable of a batch, at rest."""
    used, held = effects.asked_for(problem, gravity), problem.grasps
    if not is_clamped(problem):
        raise CablecosimError(
            f"cable {number}: a FollowerBatch takes cables with 'bending', clamped at both ends, without stretch, 'micro_length' and "
            "contacts; use a Follower for others"
        )
    task = Task(problem, gravity, 1.0, None, False, False, used, kernels, lambda iteration, residual: None)
    system = task.system(even(stops(problem), held.s, segments))
    if len(system.rod.lengths) != segments:
        raise CablecosimError(f"cable {number}: its sections, masses and loads do not fit {segments} segments; ask for more")
    if problem.start is None:
        found = from_grasps(task, system)
    else:
        there, here = (0.5 * (s[1:] + s[:-1]) for s in (problem.start.s, system.mesh.s))
        begin = system.start(kernels.interpolate_frames(there, np.array(problem.start.frames), here))
        found = settle_or_relax(kernels, system.rod, begin, task.progress)
    if not (found.is_converged and found.is_stable):
        raise CablecosimError(f"cable {number}: no first shape to follow: {WHY[found.why]}")
    return system, found


def _blocks(of_cables: Sequence[Array] | Array) -> Array:
    """Arrays (..., c) of all cables as (blocks, ..., c LANES), cables in line; their number is a multiple of `LANES`."""
    together = np.moveaxis(np.reshape(of_cables, (-1, LANES, *of_cables[0].shape)), 1, -1)
    return np.ascontiguousarray(together.reshape(*together.shape[:-2], -1))


def _spread(of_cables: Array) -> Array:
    """An array of the cables without those that fill up the last block, in blocks."""
    return _blocks(np.concatenate([of_cables, np.repeat(of_cables[-1:], -len(of_cables) % LANES, axis=0)]))
