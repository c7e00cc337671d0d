"""More or fewer nodes from one step to the next, so that the estimated error keeps to the tolerance and no step pays for more.

The shape server answers on the nodes that it is given and says how far off it may be. Where that is more than the
tolerance, the step is repeated from the last one with every segment cut in two; where it would still be below the tolerance on every
second node, the next step begins there. The error is of second order, so that these are a factor of four apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import msgspec
import numpy as np

from protocol.kinds import Outcome
from protocol.messages import Grasps, Shape
from protocol.scene import Scene

SEGMENTS_LEAST, SEGMENTS_MOST = 48, 800
CHORD: Final = 0.2  # of its radius, that chords of a cable without bending may be off a body that it touches
AGAIN_MOST: Final = 3  # rounds more of a step whose shape and contacts disagree by more than the tolerance leaves
FOURFOLD: Final = 4.4  # growth of the error on every second node, with a tenth to spare


def tolerance_of(scene: Scene) -> float:
    """Asked of shapes [m]: that of the scene, or less where chords of a cable without bending have to be near what it touches."""
    limp = [cable.diameter for cable in scene.cables if cable.bending is None]
    return min(scene.tolerance, 0.5 * CHORD * min(limp)) if limp and scene.bodies else scene.tolerance


def is_too_coarse(shape: Shape, tolerance: float) -> bool:
    """Whether the error is above the tolerance, or unknown, and more nodes may help."""
    return (shape.error is None or shape.error > tolerance) and 2 * len(shape.frames) <= SEGMENTS_MOST


def are_too_coarse(shapes: Sequence[Shape], tolerance: float) -> bool:
    """Whether a step is worth repeating on more nodes: all cables have a shape, and one is further off than the tolerance."""
    has_all = all(shape.outcome is Outcome.CONVERGED for shape in shapes)
    return has_all and any(is_too_coarse(shape, tolerance) for shape in shapes)


def are_close_enough(shapes: Sequence[Shape], coupling: Sequence[float], tolerance: float) -> bool:
    """Whether what one more round would change (c,) [m] is within what the errors leave of the tolerance; or nothing is known of it."""
    known = [(shape.error, change) for shape, change in zip(shapes, coupling, strict=False) if shape.error is not None]
    return all(change <= max(tolerance - error, 0.0) for error, change in known if error is not None)


def is_too_fine(shape: Shape, grasps: Grasps, tolerance: float) -> bool:
    """Whether every second node will do; every held point must be one of them."""
    if shape.error is None or FOURFOLD * shape.error > tolerance or len(shape.frames) < 2 * SEGMENTS_LEAST or len(shape.frames) % 2:
        return False
    fewer, near = shape.s[::2], 1e-9 * shape.s[-1]
    return bool((np.abs(fewer[np.minimum(np.searchsorted(fewer, grasps.s - near), len(fewer) - 1)] - grasps.s) < near).all())


def finer(shape: Shape) -> Shape:
    """The same polyline with every segment cut in two, its frames turned a quarter of the way to their neighbours.

    Not an equilibrium: a start.
    """
    s = np.empty(2 * len(shape.s) - 1)
    s[::2], s[1::2] = shape.s, 0.5 * (shape.s[1:] + shape.s[:-1])
    nodes = np.empty((len(s), 3))
    nodes[::2], nodes[1::2] = shape.nodes, 0.5 * (shape.nodes[1:] + shape.nodes[:-1])
    last = len(shape.frames) - 1
    frames = np.empty((len(s) - 1, 4))
    for child, neighbour in ((0, np.maximum(np.arange(last + 1) - 1, 0)), (1, np.minimum(np.arange(last + 1) + 1, last))):
        frames[child::2] = blended(shape.frames, shape.frames[neighbour], 0.25)
    curvature = np.interp(s, shape.s, shape.curvature)
    return msgspec.structs.replace(shape, s=s, nodes=nodes, frames=frames, tension=np.repeat(shape.tension, 2), curvature=curvature)


def coarser(shape: Shape) -> Shape:
    """Every second node, with the frames half-way between those of the two segments that become one; a start."""
    return msgspec.structs.replace(
        shape,
        s=shape.s[::2].copy(),
        nodes=shape.nodes[::2].copy(),
        frames=blended(shape.frames[::2], shape.frames[1::2], 0.5),
        tension=0.5 * (shape.tension[::2] + shape.tension[1::2]),
        curvature=shape.curvature[::2].copy(),
    )


def blended(first: np.ndarray, second: np.ndarray, share: float) -> np.ndarray:
    """Unit quaternions a share of the way from the first to the second, whichever sign the second has."""
    same = np.where(np.einsum("ij,ij->i", first, second) < 0.0, -1.0, 1.0)
    mixed = (1.0 - share) * first + share * same[:, None] * second
    unit: np.ndarray = mixed / np.linalg.norm(mixed, axis=1, keepdims=True)
    return unit
