"""A cable without bending that snaps from one posture to another over the same obstacle (Fig. 5 of the paper).

Without friction such a cable may have two postures over a point or an edge. Where the one that it is in ceases to be an equilibrium, the
cable slides over the contact to the other, however short the step, and moves much further than its distance to what it touches. It passes
through nothing on the way, as it stays on the contact all the time. That is so if what pushed it before pushes it after, on the same hand
of the cable, and no other body is in the way from the one shape to the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from .hanging import Hanging
from .looking import touching
from .polyline import points_at
from .stage import Posture, Stage

PARTS: Final = 16  # of the way between two shapes, looked at in turn


def have_slid_over(stage: Stage, was: Sequence[Hanging], now: Sequence[Hanging], goal: Posture) -> bool:
    """Whether every cable has no bending and went from one shape to the other by sliding over the contacts that it has."""
    return all(_has_slid_over(stage, index, *pair, goal) for index, pair in enumerate(zip(was, now, strict=True)))


def _has_slid_over(stage: Stage, index: int, was: Hanging, now: Hanging, goal: Posture) -> bool:
    before, after = was.boundary.pushes, now.boundary.pushes
    if not was.boundary.is_limp or not len(before.s) or set(before.surface.tolist()) != set(after.surface.tolist()):
        return False
    for surface in set(before.surface.tolist()):
        if not float(_hand(was, surface) @ _hand(now, surface)) > 0.0:
            return False
    start = points_at(was.shape, now.shape.s)
    for share in np.linspace(0.0, 1.0, PARTS + 1):
        found = touching(stage, index, (1.0 - share) * start + share * now.shape.nodes, goal.surfaces)
        if not np.isin(found.body[found.gap < 0.0], before.surface).all():
            return False
    return True


def _hand(cable: Hanging, surface: int) -> np.ndarray:
    """Tangent x push (3,) where a surface pushes a cable: on which hand it is."""
    pushes, shape = cable.boundary.pushes, cable.shape
    own = pushes.surface == surface
    s, half = float(pushes.s[own].mean()), float(np.diff(shape.s).max())
    first, last = points_at(shape, np.clip([s - half, s + half], 0.0, shape.s[-1]))
    hand: np.ndarray = np.cross(last - first, pushes.force[own].sum(axis=0))
    return hand
