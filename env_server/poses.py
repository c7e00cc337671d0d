"""Points and directions between the world and the frame of a body; a pose is (x, y, z, qx, qy, qz, qw)."""

from __future__ import annotations

import math

import numpy as np

from protocol.scene import Body


def body_pose(body: Body) -> np.ndarray:
    """Pose (7,) of a body at the start."""
    return np.array([*body.position, *np.array(body.quaternion) / math.hypot(*body.quaternion)])


def outside(pose: np.ndarray, point: np.ndarray) -> np.ndarray:
    """World coordinates (3,) of a point of the body."""
    moved: np.ndarray = pose[:3] + turn_outside(pose, point)
    return moved


def inside(pose: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Body coordinates (3,) of a point of the world."""
    return turn_inside(pose, point - pose[:3])


def turn_outside(pose: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """World direction (3,) of a direction of the body."""
    return _turned(pose[3:6], pose[6], vector)


def turn_inside(pose: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Body direction (3,) of a direction of the world."""
    return _turned(-pose[3:6], pose[6], vector)


def moves(before: np.ndarray, after: np.ndarray, extent: np.ndarray) -> np.ndarray:
    """How far at most any point of each body moved (b,) [m], from poses (b, 7) and extents (b,) about their origins."""
    shift = np.linalg.norm(after[:, :3] - before[:, :3], axis=1)
    first, last = before[:, 3:], after[:, 3:]
    chord = np.minimum(np.linalg.norm(last - first, axis=1), np.linalg.norm(last + first, axis=1))
    # From the chord between unit quaternions: exactly zero for equal ones, which an arc cosine is not.
    angle = 4.0 * np.arcsin(np.minimum(0.5 * chord, 1.0))
    far: np.ndarray = shift + np.multiply(angle, extent, out=np.zeros(len(angle)), where=angle > 0.0)  # a plane has no end
    return far


def _turned(axis: np.ndarray, scalar: float, vector: np.ndarray) -> np.ndarray:
    # Plain floats: for one vector they are ten times faster than arrays.
    x, y, z = axis.tolist()
    u, v, w = vector.tolist()
    scalar = float(scalar)
    a, b, c = y * w - z * v + scalar * u, z * u - x * w + scalar * v, x * v - y * u + scalar * w
    return np.array([u + 2.0 * (y * c - z * b), v + 2.0 * (z * a - x * c), w + 2.0 * (x * b - y * a)])
