"""Frames of a cable as quaternions (x, y, z, w), made from tangents; the third director is the tangent."""

from __future__ import annotations

import math

from protocol.scene import Quaternion, Vector


def upright(tangent: Vector) -> Quaternion:
    """The frame whose first director is as far up as it can be, or along x where the tangent is vertical."""
    tangent = unit(tangent)
    frame = between((0.0, 0.0, 1.0), tangent, (1.0, 0.0, 0.0))
    up = (0.0, 0.0, 1.0) if abs(tangent[2]) < 1.0 - 1e-9 else (1.0, 0.0, 0.0)
    first, second = turn(frame, (1.0, 0.0, 0.0)), turn(frame, (0.0, 1.0, 0.0))
    return multiply(about(tangent, math.atan2(dot(up, second), dot(up, first))), frame)


def carried(frame: Quaternion, tangent: Vector, chord: Vector) -> Quaternion:
    """A frame turned by the smallest rotation that takes its tangent to another one.

    Where the two tangents are opposite, the turn is in the plane of tangent and chord.
    """
    old, second = turn(frame, (0.0, 0.0, 1.0)), turn(frame, (0.0, 1.0, 0.0))
    normal = cross(old, chord)
    return multiply(between(old, unit(tangent), normal if math.hypot(*normal) > 1e-9 else second), frame)


def about(axis: Vector, angle: float) -> Quaternion:
    """Rotation by an angle [rad] about an axis of length 1."""
    x, y, z = (math.sin(0.5 * angle) * part for part in axis)
    return (x, y, z, math.cos(0.5 * angle))


def between(old: Vector, new: Vector, spare: Vector) -> Quaternion:
    """The smallest rotation from one unit vector to another, about `spare` where they are opposite."""
    axis = cross(old, new)
    sine, cosine = math.hypot(*axis), dot(old, new)
    if sine > 1e-9:
        return about(unit(axis), math.atan2(sine, cosine))
    return (0.0, 0.0, 0.0, 1.0) if cosine > 0 else about(unit(spare), math.pi)


def multiply(second: Quaternion, first: Quaternion) -> Quaternion:
    """The rotation `first`, then `second`; of length 1."""
    (a, b, c, d), (x, y, z, w) = second, first
    product = (d * x + a * w + b * z - c * y, d * y - a * z + b * w + c * x, d * z + a * y - b * x + c * w, d * w - a * x - b * y - c * z)
    return normal(product)


def normal(quaternion: Quaternion) -> Quaternion:
    """The quaternion with length 1."""
    size = math.hypot(*quaternion)
    x, y, z, w = (part / size for part in quaternion)
    return (x, y, z, w)


def turn(quaternion: Quaternion, vector: Vector) -> Vector:
    """A vector turned by a rotation, v + 2 u x (u x v + w v) with u the vector part."""
    u, w = quaternion[:3], quaternion[3]
    x, y, z = cross(u, vector)
    inner = (x + w * vector[0], y + w * vector[1], z + w * vector[2])
    a, b, c = cross(u, inner)
    return (vector[0] + 2 * a, vector[1] + 2 * b, vector[2] + 2 * c)


def unit(vector: Vector) -> Vector:
    """The vector with length 1."""
    size = math.hypot(*vector)
    return (vector[0] / size, vector[1] / size, vector[2] / size)


def cross(a: Vector, b: Vector) -> Vector:
    """The cross product a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def dot(a: Vector, b: Vector) -> float:
    """The dot product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
