"""A cable without bending where no closed form covers what it touches: solved as a rod so soft that its bending hardly shows.

Catenaries between sharp bends and arcs (`touching`) know nothing of faces, and nothing of contacts that come and go along a wide body
from step to step. A rod does. Its stiffness

    EI = F (`LAYER` tolerance)^2   [N m^2],

with F the largest force at a grasp of the start shape, or the weight, gives it layers of a tenth of the tolerance, so that it bends at
its nodes like a chain; rows are measured from straight segments then (`system`). Clamps are hinges to it. What that much
bending moves (`effects.bending`) is added to the error.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

import msgspec
import numpy as np

from protocol.kinds import Hold, Model, Outcome
from protocol.messages import Problem, Shape
from protocol.scene import Vector

from .effects import bending
from .seen import seen_in

if TYPE_CHECKING:
    from .choice import Plainly

LAYER: Final = 0.1  # of the tolerance
LEAST: Final = 1e-6  # of the length, no layer is shorter than that


def softly(problem: Problem, gravity: Vector, tolerance: float, budget: float | None, plainly: Plainly) -> Shape:
    """The shape of a cable without bending, found as that of a soft rod; `plainly` solves that within a budget [s], if there is one."""
    cable, start = problem.cable, problem.start
    pull = cable.mass_per_length * cable.length * float(np.linalg.norm(gravity))
    if start is not None:
        pull = max(pull, float(np.linalg.norm(start.grasp_forces, axis=1).max(initial=0.0)))
    stiffness = pull * max(LAYER * tolerance, LEAST * cable.length) ** 2
    hold = tuple(Hold.HINGE if hold is Hold.CLAMP else hold for hold in problem.grasps.hold)
    grasps = problem.grasps.altered(hold=hold)
    soft = problem.altered(cable=replace(cable, bending=stiffness, twist=stiffness), grasps=grasps, model=Model.ROD)
    shape = plainly(soft, gravity, tolerance, budget)
    if shape.outcome is not Outcome.CONVERGED:
        return shape
    moved = bending.size(soft, gravity, seen_in(soft, gravity, shape))
    return msgspec.structs.replace(
        shape,
        effects=tuple(name for name in shape.effects if name not in ("bending", "twist")),
        error=None if shape.error is None else shape.error + float(moved.length),
        sentence=f"{shape.sentence}; as a rod of {stiffness:.2g} N m^2, which moves it by {moved.length:.2g} m at most",
    )
