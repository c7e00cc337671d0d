"""Exact bodies as triangles: for pictures, and for collisions of the robot with them; cables touch the exact shape.

The triangles lie within twice R (1 - cos(pi / SECTIONS)), 0.43 % of the radius, inside the surface. A plane is drawn as a square about its
position, and what has no thickness as a thin thing that can be seen.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from protocol.kinds import Primitive
from protocol.scene import Body

SECTIONS: Final = 48  # around the axis
SEEN: Final = 0.002  # m, radius at which points and lines are drawn
SQUARE: Final = 2.0  # m, half the side of a drawn plane


def tessellated(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (v, 3) [m], in the body's frame, and triangles (t, 3) of an exact body."""
    if body.shape is Primitive.PLANE:
        corners = SQUARE * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
        return corners, np.array([[0, 1, 2], [0, 2, 3]])
    radius, half = body.radius or SEEN, 0.5 * (body.length or 0.0)
    if body.shape is Primitive.CYLINDER:
        return _turned_about_z(np.array([[0.0, -half], [radius, -half], [radius, half], [0.0, half]]))
    angles = np.linspace(0.0, 0.5 * np.pi, SECTIONS // 4 + 1)
    upper = np.stack([radius * np.cos(angles), half + radius * np.sin(angles)], axis=1)
    upper[-1, 0] = 0.0
    return _turned_about_z(np.vstack([upper[::-1] * [1.0, -1.0], upper]) + 0.0)  # no -0, which is another vertex than 0


def _turned_about_z(profile: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The surface that a profile (p, 2) of distance from the axis and height [m] sweeps; its ends lie on the axis."""
    around = 2.0 * np.pi * np.arange(SECTIONS) / SECTIONS
    ring = np.stack([np.cos(around), np.sin(around)], axis=1)
    vertices = np.concatenate([np.column_stack([r * ring, np.full(SECTIONS, z)]) for r, z in profile])
    here = np.arange(SECTIONS)
    there = (here + 1) % SECTIONS
    triangles = []
    for level in range(len(profile) - 1):
        low, high = level * SECTIONS, (level + 1) * SECTIONS
        if level > 0:
            triangles.append(np.stack([low + here, low + there, high + there], axis=1))
        if level < len(profile) - 2:
            triangles.append(np.stack([low + here, high + there, high + here], axis=1))
    return vertices, np.concatenate(triangles)
