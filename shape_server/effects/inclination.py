"""Inclination (G_inf): where a body bonds the cable, the cable's tangent lies in the body's tangent plane.

One row for each such bond, normal . r'(s) = 0, with r' the derivative of the axis along segments (`strands.shares`, linear between the
middles of segments), and a couple as its unknown: the force f of the row acts as f normal r'-weights on three nodes, whose sum is nothing.
A clamp would hold the roll and the direction within the plane too; G_inf leaves both to the mechanics, and so does the paper (5.1), which
sets one angle in a plane. On an edge or a vertex the normal is that with which the bond was made, square to the cable, so that the tangent
lies in the admissible cone. The row goes when the bond lets go.

A contact that pushes without a bond needs no row: where it slides, its push is square to the cable, and the tangent in the plane already.
Left out: contacts at a free end of the cable, whose tangent may leave the plane there unless they are bonds. G_0, `free`, has no rows.
"""

from __future__ import annotations

import numpy as np

from protocol.messages import Contacts


def bonds(contacts: Contacts, chosen: np.ndarray) -> np.ndarray:
    """Which of the bonds, contacts `chosen` (b,) of the request, have their inclination fixed, (i,) int."""
    assert contacts.inclination is not None
    return np.flatnonzero(contacts.inclination[chosen] == 1)
