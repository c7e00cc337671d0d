"""A cable that bends in the plane x-z alone: it is a hundred times as stiff out of it, and weighs nothing."""

from __future__ import annotations

from protocol.kinds import SelfInteraction
from protocol.scene import Cable

DIAMETER, BENDING = 0.02, 1e-2  # m; N m^2


def planar(name: str, kind: SelfInteraction) -> Cable:
    """A metre of it."""
    return Cable(
        name=name,
        length=1.0,
        diameter=DIAMETER,
        mass_per_length=0.0,
        bending=100 * BENDING,
        bending_2=BENDING,
        twist=0.5,
        self_interaction=kind,
    )
