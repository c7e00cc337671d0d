"""A shape to start from when there is none: a smooth curve of the right length through the held points."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from protocol.kinds import Hold
from protocol.messages import Grasps

from .mesh import Mesh


def curve_frames(mesh: Mesh, grasps: Grasps, gravity: np.ndarray) -> np.ndarray:
    """Frames (n-1, 4) of a curve through all held points with the right length between them.

    Between two held points a cubic Hermite curve, its end tangents along the clamps and as long as the cable needs; from a
    free end to the first held point a straight line. The frames turn with the curve (rotation-minimising), and the roll
    that the clamps ask for is spread evenly.
    """
    directions = _directions(grasps, gravity)
    tangents = np.empty((len(mesh.lengths), 3))
    nodes = mesh.grasp_nodes
    tangents[: nodes[0]] = directions[0]
    tangents[nodes[-1] :] = directions[-1]
    for k in range(len(nodes) - 1):
        first, last = nodes[k], nodes[k + 1]
        fractions = (mesh.s[first : last + 1] - mesh.s[first]) / (mesh.s[last] - mesh.s[first])
        points = _hermite(
            grasps.position[k], grasps.position[k + 1], directions[k], directions[k + 1], mesh.s[last] - mesh.s[first], fractions
        )
        chords = np.diff(points, axis=0)
        tangents[first:last] = chords / np.maximum(np.linalg.norm(chords, axis=1), 1e-300)[:, None]
    return _roll(mesh, grasps, tangents)


def _directions(grasps: Grasps, gravity: np.ndarray) -> np.ndarray:
    """Tangent at every held point: that of a clamp; at a hinge towards the next held point, sagging with gravity."""
    count = len(grasps.s)
    out = Rotation.from_quat(grasps.quaternion).apply([0.0, 0.0, 1.0])
    down = gravity / max(float(np.linalg.norm(gravity)), 1e-300)
    for k in range(count):
        if grasps.hold[k] is Hold.HINGE:
            low, high = max(k - 1, 0), min(k + 1, count - 1)
            chord = grasps.position[high] - grasps.position[low]
            sag = down * (1.0 if k == 0 else -1.0 if k == count - 1 else 0.0)
            size = float(np.linalg.norm(chord))
            out[k] = chord / size + 0.5 * sag if size > 1e-12 else (sag if sag.any() else out[k])
            out[k] /= max(float(np.linalg.norm(out[k])), 1e-300)
    return out


def _hermite(start: np.ndarray, end: np.ndarray, first: np.ndarray, last: np.ndarray, length: float, fractions: np.ndarray) -> np.ndarray:
    """Points (m, 3) at equal shares of the arc of a cubic Hermite curve that is `length` long."""
    u = np.linspace(0.0, 1.0, 401)[:, None]
    h00, h01 = 2 * u**3 - 3 * u**2 + 1, 3 * u**2 - 2 * u**3
    h10, h11 = u**3 - 2 * u**2 + u, u**3 - u**2

    def curve(pull: float) -> np.ndarray:
        points: np.ndarray = h00 * start + h01 * end + pull * (h10 * first + h11 * last)
        return points

    def excess(pull: float) -> float:
        return float(np.linalg.norm(np.diff(curve(pull), axis=0), axis=1).sum()) - length

    pulls = length * np.linspace(0.0, 12.0, 121)
    values = [excess(pull) for pull in pulls]
    crossing = next((i for i in range(120) if values[i] <= 0.0 < values[i + 1]), None)
    pull = brentq(excess, pulls[crossing], pulls[crossing + 1]) if crossing is not None else pulls[int(np.argmin(np.abs(values)))]
    points = curve(float(pull))
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return np.column_stack([np.interp(fractions * arc[-1], arc, points[:, k]) for k in range(3)])


def _roll(mesh: Mesh, grasps: Grasps, tangents: np.ndarray) -> np.ndarray:
    """Frames along the tangents, without twist from the first clamp on, then turned to meet the other clamps."""
    clamps = [k for k in range(len(grasps.s)) if grasps.hold[k] is Hold.CLAMP]
    anchor = clamps[0] if clamps else 0
    quaternions = frames_along(tangents, Rotation.from_quat(grasps.quaternion[anchor]), int(mesh.grasp_nodes[anchor]))
    middles = 0.5 * (mesh.s[:-1] + mesh.s[1:])
    rolls = [0.0]
    for k in clamps[1:]:
        at = int(mesh.grasp_nodes[k]) - 1
        clamp = Rotation.from_quat(grasps.quaternion[k])
        reached = _turn_onto(quaternions[at], tangents[at], clamp.apply([0.0, 0.0, 1.0]))
        missing = (Rotation.from_quat(reached).inv() * clamp).as_rotvec()[2]
        # The roll nearest to that of the clamp before: no turns that nobody asked for.
        rolls.append(rolls[-1] + float((missing - rolls[-1] + np.pi) % (2 * np.pi) - np.pi))
    if len(rolls) > 1:
        extra = np.interp(middles, grasps.s[clamps], rolls)
        spin = Rotation.from_rotvec(np.outer(extra, [0.0, 0.0, 1.0]))
        quaternions = (Rotation.from_quat(quaternions) * spin).as_quat()
    return quaternions


def frames_along(tangents: np.ndarray, seed: Rotation, node: int) -> np.ndarray:
    """Frames (n-1, 4) along unit tangents (n-1, 3) without twist, starting from the frame `seed` at a node."""
    quaternions = np.empty((len(tangents), 4))
    for segments in (range(node, len(tangents)), range(node - 1, -1, -1)):
        frame = seed.as_quat()
        axis = seed.apply([0.0, 0.0, 1.0])
        for j in segments:
            quaternions[j] = frame = _turn_onto(frame, axis, tangents[j])
            axis = tangents[j]
    return quaternions


def _turn_onto(frame: np.ndarray, axis: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """The frame (4,) with third director `axis`, turned by the shortest rotation that brings that onto `tangent`."""
    a0, a1, a2 = axis
    t0, t1, t2 = tangent
    w = 1.0 + a0 * t0 + a1 * t1 + a2 * t2
    x, y, z = a1 * t2 - a2 * t1, a2 * t0 - a0 * t2, a0 * t1 - a1 * t0
    if w < 1e-12:  # straight back: half a turn about the frame's own first director
        x, y, z = Rotation.from_quat(frame).apply([1.0, 0.0, 0.0])
        w = 0.0
    fx, fy, fz, fw = frame
    turned = np.array(
        [
            w * fx + x * fw + y * fz - z * fy,
            w * fy - x * fz + y * fw + z * fx,
            w * fz + x * fy - y * fx + z * fw,
            w * fw - x * fx - y * fy - z * fz,
        ]
    )
    turned /= np.linalg.norm(turned)
    return turned
