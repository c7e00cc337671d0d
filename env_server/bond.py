"""A place of a cable that sticks to a place of a body (F_inf), and how a cable without bending hangs on it.

Such a cable has a sharp bend at a bond to a point or an edge. The normal of the bond halves the angle of the bend, so that both pieces
of the cable pass the point alike, and what the bond pushes with along it is (T_before + T_after) sin(theta / 2) > 0 [N], with T the
tensions and theta the angle, however different they are: it pulls only where the cable is bent towards the body. That the two pieces
pass the point at less than the radius of the cable, by the cosine of theta / 2, is neglected.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from protocol.messages import Shape

from .poses import turn_inside, turn_outside

SLIGHT: Final = 0.05  # rad, a bend so slight that the normal of a bond is rather kept than turned to halve it


@dataclass(frozen=True)
class Bond:
    """A point of the cable that sticks to a point of a body."""

    surface: int
    s: float  # m, arc length
    point: np.ndarray  # (3,) m, in the body's frame
    normal: np.ndarray  # (3,) in the body's frame
    force: np.ndarray  # (3,) N, on the cable, world
    drawn: float = 0.0  # m of the cable that were drawn through it since the last step
    is_sharp: bool = False  # on a point or an edge that a cable without bending may bend about


def slid(bond: Bond, shape: Shape, row: int, pose: np.ndarray) -> Bond:
    """A bond as the shape server left it: a cable without bending slides through one that would pull."""
    s = float(shape.contact_s[row])
    bond = replace(bond, s=s, force=shape.contact_forces[row], drawn=bond.drawn + abs(s - bond.s))
    return replace(bond, normal=_turned(bond, shape, pose))


def _turned(bond: Bond, shape: Shape, pose: np.ndarray) -> np.ndarray:
    """Normal (3,) of a bond, in the body's frame, turned with a cable that bends sharply about a point or an edge.

    It halves the angle between both pieces, t_before - t_after, as long as they are bent away from the body; when they are bent towards it,
    it is square to both, so that the force along it pulls.
    """
    node = int(np.argmin(np.abs(shape.s - bond.s)))
    if not bond.is_sharp or not 0 < node < len(shape.s) - 1:
        return bond.normal
    before, after = (chord / np.linalg.norm(chord) for chord in np.diff(shape.nodes[node - 1 : node + 2], axis=0))
    normal, bend, along = turn_outside(pose, bond.normal), before - after, before + after
    square = normal - (normal @ along) / max(float(along @ along), 1e-12) * along
    turned = square if bend @ normal <= 0.0 else SLIGHT * square + bend
    size = float(np.linalg.norm(turned))
    return turn_inside(pose, turned / size) if size > 1e-9 else bond.normal
