"""Places where two surfaces stick together (F_inf between cables): a ball joint at the point where they first touched.

With r(s) the axis at the material point, R its directors and a the arm from the axis to the common point in these, a knot is the equations

    p - q = 0,    p = r(s) + R a    of the first cable, q of the second (or of another place of the same one),

and its force F, on the first at p and against it on the second, moves and turns the pair neither way. R is taken between the two segments
whose middles are on both sides of s, R = sum_k w_k R_k, which makes it of second order. With the turn exp(t) of segment k in its own axes
and f = w_k R_k^T F, the arm has the slope dp . F = t . (a x f) and the second derivative

    F . w_k R_k (t x (t x a)) = (f . t)(a . t) - (f . a) |t|^2.

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
    beside: Array  # (b, 2, 2) int, segments that turn the arm
    share: Array  # (b, 2, 2) of each in that

    def sides(self) -> list[tuple[int, int, int, float, float]]:
        """Knot, cable, segment, fraction and sign of every side."""
        return [
            (b, int(self.cable[b, side]), int(self.element[b, side]), float(self.fraction[b, side]), sign)
            for b in range(len(self.cable))
            for side, sign in ((0, 1.0), (1, -1.0))
        ]

    def arms(self) -> list[tuple[int, int, int, float, Array, float]]:
        """Knot, cable, segment that turns it, its share, arm and sign of the two parts of every arm."""
        return [
            (b, int(self.cable[b, side]), int(self.beside[b, side, k]), float(self.share[b, side, k]), self.arm[b, side], sign)
            for b in range(len(self.cable))
            for side, sign in ((0, 1.0), (1, -1.0))
            for k in range(2)
        ]


def knots(asked: Crossings, chosen: Array, meshes: Sequence[Mesh]) -> tuple[Knots, Array]:
    """The rows `chosen` (b,) of a request that stick, and their forces (b, 3) [N] to start from."""
    pairs = (len(chosen), 2)
    element, fraction, beside, share = (
        np.empty(pairs, dtype=np.int64),
        np.empty(pairs),
        np.empty((*pairs, 2), dtype=np.int64),
        np.empty((*pairs, 2)),
    )
    for b, row in enumerate(chosen.tolist()):
        for side in range(2):
            mesh, s = meshes[asked.cable[row, side]], asked.s[row, side : side + 1]
            j, f = mesh.locate(s)
            element[b, side], fraction[b, side] = j[0], f[0]
            middles = 0.5 * (mesh.s[1:] + mesh.s[:-1])
            first = min(max(int(np.searchsorted(middles, s[0])) - 1, 0), len(middles) - 2)
            last = float(np.clip((s[0] - middles[first]) / (middles[first + 1] - middles[first]), 0.0, 1.0))
            beside[b, side], share[b, side] = (first, first + 1), (1.0 - last, last)
    return Knots(asked.cable[chosen], element, fraction, asked.arm[chosen].reshape(-1, 2, 3), beside, share), np.array(asked.force[chosen])


def points(own: Knots, nodes: Sequence[Array], axes: Sequence[Array]) -> Array:
    """The points p and q of every knot (b, 2, 3) [m]."""
    out = np.zeros((len(own.cable), 2, 3))
    for b, cable, j, f, sign in own.sides():
        out[b, 0 if sign > 0.0 else 1] += (1.0 - f) * nodes[cable][j] + f * nodes[cable][j + 1]
    for b, cable, j, share, arm, sign in own.arms():
        out[b, 0 if sign > 0.0 else 1] += share * arm @ axes[cable][j]
    return out


def add_forces(own: Knots, pull: Array, axes: Sequence[Array], forces: Sequence[Array], couples: Sequence[Array]) -> None:
    """Add their forces [N] to those on the nodes (n, 3) of every cable, and the slopes of their arms [N m] to (n-1, 3)."""
    for b, cable, j, f, sign in own.sides():
        forces[cable][j] += sign * (1.0 - f) * pull[b]
        forces[cable][j + 1] += sign * f * pull[b]
    for b, cable, j, share, arm, sign in own.arms():
        couples[cable][j] += sign * share * np.cross(arm, axes[cable][j] @ pull[b])


def curve(own: Knots, pull: Array, axes: Sequence[Array], blocks: Sequence[Array]) -> None:
    """Take the second derivative of their work [N m] off the blocks (n-1, 3, 3) of every cable."""
    for b, cable, j, share, arm, sign in own.arms():
        force = sign * share * (axes[cable][j] @ pull[b])
        both = np.outer(force, arm)
        blocks[cable][j] -= 0.5 * (both + both.T) - (force @ arm) * np.eye(3)


def strips(own: Knots, axes: Sequence[Array], first: int) -> tuple[list[Strip], list[list[tuple[int, int, Array]]]]:
    """Rows of every cable, numbered from `first` on, three a knot; and what the turn of segments adds: segment, row, slope (3,) [m]."""
    entries: list[list[tuple[int, int, Array]]] = [[] for _ in axes]
    turns: list[list[tuple[int, int, Array]]] = [[] for _ in axes]
    for b, cable, j, f, sign in own.sides():
        for k in range(3):
            vectors = np.zeros((3, 3))
            vectors[0, k], vectors[1, k] = sign * (1.0 - f), sign * f
            entries[cable].append((first + 3 * b + k, j, vectors))
    for b, cable, j, share, arm, sign in own.arms():
        turns[cable] += [(j, first + 3 * b + k, sign * share * np.cross(arm, axes[cable][j][:, k])) for k in range(3)]
    return [strip(own_entries) for own_entries in entries], turns
