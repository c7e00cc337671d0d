"""Problems posed to the solver under test, and the balance of what it answers."""

from __future__ import annotations

from itertools import pairwise

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

import shape_server.kernels as compiled
from protocol.kinds import FRICTION_CODES, Feature, Friction, Hold
from protocol.messages import Contacts, Grasps, Problem, Shape, Start
from protocol.scene import Cable
from shape_server import solve

G = 9.81  # m/s^2


def cable(*, length: float = 1.0, weight: float = 1.0, bending: float | None = None, twist: float | None = None) -> Cable:
    """A cable of the given weight [N/m]; twist stiffness equals bending stiffness unless given."""
    stiffness = bending if twist is None else twist
    return Cable("cable", length, 1e-3 * length, weight / G, bending, stiffness)


def frame(tangent: np.ndarray | tuple[float, float, float], roll: float = 0.0) -> np.ndarray:
    """(4,) Quaternion of a frame with d3 along `tangent` and d2 as near to y as can be, turned by `roll` [rad] about d3."""
    d3 = np.asarray(tangent, dtype=float) / np.linalg.norm(tangent)
    d1 = np.cross((0.0, 1.0, 0.0), d3)
    d1 /= np.linalg.norm(d1)
    return (Rotation.from_matrix(np.column_stack([d1, np.cross(d3, d1), d3])) * Rotation.from_rotvec([0, 0, roll])).as_quat()


def slope_frames(slope: np.ndarray) -> np.ndarray:
    """(k, 4) Frames in the plane x-z whose tangents rise by `slope` [rad]."""
    return np.array([frame((np.cos(a), 0.0, np.sin(a))) for a in slope])


def grasps(*held: tuple[float, tuple[float, float, float] | np.ndarray, np.ndarray, Hold]) -> Grasps:
    """Grasps from rows of arc length [m], position [m], quaternion and hold."""
    return Grasps(
        s=np.array([row[0] for row in held], dtype=float),
        position=np.array([row[1] for row in held], dtype=float).reshape(-1, 3),
        quaternion=np.array([row[2] for row in held], dtype=float).reshape(-1, 4),
        hold=tuple(row[3] for row in held),
    )


def ask(
    cable: Cable,
    grasps: Grasps,
    *,
    contacts: Contacts | None = None,
    start: Start | None = None,
    tolerance: float = 1e-3,
    extrapolate: bool = False,
) -> Shape:
    """Solve with the compiled kernels under gravity along -z, on one mesh unless `extrapolate`."""
    problem = Problem(cable=cable, grasps=grasps, contacts=contacts, start=start)
    return solve(problem, (0.0, 0.0, -G), tolerance=tolerance, extrapolate=extrapolate, path=compiled)


def start_from(shape: Shape) -> Start:
    """The start that repeats a shape."""
    return Start(s=shape.s, frames=shape.frames, grasp_forces=np.ascontiguousarray(shape.grasp_wrenches[:, :3]))


def on_nodes(shape: Shape, weight: np.ndarray, grasps: Grasps) -> np.ndarray:
    """The weights (n-1,) [N] of all segments as weights (n,) [N] of nodes: half and half, or by Simpson's rule over pairs of segments.

    Simpson's where two meshes are combined, whose nodes lie on a curve and not along the frames, and for the gradient cable, whose nodes
    lie on one too (decision 0016); each piece between clamps for itself.
    """
    out = np.zeros(len(shape.s))
    tangents = Rotation.from_quat(shape.frames).apply([0.0, 0.0, 1.0])
    aside = np.linalg.norm(np.cross(np.diff(shape.nodes, axis=0), tangents), axis=1)
    clamps = [int(np.argmin(np.abs(shape.s - s))) for s, hold in zip(grasps.s, grasps.hold, strict=True) if hold is Hold.CLAMP]
    for first, last in pairwise(np.unique([0, *clamps, len(out) - 1]).tolist()):
        own, part = weight[first:last], out[first : last + 1]
        if shape.model != "gradient" and np.median(aside[first:last]) < 1e-13 * shape.s[-1]:  # beside a clamp the pieces meet to 1e-12 m
            part += 0.5 * (np.append(own, 0.0) + np.append(0.0, own))
        else:
            pair = own[::2] + own[1::2]
            part[::2] += (np.append(pair, 0.0) + np.append(0.0, pair)) / 6
            part[1::2] += 2 / 3 * pair
    return out


def unbalance(cable: Cable, shape: Shape, grasps: Grasps, points: np.ndarray | None = None) -> tuple[float, float]:
    """Sum of all forces, and of their moments about the origin, on the whole cable; over its weight, and weight times length.

    The weight acts as `on_nodes` says, a grasp at its node, a contact with its moment on the axis at its arc length, or its force alone
    at the `points` of the bodies, (m, 3) [m]: without friction its line passes through the edge, and the axis is a polygon.
    """
    weight = on_nodes(shape, cable.mass_per_length * G * np.diff(shape.s), grasps)[:, None] * np.array([0.0, 0.0, -1.0])
    held, axis = (np.column_stack([np.interp(s, shape.s, row) for row in shape.nodes.T]) for s in (grasps.s, shape.contact_s))
    touch, touch_moments = (axis, shape.contact_moments) if points is None else (points, np.zeros((0, 3)))
    force = shape.grasp_wrenches[:, :3].sum(0) + shape.contact_forces.sum(0) + weight.sum(0)
    moment = (
        shape.grasp_wrenches[:, 3:].sum(0)
        + np.cross(held, shape.grasp_wrenches[:, :3]).sum(0)
        + np.cross(touch, shape.contact_forces).sum(0)
        + touch_moments.sum(0)
        + np.cross(shape.nodes, weight).sum(0)
    )
    total = cable.mass_per_length * G * cable.length
    return float(np.linalg.norm(force) / total), float(np.linalg.norm(moment) / total / cable.length)


def touches(
    *rows: tuple[float, Feature, np.ndarray | tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]],
    distance: float,
    friction: Friction = Friction.NONE,
) -> Contacts:
    """Contacts from rows of arc length [m], feature, its point [m], normal, and direction of the edge, 1 m to either side."""
    count = len(rows)
    return Contacts(
        s=np.array([row[0] for row in rows], dtype=float),
        body=np.zeros(count, dtype=np.int64),
        feature=np.array([row[1] for row in rows], dtype=np.int64),
        point=np.array([row[2] for row in rows], dtype=float).reshape(-1, 3),
        normal=np.array([row[3] for row in rows], dtype=float).reshape(-1, 3),
        direction=np.array([row[4] for row in rows], dtype=float).reshape(-1, 3),
        extent=np.array([(-1.0, 1.0) if row[1] is Feature.EDGE else (0.0, 0.0) for row in rows]),
        distance=np.full(count, distance),
        friction=np.full(count, FRICTION_CODES.index(friction), dtype=np.int64),
        force=np.zeros((count, 3)),
    )


def around(nodes: np.ndarray, s: np.ndarray, axis: np.ndarray, before: Shape | None, distance: float, reach: float = 0.006) -> Contacts:
    """A cylinder along y about `axis`, as an edge near every segment within reach; forces from the contacts of the last shape near by."""
    middle, at = 0.5 * (nodes[1:] + nodes[:-1]) - axis, 0.5 * (s[1:] + s[:-1])
    away = np.hypot(middle[:, 0], middle[:, 2])
    near = np.flatnonzero(away < distance + reach)
    near = near if len(near) else np.array([np.argmin(away)])
    rows = [(float(at[k]), Feature.EDGE, tuple(axis), tuple(middle[k] / away[k]), (0.0, 1.0, 0.0)) for k in near]
    contacts = touches(*rows, distance=distance)
    if before is None:
        return contacts
    force = np.zeros((len(near), 3))
    for place, push in zip(before.contact_s, before.contact_forces, strict=True):
        force[np.argmin(np.abs(at[near] - place))] += push
    return msgspec.structs.replace(contacts, force=force)
