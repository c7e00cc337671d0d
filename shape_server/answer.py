"""What is answered: a settled rod, a catenary, or no shape and why, each with its price tag."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Final

import numpy as np

from protocol.kinds import Outcome
from protocol.messages import Contacts, Cost, Problem, SelfReactions, Shape

from . import numpy_path
from .reading import Reading, rubbed
from .task import Solution, Task

FELT: Final = 1e-5  # of the length, what is too near where the error is not known


@dataclass(frozen=True)
class Price:
    """Estimated errors of an answer, and what it took; an error that is not finite is not known."""

    error: float  # m
    error_tension: float  # N
    error_curvature: float  # 1/m
    iterations: int
    solved: float  # s, when the last shape was found


def rod_shape(task: Task, solution: Solution, reading: Reading, sentence: str, price: Price) -> Shape:
    """The answer that a settled rod is; `reading` may combine it with that of a coarser mesh."""
    found, system, error = solution.found, solution.system, price.error
    if task.problem.contacts is not None:
        sentence, error = _with_trespass(task.problem.contacts, system.mesh.s, reading.nodes, sentence, error)
    estimated = time.perf_counter()
    margin = float(task.path.smallest_stiffness(system.rod, found.state, found.seen)[0]) if task.margin else None
    return Shape(
        s=system.mesh.s,
        nodes=reading.nodes,
        frames=reading.frames,
        tension=reading.tension,
        curvature=reading.curvature,
        grasp_wrenches=reading.wrenches,
        contact_forces=reading.contact_forces,
        contact_moments=reading.contact_moments,
        contact_s=reading.contact_s,
        self_reactions=_self_reactions(solution) if task.problem.self_contacts is not None else None,
        outcome=Outcome.CONVERGED,
        sentence=sentence,
        model="rod",
        effects=task.used,
        left_out={},
        error=_known(error),
        error_tension=_known(price.error_tension),
        error_curvature=_known(price.error_curvature),
        residual=float(task.path.unbalanced(system.rod, found.state, found.seen)),
        iterations=price.iterations,
        energy=reading.energy,
        total_twist=reading.total_twist,
        is_stable=bool(found.is_stable),
        margin=margin,
        fold=_steps_to_fold(task.problem.start.margin if task.problem.start is not None else None, margin),
        cost=Cost(
            solve=price.solved - task.begun,
            estimate=estimated - price.solved,
            certify=time.perf_counter() - estimated,
            factorisations=price.iterations,
            path="numpy" if task.path is numpy_path else "numba",
        ),
        rubbed=rubbed(task.problem, system, found, reading.contact_s, task.path),
    )


def _self_reactions(solution: Solution) -> SelfReactions:
    """What the cable does to itself."""
    system, found, reading = solution.system, solution.found, solution.reading
    view, own = found.seen, slice(system.body_rows, None)
    return SelfReactions(s=reading.self_places, force=reading.self_push[:, None] * view.normal[own], gap=view.gap[own])


def _with_trespass(contacts: Contacts, s: np.ndarray, nodes: np.ndarray, sentence: str, error: float) -> tuple[str, float]:
    """The sentence and the error [m] of a shape that may pass an edge a second time, where it was not asked to touch it."""
    from .trespass import trespass

    deep, place, contact = trespass(contacts, s, nodes)
    if not deep > (error if math.isfinite(error) else FELT * s[-1]):
        return sentence, error
    told = f"at s = {place:.4g} m the cable comes {deep:.2g} m too near to what contact {contact} touches at {contacts.s[contact]:.4g} m"
    return f"{sentence}; {told}, and needs a contact there too", deep + error


def _known(error: float) -> float | None:
    return float(error) if math.isfinite(error) else None


def _steps_to_fold(before: float | None, now: float | None) -> float | None:
    """Steps like the last one until the margin is zero: near a fold its square falls linearly (a square-root singularity).

    At a bifurcation the margin itself does, and the shape goes on for up to twice as many steps as this says.
    """
    if before is None or now is None or not before > now > 0.0:
        return None
    return now**2 / (before**2 - now**2)


def no_shape(
    problem: Problem,
    used: tuple[str, ...],
    outcome: Outcome,
    sentence: str,
    model: str,
    seconds: float,
    iterations: int = 0,
    *,
    advice: str = "",
) -> Shape:
    """An answer without a shape: its arrays are empty, so that nobody can take it for one; with the outcome's advice unless given."""
    return Shape(
        s=np.zeros(0),
        nodes=np.zeros((0, 3)),
        frames=np.zeros((0, 4)),
        tension=np.zeros(0),
        curvature=np.zeros(0),
        grasp_wrenches=np.zeros((len(problem.grasps.s), 6)),
        contact_forces=np.zeros((0, 3)),
        contact_moments=np.zeros((0, 3)),
        contact_s=np.zeros(0),
        outcome=outcome,
        sentence=f"{sentence}. {advice or outcome.advice}",
        model=model,
        effects=used,
        left_out={},
        error=None,
        error_tension=None,
        error_curvature=None,
        residual=0.0,
        iterations=iterations,
        energy=0.0,
        total_twist=0.0,
        is_stable=False,
        margin=None,
        fold=None,
        cost=Cost(solve=seconds, estimate=0.0, certify=0.0, factorisations=iterations, path="none"),
    )
