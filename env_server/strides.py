"""How far a step may go without passing through a body: conservative advancement.

Let d be the distance of a segment of the cable to the nearest surface, and let no point of that surface move further than b, and no
point of the segment further than c, in a step. While b + c < d nothing can have been passed, whatever way both took. The rigid
motion is known before the cable is asked about: b of a pose that shifts by x and turns by an angle a about its origin is
|x| + a R, with R the distance of the furthest point from that origin. A surface that is too far away to come within reach of
the cable during its step does not count.

Source: Mirtich 1996, "Impulse-based dynamic simulation of rigid body systems", chapter 2 (conservative advancement).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from protocol.messages import Shape

from .apart import may_go, way_of
from .crossed import Crossed
from .hanging import Hanging
from .poses import moves
from .stage import Posture, Stage

SHARE: Final = 0.8  # of the distance to a body that its own motion may take up
LEAST: Final = 0.2  # of the radius; a body nearer than that has been let in, and no shorter step keeps it out
FADED: Final = 0.05  # of the weight of a cable, that a body may push it with just before they part
HALVINGS_MOST: Final = 14  # of a time step, for the motion of bodies


class Rigid(NamedTuple):
    """How far at most any point of what may come within reach has moved [m]."""

    bodies: float
    links: float


def rigid_motion(stage: Stage, at: Posture, goal: Posture, cables: Sequence[Hanging]) -> Rigid:
    """Motion of the bodies and of the robot's links that are near enough to matter.

    Args:
        stage: The rigid side of the scene.
        at: Posture for which the clearances of the cables hold.
        goal: Posture that is gone to.
        cables: With their shapes and clearances.
    """
    far = moves(at.surfaces, goal.surfaces, stage.extents)
    if not far.any():
        return Rigid(0.0, 0.0)
    nodes = np.vstack([cable.shape.nodes for cable in cables])
    low, high, count = nodes.min(axis=0), nodes.max(axis=0), stage.body_count
    centre = at.surfaces[:, :3]
    apart = np.linalg.norm(np.maximum(np.maximum(low - centre, centre - high), 0.0), axis=1) - stage.extents
    # Clearances are known up to how far was looked: a surface that stays beyond all of them changes none.
    known = [max(float(part.clearance.max()) for part in parts) for parts in zip(*((c.bodies, c.links) for c in cables), strict=True)]
    near = np.where(apart - far < np.where(np.arange(len(far)) < count, *known), far, 0.0)
    return Rigid(float(near[:count].max(initial=0.0)), float(near[count:].max(initial=0.0)))


def outruns(rigid: Rigid, cables: Sequence[Hanging]) -> bool:
    """Whether the bodies alone may reach the axis of a cable on their way."""
    if rigid == (0.0, 0.0):
        return False
    return any(
        motion > SHARE * max(float(clearance.min()), LEAST * cable.boundary.radius)
        for cable in cables
        for motion, clearance in ((rigid.bodies, cable.bodies.clearance), (rigid.links, cable.links.clearance))
        if motion > 0.0
    )


def free_share(rigid: Rigid, was: Sequence[Hanging], now: Sequence[Hanging], crossed: Crossed | None = None) -> tuple[float, float]:
    """Share of the way that surely passes no body, cable or strand, at most 1, and how far the furthest node goes [m].

    `crossed` says how near the cables were to each other.
    """
    farthest, share, moved, ways = 0.0, 1.0, [], []
    for before, after in zip(was, now, strict=True):
        segment = np.maximum(_motion(before.shape, after.shape), 1e-12)
        farthest = max(farthest, float(segment.max()))
        moved.append(segment)
        ways.append(way_of(before.shape, after.shape) if before.own is not None or crossed is not None else None)
        for clearance, motion in ((before.bodies.clearance, rigid.bodies), (before.links.clearance, rigid.links)):
            share = min(share, float(((clearance - motion) / segment).min()))
        if before.own is not None:
            own = before.own.free_share(segment)
            if own < 1.0 and not may_go(ways[-1], ways[-1], before.own.radius, is_own=True):
                share = min(share, own)
    return share if crossed is None else min(share, crossed.free_share(moved, ways)), farthest


def slipped_through(was: Sequence[Hanging], now: Sequence[Hanging]) -> bool:
    """Whether a cable without bending is off a body that pushed it hard just before: in steps short enough, a push fades first."""
    for before, after in zip(was, now, strict=True):
        pushes = before.boundary.pushes
        if before.boundary.is_limp and len(pushes.s):
            weight = float(np.linalg.norm(before.shape.grasp_wrenches[:, :3].sum(axis=0) + pushes.force.sum(axis=0)))
            hard = np.linalg.norm(pushes.force, axis=1) > FADED * weight
            if not np.isin(pushes.surface[hard], after.boundary.pushes.surface).all():
                return True
    return False


def slid_over(stage: Stage, goal: Posture, was: Sequence[Hanging], now: Sequence[Hanging]) -> bool:
    """Whether cables without bending went far only because they slid over what they touch, and met nothing else on the way.

    An equilibrium over a body without friction ends in a fold (Fig. 5 of the paper): the cable runs over that body, on the same hand of
    it, to the next one, however short the step. On the way every part stays within the box about both shapes. Half-spaces are left out of
    it, for what is outside of one at both ends is so in between.
    """
    for before, after in zip(was, now, strict=True):
        touched = set(before.boundary.pushes.surface.tolist())
        if not before.boundary.is_limp or before.boundary.bonds or touched != set(after.boundary.pushes.surface.tolist()):
            return False
        others = np.isfinite(stage.extents)
        others[list(touched)] = False
        nodes, radius = np.vstack([before.shape.nodes, after.shape.nodes]), before.boundary.radius
        centres, room = goal.surfaces[others, :3], stage.extents[others] + radius
        away = np.maximum(np.maximum(nodes.min(axis=0) - centres, centres - nodes.max(axis=0)), 0.0)
        if (np.linalg.norm(away, axis=1) < room).any():
            return False
    return True


def _motion(before: Shape, after: Shape) -> np.ndarray:
    """How far at most any point of each segment (n-1,) [m] of the cable as it was has gone."""
    if np.array_equal(before.s, after.s):
        node = np.linalg.norm(after.nodes - before.nodes, axis=1)
        most: np.ndarray = np.maximum(node[1:], node[:-1])
        return most
    # Nodes may move along the cable. Between the nodes of both shapes the way of a point is linear, so its length is largest at one.
    s = np.union1d(before.s, after.s)
    was, now = (np.column_stack([np.interp(s, shape.s, column) for column in shape.nodes.T]) for shape in (before, after))
    far = np.linalg.norm(now - was, axis=1)
    first = np.searchsorted(s, before.s)
    return np.array([far[low : high + 1].max() for low, high in pairwise(first)])
