"""What the programs are asked to do: physics only, the same for all.

| name | rod | ends |
| -- | -- | -- |
| P2 planar | 1 m, 1 N/m, EI = 3e-3 or 1e-2 N m^2, inextensible, naturally straight | 0.6 m apart, both clamped level |
| P3 spatial | the same, GJ = 0.8 EI | 0.6 m apart, tangents 40 degrees from each other, 180 degrees of end twist |
| P4 | P2 or P3, whose far end goes round a closed loop in 200 motions | 4.4 mm and 0.7 degrees (mean) each |
| catenary | 12 m, no bending | 5 m apart, level |

The planar load number w L^3 / EI is 333 (EI = 3e-3) and 100, so bending shapes the whole cable and not only its ends. Frames are
quaternions (x, y, z, w) whose third axis is the tangent; gravity pulls along -z.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.scene import Vector

G = 9.81  # m/s^2
MOTIONS = 200
LOOP_RADIUS = 0.14  # m; 2 pi 0.14 / 200 = 4.4 mm a motion
SWING = np.radians(17.5)  # of the far clamp, twice a loop: 140 degrees in all, 0.7 a motion
SPAN = 0.6  # m
YAW = np.radians(40.0)  # between the tangents of the spatial rod's ends
END_TWIST = np.pi  # rad, of the spatial rod's far clamp about its tangent
LEVEL = Rotation.from_matrix([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])  # d1 up, d3 along x


class Need(StrEnum):
    """What not every program can do; the values go into sentences."""

    HINGE = "a hinge"
    FLAT = "two bending stiffnesses"
    BENT = "a shape when free that is not straight"
    STRETCH = "a given stretch"
    FLOOR = "a floor"


@dataclass(frozen=True)
class Rod:
    """A uniform rod; inextensible, round and straight when free unless it says otherwise."""

    bending: float  # N m^2, EI, about the first axis of the section
    twist: float  # N m^2, GJ
    length: float = 1.0  # m
    weight: float = 1.0  # N/m
    bending_2: float | None = None  # N m^2, about the second axis; None for the same
    bent: Vector = (0.0, 0.0, 0.0)  # 1/m, curvatures about both axes, and twist, when free
    stretch: float | None = None  # N, EA


@dataclass(frozen=True)
class Motions:
    """A rod held at both ends, clamped at the first, and where its clamps are after every motion; row 0 is where they start, and end."""

    name: str
    rod: Rod
    is_planar: bool
    position: np.ndarray  # (201, 2, 3) m
    quaternion: np.ndarray  # (201, 2, 4)
    end_twist: float = 0.0  # rad, whole or half turns of the far clamp that its pose does not tell
    is_hinged: bool = False  # at the far end
    floor: float | None = None  # m, height of the axis where it lies on a smooth floor

    @property
    def needs(self) -> frozenset[Need]:
        """What a program must know beyond round, inextensible, straight rods in two clamps."""
        rod = self.rod
        asked = {
            Need.HINGE: self.is_hinged,
            Need.FLAT: rod.bending_2 is not None,
            Need.BENT: any(rod.bent),
            Need.STRETCH: rod.stretch is not None,
            Need.FLOOR: self.floor is not None,
        }
        return frozenset(need for need, is_asked in asked.items() if is_asked)


@dataclass(frozen=True)
class Hanging:
    """A cable without bending between two points."""

    length: float = 12.0  # m
    span: float = 5.0  # m
    weight: float = 1.0  # N/m
    nodes: int = 100

    def s(self) -> np.ndarray:
        """(nodes,) [m] Arc lengths asked for."""
        return np.linspace(0.0, self.length, self.nodes)


def planar_motions(bending: float = 3e-3) -> Motions:
    """P4 of P2: the far clamp goes round a circle in the plane x-z and swings in it."""
    turn = 2 * np.pi * np.arange(MOTIONS + 1) / MOTIONS
    away = LOOP_RADIUS * np.column_stack([np.sin(turn), np.zeros_like(turn), 1 - np.cos(turn)])
    swing = Rotation.from_rotvec(np.outer(SWING * np.sin(2 * turn), (0.0, -1.0, 0.0)))
    return _motions(f"planar, EI = {bending:g}", Rod(bending, 0.8 * bending), LEVEL, away, swing, is_planar=True)


def spatial_motions(bending: float = 3e-3) -> Motions:
    """P4 of P3: the far clamp goes round a tilted circle and swings about an axis that is not its own."""
    turn = 2 * np.pi * np.arange(MOTIONS + 1) / MOTIONS
    across, up = np.array([0.6, 0.8, 0.0]), np.array([-0.48, 0.36, 0.8])
    away = LOOP_RADIUS * (np.outer(np.sin(turn), across) + np.outer(1 - np.cos(turn), up))
    swing = Rotation.from_rotvec(np.outer(SWING * np.sin(2 * turn), (0.48, -0.64, 0.6)))
    return _motions(f"spatial, EI = {bending:g}", Rod(bending, 0.8 * bending), far_frame(1.0), away, swing, is_planar=False)


def element(motions: Motions, segments: int) -> float:
    """Length [m] of elements that lie astride the clamps, half before and half behind, and end at a hinge."""
    return motions.rod.length / (segments - 0.5 if motions.is_hinged else segments)


def approach(motions: Motions, count: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Poses of both clamps (2, 3) [m] and (2, 4) that lead a straight, level rod to where the motions start, without another turn."""
    straight = np.array([motions.rod.length, 0.0, 0.0])
    for part in np.linspace(0.0, 1.0, count + 1):
        position = np.array([np.zeros(3), part * motions.position[0, 1] + (1 - part) * straight])
        far = far_frame(part) if motions.end_twist else LEVEL
        yield position, np.array([LEVEL.as_quat(), far.as_quat()])


def far_frame(part: float) -> Rotation:
    """Frame of the spatial rod's far clamp when only a part of its yaw and its twist has been made; 1 for all."""
    yaw = Rotation.from_rotvec((0.0, 0.0, part * YAW))
    return yaw * LEVEL * Rotation.from_rotvec((0.0, 0.0, part * END_TWIST))


def _motions(name: str, rod: Rod, far: Rotation, away: np.ndarray, swing: Rotation, *, is_planar: bool) -> Motions:
    position = np.zeros((len(away), 2, 3))
    position[:, 1] = away + np.array([SPAN, 0.0, 0.0])
    quaternion = np.empty((len(away), 2, 4))
    quaternion[:, 0] = LEVEL.as_quat()
    quaternion[:, 1] = (swing * far).as_quat()
    return Motions(name, rod, is_planar, position, quaternion, 0.0 if is_planar else END_TWIST)
