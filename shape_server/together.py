"""All cables of a request: those that touch, rub on or stick to each other are solved together, the others each for itself.

Cables that did not touch are solved each for itself first, and together only if they would be in each other then.

`coupled` has the equations. Every cable keeps the nodes of its start shape, and the same is solved on every second of them for the
estimate of the error. What a cable bears from the others counts as its load in what is answered about it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import ModuleType
from typing import Final

import msgspec
import numpy as np

from protocol.kinds import Outcome, SelfTouch
from protocol.messages import CrossingReactions, Crossings, Problem, Shape, ShapeRequest

from . import coupled, crossing, effects, knots, pieces, strand_friction
from .answer import no_shape, rod_shape
from .crossing import Met
from .descent import Progress
from .equilibrium import DONE, UNSTABLE, WHY
from .joint import Forces, Group
from .mesh import Mesh, from_nodes, halved
from .refine import judged
from .richardson import transfer
from .rod import State
from .solve import answer
from .strands import point_at
from .task import Solution, Task

EFFECT: Final = "crossing"  # among the effects of a shape
LEAST_NODES: Final = 3  # of a smooth axis
SAME_SIDE: Final = 0.5  # cosine, by which a normal may turn


def answers(
    request: ShapeRequest, path: ModuleType, progress: Progress = lambda iteration, residual: None
) -> tuple[tuple[Shape, ...], CrossingReactions | None]:
    """The shapes of all cables of a request, and what they do to each other; None for that without crossings, or without all shapes."""
    asked = request.crossings
    if asked is None or not len(asked.kind):
        return tuple(answer(problem, request, path, progress) for problem in request.problems), None
    shapes: dict[int, Shape] = {}
    count = len(asked.kind)
    reactions = CrossingReactions(
        s=asked.s.copy(),
        force=np.zeros((count, 3)),
        point=np.zeros((count, 3)),
        gap=np.zeros(count),
        drag=np.zeros((count, 3)),
        lag=np.zeros((count, 3)),
        is_sticking=np.zeros(count, dtype=np.int64),
    )
    for members in _groups(asked):
        own = _together(request, asked, members, path, progress, reactions)
        shapes.update(zip(members, own, strict=True))
    for index, problem in enumerate(request.problems):
        if index not in shapes:
            shapes[index] = answer(problem, request, path, progress)
    is_whole = all(shape.outcome is Outcome.CONVERGED for shape in shapes.values())
    return tuple(shapes[index] for index in range(len(request.problems))), reactions if is_whole else None


def _groups(asked: Crossings) -> list[list[int]]:
    """Cables that know of each other, each with its numbers in order."""
    groups: list[set[int]] = []
    for pair in asked.cable.tolist():
        near = [group for group in groups if group & set(pair)]
        groups = [group for group in groups if group not in near] + [set(pair).union(*near)]
    return sorted(sorted(group) for group in groups)


def _together(
    request: ShapeRequest, asked: Crossings, members: list[int], path: ModuleType, progress: Progress, reactions: CrossingReactions
) -> list[Shape]:
    """The shapes of one group; what they do to each other goes into `reactions`."""
    problems = [request.problems[index] for index in members]
    rows = np.flatnonzero(np.isin(asked.cable[:, 0], members))
    asked = _renumbered(asked, rows, members)
    if not (asked.force.any() or (asked.kind == SelfTouch.BOND).any()):
        apart = _apart(request, asked, problems, path, progress)
        if apart is not None:
            shapes, met = apart
            reactions.s[rows], reactions.gap[rows] = _places(asked, [shape.s for shape in shapes], met), met.gap
            return shapes
    used = [effects.asked_for(problem, request.gravity) for problem in problems]
    what = "touches another cable" if len(members) > 1 else "sticks to itself or rubs on itself"
    sentence = next((f"cable '{problem.cable.name}' {what} and {why}" for problem in problems if (why := _not_built(problem))), "")
    if sentence:
        return [no_shape(*item, Outcome.UNSUPPORTED, sentence, "rod", 0.0) for item in zip(problems, used, strict=True)]
    tasks = [
        Task(problem, request.gravity, request.tolerance, None, False, request.margin, own, path, progress)
        for problem, own in zip(problems, used, strict=True)
    ]
    meshes = [_mesh(problem) for problem in problems]
    group, begun = _equations(tasks, meshes, asked)
    states = [system.start(frames) for system, frames in zip(group.systems, _frames(problems), strict=True)]
    found = coupled.settle(group, coupled.begin(group, states, begun))
    if not found.is_good:
        why = f"{_named(problems)}: {WHY[found.why]}"
        outcome = Outcome.UNSTABLE if found.why == UNSTABLE else Outcome.NOT_CONVERGED
        return [no_shape(task.problem, task.used, outcome, why, "rod", task.seconds, found.iterations) for task in tasks]
    fine = _solutions(tasks, group, found)
    coarse = _coarser(tasks, meshes, asked, group, found)
    _react(asked, rows, group, found, meshes, reactions)
    return [_shape(task, fine[i], None if coarse is None else coarse[i], found, i) for i, task in enumerate(tasks)]


def _apart(
    request: ShapeRequest, asked: Crossings, problems: Sequence[Problem], path: ModuleType, progress: Progress
) -> tuple[list[Shape], Met] | None:
    """The shapes of cables that did not touch, each for itself; None if they do now, or if one of them has come to another side."""
    shapes = [answer(problem, request, path, progress) for problem in problems]
    if any(shape.outcome is not Outcome.CONVERGED or len(shape.s) < LEAST_NODES for shape in shapes):
        return None
    meshes = [
        from_nodes(np.array(shape.s), problem.cable.length, problem.grasps.s) for shape, problem in zip(shapes, problems, strict=True)
    ]
    touching, met, _ = crossing.rows(asked, np.arange(len(asked.kind)), meshes)
    met = crossing.meet(path, touching, [np.ascontiguousarray(shape.nodes) for shape in shapes], met)
    is_beside = np.einsum("kx,kx->k", met.normal, asked.normal) > SAME_SIDE
    return (shapes, met) if is_beside.all() and met.gap.min(initial=0.0) >= 0.0 else None


def _named(problems: Sequence[Problem]) -> str:
    """Which cables these are, and why they are solved as one system."""
    names = [f"'{problem.cable.name}'" for problem in problems]
    return f"cable {names[0]} with itself" if len(names) == 1 else f"cables {' and '.join(names)}, which touch each other, together"


def _not_built(problem: Problem) -> str:
    """Why a cable cannot be solved together with others or stuck to itself; empty if it can."""
    if problem.cable.bending is None:
        return "has no bending: give it 'bending' and 'twist'"
    if problem.cable.stretch is not None:
        return "stretches, which is not built: leave out 'stretch'"
    if problem.start is None:
        return "has no start shape, which says on which side it is: give 'start'"
    if len(pieces.cuts(problem)) > 2:
        return "has clamps along its way, which is not built: hold it there by hinges"
    return ""


def _renumbered(asked: Crossings, rows: np.ndarray, members: list[int]) -> Crossings:
    """The rows of one group, its cables numbered from 0."""
    columns = {name: getattr(asked, name)[rows] for name in asked.__struct_fields__}
    return Crossings(**columns | {"cable": np.searchsorted(members, asked.cable[rows])})


def _mesh(problem: Problem) -> Mesh:
    assert problem.start is not None
    return from_nodes(np.array(problem.start.s), problem.cable.length, problem.grasps.s)


def _frames(problems: Sequence[Problem]) -> list[np.ndarray]:
    return [np.array(problem.start.frames) for problem in problems if problem.start is not None]


def _equations(tasks: Sequence[Task], meshes: Sequence[Mesh], asked: Crossings) -> tuple[Group, Forces]:
    """The equations on these meshes, and where the cables meet to begin with, with what they do to each other."""
    sticks = asked.kind == SelfTouch.BOND
    touching, met, push = crossing.rows(asked, np.flatnonzero(~sticks), meshes)
    systems = [task.system(mesh) for task, mesh in zip(tasks, meshes, strict=True)]
    scale = max(system.rod.force_scale for system in systems)  # of all, so that all contacts are as hard
    systems = [replace(system, rod=system.rod._replace(force_scale=scale)) for system in systems]
    rods = [system.rod for system in systems]
    tied, pull = knots.knots(asked, np.flatnonzero(sticks), meshes, rods)
    rubbing, drag = strand_friction.rubs(asked, np.flatnonzero(~sticks), meshes, rods)
    return Group(tasks[0].path, tuple(systems), touching, tied, rubbing), Forces(met, push, pull, drag)


def _solutions(tasks: Sequence[Task], group: Group, found: coupled.Outcome) -> list[Solution]:
    """Every rod for itself, what it bears from the others among its loads."""
    out = []
    for i, task in enumerate(tasks):
        couple = np.einsum("jkx,jk->x", found.now.views[i].axes, found.couples[i])
        system = replace(group.systems[i], rod=found.rods[i], couple=couple)
        out.append(Solution(task, system, found.settled(i)))
    return out


def _coarser(tasks: Sequence[Task], meshes: Sequence[Mesh], asked: Crossings, fine: Group, found: coupled.Outcome) -> list[Solution] | None:
    """The same shapes on every second node, for the estimate; None if these do not converge."""
    force, drag = _forces(asked, fine, found)
    asked = msgspec.structs.replace(asked, force=force, drag=drag, s=_places(asked, [mesh.s for mesh in meshes], found.now.met))
    group, begun = _equations(tasks, [halved(mesh) for mesh in meshes], asked)
    pairs = zip(group.systems, fine.systems, found.now.states, strict=True)
    states = [transfer(group.path, coarse, system, State(*state)) for coarse, system, state in pairs]
    near = coupled.compare(group, coupled.begin(group, states, begun))
    return _solutions(tasks, group, near) if near.why == DONE else None


def _shape(task: Task, fine: Solution, coarse: Solution | None, found: coupled.Outcome, index: int) -> Shape:
    """The answer about one of them."""
    reading, price = judged(task, [fine] if coarse is None else [coarse, fine], found.iterations)
    shape = rod_shape(task, fine, reading, "settled together with the cables that it touches", price)
    # What the others do to it is no work of its own loads.
    given = fine.system.rod.loads - task.system(fine.system.mesh).rod.loads
    energy = shape.energy + float((given * shape.nodes).sum())
    return msgspec.structs.replace(shape, energy=energy, residual=found.unbalanced, effects=(*shape.effects, EFFECT))


def _forces(asked: Crossings, group: Group, found: coupled.Outcome) -> tuple[np.ndarray, np.ndarray]:
    """Forces (k, 3) [N] of all rows on their first cables: pushes and knots, and friction."""
    out, drag, sticks = np.zeros((len(asked.kind), 3)), np.zeros((len(asked.kind), 3)), asked.kind == SelfTouch.BOND
    out[~sticks] = found.now.push[:, None] * found.now.met.normal
    out[sticks] = found.now.pull[:, :3]
    drag[np.flatnonzero(~sticks)[group.rubs.row]] = found.now.drag
    return out, drag


def _places(asked: Crossings, nodes: Sequence[np.ndarray], met: Met) -> np.ndarray:
    """Arc lengths (k, 2) [m] of both places of all rows, from those (n,) of the nodes of every cable."""
    out = asked.s.copy()
    for k, row in enumerate(np.flatnonzero(asked.kind != SelfTouch.BOND).tolist()):
        for side in range(2):
            s = nodes[asked.cable[row, side]]
            out[row, side] = np.interp(met.place[k, side], np.arange(len(s)), s)
    return out


def _react(
    asked: Crossings, rows: np.ndarray, group: Group, found: coupled.Outcome, meshes: Sequence[Mesh], reactions: CrossingReactions
) -> None:
    """Write what the cables of a group do to each other into its rows."""
    now, sticks = found.now, asked.kind == SelfTouch.BOND
    force, drag = _forces(asked, group, found)
    reactions.s[rows], reactions.force[rows], reactions.drag[rows] = (
        _places(asked, [mesh.s for mesh in meshes], now.met),
        force + drag,
        drag,
    )
    reactions.lag[rows] = -group.hard * drag
    reactions.is_sticking[rows[~sticks][group.rubs.row]] = coupled.slipped(group, now)[2]
    met, weights, out = now.met, np.empty((3, 3)), np.empty((3, 3))
    for k, row in enumerate(rows[~sticks].tolist()):
        point_at(now.nodes[group.crossing.cable[k, 1]], met.place[k, 1], weights, out)
        reactions.point[row] = out[0] + 0.5 * (met.gap[k] + group.crossing.distance[k]) * met.normal[k]
        reactions.gap[row] = met.gap[k]
    apart = knots.points(group.path, group.tied(now), now.nodes, now.axes)
    reactions.point[rows[sticks]] = 0.5 * (apart[:, 0] + apart[:, 1])
    reactions.gap[rows[sticks]] = np.linalg.norm(apart[:, 0] - apart[:, 1], axis=1)
