"""The path of the bodies: from rest to rest by the same quintic as the grippers, along straight lines and about fixed axes.

In a move of duration T a body has gone the share s(t / T) of its way (`motion.quintic`), and has turned by the same share of
its turn about one axis of the world through its own position. A turn may be more than half a revolution.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass
from operator import attrgetter
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.errors import SceneError
from protocol.scene import Scene

from .motion import Clips, quintic
from .poses import body_pose

TURN_MOST: Final = 1.0  # rad in one time step
FASTEST: Final = 1.875  # largest slope of the quintic, s'(1/2) = 15/8


@dataclass(frozen=True)
class Ride:
    """One move of all bodies."""

    start: float  # s
    end: float  # s
    positions: np.ndarray  # (2, b, 3) m, at start and end
    rotations: Rotation  # (b,) at the start
    turns: np.ndarray  # (b, 3) rad, rotation vector from start to end, in the world


class BodyPath:
    """Where every body of a scene is at any time."""

    def __init__(self, scene: Scene) -> None:
        """Lay out the path.

        Raises:
            SceneError: If a body has two targets in one move, or turns by more than a radian in a time step.
        """
        self._names = [body.name for body in scene.bodies]
        self._first = np.array([body_pose(body) for body in scene.bodies]).reshape(-1, 7)
        rides, begin = [], 0.0
        positions, rotations = self._first[:, :3], Rotation.from_quat(self._first[:, 3:])
        for index, move in enumerate(scene.moves):
            before, turns, moved = positions.copy(), np.zeros_like(positions), set()
            positions = positions.copy()
            for place, target in enumerate(move.targets):
                if target.body is None:
                    continue
                key, row = f"moves[{index}].targets[{place}]", self._names.index(target.body)
                if row in moved:
                    raise SceneError(f"{key}.body: '{target.body}' has a target already; give one target a move", key=f"{key}.body")
                moved.add(row)
                if target.by is not None:
                    positions[row] += target.by
                elif target.to is not None:
                    positions[row] = np.array(target.to) + target.offset
                if target.turn is not None:
                    _check_turn(f"{key}.turn", target.turn, move.duration, scene.time_step)
                    turns[row] = target.turn
            rides.append(Ride(begin, begin + move.duration, np.stack([before, positions]), rotations, turns))
            rotations, begin = Rotation.from_rotvec(turns) * rotations, begin + move.duration
        self._rides = tuple(rides)

    def at(self, time: float) -> np.ndarray:
        """Poses (b, 7) of the bodies, in the order of the scene; at rest before the first move and after the last."""
        if time <= 0.0 or not self._rides:
            return self._first.copy()
        ride = self._rides[min(bisect_left(self._rides, time, key=attrgetter("end")), len(self._rides) - 1)]
        share = quintic(min(max((time - ride.start) / (ride.end - ride.start), 0.0), 1.0))
        positions = (1.0 - share) * ride.positions[0] + share * ride.positions[1]
        return np.hstack([positions, (Rotation.from_rotvec(share * ride.turns) * ride.rotations).as_quat()])

    def carried(self, clips: Clips, time: float) -> Clips:
        """Clips given for the start, where the bodies have taken them at a time."""
        poses, out = self.at(time), {}
        for row, name in enumerate(self._names):
            turn = Rotation.from_quat(poses[row, 3:]) * Rotation.from_quat(self._first[row, 3:]).inv()
            there = clips.get(name, {}).items()
            out[name] = {clip: (poses[row, :3] + turn.apply(p - self._first[row, :3]), turn.apply(axis)) for clip, (p, axis) in there}
        return out


def _check_turn(key: str, turn: tuple[float, float, float], duration: float, time_step: float) -> None:
    most = FASTEST * math.hypot(*turn) * min(time_step / duration, 1.0)
    if most > TURN_MOST:
        raise SceneError(
            f"{key}: {list(turn)} rad within {duration:g} s turns the body by up to {most:.2g} rad in a time step; "
            f"give it more time, or a time_step that keeps it below {TURN_MOST:g} rad",
            key=key,
        )
