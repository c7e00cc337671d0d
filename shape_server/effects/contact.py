"""One-sided contact without friction (F_0): a body pushes the cable along its normal, or not at all.

gap >= 0, force >= 0, gap * force = 0 for every row, the gap and its normal from `contact_geometry`. The force acts at the
nearest point of the axis and is shared by the two nodes of its segment. A compliance of `SOFTNESS` weights of the cable
takes the place of perfect hardness: two rows at one point then share their force evenly, and the gap is below zero by
1e-7 m for a force as large as the weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from protocol.messages import Contacts

from ..mesh import Mesh

SOFTNESS = 1e-7  # m by which a contact gives way under the cable's whole weight


@dataclass(frozen=True)
class OneSided:
    """One-sided rows; `index` says which contact of the request each one is."""

    index: np.ndarray  # (m,) int
    element: np.ndarray  # (m,) int, segment where it was found
    fraction: np.ndarray  # (m,) place along that segment
    feature: np.ndarray  # (m,) int
    point: np.ndarray  # (m, 3) m
    normal: np.ndarray  # (m, 3) unit
    direction: np.ndarray  # (m, 3) unit
    distance: np.ndarray  # (m,) m
    push: np.ndarray  # (m,) N, along the normal, to start from


def rows(contacts: Contacts, chosen: np.ndarray, mesh: Mesh) -> OneSided:
    """Rows for the contacts whose indices are `chosen` (m,)."""
    element, fraction = mesh.locate(contacts.s[chosen])
    normal = contacts.normal[chosen]
    return OneSided(
        index=chosen,
        element=element,
        fraction=fraction,
        feature=contacts.feature[chosen],
        point=contacts.point[chosen],
        normal=normal,
        direction=contacts.direction[chosen],
        distance=contacts.distance[chosen],
        push=np.maximum(np.einsum("ij,ij->i", contacts.force[chosen], normal), 0.0),
    )
