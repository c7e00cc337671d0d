"""Where a cable without bending first touches a bonding body, within a step: there it is bonded (F_inf).

Such a cable is not asked about with one-sided rows on bonding bodies: it would slide over them until the step has settled, past a point
altogether, and be bonded, if at all, where it never touched. Instead it is solved as if the body were not there. If it comes out
within the body, its nodes x and the body's pose p are followed from the last shape to this one,

    x(t) = (1 - t) x_was + t x_now   [m],   p(t) likewise,   0 <= t <= 1,

to the first t at which they touch, by bisection; the place of the cable that touches there is bonded to the place of the body, and the
step is asked about again. What is neglected is how the true way between two shapes bends, second order in the step; the steps are cut
so short that nothing moves further than its distance to the nearest body. `turned` keeps the normal of a bond between both pieces.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from protocol.messages import Grasps

from .boundary import Bond, at_place
from .hanging import Hanging, unsettled
from .piece_hits import FACE
from .poses import inside, turn_inside
from .stage import Posture
from .touch import Candidates

PARTS: Final = 16  # of the way between two shapes, looked at in turn
HALVINGS: Final = 36  # of the part in which it touches
STARTS_WITHIN: Final = (
    "the cable hangs within a body with friction 'bond' at the start; where such a cable is bonded is a matter of how it came there: "
    "start it beside the body and move one to the other"
)

Look = Callable[[int, np.ndarray, np.ndarray], Candidates]  # places of a cable by its number, nodes (n, 3) and poses (b, 7)


def with_first_touches(
    was: Sequence[Hanging], now: Sequence[Hanging], grasps: Sequence[Grasps], way: tuple[Posture, Posture], look: Look
) -> list[Hanging] | None:
    """The cables with a bond for each that first touches a bonding body on the way; None if none does.

    Args:
        was: Cables that touch no bonding body but at their bonds.
        now: As they would hang at the end of the way.
        grasps: At the end of the way.
        way: Postures at `was` and now.
        look: For places that touch.
    """
    at, goal = way[0].surfaces, way[1].surfaces
    touched, any_touched = [], False
    for index, (before, after, held) in enumerate(zip(was, now, grasps, strict=True)):
        boundary = after.boundary
        if boundary.is_limp and boundary.missed(after.bodies, after.shape.s).any():
            any_touched = True
            bond = _first(index, before, after, at, goal, look)
            boundary = replace(boundary, bonds=(*boundary.bonds, bond)).drawn_through(held, goal)
        touched.append(replace(after, boundary=boundary))
    return touched if any_touched else None


def sides(was: Hanging) -> Candidates:
    """The places near a cable from which the next search takes on which side of a body it is.

    Of a cable without bending these are the bends where it slides, each with the direction of its push: beside a sharp bend the sides of
    the two pieces differ. A body that it is bonded to it cannot pass.
    """
    near, boundary, s = was.bodies, was.boundary, was.shape.s
    if not boundary.is_limp or not len(near.body):
        return near
    kept, normal, place = ~boundary.bonding[near.body], near.normal.copy(), at_place(near, s)
    pushes, spacing = boundary.pushes, float(np.diff(s).max())
    for row in np.flatnonzero(~pushes.is_bond):
        own, here = near.body == pushes.surface[row], np.abs(place - pushes.s[row]) < spacing
        normal[own & here] = pushes.normal[row]
        kept &= ~own | here
    columns = {name: getattr(near, name)[kept] for name in Candidates._fields if name not in ("clearance", "normal")}
    return Candidates(**columns, normal=normal[kept], clearance=near.clearance)


def within(cables: tuple[Hanging, ...]) -> tuple[Hanging, ...]:
    """The cables of a start, without a shape for those that hang within a bonding body."""
    return tuple(
        unsettled((cable,), STARTS_WITHIN)[0]
        if cable.boundary.is_limp and cable.boundary.missed(cable.bodies, cable.shape.s).any()
        else cable
        for cable in cables
    )


def _first(index: int, before: Hanging, after: Hanging, at: np.ndarray, goal: np.ndarray, look: Look) -> Bond:
    """The bond that is made on the way from one shape to the next."""
    s, boundary = after.shape.s, after.boundary
    start = np.column_stack([np.interp(s, before.shape.s, column) for column in before.shape.nodes.T])

    def found(share: float) -> tuple[Candidates, np.ndarray]:
        near = look(index, (1.0 - share) * start + share * after.shape.nodes, _between(at, goal, share))
        return near, boundary.missed(near, s, depth=0.0)

    touching, missed, high = after.bodies, boundary.missed(after.bodies, s), 1.0
    lost = [bond.surface for bond in before.boundary.bonds if bond.s not in [kept.s for kept in boundary.bonds]]
    # A bond that would have pulled holds no more: the cable slides over that body to where it would hang without, and is bonded there.
    if not np.isin(touching.body[missed], lost).any():
        # One part of the way after the other: a thin body may be on the far side already at the end of it.
        shares = np.linspace(0.0, 1.0, PARTS + 1)
        last = next((part for part in range(PARTS) if found(shares[part])[1].any()), PARTS)
        low, high = shares[max(last - 1, 0)], shares[last]
        for _ in range(HALVINGS if last else 0):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if found(middle)[1].any() else (middle, high)
        touching, missed = found(high) if high < 1.0 else (touching, missed)
    row = int(np.argmin(np.where(missed, np.abs(touching.gap + boundary.radius), np.inf)))
    surface, normal = int(touching.body[row]), touching.normal[row]
    pose = _between(at, goal, high)[surface]
    return Bond(
        surface=surface,
        s=float(at_place(touching, s)[row]),
        point=inside(pose, touching.point[row] + touching.thickness[row] * normal),
        normal=turn_inside(pose, normal),
        force=np.zeros(3),
        is_sharp=bool(touching.thickness[row] == 0.0 and touching.feature[row] != FACE),
    )


def _between(at: np.ndarray, goal: np.ndarray, share: float) -> np.ndarray:
    """Poses (b, 7) a share of the way from one set to another."""
    sign = np.where(np.einsum("ij,ij->i", at[:, 3:], goal[:, 3:]) < 0.0, -1.0, 1.0)
    poses = (1.0 - share) * at + share * np.hstack([goal[:, :3], sign[:, None] * goal[:, 3:]])
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    return poses
