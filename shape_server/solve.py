"""One problem in, one shape out: picks the model, the mesh and the way to start, and says what the answer cost."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Final

import numpy as np

from protocol.kinds import Outcome
from protocol.messages import Problem, Shape
from protocol.scene import Vector

from . import effects, numpy_path, reading
from .answer import catenary_shape, no_shape, rod_shape
from .cold import curve_frames
from .equilibrium import Progress, Settled, kick, relax, settle, step_near
from .mesh import Mesh, even, from_nodes, halved
from .rod import Rod, State, start_state
from .system import make_rod

LEVELS: Final = (25, 50, 100, 200, 400, 800)
"""Segments tried on a cold start, until the error estimate is within the tolerance."""


def solve(
    problem: Problem,
    gravity: Vector,
    *,
    tolerance: float = 1e-3,
    path: ModuleType = numpy_path,
    progress: Progress = lambda iteration, residual: None,
) -> Shape:
    """The equilibrium shape of one cable under its boundary conditions.

    With a start shape the answer keeps its nodes and its branch; without one the mesh is refined until the estimated error
    is within the tolerance. Where several equilibria are stable, the start shape decides.

    Args:
        problem: Cable, grasps, contacts and start shape.
        gravity: [m/s^2].
        tolerance: [m] Error of the node positions asked for.
        path: `numpy_path`, or the compiled `kernels`.
        progress: Told the iteration and the largest unbalanced moment [N m] as the solution goes on.

    Returns:
        The shape; a hard problem gives one whose `outcome` is not converged, and whose `sentence` says why.
    """
    used = effects.asked_for(problem, gravity)
    begun = time.perf_counter()
    if "bending" not in used:
        return catenary_shape(problem, gravity, tolerance, used, begun)
    sentence = _too_far(problem)
    if sentence:
        return no_shape(problem, used, Outcome.UNREACHABLE, sentence, "rod", time.perf_counter() - begun)
    task = _Task(problem, gravity, tolerance, used, path, progress)
    if problem.start is not None:
        return _warm(task, begun)
    return _cold(task, begun)


@dataclass(frozen=True)
class _Task:
    problem: Problem
    gravity: Vector
    tolerance: float
    used: tuple[str, ...]
    path: ModuleType
    progress: Progress


def _warm(task: _Task, begun: float) -> Shape:
    start = task.problem.start
    assert start is not None
    mesh = from_nodes(start.s, task.problem.cable.length, task.problem.grasps.s)
    rod = make_rod(task.problem, task.gravity, task.used, mesh, task.path)
    begin = start_state(rod, start.frames)
    found = settle(rod, begin, task.progress)
    sentence = "settled from the start shape"
    if not (found.is_converged and found.is_stable):
        sentence = f"relaxed from the start shape, because {found.why}"
        relaxed = relax(rod, _off_the_saddle(rod, begin, found), task.progress)
        found = replace(relaxed, iterations=relaxed.iterations + found.iterations)
    if not (found.is_converged and found.is_stable):
        return _cold(task, begun, mesh=mesh, spent=found.iterations)
    solved = time.perf_counter()
    coarse_rod = make_rod(task.problem, task.gravity, task.used, halved(mesh), task.path)
    coarse = step_near(coarse_rod, _transfer(coarse_rod, rod, found.state))
    return rod_shape(task.problem, task.used, rod, found, sentence, _estimate(coarse_rod, coarse, rod, found), (begun, solved))


def _cold(task: _Task, begun: float, *, mesh: Mesh | None = None, spent: int = 0) -> Shape:
    """Solve from the grasps alone, on finer and finer meshes, or on the mesh given and one coarser."""
    problem = task.problem
    meshes = [even(problem.cable.length, problem.grasps.s, count) for count in LEVELS] if mesh is None else [halved(mesh), mesh]
    rod: Rod | None = None
    found: Settled | None = None
    error = math.inf
    solved = begun
    for level, finer in enumerate(meshes):
        next_rod = make_rod(problem, task.gravity, task.used, finer, task.path)
        if rod is None or found is None:
            after = _from_grasps(task, next_rod)
        else:
            after = _either(next_rod, _transfer(next_rod, rod, found.state), task.progress)
        spent += after.iterations
        if not (after.is_converged and after.is_stable):
            outcome = Outcome.UNSTABLE if after.is_converged else Outcome.NOT_CONVERGED
            return no_shape(problem, task.used, outcome, f"cold start: {after.why}", "rod", time.perf_counter() - begun, spent)
        error = _estimate(rod, found, next_rod, after) if rod is not None and found is not None else math.inf
        rod, found = next_rod, after
        solved = time.perf_counter()
        is_fine = error <= task.tolerance and 1.5 * float(rod.mesh.lengths.max()) <= _layer(rod, found)
        if is_fine and (mesh is None or level == len(meshes) - 1):
            break
    assert rod is not None
    assert found is not None
    sentence = "cold start"
    if error > task.tolerance:
        sentence = (
            f"cold start; the error estimate of {error:.2g} m is above the tolerance of {task.tolerance:.2g} m on {len(rod.mesh.s)} nodes"
        )
    return rod_shape(task.problem, task.used, rod, replace(found, iterations=spent), sentence, error, (begun, solved))


def _from_grasps(task: _Task, rod: Rod) -> Settled:
    """The first shape, from nothing but the grasps: without contacts at first, so that these find the cable in one piece."""
    frames = task.path.retract(curve_frames(rod.mesh, task.problem.grasps, np.asarray(task.gravity)), kick(rod))
    begin = start_state(rod, frames)
    begin = replace(begin, force=np.zeros_like(begin.force), push=np.zeros_like(begin.push), touches=np.zeros_like(begin.touches))
    if rod.touch is None:
        return relax(rod, begin, task.progress)
    free = replace(rod, touch=None)
    hanging = relax(free, replace(begin, push=np.zeros(0), touches=np.zeros(0, dtype=bool), fraction=np.zeros(0)), task.progress)
    after = _either(rod, replace(begin, frames=hanging.state.frames, force=hanging.state.force, holds=hanging.state.holds), task.progress)
    return replace(after, iterations=after.iterations + hanging.iterations)


def _either(rod: Rod, begin: State, progress: Progress) -> Settled:
    """Settle from a state nearby; relax from it where that finds no stable equilibrium."""
    after = settle(rod, begin, progress)
    if after.is_converged and after.is_stable:
        return after
    relaxed = relax(rod, _off_the_saddle(rod, begin, after), progress)
    return replace(relaxed, iterations=relaxed.iterations + after.iterations)


def _off_the_saddle(rod: Rod, begin: State, after: Settled) -> State:
    """Where to relax from: beside the unstable equilibrium that was found, or the beginning if there was none."""
    if not after.is_converged:
        return begin
    return replace(after.state, frames=rod.path.retract(after.state.frames, kick(rod)))


def _layer(rod: Rod, found: Settled) -> float:
    """Length sqrt(EI / T) [m] over which a clamp or a contact bends the cable; segments must be shorter to see it."""
    largest = float(np.abs(reading.tension(rod, found.state, found.view)).max())
    return math.sqrt(float(rod.law[0]) / max(largest, 1e-300))


def _transfer(finer: Rod, coarser: Rod, state: State) -> State:
    """The state of a rod carried over to another mesh: frames interpolated along s, forces kept."""
    here = 0.5 * (finer.mesh.s[:-1] + finer.mesh.s[1:])
    there = 0.5 * (coarser.mesh.s[:-1] + coarser.mesh.s[1:])
    signs = np.where(np.einsum("ij,ij->i", state.frames[1:], state.frames[:-1]) < 0, -1.0, 1.0)
    aligned = state.frames * np.concatenate([[1.0], np.cumprod(signs)])[:, None]
    frames = np.column_stack([np.interp(here, there, aligned[:, k]) for k in range(4)])
    frames /= np.linalg.norm(frames, axis=1, keepdims=True)
    moved = start_state(finer, frames)
    push = np.zeros(len(moved.push))
    if finer.touch is not None and coarser.touch is not None:
        total = np.bincount(coarser.touch.index, weights=state.push, minlength=int(finer.touch.index.max()) + 1)
        first = np.unique(finer.touch.index, return_index=True)[1]
        push[first] = total[finer.touch.index[first]]
    return replace(moved, force=state.force.copy(), holds=state.holds.copy(), push=push, touches=push > 0.0)


def _estimate(coarse_rod: Rod, coarse: Settled, rod: Rod, found: Settled) -> float:
    """Error of the finer shape [m]: a third of its largest distance from the coarser one (second order).

    Infinite where the coarser solution failed.
    """
    if not coarse.is_converged:
        return math.inf
    shared = np.searchsorted(rod.mesh.s, coarse_rod.mesh.s - 1e-9 * rod.length)
    apart = found.view.nodes[shared] - coarse.view.nodes if len(shared) == len(coarse_rod.mesh.s) else None
    if apart is None or np.abs(rod.mesh.s[shared] - coarse_rod.mesh.s).max() > 1e-6 * rod.length:
        at = np.column_stack([np.interp(coarse_rod.mesh.s, rod.mesh.s, found.view.nodes[:, k]) for k in range(3)])
        apart = at - coarse.view.nodes
    return float(np.linalg.norm(apart, axis=1).max()) / 3


def _too_far(problem: Problem) -> str:
    """Why the held points cannot be reached; empty if they can."""
    grasps = problem.grasps
    chords = np.linalg.norm(np.diff(grasps.position, axis=0), axis=1)
    for k, (span, chord) in enumerate(zip(np.diff(grasps.s), chords, strict=True)):
        if chord > span * (1 - 1e-12):
            return f"grasps {k} and {k + 1} are {chord:.9g} m apart, with {span:.9g} m of cable between them; bring them closer together"
    return ""
