"""A shape to start from when there is none: a smooth curve of the right length through the held points."""

from __future__ import annotations

import math
from types import ModuleType
from typing import Final

import numpy as np

from protocol.kinds import Hold
from protocol.messages import Grasps, Problem

from .mesh import Mesh

PULL: Final = 0.6  # of the cable's length: how far a start curve goes along its clamps
"""With 0.1, 0.3, 0.6 and 1 the descent ended at the lowest shape found in 184, 188, 188 and 170 of 196 problems, plane and random."""


def curve_frames(mesh: Mesh, problem: Problem, gravity: np.ndarray, path: ModuleType, pull: float = PULL) -> np.ndarray:
    """Frames (n-1, 4) of a curve through all held points with the right length between them.

    Between two held points a curve with its end tangents along the clamps that hangs down as far as its length asks; from a
    free end to the first held point a straight line. The frames turn with the curve (rotation-minimising), and the roll
    that the clamps ask for is spread evenly, with the whole turns that the problem asks for beyond that.
    """
    return _rolled(mesh, problem, curve_tangents(mesh, problem, gravity, path, pull), path)


def curve_tangents(mesh: Mesh, problem: Problem, gravity: np.ndarray, path: ModuleType, pull: float = PULL) -> np.ndarray:
    """Tangents (n-1, 3) of the same curve."""
    grasps = problem.grasps
    directions = tangents_at(grasps, gravity)
    tangents = np.empty((len(mesh.lengths), 3))
    nodes = mesh.grasp_nodes
    tangents[: nodes[0]] = directions[0]
    tangents[nodes[-1] :] = directions[-1]
    for k in range(len(nodes) - 1):
        first, last = nodes[k], nodes[k + 1]
        fractions = (mesh.s[first : last + 1] - mesh.s[first]) / (mesh.s[last] - mesh.s[first])
        ends = np.array(grasps.position[k : k + 2])
        span = float(mesh.s[last] - mesh.s[first])
        down = _downwards(gravity, ends[1] - ends[0])
        tangents[first:last] = path.sagging_tangents(ends[0], ends[1], directions[k], directions[k + 1], down, span, pull * span, fractions)
    return tangents


def _downwards(gravity: np.ndarray, chord: np.ndarray) -> np.ndarray:
    """Unit direction to hang in: along gravity; square to the chord where there is none, or gravity is along the chord."""
    (u, v, w), (x, y, z) = gravity.tolist(), chord.tolist()
    size, length = math.hypot(u, v, w), max(math.hypot(x, y, z), 1e-300)
    if size > 0.0 and math.hypot(v * z - w * y, w * x - u * z, u * y - v * x) > 1e-3 * size * length:
        return gravity / size
    along = chord / length
    aside = np.eye(3)[int(np.argmin(np.abs(along)))]
    out = aside - (aside @ along) * along
    return np.asarray(out / np.linalg.norm(out))


def tangents_at(grasps: Grasps, gravity: np.ndarray) -> np.ndarray:
    """Tangent at every held point (g, 3): that of a clamp; at a hinge towards the next held point, sagging with gravity."""
    count = len(grasps.s)
    out = np.array([tangent_of(quaternion) for quaternion in grasps.quaternion])
    down = gravity / max(float(np.linalg.norm(gravity)), 1e-300)
    for k in range(count):
        if grasps.hold[k] is Hold.HINGE:
            low, high = max(k - 1, 0), min(k + 1, count - 1)
            chord = grasps.position[high] - grasps.position[low]
            sag = down * (1.0 if k == 0 else -1.0 if k == count - 1 else 0.0)
            size = math.hypot(*chord.tolist())
            out[k] = chord / size + 0.5 * sag if size > 1e-12 else (sag if sag.any() else out[k])
            out[k] /= max(math.hypot(*out[k].tolist()), 1e-300)
    return out


def _rolled(mesh: Mesh, problem: Problem, tangents: np.ndarray, path: ModuleType) -> np.ndarray:
    """Frames along the tangents, without twist from the first clamp on, then turned to meet the other clamps."""
    grasps, turns = problem.grasps, problem.turns
    clamps = [k for k in range(len(grasps.s)) if grasps.hold[k] is not Hold.HINGE]
    anchor = clamps[0] if clamps else 0
    quaternions: np.ndarray = path.frames_along(tangents, np.array(grasps.quaternion[anchor]), int(mesh.grasp_nodes[anchor]))
    rolls = [0.0]
    for place, k in enumerate(clamps[1:]):
        clamp = grasps.quaternion[k]
        reached = path.turn_onto(quaternions[int(mesh.grasp_nodes[k]) - 1], tangent_of(clamp))
        missing = _roll(reached, clamp)
        # The roll nearest to that of the clamp before: no turns that nobody asked for.
        least = float((missing - rolls[-1] + np.pi) % (2 * np.pi) - np.pi)
        rolls.append(rolls[-1] + least + (2 * np.pi * turns[place] if turns else 0.0))
    if len(rolls) > 1:
        extra = np.interp(0.5 * (mesh.s[:-1] + mesh.s[1:]), grasps.s[clamps], rolls)
        quaternions = path.retract(quaternions, np.outer(extra, [0.0, 0.0, 1.0]))
    return quaternions


def tangent_of(quaternion: np.ndarray) -> np.ndarray:
    """Third director (3,) of a frame (4,)."""
    x, y, z, w = quaternion.tolist()
    return np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])


def _roll(first: np.ndarray, second: np.ndarray) -> float:
    """Turn [rad] about their common tangent from one frame to another, at most half a turn."""
    x, y, z, w = first.tolist()
    along = w * second[2] - x * second[1] + y * second[0] - z * second[3]
    straight = float(first @ second)
    return 2.0 * math.atan2(math.copysign(1.0, straight) * along, abs(straight))
