"""One-sided contact without friction (F_0): a body pushes the cable along its normal, or not at all.

gap >= 0, force >= 0, gap * force = 0 for every row, the gap and its normal from `contact_geometry`. The force acts at the
nearest point of the axis and is shared by the two nodes of its segment. A compliance (`rod.SOFTNESS` per typical force)
takes the place of perfect hardness: two rows at one point then share their force evenly, and the gap is below zero by
1e-7 m for a force as large as the weight (or as 10 EI / L^2, which is added to it).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from protocol.kinds import Feature
from protocol.messages import Contacts

from ..contact_geometry import FAR, contact_geometry
from ..mesh import Mesh


@dataclass(frozen=True)
class OneSided:
    """One-sided rows; `index` says which contact of the request each one is."""

    index: np.ndarray  # (m,) int; several rows may belong to one contact
    element: np.ndarray  # (m,) int, segment where it was found
    fraction: np.ndarray  # (m,) place along that segment
    feature: np.ndarray  # (m,) int
    point: np.ndarray  # (m, 3) m
    normal: np.ndarray  # (m, 3) unit
    direction: np.ndarray  # (m, 3) unit
    extent: np.ndarray  # (m, 2) m, of the edge from `point`
    distance: np.ndarray  # (m,) m
    push: np.ndarray  # (m,) N, along the normal, to start from

    def look(self, nodes: np.ndarray, axes: np.ndarray, lengths: np.ndarray, fraction: np.ndarray) -> tuple[np.ndarray, ...]:
        """Gaps and directions of all rows, see `contact_geometry`; `fraction` is updated in place."""
        places = (self.element, fraction, self.feature, self.point, self.normal, self.direction, self.extent, self.distance)
        seen: tuple[np.ndarray, ...] = contact_geometry(nodes, axes, lengths, *places)
        return seen

    def handed_over(self, gap: np.ndarray, push: np.ndarray, touches: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces (m,) and touches (m,) after rows that another one has taken over from gave it what they carried."""
        gone = np.flatnonzero((gap == FAR) & (push > 0.0))
        if not len(gone):
            return push, touches
        push, touches = push.copy(), touches.copy()
        for row in gone:
            heirs = np.flatnonzero((self.index == self.index[row]) & (gap < FAR))
            if len(heirs):
                heir = heirs[np.argmin(np.abs(gap[heirs]))]
                push[heir] += push[row]
                touches[heir] = True
            push[row], touches[row] = 0.0, False
        return push, touches


def rows(contacts: Contacts, chosen: np.ndarray, mesh: Mesh) -> OneSided:
    """Rows for the contacts whose indices are `chosen` (m,).

    An edge or a vertex gets a row on the segment where it was found and on both neighbours, unless another contact with the
    same feature is nearer there. The contact then passes from segment to segment without a jump: over a convex bend both
    segments beside a node touch the edge for a while.
    """
    element, fraction = mesh.locate(contacts.s[chosen])
    push = np.maximum(np.einsum("ij,ij->i", contacts.force[chosen], contacts.normal[chosen]), 0.0)
    extent = contacts.extent[chosen].copy()
    source = [(k, int(j)) for k, j in enumerate(element) if contacts.feature[chosen[k]] == Feature.FACE]
    for group in _by_feature(contacts, [k for k in range(len(chosen)) if contacts.feature[chosen[k]] != Feature.FACE], chosen):
        taken = {int(element[k]): k for k in reversed(group)}
        near = {j + step for j in taken for step in (-1, 1) if 0 <= j + step < len(mesh.lengths)} - taken.keys()
        middle = 0.5 * (mesh.s[:-1] + mesh.s[1:])
        taken |= {j: min(group, key=lambda k: abs(contacts.s[chosen[k]] - middle[j])) for j in near}
        source += [(k, j) for j, k in taken.items()]
        _join_extents(contacts, group, chosen, extent)
    source.sort(key=lambda item: (item[1], item[0]))
    of = np.array([k for k, _ in source], dtype=np.int64)
    segment = np.array([j for _, j in source], dtype=np.int64)
    is_own = segment == element[of]
    index = chosen[of]
    return OneSided(
        index=index,
        element=segment,
        fraction=np.where(is_own, fraction[of], np.where(segment < element[of], 1.0, 0.0)),
        feature=contacts.feature[index],
        point=contacts.point[index],
        normal=contacts.normal[index],
        direction=contacts.direction[index],
        extent=extent[of],
        distance=contacts.distance[index],
        push=np.where(is_own, push[of], 0.0),
    )


def _by_feature(contacts: Contacts, rows: list[int], chosen: np.ndarray) -> list[list[int]]:
    """The rows of edges and vertices, grouped by the line or point that they touch, the strongest first in each group."""
    groups: list[list[int]] = []
    for k in sorted(rows, key=lambda k: -float(np.abs(contacts.force[chosen[k]]).max())):
        for group in groups:
            if _is_same_feature(contacts, int(chosen[k]), int(chosen[group[0]])):
                group.append(k)
                break
        else:
            groups.append([k])
    return groups


def _join_extents(contacts: Contacts, group: list[int], chosen: np.ndarray, extent: np.ndarray) -> None:
    """Let edges on one line count as one edge from the first end to the last."""
    if len(group) == 1 or contacts.feature[chosen[group[0]]] != Feature.EDGE:
        return
    first = chosen[group[0]]
    along = contacts.direction[first]
    place = np.array([(contacts.point[chosen[k]] - contacts.point[first]) @ along for k in group])
    sign = np.array([np.sign(contacts.direction[chosen[k]] @ along) for k in group])
    ends = np.sort(extent[group] * sign[:, None], axis=1) + place[:, None]
    for k, at, turned in zip(group, place, sign, strict=True):
        extent[k] = np.sort(turned * (np.array([ends[:, 0].min(), ends[:, 1].max()]) - at))


def _is_same_feature(contacts: Contacts, one: int, other: int) -> bool:
    if contacts.feature[one] != contacts.feature[other] or contacts.body[one] != contacts.body[other]:
        return False
    direction = contacts.direction[one]
    offset = contacts.point[one] - contacts.point[other]
    near = 1e-9 + 1e-6 * float(contacts.distance[one])
    if contacts.feature[one] == Feature.EDGE and abs(abs(direction @ contacts.direction[other]) - 1.0) > 1e-9:
        return False
    away = offset - (offset @ direction) * direction
    return bool(np.abs(away).max() < near)
