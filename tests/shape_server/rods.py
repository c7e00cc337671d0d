"""Problems for the solver under test, those of the catalogue of hard cases and more, and an independent check of what it answers."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.kinds import Outcome
from protocol.messages import Problem, Shape
from shape_server import kernels
from shape_server.hard_cases.balance import largest_moment as largest_moment
from shape_server.hard_cases.balance import unbalanced_moment as unbalanced_moment
from shape_server.hard_cases.posing import ALONG_X as ALONG_X
from shape_server.hard_cases.posing import GRAVITY as GRAVITY
from shape_server.hard_cases.posing import RADIUS as RADIUS
from shape_server.hard_cases.posing import WEIGHTLESS as WEIGHTLESS
from shape_server.hard_cases.posing import Row as Row
from shape_server.hard_cases.posing import cable as cable
from shape_server.hard_cases.posing import contacts as contacts
from shape_server.hard_cases.posing import frame as frame
from shape_server.hard_cases.posing import grasps as grasps
from shape_server.hard_cases.posing import span as span
from shape_server.hard_cases.posing import start_from as start_from

KERNELS = kernels


def random_spans(count: int, bending: float, seed: int) -> list[Problem]:
    """Cables of one metre between random clamps at 0.2 to 0.95 m from each other, all directions alike."""
    rng = np.random.default_rng(seed)
    problems = []
    for _ in range(count):
        direction = rng.normal(size=3)
        end = rng.uniform(0.2, 0.95) * direction / np.linalg.norm(direction)
        first, last = Rotation.random(2, random_state=rng).as_quat()
        problems.append(Problem(cable=cable(bending=bending), grasps=grasps((0.0, (0.0, 0.0, 0.0), first), (1.0, end, last))))
    return problems


def is_honest(shape: Shape) -> bool:
    """A shape that is finite and stable, or none with a sentence."""
    if shape.outcome is Outcome.CONVERGED:
        values = (shape.nodes, shape.frames, shape.tension, shape.curvature, shape.grasp_wrenches, shape.contact_forces)
        return shape.is_stable and len(shape.s) > 1 and all(np.isfinite(value).all() for value in values)
    return len(shape.s) == 0 and len(shape.sentence) > 20
