"""Surfaces of triangles for hard cases: vertices (v, 3) [m] and triangles (t, 3), and the files that a scene names them by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from protocol.scene import Scene

Shell = tuple[np.ndarray, np.ndarray]
HALF: Final = 5.0  # m, of a floor


def box(size: tuple[float, float, float]) -> Shell:
    """A box about the origin."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return corners, np.array([corner for a, b, c, d in sides for corner in ((a, b, c), (a, c, d))])


def grid(x: np.ndarray, y: np.ndarray) -> Shell:
    """A floor at z = 0, which faces up, of rectangles between given coordinates, each cut in two."""
    across, along = np.meshgrid(x, y, indexing="ij")
    vertices = np.column_stack([across.ravel(), along.ravel(), np.zeros(across.size)])
    i, j = (index.ravel() for index in np.meshgrid(np.arange(len(x) - 1), np.arange(len(y) - 1), indexing="ij"))
    a, b, c, d = i * len(y) + j, (i + 1) * len(y) + j, (i + 1) * len(y) + j + 1, i * len(y) + j + 1
    return vertices, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def graded(least: float) -> Shell:
    """A floor whose triangles shrink towards the origin by a factor of three each, from `HALF` down to `least` [m]."""
    count = max(1, int(np.ceil(np.log(HALF / least) / np.log(3.0))))
    side = HALF * 3.0 ** -np.arange(count + 1)
    return grid(*2 * (np.concatenate([-side, [0.0], side[::-1]]),))


def strips(width: float, count: int = 40) -> Shell:
    """A floor cut across by so many slivers of a width [m], ten metres long, in its middle."""
    middle = width * (np.arange(count + 1) - 0.5 * count)
    inner = middle[np.abs(middle) < 0.9 * HALF]
    return grid(np.concatenate([[-HALF], inner, [HALF]]), np.array([-HALF, HALF]))


def fan(count: int) -> Shell:
    """A floor of so many triangles that all meet at the origin."""
    angles = 2 * np.pi * np.arange(count) / count
    rim = HALF * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(count)])
    here = np.arange(count)
    return np.vstack([np.zeros(3), rim]), np.column_stack([np.zeros(count, dtype=np.int64), 1 + here, 1 + (here + 1) % count])


def written(scene: Scene, shells: Mapping[str, Shell], folder: Path) -> Scene:
    """The scene with the mesh of every body that names a shell in a file of its own."""
    bodies = []
    for body in scene.bodies:
        if body.mesh is not None and body.mesh in shells:
            vertices, triangles = shells[body.mesh]
            file = folder / f"{body.name}.obj"
            lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
            lines += [f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist()]
            file.write_text("\n".join(lines) + "\n", encoding="ascii")
            body = replace(body, mesh=str(file))
        bodies.append(body)
    return replace(scene, bodies=tuple(bodies))
