"""One-sided contact without friction (F_0): a body pushes the cable along its normal, or not at all.

gap >= 0, force >= 0, gap * force = 0 for every row, the gap and its normal from `contact_geometry`. The force acts at the
nearest point of the axis and is shared by the two nodes of its segment. A compliance (`border.SOFTNESS` per typical force)
takes the place of perfect hardness: two rows at one point then share their force evenly, and the gap is below zero by
1e-7 m for a force as large as the weight (or as 10 EI / L^2, which is added to it).
"""

from __future__ import annotations

import numpy as np

from protocol.messages import Contacts

from ..contact_geometry import EDGE, FACE
from ..mesh import Mesh
from ..rod import Touch


def rows(contacts: Contacts, chosen: np.ndarray, mesh: Mesh) -> tuple[Touch, np.ndarray, np.ndarray]:
    """Rows for the contacts whose indices are `chosen` (m,), with their forces [N] and places along their segments to start from.

    An edge or a vertex gets a row on the segment where it was found and on both neighbours, unless another contact with the
    same feature is nearer there. The contact then passes from segment to segment without a jump.
    """
    element, fraction = mesh.locate(contacts.s[chosen])
    push = np.maximum(np.einsum("ij,ij->i", contacts.force[chosen], contacts.normal[chosen]), 0.0)
    is_face = contacts.feature[chosen] == FACE
    extent = contacts.extent[chosen].copy()
    found = element.tolist()
    source = [(k, found[k]) for k in np.flatnonzero(is_face).tolist()]
    last = len(mesh.lengths) - 1
    for group in _by_feature(contacts, chosen[~is_face].tolist(), push[~is_face].tolist()):
        own = [int(np.searchsorted(chosen, index)) for index in group]
        taken = {found[k]: k for k in reversed(own)}
        for j in {j + step for j in taken for step in (-1, 1)} - taken.keys():
            if 0 <= j <= last:
                taken[j] = min(own, key=lambda k: abs(found[k] - j))
        source += [(k, j) for j, k in taken.items()]
        _join_extents(contacts, group, own, extent)
    source.sort(key=lambda item: (item[1], item[0]))
    of = np.array([k for k, _ in source], dtype=np.int64)
    segment = np.array([j for _, j in source], dtype=np.int64)
    is_own = segment == element[of]
    index = chosen[of]
    touch = Touch(
        contact=index,
        element=segment,
        feature=contacts.feature[index],
        point=contacts.point[index],
        normal=contacts.normal[index],
        direction=contacts.direction[index],
        extent=extent[of],
        distance=contacts.distance[index],
    )
    return touch, np.where(is_own, push[of], 0.0), np.where(is_own, fraction[of], np.where(segment < element[of], 1.0, 0.0))


def _by_feature(contacts: Contacts, rows: list[int], push: list[float]) -> list[list[int]]:
    """Contacts with edges and vertices, grouped by the line or point that they touch, the strongest first in each group."""
    groups: list[tuple[tuple[float, ...], list[int]]] = []
    for _, row in sorted(zip(push, rows, strict=True), key=lambda item: (-item[0], item[1])):
        feature = (
            float(contacts.feature[row]),
            float(contacts.body[row]),
            *contacts.point[row].tolist(),
            *contacts.direction[row].tolist(),
        )
        near = 1e-9 + 1e-6 * float(contacts.distance[row])
        for known, group in groups:
            if _is_same_feature(feature, known, near):
                group.append(row)
                break
        else:
            groups.append((feature, [row]))
    return [group for _, group in groups]


def _is_same_feature(one: tuple[float, ...], other: tuple[float, ...], near: float) -> bool:
    """Whether two features (kind, body, point, direction) are one point, or lie on one line, to within `near` [m]."""
    if one[:2] != other[:2]:
        return False
    x, y, z, u, v, w = one[2:]
    dx, dy, dz = x - other[2], y - other[3], z - other[4]
    if one[0] == EDGE and abs(abs(u * other[5] + v * other[6] + w * other[7]) - 1.0) > 1e-9:
        return False
    along = dx * u + dy * v + dz * w
    return max(abs(dx - along * u), abs(dy - along * v), abs(dz - along * w)) < near


def _join_extents(contacts: Contacts, group: list[int], own: list[int], extent: np.ndarray) -> None:
    """Let edges on one line count as one edge from the first end to the last."""
    if len(group) == 1 or contacts.feature[group[0]] != EDGE:
        return
    along = contacts.direction[group[0]]
    place = (contacts.point[group] - contacts.point[group[0]]) @ along
    sign = np.sign(contacts.direction[group] @ along)
    ends = np.sort(extent[own] * sign[:, None], axis=1) + place[:, None]
    low, high = ends[:, 0].min(), ends[:, 1].max()
    extent[own] = np.sort(sign[:, None] * (np.array([low, high]) - place[:, None]), axis=1)
