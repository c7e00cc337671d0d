"""Bond (F_inf): the touched point of the cable stays at the touched point of the body, as long as it is pushed there.

Three equations r(s) = p + distance * normal hold the material point s of the axis; their unknowns are the three parts of
the force. The bond is dropped when its force would have to pull the cable towards the body (force . normal < 0).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from protocol.messages import Contacts

from ..mesh import Mesh


@dataclass(frozen=True)
class Bonds:
    """Bonded points; `index` says which contact of the request each one is."""

    index: np.ndarray  # (b,) int
    element: np.ndarray  # (b,) int, segment
    fraction: np.ndarray  # (b,) place along that segment
    anchor: np.ndarray  # (b, 3) m, where the axis is held
    normal: np.ndarray  # (b, 3) unit
    force: np.ndarray  # (b, 3) N, to start from


def rows(contacts: Contacts, chosen: np.ndarray, mesh: Mesh) -> Bonds:
    """Rows for the contacts whose indices are `chosen` (b,)."""
    element, fraction = mesh.locate(contacts.s[chosen])
    normal = contacts.normal[chosen]
    return Bonds(
        index=chosen,
        element=element,
        fraction=fraction,
        anchor=contacts.point[chosen] + contacts.distance[chosen, None] * normal,
        normal=normal,
        force=contacts.force[chosen],
    )
