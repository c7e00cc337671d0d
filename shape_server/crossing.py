"""Where cables meet one another, one-sided: the geometry of `strands` between the axes of two cables, or of one that rubs on itself.

A row for each cell of the first cable: its place slides within half a segment of a node, that on the second cable along all of it. With n
from the second axis to the first, u the motion of both places and f the force of the row,

    gap = d - distance >= 0,    f >= 0,    gap f = 0,    f n on the first cable, -f n on the second,

both forces on the line through both axes. The curvature of the gap couples the two cables by up to four rows more, as in `strand_rows`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Final

import numpy as np

from protocol.messages import Crossings

from .contact_geometry import FAR
from .equilibrium import GIVE_MAX
from .mesh import Mesh
from .strand_rows import WEAK
from .strands import BEND

Array = np.ndarray
MANY: Final = 4  # rows of curvature that a contact may have


@dataclass(frozen=True)
class Crossing:
    """The rows, on given meshes."""

    cable: Array  # (k, 2) int
    cell: Array  # (k, 2) how far the first place slides
    distance: Array  # (k,) m
    s: tuple[Array, ...]  # (n,) m, arc length of the nodes of every cable


@dataclass(frozen=True)
class Met:
    """Where the cables are near each other in one state."""

    place: Array  # (k, 2) segments from the start of each cable
    normal: Array  # (k, 3) unit
    gap: Array  # (k,) m


@dataclass(frozen=True)
class Strip:
    """Rows of one cable that are sums of vectors at three nodes each: coef . dr, as `strand_rows.Spread` has them."""

    row: Array  # (r,) int, among the shared rows
    node: Array  # (r, 2) int
    coef: Array  # (r, 2, 3, 3)


def rows(asked: Crossings, chosen: Array, meshes: Sequence[Mesh]) -> tuple[Crossing, Met, Array]:
    """The one-sided rows `chosen` (k,) of a request on these meshes; where they begin, and their forces (k,) [N] to start from."""
    cable, place = asked.cable[chosen], np.empty((len(chosen), 2))
    for k, pair in enumerate(cable.tolist()):
        for side in range(2):
            element, fraction = meshes[pair[side]].locate(asked.s[chosen[k], side : side + 1])
            place[k, side] = element[0] + fraction[0]
    node = np.round(place[:, 0])
    last = np.array([len(meshes[first].lengths) for first in cable[:, 0]])
    cell = np.column_stack([np.maximum(node - 0.5, 0.0), np.minimum(node + 0.5, last)])
    push = np.maximum(np.einsum("ij,ij->i", asked.force[chosen], asked.normal[chosen]), 0.0)
    begun = Met(place, np.array(asked.normal[chosen]), np.zeros(len(chosen)))
    return Crossing(cable, cell, np.array(asked.distance[chosen]), tuple(mesh.s for mesh in meshes)), begun, push


def meet(path: ModuleType, crossing: Crossing, nodes: Sequence[Array], before: Met) -> Met:
    """Gaps and normals of all rows, with their places slid to where they are nearest."""
    place, normal, gap = before.place.copy(), before.normal.copy(), np.empty(len(crossing.distance))
    weights, one, other = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for k, (first, second) in enumerate(crossing.cable.tolist()):
        own, others = nodes[first], nodes[second]
        found = path.slide(own, others, place[k, 0], place[k, 1], crossing.cell[k], weights, one, other)
        if first == second and abs(np.diff(np.interp(found, np.arange(len(own)), crossing.s[first]))[0]) < BEND * crossing.distance[k]:
            gap[k] = FAR  # places of one cable that slide into each other: between them is but a bend
            continue
        place[k] = found
        gap[k] = path.apart(one, other, crossing.distance[k], normal[k])
    return Met(place, normal, gap)


def are_apart(met: Met, length: float) -> bool:
    """Whether no row has given way further than its softness can be meant, for cables of a length [m]."""
    return bool(met.gap.min(initial=0.0) >= -GIVE_MAX * length)


def add_forces(path: ModuleType, crossing: Crossing, met: Met, push: Array, forces: Sequence[Array]) -> None:
    """Add the forces [N] of all rows to those on the nodes (n, 3) of every cable."""
    weights = np.empty((3, 3))
    for k in np.flatnonzero(push).tolist():
        for side, sign in ((0, 1.0), (1, -1.0)):
            own = forces[crossing.cable[k, side]]
            first = path.shares(met.place[k, side], len(own) - 1, weights)
            own[first : first + 3] += sign * push[k] * weights[0][:, None] * met.normal[k]


def strips(
    path: ModuleType, crossing: Crossing, met: Met, push: Array, nodes: Sequence[Array], first_row: int, scale: float
) -> tuple[list[Strip], Array]:
    """The rows of every cable, numbered from `first_row` on, then those of curvature, and the stiffness (q,) [N/m] of these.

    `scale` [N] is the typical force.
    """
    weights, first_curved = np.empty((3, 3)), first_row + len(push)
    entries: list[list[tuple[int, int, Array]]] = [[] for _ in nodes]
    stiffness: list[float] = []
    for k, pair in enumerate(crossing.cable.tolist()):
        for side, sign in ((0, 1.0), (1, -1.0)):
            first = path.shares(met.place[k, side], len(nodes[pair[side]]) - 1, weights)
            entries[pair[side]].append((first_row + k, first, sign * weights[0][:, None] * met.normal[k]))
        if not push[k] > WEAK * scale:
            continue
        coef, node = np.zeros((MANY, 2, 3, 3)), np.empty((MANY, 2), dtype=np.int64)
        ends = nodes[pair[0]], nodes[pair[1]]
        found, values = path.curvature(
            *ends, met.place[k], crossing.cell[k], met.normal[k], met.gap[k], crossing.distance[k], push[k], coef, node
        )
        for q in range(found):
            for side in range(2):
                entries[pair[side]].append((first_curved + len(stiffness), node[q, side], coef[q, side]))
            stiffness.append(float(values[q]))
    return [strip(own) for own in entries], np.array(stiffness)


def strip(entries: Sequence[tuple[int, int, Array]]) -> Strip:
    """Rows from their numbers, first nodes and vectors (3, 3) at three nodes."""
    coef = np.zeros((len(entries), 2, 3, 3))
    for k, (_, _, vectors) in enumerate(entries):
        coef[k, 0] = vectors
    first = np.array([node for _, node, _ in entries], dtype=np.int64)
    return Strip(np.array([row for row, _, _ in entries], dtype=np.int64), np.column_stack([first, first]).reshape(-1, 2), coef)
