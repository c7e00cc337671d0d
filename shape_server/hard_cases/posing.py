"""Problems posed by their numbers: a cable, what holds it, what it touches, and the shape that it starts from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from protocol.kinds import FRICTION_CODES, Feature, Friction, Hold
from protocol.messages import Contacts, FrictionLaw, Grasps, Problem, Rubbing, Shape, Start
from protocol.scene import Cable, Vector

GRAVITY: Final[Vector] = (0.0, 0.0, -9.81)
WEIGHTLESS: Final[Vector] = (0.0, 0.0, 0.0)
RADIUS: Final = 0.0045  # m, distance between axis and feature in the contacts made here


def cable(*, length: float = 1.0, bending: float | None = 1e-2, twist: float | None = None, mass: float = 0.1) -> Cable:
    """A cable whose twist stiffness is 0.8 of its bending stiffness unless given."""
    if twist is None and bending is not None:
        twist = 0.8 * bending
    return Cable(name="cable", length=length, diameter=2 * RADIUS, mass_per_length=mass, bending=bending, twist=twist)


def frame(tangent: object, first: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> np.ndarray:
    """(4,) Quaternion with d3 along `tangent` and d1 as near to `first` as can be."""
    d3 = np.asarray(tangent, dtype=float) / np.linalg.norm(np.asarray(tangent, dtype=float))
    for guess in (first, (1.0, 0.0, 0.0)):
        d1 = np.asarray(guess) - (np.asarray(guess) @ d3) * d3
        if np.linalg.norm(d1) > 1e-6:
            break
    d1 /= np.linalg.norm(d1)
    return np.asarray(Rotation.from_matrix(np.column_stack([d1, np.cross(d3, d1), d3])).as_quat())


ALONG_X: Final = frame((1.0, 0.0, 0.0))
UP: Final = frame((0.0, 0.0, 1.0))
DOWN: Final = frame((0.0, 0.0, -1.0))


def grasps(*held: tuple[float, object, np.ndarray], hold: Hold = Hold.CLAMP) -> Grasps:
    """Grasps from (arc length [m], position [m], frame), all of one kind; guides after a first clamp."""
    return Grasps(
        s=np.array([row[0] for row in held], dtype=float),
        position=np.array([row[1] for row in held], dtype=float).reshape(-1, 3),
        quaternion=np.array([row[2] for row in held], dtype=float).reshape(-1, 4),
        hold=tuple(Hold.CLAMP if hold is Hold.GUIDE and k == 0 else hold for k in range(len(held))),
    )


def span(chord: float = 0.6, length: float = 1.0, *, hold: Hold = Hold.CLAMP) -> Grasps:
    """Both ends held at the same height, tangents along x."""
    return grasps((0.0, (0.0, 0.0, 0.0), ALONG_X), (length, (chord, 0.0, 0.0), ALONG_X), hold=hold)


@dataclass(frozen=True)
class Row:
    """One row of `Contacts`."""

    s: float
    point: object
    normal: object = (0.0, 0.0, 1.0)
    direction: object = (0.0, 0.0, 0.0)
    feature: Feature = Feature.FACE
    extent: tuple[float, float] = (-1.0, 1.0)  # m, of an edge on both sides of `point`
    distance: float = RADIUS
    friction: Friction = Friction.NONE
    force: object = (0.0, 0.0, 0.0)


def contacts(*rows: Row) -> Contacts:
    """The rows as a message."""
    return Contacts(
        s=np.array([row.s for row in rows], dtype=float),
        body=np.zeros(len(rows), dtype=np.int64),
        feature=np.array([int(row.feature) for row in rows], dtype=np.int64),
        point=np.array([row.point for row in rows], dtype=float).reshape(-1, 3),
        normal=np.array([row.normal for row in rows], dtype=float).reshape(-1, 3),
        direction=np.array([row.direction for row in rows], dtype=float).reshape(-1, 3),
        extent=np.array([row.extent if row.feature is Feature.EDGE else (0.0, 0.0) for row in rows], dtype=float).reshape(-1, 2),
        distance=np.array([row.distance for row in rows], dtype=float),
        friction=np.array([FRICTION_CODES.index(row.friction) for row in rows], dtype=np.int64),
        force=np.array([row.force for row in rows], dtype=float).reshape(-1, 3),
    )


def rubbing(rows: Contacts, kind: Friction, law: FrictionLaw, anchor: np.ndarray, time_step: float = 0.1) -> Contacts:
    """The rows with friction, every one of which was held at its `anchor` (m, 3) [m], a point of the axis, a `time_step` [s] ago."""
    columns = {name: getattr(rows, name) for name in rows.__struct_fields__ if name not in ("friction", "rubbing")}
    count = len(rows.s)
    held = Rubbing(contact=np.arange(count), law=np.zeros(count, dtype=np.int64), s=rows.s, anchor=anchor, laws=(law,), time_step=time_step)
    return Contacts(**columns, friction=np.full(count, FRICTION_CODES.index(kind)), rubbing=held)


def start_from(shape: Shape) -> Start:
    """The start that repeats a shape."""
    return Start(s=shape.s, frames=shape.frames, grasp_forces=np.ascontiguousarray(shape.grasp_wrenches[:, :3]))


def going_on(problem: Problem, shape: Shape) -> Problem:
    """A problem that starts from a shape."""
    return msgspec.structs.replace(problem, start=start_from(shape))


def straight(quaternion: np.ndarray, segments: int, forces: object, length: float = 1.0) -> Start:
    """Start as a straight cable with one frame, held by `forces`, (g, 3) [N]."""
    s = np.linspace(0.0, length, segments + 1)
    return Start(s=s, frames=np.tile(quaternion, (segments, 1)), grasp_forces=np.array(forces, dtype=float).reshape(-1, 3))


def place(shape: Shape, s: float | np.ndarray) -> np.ndarray:
    """(..., 3) [m] Position at arc length s, between nodes on the polygon."""
    return np.stack([np.interp(s, shape.s, row) for row in shape.nodes.T], axis=-1)


def apart(one: Shape, other: Shape) -> float:
    """[m] Largest distance of the nodes of one shape from the places of the other at their arc lengths."""
    return float(np.linalg.norm(one.nodes - place(other, one.s), axis=1).max())
