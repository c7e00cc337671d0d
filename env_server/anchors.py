"""Where the cable was held on the bodies that it rubs on: what the friction of the next step starts from.

The shape server has no memory, so this is the history of friction. After a step has settled it says of every contact that rubs which
point of the cable is held, and where: as before if it sticks, so that it never creeps, and where it has slid to otherwise. These anchors
lie in the frames of the bodies and move and turn with them. A place that was not touched before is held where this point of the
cable was at the end of the last step, as the body has moved since: what it went until it touched counts as sliding, one step at most.

At the very first shape nothing has slid yet, so it is found without friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from protocol.kinds import FRICTION_CODES, RUBS, Feature
from protocol.messages import Contacts, FrictionLaw, FrictionTable, Rubbing, Shape
from protocol.scene import Body

from .poses import inside, outside, turn_inside, turn_outside

NEAR: Final = 0.45  # of a segment; an anchor this near to a place is its own
ALIKE: Final = 0.5  # cosine between the normals of a place and of its anchor


@dataclass(frozen=True)
class Laws:
    """Friction of all surfaces that a cable can touch."""

    code: np.ndarray  # (surfaces,) int, one of `RUBS`, or 0 for none
    law: np.ndarray  # (surfaces,) int, which of `laws`
    laws: tuple[FrictionLaw, ...]


@dataclass(frozen=True)
class Anchors:
    """Points of one cable that were held when the last step had settled, and where all of it was then."""

    surface: np.ndarray  # (a,) int
    s: np.ndarray  # (a,) m, of the point of the cable
    point: np.ndarray  # (a, 3) m, on the axis, in the body's frame
    normal: np.ndarray  # (a, 3) in the body's frame
    past_s: np.ndarray  # (n,) m, of the nodes
    past_nodes: np.ndarray  # (n, 3) m
    past_poses: np.ndarray  # (surfaces, 7)
    time: float  # s


def laws_of(bodies: Sequence[Body], surfaces: int) -> Laws | None:
    """Friction of the bodies, which are the first of so many surfaces; None if none of them rubs."""
    code, law = np.zeros(surfaces, dtype=np.int64), np.zeros(surfaces, dtype=np.int64)
    laws: list[FrictionLaw] = []
    for index, body in enumerate(bodies):
        number = FRICTION_CODES.index(body.friction)
        if number in RUBS:
            code[index], law[index] = number, len(laws)
            laws.append(_law(body))
    return Laws(code, law, tuple(laws)) if laws else None


def rubbing(laws: Laws, anchors: Anchors | None, contacts: Contacts, poses: np.ndarray, time: float, spacing: float) -> Contacts:
    """The contacts with the friction of their bodies, as it goes on from the anchors; as they are without any, at the first shape.

    Args:
        laws: Friction of all surfaces.
        anchors: From the last step.
        contacts: One-sided, and bonds, which stay as they are.
        poses: (surfaces, 7) Now.
        time: [s] Now.
        spacing: [m] Length of a segment.
    """
    if anchors is None or time <= anchors.time:
        return contacts
    rows = np.flatnonzero((laws.code[contacts.body] > 0) & (contacts.friction == 0))
    if not len(rows):
        return contacts
    friction, body = contacts.friction.copy(), contacts.body[rows]
    friction[rows] = laws.code[body]
    s, anchor = contacts.s[rows].copy(), np.empty((len(rows), 3))
    known = _own_anchors(anchors, body, s, contacts.normal[rows], poses, NEAR * spacing)
    then = np.column_stack([np.interp(s, anchors.past_s, column) for column in anchors.past_nodes.T])
    for row, (surface, own) in enumerate(zip(body.tolist(), known.tolist(), strict=True)):
        if own >= 0:
            s[row], anchor[row] = anchors.s[own], outside(poses[surface], anchors.point[own])
        else:
            anchor[row] = _carried(then[row], anchors.past_poses[surface], poses[surface])
    columns = {name: getattr(contacts, name) for name in contacts.__struct_fields__ if name not in ("friction", "rubbing")}
    held = Rubbing(contact=rows, law=laws.law[body], s=s, anchor=anchor, laws=laws.laws, time_step=time - anchors.time)
    return Contacts(**columns, friction=friction, rubbing=held)


def anchored(contacts: Contacts | None, shape: Shape, poses: np.ndarray, time: float) -> Anchors:
    """The anchors that a settled shape leaves: of every contact that pushes."""
    surface, s, points, normals = [], [], [], []
    if contacts is not None and contacts.rubbing is not None and shape.rubbed is not None:
        for row, contact in enumerate(contacts.rubbing.contact.tolist()):
            if shape.contact_forces[contact].any():
                pose = poses[contacts.body[contact]]
                surface.append(int(contacts.body[contact]))
                s.append(float(shape.rubbed.s[row]))
                points.append(inside(pose, shape.rubbed.anchor[row]))
                normals.append(turn_inside(pose, contacts.normal[contact]))
    return Anchors(
        surface=np.array(surface, dtype=np.int64),
        s=np.array(s),
        point=np.array(points).reshape(-1, 3),
        normal=np.array(normals).reshape(-1, 3),
        past_s=shape.s,
        past_nodes=shape.nodes,
        past_poses=poses,
        time=time,
    )


def surface_normals(contacts: Contacts, rows: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Normals (r, 3) of contacts whose force is not along them, from the places (r, 3) [m] of the axis that touch."""
    away = places - contacts.point[rows]
    edge = contacts.feature[rows] == Feature.EDGE
    direction = contacts.direction[rows]
    away[edge] -= (np.einsum("rx,rx->r", away, direction)[:, None] * direction)[edge]
    size = np.linalg.norm(away, axis=1, keepdims=True)
    flat = (contacts.feature[rows] == Feature.FACE) | (size[:, 0] < 1e-9)
    normals: np.ndarray = np.where(flat[:, None], contacts.normal[rows], away / np.maximum(size, 1e-9))
    return normals


def _own_anchors(anchors: Anchors, body: np.ndarray, s: np.ndarray, normal: np.ndarray, poses: np.ndarray, near: float) -> np.ndarray:
    """Which anchor (r,) is that of every place, -1 for none: the nearest on the same surface with a normal like it, each for one place."""
    own = np.full(len(s), -1, dtype=np.int64)
    if not len(anchors.s):
        return own
    turned = np.array([turn_outside(poses[surface], n) for surface, n in zip(anchors.surface.tolist(), anchors.normal, strict=True)])
    away = np.abs(s[:, None] - anchors.s)
    away[(body[:, None] != anchors.surface) | (normal @ turned.T < ALIKE)] = np.inf
    return each_its_own(away, near)


def each_its_own(away: np.ndarray, near: float) -> np.ndarray:
    """Which of some points (r,) is that of every place, -1 for none: the nearest within `near`, each for one place; `away` is (r, a)."""
    own, nearest = np.full(len(away), -1, dtype=np.int64), np.argmin(away, axis=1)
    distance = away[np.arange(len(away)), nearest]
    for row in np.argsort(distance, kind="stable").tolist():
        if distance[row] <= near and not (own == nearest[row]).any():
            own[row] = nearest[row]
    return own


def _carried(point: np.ndarray, before: np.ndarray, now: np.ndarray) -> np.ndarray:
    """A point as the body has moved it; exactly as it is where the body stands still."""
    return point if np.array_equal(before, now) else outside(now, inside(before, point))


def _law(body: Body) -> FrictionLaw:
    """The law of a body, whose numbers `protocol.friction` has checked."""
    table = None
    if body.friction_table:
        points = np.array(body.friction_table)
        table = FrictionTable(speeds=points[:, 0], normals=np.array(body.friction_normals or (1.0,)), forces=points[:, 1:])
    return FrictionLaw(coefficient=body.friction_coefficient or 0.0, speed=body.friction_speed or 0.0, table=table)
