"""Friction defined by a table (F_d): a force for every sliding speed and normal force, linear between the points given.

With a force at zero speed a contact sticks up to that, as with Coulomb's friction; a table that falls from there has more friction at rest.

Source: the paper's sec. 3.1.
"""

from __future__ import annotations

from protocol.errors import MessageError
from protocol.messages import FrictionLaw

from . import Numbers


def numbers(law: FrictionLaw) -> Numbers:
    """F(v, N) from a table.

    Raises:
        MessageError: If it is missing.
    """
    if law.table is None:
        raise MessageError("table: defined friction needs a table of speeds, normal forces and forces", key="table")
    return Numbers(0.0, 0.0, (law.table.speeds, law.table.normals, law.table.forces))
