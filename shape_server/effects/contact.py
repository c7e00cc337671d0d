"""One-sided contact without friction (F_0): a body pushes the cable along its normal, or not at all.

gap >= 0, force >= 0, gap * force = 0 for every row, the gap and its normal from `contact_geometry`. The force acts at the
nearest point of the axis and is shared by the two nodes of its segment. A compliance (`border.SOFTNESS` per typical force)
takes the place of perfect hardness: two rows at one point then share their force evenly, and the gap is below zero by
1e-7 m for a force as large as the weight (or as 10 EI / L^2, which is added to it).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from protocol.messages import Contacts

from ..contact_geometry import EDGE, FACE
from ..mesh import Mesh
from ..rod import TOUCH, from_columns

SAME_PLANE: Final = 1e-9  # m, and of a unit normal


@dataclass(frozen=True)
class Grouped:
    """The one-sided contacts of a request by the face, line or point that they touch; the same for every mesh."""

    chosen: np.ndarray  # (m,) int, which contacts of the request
    push: np.ndarray  # (m,) N, to start from
    faces: list[int]  # rows of `chosen`
    features: list[list[int]]  # rows of `chosen` that touch one line or point, the strongest first
    extent: np.ndarray  # (m, 2) m, that of edges on one line joined
    reach: int  # segments to either side of where an edge or a vertex was found that get a row too


def grouped(contacts: Contacts, chosen: np.ndarray, reach: int) -> Grouped:
    """Group the contacts whose indices are `chosen` (m,); `reach` segments to either side get rows for an edge or a vertex."""
    push = np.maximum(np.einsum("ij,ij->i", contacts.force[chosen], contacts.normal[chosen]), 0.0)
    is_face = contacts.feature[chosen] == FACE
    extent = contacts.extent[chosen].copy()
    others = np.flatnonzero(~is_face).tolist()
    features = _by_feature(contacts, chosen, others, push[others].tolist())
    for own in features:
        _join_extents(contacts, chosen[own], own, extent)
    return Grouped(chosen, push, np.flatnonzero(is_face).tolist(), features, extent, reach)


def rows(contacts: Contacts, groups: Grouped, mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows (m,) of `TOUCH` for the grouped contacts, with their forces [N] and places along their segments to start from.

    An edge or a vertex gets a row on the segment where it was found and on its neighbours, unless another contact with the
    same feature is nearer there. The contact then passes from segment to segment without a jump.
    """
    chosen, push = groups.chosen, groups.push
    element, fraction = mesh.locate(contacts.s[chosen])
    found, aside = element.tolist(), np.abs(fraction - 0.5).tolist()
    source = [(k, found[k]) for k in groups.faces]
    last = len(mesh.lengths) - 1
    for feature in groups.features:
        own = sorted(feature, key=lambda k: (-push[k], aside[k]))  # of those without a force the one at a node is not the nearest
        taken = {found[k]: k for k in reversed(own)}
        for j in {j + step for j in taken for step in range(-groups.reach, groups.reach + 1)} - taken.keys():
            if 0 <= j <= last:
                taken[j] = min(own, key=lambda k: abs(found[k] - j))
        source += [(k, j) for j, k in taken.items()]
    source.sort(key=lambda item: (item[1], item[0]))
    of = np.array([k for k, _ in source], dtype=np.int64)
    segment = np.array([j for _, j in source], dtype=np.int64)
    is_own = segment == element[of]
    index = chosen[of]
    touch = from_columns(
        TOUCH,
        {
            "contact": index,
            "element": segment,
            "feature": contacts.feature[index],
            "rub": np.full(len(index), -1, dtype=np.int64),
            "point": contacts.point[index],
            "normal": contacts.normal[index],
            "direction": contacts.direction[index],
            "extent": groups.extent[of],
            "distance": contacts.distance[index],
            "is_straight": np.zeros(len(index), dtype=np.int64),
        },
    )
    return touch, np.where(is_own, push[of], 0.0), np.where(is_own, fraction[of], np.where(segment < element[of], 1.0, 0.0))


def thinned(contacts: Contacts, groups: Grouped, mesh: Mesh) -> Grouped:
    """The same with one face for each segment of a mesh and each plane, the one nearest to its middle; nothing else is left out.

    Between two rows of one plane the cable can get into it by no more than its chord can, which vanishes with the segments.
    """
    faces = np.array(groups.faces, dtype=np.int64)
    index = groups.chosen[faces]
    segment, fraction = mesh.locate(contacts.s[index])
    offset = np.einsum("ij,ij->i", contacts.point[index], contacts.normal[index]) + contacts.distance[index]
    plane = np.column_stack([contacts.body[index], segment, np.round(np.column_stack([contacts.normal[index], offset]) / SAME_PLANE)])
    nearest = np.argsort(np.abs(fraction - 0.5), kind="stable")
    kept = nearest[np.unique(plane[nearest], axis=0, return_index=True)[1]]
    return replace(groups, faces=np.sort(faces[kept]).tolist())


def _by_feature(contacts: Contacts, chosen: np.ndarray, rows: list[int], push: list[float]) -> list[list[int]]:
    """Rows of `chosen` with edges and vertices, grouped by the line or point that they touch, the strongest first in each group."""
    groups: list[tuple[list[float], list[int]]] = []
    index = chosen[rows]
    told = np.column_stack(
        [contacts.feature[index], contacts.body[index], contacts.point[index], contacts.direction[index], contacts.distance[index]]
    )
    for _, own, (*feature, distance) in sorted(zip(push, rows, told.tolist(), strict=True), key=lambda item: (-item[0], item[1])):
        near = 1e-9 + 1e-6 * distance
        for known, group in groups:
            if _is_same_feature(feature, known, near):
                group.append(own)
                break
        else:
            groups.append((feature, [own]))
    return [group for _, group in groups]


def _is_same_feature(one: list[float], other: list[float], near: float) -> bool:
    """Whether two features (kind, body, point, direction) are one point, or lie on one line, to within `near` [m]."""
    if one[:2] != other[:2]:
        return False
    x, y, z, u, v, w = one[2:]
    dx, dy, dz = x - other[2], y - other[3], z - other[4]
    if one[0] == EDGE and abs(abs(u * other[5] + v * other[6] + w * other[7]) - 1.0) > 1e-9:
        return False
    along = dx * u + dy * v + dz * w
    return max(abs(dx - along * u), abs(dy - along * v), abs(dz - along * w)) < near


def _join_extents(contacts: Contacts, group: np.ndarray, own: list[int], extent: np.ndarray) -> None:
    """Let edges on one line, contacts `group` of the request, count as one edge from the first end to the last."""
    if len(group) == 1 or contacts.feature[group[0]] != EDGE:
        return
    along = contacts.direction[group[0]]
    place = (contacts.point[group] - contacts.point[group[0]]) @ along
    sign = np.sign(contacts.direction[group] @ along)
    ends = np.sort(extent[own] * sign[:, None], axis=1) + place[:, None]
    low, high = ends[:, 0].min(), ends[:, 1].max()
    extent[own] = np.sort(sign[:, None] * (np.array([low, high]) - place[:, None]), axis=1)
