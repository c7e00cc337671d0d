"""Surfaces of a robot's links in link coordinates: what is drawn of them, and what a cable can touch.

Drawn are the visual shapes, thinned out; touched are the convex hulls of the collision shapes, as PyBullet has them.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np

from protocol.errors import SceneError

from .meshes import clean, read_mesh, thin_out
from .urdf import Shape

SPACING: Final = 0.003  # m, between vertices that are drawn; 3 mm gives 142k triangles for two Panda arms, of 205k
ROUND: Final = 24  # corners of a drawn circle


def drawn_surface(shapes: tuple[Shape, ...], folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (v, 3) [m] and triangles (t, 3) of visual shapes of one link, joined."""
    parts = []
    for shape in shapes:
        if shape.kind == "mesh":
            vertices, triangles = _thinned(find_mesh(shape.file, folder))
            parts.append((vertices * np.array(shape.size), triangles))
        else:
            parts.append(_hull(_primitive(shape)))
    return _join(parts, shapes)


def touched_surface(shapes: tuple[Shape, ...], folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (v, 3) [m] and triangles (t, 3) of the convex hulls of collision shapes of one link, joined."""
    parts = []
    for shape in shapes:
        points = _points(find_mesh(shape.file, folder)) * np.array(shape.size) if shape.kind == "mesh" else _primitive(shape)
        parts.append(_hull(points))
    return _join(parts, shapes)


def find_mesh(file: str, folder: Path) -> Path:
    """Path of a mesh named in a URDF: as it stands, or "package://" looked for in the URDF's folder and those above it.

    Raises:
        SceneError: If there is no such file.
    """
    name = file.removeprefix("file://").removeprefix("package://")
    for place in (folder, *folder.resolve().parents):
        if (place / name).is_file():
            return place / name
    raise SceneError(f"robot.model: the mesh '{file}' is not found from '{folder}'; give a URDF whose meshes exist", key="robot.model")


@lru_cache(maxsize=64)
def _points(path: Path) -> np.ndarray:
    return read_mesh(path, "robot.model")[0]


@lru_cache(maxsize=64)
def _thinned(path: Path) -> tuple[np.ndarray, np.ndarray]:
    return thin_out(*read_mesh(path, "robot.model"), SPACING)


def _primitive(shape: Shape) -> np.ndarray:
    """Points (p, 3) whose hull is the shape; spheres and cylinders as polyhedra inside them."""
    if shape.kind == "box":
        signs = np.array(np.meshgrid(*3 * [[-0.5, 0.5]])).reshape(3, -1).T
        return np.asarray(signs * np.array(shape.size))
    angle = np.linspace(0.0, 2.0 * np.pi, ROUND, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    radius = shape.size[0]
    latitude = np.linspace(-0.5, 0.5, ROUND // 2 + 1) * np.pi
    ball = radius * np.vstack([np.column_stack([np.cos(a) * circle, np.full(ROUND, np.sin(a))]) for a in latitude])
    match shape.kind:
        case "sphere":
            return ball
        case "capsule":
            return np.vstack([ball + np.array([0.0, 0.0, side * shape.size[1] / 2]) for side in (-1, 1)])
        case _:
            return np.vstack([np.column_stack([radius * circle, np.full(ROUND, side * shape.size[1] / 2)]) for side in (-1, 1)])


def _hull(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Convex hull with triangles counter-clockwise from outside."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    triangles = hull.simplices.astype(np.int64)
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("ij,ij->i", normals, hull.equations[:, :3]) < 0.0
    triangles[inward] = triangles[inward][:, ::-1]
    return clean(points, triangles)


def _join(parts: list[tuple[np.ndarray, np.ndarray]], shapes: tuple[Shape, ...]) -> tuple[np.ndarray, np.ndarray]:
    """The parts in link coordinates, each placed by the origin of its shape."""
    vertices, triangles, count = [], [], 0
    for (points, corners), shape in zip(parts, shapes, strict=True):
        vertices.append(points @ shape.origin[:3].T + shape.origin[3])
        triangles.append(corners + count)
        count += len(points)
    return np.vstack(vertices), np.vstack(triangles)
