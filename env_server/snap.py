"""Whether a cable has jumped in a step, or only gone fast: a jump stays as large in however short a step.

A step in which some point of a cable goes far is cut in half, again and again, each time in the half in which it goes further. What
is smooth shrinks with the step, even the sag x^(1/2) of a taut cable that is let go by x: by 0.71 with every halving. A jump from one
equilibrium to another is found in one of the halves as it was in the whole. It counts if after `HALVINGS` halvings, in a step 1/64
as long, `LEFT` of it is left.

A step is looked into if a point went further than `NOTICED` of the length, and `LIVELY` times as far as anything that drives the cable
(grippers, bodies, links): in a scene that moves at its leisure, none but the steps in which something happens.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from protocol.kinds import Outcome
from protocol.messages import Shape

from .polyline import points_at
from .poses import moves
from .stage import Posture, Stage
from .stepped import Stepped

NOTICED: Final = 0.02  # of the length
LIVELY: Final = 1.5
TURNED: Final = 4.0 / 27.0  # of angle times length: the most that a beam between two clamps, a cubic, goes where one of them turns
HALVINGS: Final = 6
LEFT: Final = 0.5

Tried = Callable[[Posture, Stepped], Stepped]
"""Where a step to a posture ends, from another step."""


def has_snapped(stage: Stage, tried: Tried, before: Stepped, after: Stepped, index: int) -> bool:
    """Whether a cable has jumped between two steps."""
    far = farthest(before.cables[index].shape, after.cables[index].shape)
    if far < NOTICED * stage.scene.cables[index].length or far < LIVELY * _driven(stage, index, before.posture, after.posture):
        return False
    low, high = before, after
    for _ in range(HALVINGS):
        middle = tried(stage.between(0.5 * (low.posture.time + high.posture.time), low.posture.joints), low)
        if any(cable.shape.outcome is not Outcome.CONVERGED for cable in middle.cables):
            return True  # where no shape is found, none was gone through
        first, last = (farthest(a.cables[index].shape, b.cables[index].shape) for a, b in ((low, middle), (middle, high)))
        if max(first, last) < LEFT * far:
            return False
        low, high = (low, middle) if first > last else (middle, high)
    return True


def farthest(was: Shape, now: Shape) -> float:
    """How far the furthest point of a cable has gone [m]."""
    return float(np.linalg.norm(now.nodes - points_at(was, now.s), axis=1).max())


def _driven(stage: Stage, index: int, first: Posture, last: Posture) -> float:
    """How far anything has moved that can drive a cable [m]."""
    bodies = moves(first.surfaces, last.surfaces, np.where(np.isfinite(stage.extents), stage.extents, 0.0))
    held = [np.hstack([posture.positions, posture.quaternions]) for posture in (first, last)]
    grippers = moves(held[0], held[1], np.full(len(held[0]), TURNED * stage.scene.cables[index].length))
    return float(max(bodies.max(initial=0.0), grippers.max(initial=0.0)))
