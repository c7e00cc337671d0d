"""A start for a cable on many hinges: each piece for itself as if clamped, then all let go together.

Positions are summed along the cable, so a descent that has to find many held points at once goes astray. Between guessed
tangents every piece is a small problem, and their shapes put together keep every held point; what is left is the turn of
the tangents at the hinges. Two guesses are made: along the chords, where every piece sags, as a heavy cable does; and
slanting to one side and the other in turn, as a stiff cable buckles into half waves.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from protocol.kinds import Hold
from protocol.messages import Grasps, Problem

from .cold import tangents_at
from .descent import settle_or_relax
from .equilibrium import Settled
from .mesh import Mesh
from .rod import State
from .system import System
from .task import Solution, Task

MANY = 3  # hinges beyond which this is tried first

Starter = Callable[[Task, System], Settled]


def count(problem: Problem) -> int:
    """How many hinges are not at an end of the cable."""
    s, near = problem.grasps.s, 1e-9 * problem.cable.length
    return sum(hold is Hold.HINGE and near < at < problem.cable.length - near for at, hold in zip(s, problem.grasps.hold, strict=True))


def let_go(task: Task, system: System, start: Starter) -> Settled:
    """A shape by way of clamped pieces, each found by `start`; not converged if there is none that way."""
    spent = 0
    for tangents in _guesses(task):
        state = _clamped(task, system, tangents, start)
        found = settle_or_relax(task.path, system.rod, state, task.progress)
        spent += found.iterations
        if found.is_converged and found.is_stable:
            break
    return found._replace(iterations=spent)


def _guesses(task: Task) -> Iterator[np.ndarray]:
    """Tangents (g, 3) at the held points; the likelier guess first."""
    grasps, gravity = task.problem.grasps, np.asarray(task.gravity)
    plain = tangents_at(grasps, gravity)
    spans = np.diff(grasps.s)
    slack = np.clip(1.0 - np.linalg.norm(np.diff(grasps.position, axis=0), axis=1) / spans, 0.0, 1.0)
    down = gravity / np.linalg.norm(gravity) if np.any(gravity) else np.array([0.0, 0.0, -1.0])
    waves = plain.copy()
    sign = 1.0
    for k in range(len(waves)):
        aside = down - (down @ plain[k]) * plain[k]
        if grasps.hold[k] is Hold.HINGE and np.linalg.norm(aside) > 1e-6:
            near = slack[max(k - 1, 0) : k + 1].mean()
            waves[k] = plain[k] + sign * 2.0 * np.sqrt(near) * aside / np.linalg.norm(aside)
            waves[k] /= np.linalg.norm(waves[k])
        sign = -sign
    cable, span = task.problem.cable, float(spans.min())
    weight = cable.mass_per_length * float(np.linalg.norm(gravity))
    is_stiff = (cable.bending or 0.0) * np.sqrt(slack.mean()) > 0.02 * weight * span**3
    yield from (waves, plain) if is_stiff else (plain, waves)


def _clamped(task: Task, system: System, tangents: np.ndarray, start: Starter) -> State:
    """The state in which every piece is clamped along the tangents."""
    problem, mesh = task.problem, system.mesh
    grasps = problem.grasps
    clamps, before = np.array(grasps.quaternion), None
    for k, hold in enumerate(grasps.hold):
        if hold is Hold.HINGE:
            clamps[k] = task.path.turn_onto(clamps[k] if before is None else before, tangents[k])
        before = clamps[k]
    frames, forces = [], np.zeros((len(grasps.s), 3))
    stops = [0, *range(len(grasps.s)), len(grasps.s) - 1]
    for first, last in pairwise(stops):
        low = 0 if first == last == 0 else int(mesh.grasp_nodes[first])
        high = len(mesh.s) - 1 if first == last != 0 or len(grasps.s) == 1 else int(mesh.grasp_nodes[last])
        if first == last and low == high:
            continue
        held = sorted({first, last})
        piece = Problem(
            cable=replace(problem.cable, length=float(mesh.s[high] - mesh.s[low]), sections=(), masses=()),
            grasps=Grasps(
                s=np.clip(grasps.s[held] - mesh.s[low], 0.0, mesh.s[high] - mesh.s[low]),
                position=grasps.position[held],
                quaternion=clamps[held],
                hold=(Hold.CLAMP,) * len(held),
            ),
        )
        part = Mesh(mesh.s[low : high + 1] - mesh.s[low], mesh.lengths[low:high], mesh.grasp_nodes[held] - low)
        own = replace(task, problem=piece, used=tuple(name for name in task.used if name in ("gravity", "bending", "twist")))
        rod = own.system(part)
        found = start(own, rod)
        frames.append(found.state.frames)
        forces[held] += Solution(own, rod, found).reading.wrenches[:, :3]
    row_force = np.einsum("ij,ij->i", system.rod.held.rows["axis"], forces[system.row_grasp]) * (system.row_grasp >= 0)
    begun = system.start(np.concatenate(frames))
    return begun._replace(
        force=row_force, push=np.zeros_like(begun.push), touches=np.zeros_like(begun.touches), drag=np.zeros_like(begun.drag)
    )
