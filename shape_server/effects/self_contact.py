"""Self_contact: two places of one cable push each other apart, or do not touch; without friction.

gap >= 0, force >= 0, gap * force = 0 with gap = |r(s1) - r(s2)| - distance (twice the radius), the force along the line between the two
places and opposite at both, so that it moves the cable as a whole neither this way nor that, nor turns it. `strands` has the geometry: one
row for each cell of one strand, so that strands which lie side by side, as in a fold or a coil, share the force among many. Left out:
friction, and that a soft sheath gives way (the softness is that of `contact`).
"""

from __future__ import annotations

import numpy as np

from protocol.messages import SelfContacts

from ..mesh import Mesh
from ..strands import Strands


def rows(contacts: SelfContacts, first: int, mesh: Mesh) -> tuple[Strands, np.ndarray, np.ndarray]:
    """Rows, the first of which has the number `first`, with their forces (k,) [N] places (2k,) and normals (3k,) to start from."""
    element, fraction = mesh.locate(contacts.s.ravel())
    push = np.maximum(np.einsum("ij,ij->i", contacts.force, contacts.normal), 0.0)
    places = element + fraction
    node = np.round(places[::2])
    cell = np.clip(np.column_stack([node - 0.5, node + 0.5]), 0.0, len(mesh.lengths))
    return Strands(first, cell, np.array(contacts.distance), mesh.s), push, np.append(places, contacts.normal.ravel())
