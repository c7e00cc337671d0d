"""Preform: the curvature and twist that a cable has free of any load, from its spool or because it was bent beforehand.

Energy (kappa - kappa_0) . K (kappa - kappa_0) / 2 per metre, kappa_0 about d1, d2 and d3 of the section (Antman 2005,
"Nonlinear Problems of Elasticity", ch. 8). Plastic bending during the motion is left out: kappa_0 is given.

Its size: it acts as a moment EI kappa_0 at the ends of the cable, and of its sections. A moment M moves a span by M / T where it is
pulled, by M L^2 / 8 EI where it is not, whichever is less; twist kappa_03 as a torque GJ kappa_03.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from protocol.messages import Problem
from protocol.scene import Cable, Section, Vector

from ..mesh import Mesh
from ..seen import Seen, Size

MARGIN: Final = 1.5  # times the formula


def natural(cable: Cable, mesh: Mesh) -> np.ndarray:
    """Natural curvature and twist of every segment, (n-1, 3) [1/m]."""
    return mesh.along(cable, "natural_curvature")


def size(problem: Problem, gravity: Vector, seen: Seen) -> Size:
    """What leaving the preform out could change."""
    cable = problem.cable
    softest, most = seen.bending
    parts: list[Cable | Section] = [cable, *cable.sections]
    given = [part.natural_curvature for part in parts if part.natural_curvature is not None]
    bent = max(math.hypot(x, y) for x, y, _ in given)
    wound = max(abs(z) for _, _, z in given) * (0.0 if cable.twist is None else cable.twist / softest)
    moved = max(span.grown(MARGIN * (bent + wound) * (most / softest) * 0.5 * seen.reach(span) ** 2) for span in seen.spans)
    moved = min(moved, cable.length)
    felt = seen.moved(moved)
    return Size(moved, felt.force, felt.curvature + bent)
