"""One problem in, one shape out: picks the model, the mesh and the way to start, and says what the answer cost."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Final

import numpy as np

from protocol.kinds import FRICTION_CODES, Friction, Hold, Outcome
from protocol.messages import Cost, Problem, Shape
from protocol.scene import Vector

from . import effects, numpy_path, reading
from .cold import curve_frames
from .equilibrium import Progress, Settled, kick, relax, settle, step_near
from .hanging import solve_hanging
from .mesh import Mesh, even, from_nodes, halved
from .rod import Held, Rod, State, start_state, unbalanced

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
        return _catenary(problem, gravity, tolerance, used, begun)
    sentence = _too_far(problem)
    if sentence:
        return _no_shape(problem, used, Outcome.UNREACHABLE, sentence, "rod", time.perf_counter() - begun)
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


def make_rod(problem: Problem, gravity: Vector, used: tuple[str, ...], mesh: Mesh, path: ModuleType) -> Rod:
    """The system of equations of a problem on a mesh: the sum of what the effects in use add."""
    grasps, cable = problem.grasps, problem.cable
    loads, law = np.zeros((len(mesh.s), 3)), np.zeros(3)
    for name in used:
        effect = effects.load(name)
        if hasattr(effect, "node_loads"):
            loads += effect.node_loads(mesh.lengths, cable, gravity)
        if hasattr(effect, "stiffness"):
            law += effect.stiffness(cable)
    clamps = [k for k, hold in enumerate(grasps.hold) if hold is Hold.CLAMP]
    clamp_of_node = np.full(len(mesh.s), -1, dtype=np.int64)
    clamp_of_node[mesh.grasp_nodes[clamps]] = np.arange(len(clamps))
    element, fraction = mesh.locate(grasps.s[1:])
    forces = problem.start.grasp_forces[1:] if problem.start is not None else np.zeros((len(element), 3))
    held = Held(element, fraction, grasps.position[1:], np.zeros((len(element), 3)), forces)
    touch = None
    if problem.contacts is not None:
        codes = problem.contacts.friction
        if "bond" in used:
            bonds = effects.load("bond").rows(problem.contacts, np.flatnonzero(codes == FRICTION_CODES.index(Friction.BOND)), mesh)
            held = Held(
                *(
                    np.concatenate(pair)
                    for pair in zip(_fields(held), (bonds.element, bonds.fraction, bonds.anchor, bonds.normal, bonds.force), strict=True)
                )
            )
        if "contact" in used:
            touch = effects.load("contact").rows(problem.contacts, np.flatnonzero(codes == FRICTION_CODES.index(Friction.NONE)), mesh)
    return Rod(
        mesh=mesh,
        base=int(mesh.grasp_nodes[0]),
        origin=grasps.position[0],
        clamp_of_node=clamp_of_node,
        clamp_frames=np.ascontiguousarray(grasps.quaternion[clamps]),
        law=law,
        loads=loads,
        weight=float(np.linalg.norm(loads.sum(axis=0))),
        held=held,
        touch=touch,
        path=path,
    )


def _fields(held: Held) -> tuple[np.ndarray, ...]:
    return (held.element, held.fraction, held.goal, held.normal, held.force)


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
    return _shape(task, rod, found, sentence, _estimate(coarse_rod, coarse, rod, found), (begun, solved))


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
            return _no_shape(problem, task.used, outcome, f"cold start: {after.why}", "rod", time.perf_counter() - begun, spent)
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
    return _shape(task, rod, replace(found, iterations=spent), sentence, error, (begun, solved))


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


def _shape(task: _Task, rod: Rod, found: Settled, sentence: str, error: float, times: tuple[float, float]) -> Shape:
    problem, state, view = task.problem, found.state, found.view
    curvature, moments = reading.curvature_and_moments(rod, state)
    grasp_count = len(problem.grasps.s)
    wrenches = np.zeros((grasp_count, 6))
    wrenches[1:, :3] = state.force[: grasp_count - 1]
    clamps = [k for k, hold in enumerate(problem.grasps.hold) if hold is Hold.CLAMP]
    wrenches[clamps, 3:] = moments
    contact_count = 0 if problem.contacts is None else len(problem.contacts.s)
    contact_forces, contact_s = np.zeros((contact_count, 3)), np.zeros(contact_count)
    if problem.contacts is not None:
        contact_s[:] = problem.contacts.s
        contact_forces[problem.contacts.friction == FRICTION_CODES.index(Friction.BOND)] = state.force[grasp_count - 1 :]
        if rod.touch is not None:
            np.add.at(contact_forces, rod.touch.index, state.push[:, None] * view.push)
            contact_s = _slid(rod, state, contact_s)
    wrenches[0, :3] = -(rod.loads.sum(axis=0) + wrenches[1:, :3].sum(axis=0) + contact_forces.sum(axis=0))
    return Shape(
        s=rod.mesh.s,
        nodes=view.nodes,
        frames=state.frames,
        tension=reading.tension(rod, state, view),
        curvature=curvature,
        grasp_wrenches=wrenches,
        contact_forces=contact_forces,
        contact_s=contact_s,
        outcome=Outcome.CONVERGED,
        sentence=sentence,
        model="rod",
        effects=task.used,
        error=error if math.isfinite(error) else None,
        residual=unbalanced(rod, state, view),
        iterations=found.iterations,
        is_stable=found.is_stable,
        cost=Cost(
            solve=times[1] - times[0],
            estimate=time.perf_counter() - times[1],
            path="numpy" if rod.path is numpy_path else "numba",
        ),
    )


def _slid(rod: Rod, state: State, s: np.ndarray) -> np.ndarray:
    """Where along the cable every contact is (m,) [m]: the middle of its rows, by their forces; where it was if it is open."""
    assert rod.touch is not None
    place = rod.mesh.s[rod.touch.element] + state.fraction * rod.mesh.lengths[rod.touch.element]
    force = np.bincount(rod.touch.index, weights=state.push, minlength=len(s))
    moment = np.bincount(rod.touch.index, weights=state.push * place, minlength=len(s))
    return np.where(force > 0.0, moment / np.where(force > 0.0, force, 1.0), s)


def _catenary(problem: Problem, gravity: Vector, tolerance: float, used: tuple[str, ...], begun: float) -> Shape:
    hanging = solve_hanging(problem, gravity, tolerance)
    if hanging.outcome is not Outcome.CONVERGED:
        return _no_shape(problem, used, hanging.outcome, hanging.sentence, "catenary", time.perf_counter() - begun)
    wrenches = np.zeros((len(problem.grasps.s), 6))
    wrenches[:, :3] = hanging.grasp_forces
    return Shape(
        s=hanging.mesh.s,
        nodes=hanging.nodes,
        frames=hanging.frames,
        tension=hanging.tension,
        curvature=hanging.curvature,
        grasp_wrenches=wrenches,
        contact_forces=hanging.contact_forces,
        contact_s=problem.contacts.s if problem.contacts is not None else np.zeros(0),
        outcome=Outcome.CONVERGED,
        sentence=hanging.sentence,
        model="catenary",
        effects=used,
        error=hanging.sag,
        residual=0.0,
        iterations=0,
        is_stable=True,
        cost=Cost(solve=time.perf_counter() - begun, estimate=0.0, path="closed form"),
    )


def _too_far(problem: Problem) -> str:
    """Why the held points cannot be reached; empty if they can."""
    grasps = problem.grasps
    chords = np.linalg.norm(np.diff(grasps.position, axis=0), axis=1)
    for k, (span, chord) in enumerate(zip(np.diff(grasps.s), chords, strict=True)):
        if chord > span * (1 - 1e-12):
            return f"grasps {k} and {k + 1} are {chord:.9g} m apart, with {span:.9g} m of cable between them; bring them closer together"
    return ""


def _no_shape(
    problem: Problem, used: tuple[str, ...], outcome: Outcome, sentence: str, model: str, seconds: float, iterations: int = 0
) -> Shape:
    """An answer without a shape: its arrays are empty, so that nobody can take it for one."""
    return Shape(
        s=np.zeros(0),
        nodes=np.zeros((0, 3)),
        frames=np.zeros((0, 4)),
        tension=np.zeros(0),
        curvature=np.zeros(0),
        grasp_wrenches=np.zeros((len(problem.grasps.s), 6)),
        contact_forces=np.zeros((0, 3)),
        contact_s=np.zeros(0),
        outcome=outcome,
        sentence=f"{sentence}. {outcome.advice}",
        model=model,
        effects=used,
        error=None,
        residual=0.0,
        iterations=iterations,
        is_stable=False,
        cost=Cost(solve=seconds, estimate=0.0, path="none"),
    )
