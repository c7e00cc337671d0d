"""One problem in, one shape out: picks the model and the way to start, and says what the answer cost."""

from __future__ import annotations

import time
from dataclasses import replace
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from protocol.cable import reaches_any_distance
from protocol.kinds import FRICTION_CODES, Feature, Friction, Model, Outcome
from protocol.messages import Problem, Shape, ShapeRequest
from protocol.scene import Vector

from . import effects, ladder, numpy_path, pieces
from .answer import no_shape
from .clock import Clock
from .descent import Progress
from .refine import cold
from .task import Task
from .warm import warm

if TYPE_CHECKING:
    from .choice import Plainly


def solve(
    problem: Problem,
    gravity: Vector,
    *,
    tolerance: float = 1e-3,
    budget: float | None = None,
    extrapolate: bool = True,
    margin: bool = False,
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
        budget: [s] The best answer within this time, in place of the tolerance; what it is then depends on the machine.
        extrapolate: Whether positions may combine two meshes to fourth order, with the frames at the middles of segments.
            Without it the answer is one mesh's own, for a shape that the next one starts from.
        margin: Whether to find the stability margin too.
        path: `numpy_path`, or the compiled `kernels`.
        progress: Told the iteration and the largest unbalanced moment [N m] as the solution goes on.

    Returns:
        The shape; a hard problem gives one whose `outcome` is not converged, and whose `sentence` says why.
    """

    def plainly(own: Problem, pull: Vector, wanted: float, within: float | None) -> Shape:
        return solve(own, pull, tolerance=wanted, budget=within, extrapolate=extrapolate, margin=margin, path=path, progress=progress)

    if problem.effects is not None:
        from .choice import solve_chosen

        return solve_chosen(problem, gravity, tolerance, budget, path, plainly)
    begun = time.perf_counter()
    clock = None if budget is None else Clock(budget, progress)
    used = effects.asked_for(problem, gravity)
    model = ladder.choose(problem, gravity, tolerance)
    sentence = _too_much_for(model, problem)
    if sentence:
        return no_shape(problem, used, Outcome.UNSUPPORTED, sentence, model.value, time.perf_counter() - begun)
    if model is Model.CATENARY:
        hung = ladder.catenary_shape(problem, gravity, tolerance, used, begun, clock, path) if not _is_wide(problem) else None
        if hung is not None and (hung.outcome is Outcome.CONVERGED or not _may_be_soft(problem)):
            return hung
        return _softly(problem, gravity, tolerance, None if clock is None else clock.rest, plainly)
    if model is Model.TAUT:
        return ladder.taut_shape(problem, gravity, used, begun, path)
    if model is Model.GRADIENT:
        return ladder.gradient_shape(problem, gravity, tolerance, used, begun, clock, path)
    refusal = _refusal(problem)
    if refusal is not None:
        return no_shape(problem, used, *refusal, "rod", time.perf_counter() - begun)
    task = Task(problem, gravity, tolerance, budget, extrapolate, margin, used, path, clock or progress, begun)
    return _one_piece(task) if len(pieces.cuts(problem)) == 2 else _pieces(task, clock, progress)


def answer(problem: Problem, request: ShapeRequest, path: ModuleType, progress: Progress = lambda iteration, residual: None) -> Shape:
    """The shape of one cable of a request."""
    return solve(
        problem,
        request.gravity,
        tolerance=request.tolerance,
        budget=request.budget,
        extrapolate=request.extrapolate,
        margin=request.margin,
        path=path,
        progress=progress,
    )


def _one_piece(task: Task) -> Shape:
    return cold(task) if task.problem.start is None else warm(task)


def _pieces(task: Task, clock: Clock | None, progress: Progress) -> Shape:
    """The pieces of a cable between its clamps, one after the other."""
    parts, shapes = pieces.split(task.problem, task.gravity), []
    for number, part in enumerate(parts):
        own = replace(task, problem=part, used=effects.asked_for(part, task.gravity), begun=time.perf_counter())
        if clock is not None:  # a piece that needed less leaves more for those that come
            share = clock.rest / (len(parts) - number)
            own = replace(own, budget=share, progress=Clock(share, progress))
        shapes.append(_one_piece(own))
    return pieces.join(task.problem, shapes)


def _may_be_soft(problem: Problem) -> bool:
    """Whether a soft rod does where the catenary does not: something is touched, without bonds.

    Without a start shape nothing but faces, for a rod may settle on another side of an edge or a point than the cable passes it on.
    """
    contacts = problem.contacts
    if contacts is None or not problem.cable.mass_per_length > 0.0 or (contacts.friction == FRICTION_CODES.index(Friction.BOND)).any():
        return False
    return problem.start is not None or bool((contacts.feature == Feature.FACE).all())


def _is_wide(problem: Problem) -> bool:
    """Whether something within reach is wider than the segments of the start shape, so that closed forms need not be tried."""
    contacts, start = problem.contacts, problem.start
    if contacts is None or start is None or not _may_be_soft(problem):
        return False
    return bool((contacts.distance[contacts.feature != Feature.FACE] > np.diff(start.s).max()).any())


def _too_much_for(model: Model, problem: Problem) -> str:
    """Why a model other than the rod does not do; empty if it does."""
    if any(problem.turns) and model is not Model.ROD:
        return f"whole turns of twist were asked for, which the model '{model.value}' does not know; ask for the rod"
    if problem.self_contacts is not None and model is not Model.ROD:
        return f"the model '{model.value}' does not meet itself; ask for the rod, with 'bending' and 'twist'"
    return ""


def _softly(problem: Problem, gravity: Vector, tolerance: float, budget: float | None, plainly: Plainly) -> Shape:
    from .limp import softly  # here: what closed forms cover does without

    return softly(problem, gravity, tolerance, budget, plainly)


def _refusal(problem: Problem) -> tuple[Outcome, str] | None:
    """Why there can be no rod; None if there may be one."""
    sentence = _not_a_rod(problem)
    if sentence:
        return Outcome.UNSUPPORTED, sentence
    sentence = _too_far(problem)
    return (Outcome.UNREACHABLE, sentence) if sentence else None


def _not_a_rod(problem: Problem) -> str:
    """What of a problem the rod does not know; empty if it knows it all."""
    if problem.cable.bending is None:
        return "a rod needs 'bending' and 'twist'; give them, or ask for the catenary"
    if problem.branch and problem.contacts is not None:
        return "branches are looked for without contacts only; leave out 'branch' or 'contacts'"
    if problem.self_contacts is not None:
        if problem.cable.stretch is not None:
            return "self-contacts of a cable that stretches are not built; leave out 'stretch'"
        if len(pieces.cuts(problem)) > 2:
            return "self-contacts of a cable with clamps along its way are not built; hold it there by hinges"
        if problem.start is None:
            return "self-contacts need a start shape, which says on which side of the other each strand lies; give 'start'"
    return ""


def _too_far(problem: Problem) -> str:
    """Why the held points cannot be reached; empty if they can."""
    grasps = problem.grasps
    if reaches_any_distance(problem.cable, grasps.hold):
        return ""
    chords = np.linalg.norm(np.diff(grasps.position, axis=0), axis=1)
    for k, (span, chord) in enumerate(zip(np.diff(grasps.s), chords, strict=True)):
        if chord > span * (1 - 1e-12):
            return f"grasps {k} and {k + 1} are {chord:.9g} m apart, with {span:.9g} m of cable between them; bring them closer together"
    return ""
