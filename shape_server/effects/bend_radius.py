"""Bend_radius: the axis bends down to a least radius r, and beyond that hardly at all, whatever the moment.

The paper (5.2) folds a cable of 3.3 mm and forces it through a clip: it resists, and keeps a loop 5.7 mm across, 2.85 mm in radius. What it
calls a fictitious obstacle, a segment with fixed ends and inclinations around which the cable lies, is an arc of that radius wherever the
cable would bend tighter, and the moment that holds it there. Here the energy per metre is, with kappa the curvature,

    EI kappa^2 / 2 + K (|kappa| - 1 / r)^2 / 2 where |kappa| > 1 / r,   K = `HARD` EI   [J/m],

so that the part beyond the limit is an arc of radius r, within M r / K of it for the moment M that bends it: 0.1 % under ten times the
moment at which the limit is met. As a law it keeps the energy without jumps and needs no rows; where the arc begins and ends comes out
of the balance. It bends both ways alike, about any axis of the section. Left out: crushing of the section, and that it is lasting.

Its size: none where the curvature stays below 1 / r, for the law is the same there. Elsewhere the turn that is above it, integral of
(|kappa| - 1 / r) ds, has to be made beside, and moves the cable by up to half the span times as much.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from protocol.messages import Problem
from protocol.scene import Cable, Vector

from ..mesh import Mesh
from ..seen import Seen, Size

HARD: Final = 1e4  # times the larger bending stiffness
MARGIN: Final = 1.15  # of curvature: a mesh averages over its segments


def limit(cable: Cable, mesh: Mesh) -> np.ndarray:
    """Largest curvature [1/m], and the stiffness [N m^2] beyond it."""
    assert cable.bend_radius is not None
    first, second = mesh.along(cable, "bending"), 0.0 if cable.bending_2 is None else mesh.along(cable, "bending_2")
    return np.array([1.0 / cable.bend_radius, HARD * float(np.max(np.maximum(first, second)))])


def size(problem: Problem, gravity: Vector, seen: Seen) -> Size:
    """What leaving the least bend radius out could change: nothing where the cable bends less than that."""
    cable = problem.cable
    assert cable.bend_radius is not None
    allowed = 1.0 / cable.bend_radius
    beyond = MARGIN * seen.bend_most - allowed
    if beyond <= 0.0:
        return Size(0.0, 0.0, 0.0)
    cells = 0.5 * (seen.mesh.lengths[1:] + seen.mesh.lengths[:-1])
    turn = float((np.maximum(MARGIN * seen.bend - allowed, 0.0) * cells).sum()) + beyond * float(seen.mesh.lengths[[0, -1]].sum())
    moved = min(max(span.grown(0.5 * turn * span.length) for span in seen.spans), cable.length)
    return Size(moved, seen.moved(moved).force, beyond)
