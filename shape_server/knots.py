"""Places where two surfaces stick together (F_inf between cables): a ball joint at the point where they first touched.

With r(s) the axis at the material point, R the directors of its segment and a the arm from the axis to the common point, in the frame of
the segment, a knot is the three equations

    p - q = 0,    p = r(s) + R a    of the first cable, q of the second (or of another place of the same one),

and its force F, on the first at p and against it on the second, moves and turns the pair neither way. With the turn exp(t) of a segment
in its own axes and f = R^T F, the arm has the slope dp . F = t . (a x f) and the second derivative

    F . R (t x (t x a)) = (f . t)(a . t) - (f . a) |t|^2.

It never yields, whichever way it is pulled: to part the two would be to tear them. How a cable rolls about the joint is free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from protocol.messages import Crossings

from .crossing import Strip, strip
from .mesh import Mesh

Array = np.ndarray


@dataclass(frozen=True)
class Knots:
    """Places that stick, on given meshes."""

    cable: Array  # (b, 2) int
    element: Array  # (b, 2) int
    fraction: Array  # (b, 2)
    arm: Array  # (b, 2, 3) m

    def sides(self) -> list[tuple[int, int, int, float, Array, float]]:
        """Knot, cable, segment, fraction, arm and sign of every side."""
        return [
            (b, int(self.cable[b, side]), int(self.element[b, side]), float(self.fraction[b, side]), self.arm[b, side], sign)
            for b in range(len(self.cable))
            for side, sign in ((0, 1.0), (1, -1.0))
        ]


def knots(asked: Crossings, chosen: Array, meshes: Sequence[Mesh]) -> tuple[Knots, Array]:
    """The rows `chosen` (b,) of a request that stick, and their forces (b, 3) [N] to start from."""
    element, fraction = np.empty((len(chosen), 2), dtype=np.int64), np.empty((len(chosen), 2))
    for b, row in enumerate(chosen.tolist()):
        for side in range(2):
            j, f = meshes[asked.cable[row, side]].locate(asked.s[row, side : side + 1])
            element[b, side], fraction[b, side] = j[0], f[0]
    return Knots(asked.cable[chosen], element, fraction, np.array(asked.arm[chosen])), np.array(asked.force[chosen])


def points(own: Knots, nodes: Sequence[Array], axes: Sequence[Array]) -> Array:
    """The points p and q of every knot (b, 2, 3) [m]."""
    out = np.empty((len(own.cable), 2, 3))
    for k, (b, cable, j, f, arm, _) in enumerate(own.sides()):
        out[b, k % 2] = (1.0 - f) * nodes[cable][j] + f * nodes[cable][j + 1] + arm @ axes[cable][j]
    return out


def add_forces(own: Knots, pull: Array, axes: Sequence[Array], forces: Sequence[Array], couples: Sequence[Array]) -> None:
    """Add their forces [N] to those on the nodes (n, 3) of every cable, and the slopes of their arms [N m] to (n-1, 3)."""
    for b, cable, j, f, arm, sign in own.sides():
        forces[cable][j] += sign * (1.0 - f) * pull[b]
        forces[cable][j + 1] += sign * f * pull[b]
        couples[cable][j] += sign * np.cross(arm, axes[cable][j] @ pull[b])


def curve(own: Knots, pull: Array, axes: Sequence[Array], blocks: Sequence[Array]) -> None:
    """Take the second derivative of their work [N m] off the blocks (n-1, 3, 3) of every cable."""
    for b, cable, j, _, arm, sign in own.sides():
        force = sign * (axes[cable][j] @ pull[b])
        both = np.outer(force, arm)
        blocks[cable][j] -= 0.5 * (both + both.T) - (force @ arm) * np.eye(3)


def strips(own: Knots, axes: Sequence[Array], first: int) -> tuple[list[Strip], list[list[tuple[int, int, Array]]]]:
    """Rows of every cable, numbered from `first` on, three a knot; and what the turn of segments adds: segment, row, slope (3,) [m]."""
    entries: list[list[tuple[int, int, Array]]] = [[] for _ in axes]
    turns: list[list[tuple[int, int, Array]]] = [[] for _ in axes]
    for b, cable, j, f, arm, sign in own.sides():
        for k in range(3):
            vectors = np.zeros((3, 3))
            vectors[0, k], vectors[1, k] = sign * (1.0 - f), sign * f
            entries[cable].append((first + 3 * b + k, j, vectors))
            turns[cable].append((j, first + 3 * b + k, sign * np.cross(arm, axes[cable][j][:, k])))
    return [strip(own_entries) for own_entries in entries], turns
