"""From a start shape: the same nodes, the same branch, a step or two of Newton's method."""

from __future__ import annotations

from typing import Final

import numpy as np

from protocol.kinds import SelfInteraction
from protocol.messages import Shape

from .answer import rod_shape
from .clock import OutOfTime
from .descent import off_the_saddle, relax, settle_alone
from .equilibrium import NEAR, NO_MINIMUM, WHY
from .mesh import Mesh, from_nodes, halved
from .refine import cold, failed, judged, late
from .richardson import transfer
from .rod import State
from .task import Solution, Task

PATIENCE: Final = 4  # descents one after the other of a cable that meets itself, which has nothing else to begin from than its last shape


def warm(task: Task) -> Shape:
    """Solve from the start shape; relax from it, or start anew, where that is needed and within a budget."""
    try:
        return _warm(task)
    except OutOfTime as what:
        return late(task, what, 0)


def _warm(task: Task) -> Shape:
    start = task.problem.start
    assert start is not None
    system = task.system(from_nodes(np.array(start.s), task.problem.cable.length, task.problem.grasps.s))
    rod, begin = system.rod, system.start(np.array(start.frames))
    found = settle_alone(task.path, rod, begin, 0.0, task.progress)
    sentence = "settled from the start shape"
    is_own = task.problem.cable.self_interaction is SelfInteraction.CONTACT
    if not (found.is_converged and found.is_stable):
        sentence = f"relaxed from the start shape, because {WHY[found.why]}"
        spent = found.iterations
        begin = off_the_saddle(task.path, rod, begin, found)
        for _ in range(PATIENCE if is_own else 1):
            found = relax(task.path, rod, begin, task.progress)
            spent, after = spent + found.iterations, State(*found.state)
            begin = after._replace(frames=task.path.retract(after.frames, task.path.kick(rod)))
            if found.why != NO_MINIMUM:
                break
        found = found._replace(iterations=spent)
    if not (found.is_converged and found.is_stable) and task.problem.self_contacts is not None:
        return failed(task, found, found.iterations, sentence)  # a start anew would not know which strand is on which side
    if not (found.is_converged and found.is_stable):
        return cold(task, mesh=system.mesh, spent=found.iterations)
    levels = [Solution(task, system, found)]
    for _ in range(2 if task.extrapolate and not task.touches else 1):
        coarser = _coarser(task, levels[0])
        if coarser is None:
            break
        levels.insert(0, coarser)
    reading, price = judged(task, levels, found.iterations)
    return rod_shape(task, levels[-1], reading, sentence, price)


def _coarser(task: Task, fine: Solution) -> Solution | None:
    """The same shape on every second node, for the estimate; None if that does not converge."""
    mesh: Mesh = halved(fine.system.mesh)
    if len(mesh.s) == len(fine.system.mesh.s):
        return None
    system = task.system(mesh)
    begin = transfer(task.path, system, fine.system, fine.found.state)
    near = settle_alone(task.path, system.rod, begin, NEAR, task.progress)
    if not near.is_converged and system.rod.touch["is_straight"].any():  # so soft that a chain twice as coarse may be too far off
        near = relax(task.path, system.rod, begin, task.progress)
    return Solution(task, system, near) if near.is_converged else None
