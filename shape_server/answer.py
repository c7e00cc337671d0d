"""What is answered: a settled rod, a catenary, or no shape and why, each with its price tag."""

from __future__ import annotations

import math
import time

import numpy as np

from protocol.kinds import FRICTION_CODES, Friction, Hold, Outcome
from protocol.messages import Cost, Problem, Shape
from protocol.scene import Vector

from . import numpy_path, reading
from .equilibrium import Settled
from .hanging import solve_hanging
from .rod import Rod, State, unbalanced


def rod_shape(
    problem: Problem, used: tuple[str, ...], rod: Rod, found: Settled, sentence: str, error: float, times: tuple[float, float]
) -> Shape:
    """The answer that a settled rod is.

    Args:
        problem: What was asked.
        used: Names of the effects simulated.
        rod: The system.
        found: Where it settled.
        sentence: How it got there.
        error: [m] Estimated error of the nodes; not finite if there is no estimate.
        times: [s] When the solution was begun and when it was found.
    """
    state, view = found.state, found.view
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
        effects=used,
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


def catenary_shape(problem: Problem, gravity: Vector, tolerance: float, used: tuple[str, ...], begun: float) -> Shape:
    """The answer for a cable without bending, whose solution was begun at the time `begun` [s]."""
    hanging = solve_hanging(problem, gravity, tolerance)
    if hanging.outcome is not Outcome.CONVERGED:
        return no_shape(problem, used, hanging.outcome, hanging.sentence, "catenary", time.perf_counter() - begun)
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


def no_shape(
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
