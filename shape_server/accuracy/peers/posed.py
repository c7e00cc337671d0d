"""A rod between two clamps whose poses are given, for every peer alike: led there from the level sag in which all of them can start.

The clamps go from 0.6 of the length apart, level, to where they are asked for on straight lines and about fixed axes, in so many
motions, and then rest until nodes move no more. Who keeps nothing between motions gets the last pose alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from . import peer_mujoco, peer_pyelastica
from .motions import LEVEL, SPAN, Motions, Rod
from .references import level, turned

WAY: Final = 20  # motions
RESTS: Final = 40  # motions at most
STILL: Final = 1e-5  # of the length, by which nodes move in a motion at rest
IN_TIME: Final = (peer_mujoco, peer_pyelastica)  # those that march in time, and come to rest


@dataclass(frozen=True)
class Posed:
    """A rod of length one and its clamps, the far one not below the first, gravity along -z."""

    rod: Rod
    position: np.ndarray  # (2, 3) m
    quaternion: np.ndarray  # (2, 4)
    is_planar: bool  # in the plane x-z, without twist


def nodes(peer: ModuleType, posed: Posed) -> tuple[np.ndarray, np.ndarray]:
    """Arc lengths (n,) [m] and nodes (n, 3) [m] that a peer of `installed.FOLLOWING` finds; not a number where it finds none."""
    motions = _motions(posed)
    flat = level(posed.rod, motions.position[0])
    first = flat if posed.is_planar else turned(posed.rod, motions.position[0], flat, np.zeros(1))
    follower = peer.prepare(motions, first, peer.careful(posed.rod))
    found = np.zeros((0, 3))
    for motion in range(1 if peer.REMEMBERS else WAY, WAY + 1):
        found = follower.move(motions.position[motion], motions.quaternion[motion])
    for _ in range(RESTS if peer in IN_TIME else 0):
        before, found = found, follower.move(motions.position[-1], motions.quaternion[-1])
        if not np.abs(found - before).max() > STILL * posed.rod.length:
            break
    return follower.s, found


def _motions(posed: Posed) -> Motions:
    start = np.array([[0.0, 0.0, 0.0], [SPAN * posed.rod.length, 0.0, 0.0]])
    share = np.linspace(0.0, 1.0, WAY + 1)
    quaternion = np.empty((WAY + 1, 2, 4))
    for clamp in range(2):
        ends = Rotation.from_quat([LEVEL.as_quat(), posed.quaternion[clamp]])
        quaternion[:, clamp] = Slerp([0.0, 1.0], ends)(share).as_quat()
    position = start + share[:, None, None] * (posed.position - start)
    return Motions("posed", posed.rod, posed.is_planar, position, quaternion)
