"""Programs that march in time, on a static problem: relaxed with damping until nothing moves any more, each with its own settings.

A program whose static solve starts afresh (CableDyn) is asked once. One that knows no other way to a shape than to lead a straight rod
there (MuJoCo) pays for that. One that can start anywhere (PyElastica) gets our coarse shape, as SciPy does, whose time is not counted;
neither is compiling. At rest is a rod of which no node goes further than `RESTED` of the length in a move. What is not at rest after `LONG`
is lost; after `LOST` settings in a row the others are not tried, for they are alike.

A clamp that is turned by half a turn one way or the other is one pose, and both ways have a stable shape: either is right.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from types import ModuleType
from typing import Final, cast

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from protocol.kinds import Hold
from protocol.messages import Problem, Shape

from .collocation import Solved
from .motions import LEVEL, Motions, Rod, far_frame
from .timing import Follower, Row, children_time, distance

RESTED: Final = 1e-6  # of the length, in one move
LONG: Final = 2.0  # s of CPU time
LOST: Final = 3  # settings
SAME: Final = 1e-9  # of the length, and of a quaternion


def as_motions(problem: Problem, weight: float) -> Motions | None:
    """A problem as motions that never leave their start; None unless it is a rod that the peers are set up for.

    That is one from a level clamp to a clamp that stands as one of the moving rods, or in a plane to a hinge, in the air or over one smooth
    floor. The first clamp becomes the origin.

    Args:
        problem: Static.
        weight: [N/m].
    """
    cable, held = problem.cable, problem.grasps
    if cable.bending is None or cable.twist is None or len(held.s) != 2 or held.hold[0] is not Hold.CLAMP:
        return None
    place, floor = held.position - held.position[0], _floor(problem)
    if problem.contacts is not None and floor is None:
        return None
    bent, is_hinged = cable.natural_curvature or (0.0, 0.0, 0.0), held.hold[1] is Hold.HINGE
    rod = Rod(cable.bending, cable.twist, cable.length, weight, cable.bending_2, bent, cable.stretch)
    is_level, is_turned = (
        np.abs(np.abs(np.einsum("ij,ij->i", held.quaternion, [LEVEL.as_quat(), far.as_quat()])) - 1.0).max() < SAME
        for far in (LEVEL, far_frame(1.0))
    )
    if not is_level and not is_turned:
        return None
    is_planar = bool(is_level and abs(place[1, 1]) < SAME * cable.length) and not any(bent) and cable.bending_2 is None
    if is_hinged and not is_planar:
        return None
    return Motions(cable.name, rod, is_planar, place[None], held.quaternion[None], is_hinged=is_hinged, floor=floor)


def _floor(problem: Problem) -> float | None:
    """Height [m] over the first clamp of an axis that lies on a smooth floor, if that is all that the cable may touch."""
    met = problem.contacts
    if met is None:
        return None
    heights = met.point[:, 2] + met.distance
    is_floor = np.ptp(heights) == 0.0 and (met.normal == (0.0, 0.0, 1.0)).all() and not met.friction.any()
    return float(heights[0] - problem.grasps.position[0, 2]) if is_floor else None


class Near:
    """Where a program may start: our coarse shape, in the place of a reference."""

    def __init__(self, shape: Shape) -> None:
        self._shape = shape
        self._frames = Slerp(0.5 * (shape.s[1:] + shape.s[:-1]), Rotation.from_quat(shape.frames))

    def positions(self, s: np.ndarray) -> np.ndarray:
        """(n, 3) [m] Points of the axis, from its first."""
        return np.column_stack([np.interp(s, self._shape.s, column) for column in (self._shape.nodes - self._shape.nodes[0]).T])

    def frames(self, s: np.ndarray) -> np.ndarray:
        """(n, 4) Quaternions of the sections."""
        return np.asarray(self._frames(np.clip(s, self._frames.times[0], self._frames.times[-1])).as_quat())


def rested(
    peer: ModuleType, motions: Motions, near: Near, exact: Sequence[Callable[[np.ndarray], np.ndarray]]
) -> Iterator[tuple[Row, int]]:
    """What a peer reaches at each of its settings, the CPU time of that and its number of nodes; those that it loses are left out.

    Args:
        peer: One of `installed.FOLLOWING`.
        motions: From `as_motions`.
        near: To start from.
        exact: Points (n, 3) [m] at arc lengths (n,) [m] of every shape that is right.
    """
    first, settings, lost = cast(Solved, near), peer.sweep(motions), 0
    _relaxed(peer.prepare(motions, first, settings[0]), motions, once=True)  # loads and compiles
    for setting in settings:
        begun = time.process_time()
        follower = peer.prepare(motions, first, setting)
        leading = time.process_time() - begun if peer.FROM_STRAIGHT else 0.0
        nodes, seconds = _relaxed(follower, motions, once=not peer.REMEMBERS)
        error = min(distance(nodes, points(follower.s)) for points in exact) / motions.rod.length if seconds < LONG else math.inf
        lost = 0 if error < 1.0 else lost + 1
        if lost == LOST:
            return
        if not lost:
            yield Row(peer.NAME, str(setting), 1e3 * (leading + seconds), error), len(nodes)


def _relaxed(follower: Follower, motions: Motions, *, once: bool) -> tuple[np.ndarray, float]:
    """Nodes (n, 3) [m] at rest, and the CPU time [s] to there."""
    begun, last, gone = time.process_time() + children_time(), None, math.inf
    while True:
        nodes = follower.move(motions.position[0], motions.quaternion[0])
        seconds = time.process_time() + children_time() - begun
        if last is not None:
            gone = distance(nodes, last) / motions.rod.length
        if once or gone < RESTED or not math.isfinite(float(nodes.sum())) or seconds > LONG:
            return nodes, seconds
        last = nodes.copy()
