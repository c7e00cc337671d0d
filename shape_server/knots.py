"""Places where two surfaces stick together (F_inf between cables): a joint at the point where they first touched.

With r(s) the axis at the material point, R its directors and a the arm from the axis to the common point in these, a knot is the equations

    p - q = 0,    (R e_1) . (S b) = (R e_2) . (S b) = 0,    p = r(s) + R a    of the first cable,

q, S and b those of the second (or of another place of the same one), and e_1, e_2 square to a. The surfaces share their point, and its
normal: two round surfaces that rolled or tilted on each other would let go of the point, or be in each other. About the normal they turn
freely. The axis is the smooth one of `strands`, on which they touched. R is taken between the two segments whose middles are on both sides
of s, R = sum_k w_k R_k, which makes it of second order.

The work of a knot's force F and of what keeps it upright, e = m_1 e_1 + m_2 e_2, is F . (p - q) + (R e) . (S b): levers v in directors,
each pushed by a G that stands still where only the lever turns. With the turn exp(t) of segment k in its own axes and f = w_k R_k^T G,

    slope t . (v x f),    second derivative (f . t)(v . t) - (f . v) |t|^2,

and of the two levers that push each other also x . y, x = sum_k w_k R_k (t_k x e), y = sum_k w_k S_k (t_k x b), between two places. As
x . y = |x + y|^2 / 4 - |x - y|^2 / 4, this enters as rows with a compliance, like the curvature of `strand_rows`.

The couple M of all levers of a side bends the rod between the two middles, which are a stretch h apart: to the joint, a share w_2 of it
away from the first, its shares on the two segments bring w_1 w_2 h M / EI less of a turn than M at the joint itself would. The levers are
ahead of their directors by that; without it the error is of first order.

It never yields, whichever way it is pulled: to part the two would be to tear them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.messages import Crossings

from .crossing import Strip, strip
from .mesh import Mesh
from .rod import Rod

Array = np.ndarray
Turns = list[list[tuple[int, int, Array]]]  # of every cable: segment, row, slope (3,)
ROWS: Final = 5  # of a knot
GIVE: Final = 1e-2  # of an arm; measured 7e-4 of 6 mm in a wound cable, whose couple of 0.02 N m is a hundred times its weight
WEAK: Final = 1e-9  # of the typical force; what is below it has no curvature


@dataclass(frozen=True)
class Knots:
    """Places that stick, on given meshes."""

    cable: Array  # (b, 2) int
    place: Array  # (b, 2) segments from the start of each cable
    arm: Array  # (b, 2, 3) m
    upright: Array  # (b, 2, 3) unit vectors e_1, e_2 in the directors of the first
    beside: Array  # (b, 2, 2) int, segments that turn the arm
    share: Array  # (b, 2, 2) of each in that
    give: Array  # (b, 2, 3) rad/(N m), by which the levers are ahead, about d1, d2, d3

    def sides(self) -> list[tuple[int, int, float, float]]:
        """Knot, cable, place and sign of every side."""
        return [
            (b, int(self.cable[b, side]), float(self.place[b, side]), sign)
            for b in range(len(self.cable))
            for side, sign in ((0, 1.0), (1, -1.0))
        ]

    def turned(self, knot: int, side: int, vector: Array, axes: Sequence[Array]) -> Array:
        """A vector (3,), or several, in the directors of one side, as it stands in the world."""
        own = axes[self.cable[knot, side]][self.beside[knot, side]]
        return np.asarray(vector @ np.einsum("k,kij->ij", self.share[knot, side], own))

    def turned_back(self, knot: int, side: int, vector: Array, axes: Sequence[Array]) -> Array:
        """A vector (3,) of the world along the directors of one side."""
        own = axes[self.cable[knot, side]][self.beside[knot, side]]
        return np.asarray(np.einsum("k,kij->ij", self.share[knot, side], own) @ vector)

    def segments(self, knot: int, side: int) -> Iterator[tuple[int, int, float]]:
        """Cable, segment and its share of the segments that turn an arm."""
        for k in range(2):
            yield int(self.cable[knot, side]), int(self.beside[knot, side, k]), float(self.share[knot, side, k])

    def levers(self, pull: Array, axes: Sequence[Array]) -> Iterator[tuple[int, int, Array, Array]]:
        """Knot, side, lever in directors and what pushes it, in the world, of all that has a slope with a turn."""
        for b in range(len(self.cable)):
            tilt = pull[b, 3:] @ self.upright[b]
            yield b, 0, self.arm[b, 0], pull[b, :3]
            yield b, 1, self.arm[b, 1], -pull[b, :3]
            yield b, 0, tilt, self.turned(b, 1, self.arm[b, 1], axes)
            yield b, 1, self.arm[b, 1], self.turned(b, 0, tilt, axes)


def knots(asked: Crossings, chosen: Array, meshes: Sequence[Mesh], rods: Sequence[Rod]) -> tuple[Knots, Array]:
    """The rows `chosen` (b,) of a request that stick, and their forces (b, 5) [N] to start from."""
    pairs, arm = (len(chosen), 2), asked.arm[chosen].reshape(-1, 2, 3)
    place, beside, share = np.empty(pairs), np.empty((*pairs, 2), dtype=np.int64), np.empty((*pairs, 2))
    upright, give = np.empty((*pairs, 3)), np.empty((*pairs, 3))
    for b, row in enumerate(chosen.tolist()):
        for side in range(2):
            mesh, rod, s = meshes[asked.cable[row, side]], rods[asked.cable[row, side]], asked.s[row, side : side + 1]
            j, f = mesh.locate(s)
            place[b, side] = j[0] + f[0]
            middles = 0.5 * (mesh.s[1:] + mesh.s[:-1])
            first = min(max(int(np.searchsorted(middles, s[0])) - 1, 0), len(middles) - 2)
            last = float(np.clip((s[0] - middles[first]) / (middles[first + 1] - middles[first]), 0.0, 1.0))
            beside[b, side], share[b, side] = (first, first + 1), (1.0 - last, last)
            give[b, side] = (1.0 - last) * last * (middles[first + 1] - middles[first]) / rod.elastic.law[first : first + 2].mean(axis=0)
        upright[b] = np.linalg.svd(arm[b, :1])[2][1:]
    force = np.pad(asked.force[chosen], ((0, 0), (0, ROWS - 3)))
    return Knots(asked.cable[chosen], place, arm, upright, beside, share, give), force


def ahead(own: Knots, pull: Array, axes: Sequence[Array]) -> Knots:
    """With the levers turned by what the couples on them bring."""
    couple = np.zeros_like(own.arm)
    for b, side, lever, push in own.levers(pull, axes):
        couple[b, side] += _cross(lever, own.turned_back(b, side, push, axes))
    turn = own.give * couple
    arm = np.array([Rotation.from_rotvec(t).apply(a) for t, a in zip(turn.reshape(-1, 3), own.arm.reshape(-1, 3), strict=True)])
    upright = [Rotation.from_rotvec(t).apply(e) for t, e in zip(turn[:, 0], own.upright, strict=True)]
    return replace(own, arm=arm.reshape(own.arm.shape), upright=np.array(upright).reshape(own.upright.shape))


def compliance(own: Knots, axes: Sequence[Array]) -> Array:
    """By how much more the equations are missed for forces that grow, as `ahead` has it (5 b, 5 b) [m/N]."""
    slope = np.zeros((ROWS, len(own.cable), 2, 3))
    for row in range(ROWS):
        for b, side, lever, push in own.levers(np.tile(np.eye(ROWS)[row], (len(own.cable), 1)), axes):
            slope[row, b, side] += _cross(lever, own.turned_back(b, side, push, axes))
    blocks = np.einsum("rbsx,bsx,qbsx->brq", slope, own.give, slope)
    out = np.zeros((len(blocks), ROWS, len(blocks), ROWS))
    out[np.arange(len(blocks)), :, np.arange(len(blocks)), :] = blocks
    return out.reshape(ROWS * len(blocks), ROWS * len(blocks))


def points(path: ModuleType, own: Knots, nodes: Sequence[Array], axes: Sequence[Array]) -> Array:
    """The points p and q of every knot (b, 2, 3) [m]."""
    out, weights = np.zeros((len(own.cable), 2, 3)), np.empty((3, 3))
    for b, cable, place, sign in own.sides():
        side, first = 0 if sign > 0.0 else 1, path.shares(place, len(nodes[cable]) - 1, weights)
        out[b, side] = weights[0] @ nodes[cable][first : first + 3] + own.turned(b, side, own.arm[b, side], axes)
    return out


def misses(path: ModuleType, own: Knots, nodes: Sequence[Array], axes: Sequence[Array]) -> Array:
    """By how much the equations of every knot are missed (b, 5) [m]."""
    apart = points(path, own, nodes, axes)
    tilts = [own.turned(b, 0, own.upright[b], axes) @ own.turned(b, 1, own.arm[b, 1], axes) for b in range(len(own.cable))]
    return np.hstack([apart[:, 0] - apart[:, 1], np.array(tilts).reshape(-1, ROWS - 3)])


def are_joined(own: Knots, missed: Array) -> bool:
    """Whether no knot has given way further than its softness can be meant: places that cannot reach each other."""
    arms = np.linalg.norm(own.arm, axis=2).min(axis=1)
    return bool((np.abs(missed).max(axis=1, initial=0.0) <= GIVE * arms).all())


def add_forces(path: ModuleType, own: Knots, pull: Array, axes: Sequence[Array], forces: Sequence[Array], couples: Sequence[Array]) -> None:
    """Add their forces [N] to those on the nodes (n, 3) of every cable, and the slopes of their levers [N m] to (n-1, 3)."""
    weights = np.empty((3, 3))
    for b, cable, place, sign in own.sides():
        first = path.shares(place, len(forces[cable]) - 1, weights)
        forces[cable][first : first + 3] += sign * weights[0][:, None] * pull[b, :3]
    for b, side, lever, push in own.levers(pull, axes):
        for cable, j, share in own.segments(b, side):
            couples[cable][j] += share * _cross(lever, axes[cable][j] @ push)


def curve(own: Knots, pull: Array, axes: Sequence[Array], blocks: Sequence[Array]) -> None:
    """Take the second derivative of their work [N m] with the turns of one segment off the blocks (n-1, 3, 3) of every cable."""
    for b, side, lever, push in own.levers(pull, axes):
        for cable, j, share in own.segments(b, side):
            force = share * (axes[cable][j] @ push)
            both = np.outer(force, lever)
            blocks[cable][j] -= 0.5 * (both + both.T) - (force @ lever) * np.eye(3)


def strips(path: ModuleType, own: Knots, axes: Sequence[Array], first: int) -> tuple[list[Strip], Turns]:
    """Rows of every cable, numbered from `first` on; and what the turn of segments adds to them."""
    entries: list[list[tuple[int, int, Array]]] = [[] for _ in axes]
    turns: Turns = [[] for _ in axes]
    weights = np.empty((3, 3))
    for b, cable, place, sign in own.sides():
        node = path.shares(place, len(axes[cable]), weights)
        for k in range(3):
            vectors = np.zeros((3, 3))
            vectors[:, k] = sign * weights[0]
            entries[cable].append((first + ROWS * b + k, node, vectors))
    for row in range(ROWS):
        for b, side, lever, push in own.levers(np.tile(np.eye(ROWS)[row], (len(own.cable), 1)), axes):
            for cable, j, share in own.segments(b, side):
                turns[cable].append((j, first + ROWS * b + row, share * _cross(lever, axes[cable][j] @ push)))
    return [strip(own_entries) for own_entries in entries], turns


def tilts(own: Knots, pull: Array, axes: Sequence[Array], first: int, scale: float) -> tuple[Turns, Array]:
    """Rows of the curvature between both places of every knot, numbered from `first` on, and their stiffness (q,).

    `scale` [N] is the typical force.
    """
    turns: Turns = [[] for _ in axes]
    stiffness: list[float] = []
    for b in range(len(own.cable)):
        tilt, arm = pull[b, 3:] @ own.upright[b], own.arm[b, 1]
        size = float(np.linalg.norm(tilt))
        if not size > WEAK * scale:
            continue
        even = np.sqrt(float(np.linalg.norm(arm)) / size)
        for sign in (1.0, -1.0):
            for side, lever in ((0, even * tilt), (1, sign / even * arm)):
                for cable, j, share in own.segments(b, side):
                    turns[cable] += [(j, first + len(stiffness) + k, share * _cross(lever, axes[cable][j][:, k])) for k in range(3)]
            stiffness += [-0.5 * sign] * 3
    return turns, np.array(stiffness)


def _cross(a: Array, b: Array) -> Array:
    """Vector product of two vectors (3,); np.cross takes ten times as long."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
