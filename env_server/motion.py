"""The path of the grippers: from rest to rest along straight lines, with a jerk that stays finite.

In a move of duration T every gripper has gone the share s(u) = 10 u^3 - 15 u^4 + 6 u^5 of its way at u = t / T, so that velocity
and acceleration vanish at both ends; its frame turns by the same share about one axis (slerp).

The frame of a grasp has x along the cable's tangent (towards growing arc length) and z where the hand points, made square to x.
The cable's own frame there has d3 = x, d1 = z, d2 = -y.

Source: Flash and Hogan 1985, "The coordination of arm movements" (the quintic is the path of least jerk).
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.errors import SceneError
from protocol.scene import Scene, Target

Clips = dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]
"""By body, by clip: position (3,) [m] and outward axis (3,), in the world."""


@dataclass(frozen=True)
class Leg:
    """One move of all grippers."""

    name: str
    start: float  # s
    end: float  # s
    steps: int
    positions: np.ndarray  # (2, g, 3) m, at start and end
    rotations: np.ndarray  # (g, 3, 3) at the start
    turns: np.ndarray  # (g, 3) rad, rotation vector from start to end, in the start's frame


class Path:
    """Where every gripper of a scene is at any time.

    Attributes:
        legs: The moves of the scene, in order.
        times: (steps + 1,) [s] The start, then every time step; each move ends on a step.
        keys: Step of each picture of the scene, in their order; 0 is the start.
    """

    def __init__(self, scene: Scene, clips: Clips, carried: Callable[[Clips, float], Clips] | None = None) -> None:
        """Lay out the path.

        Args:
            scene: With its moves.
            clips: Where they are at the start.
            carried: Clips as the bodies have taken them at a time, where bodies move; a target is where its clip is then.

        Raises:
            SceneError: If a clip is unknown, a gripper has two targets in one move, or a turn leaves its frame undefined.
        """
        self._names = [gripper.name for gripper in scene.grippers]
        self._first = (
            np.array([gripper.position for gripper in scene.grippers], dtype=np.float64),
            np.stack([grasp_frame(gripper.tangent, gripper.approach) for gripper in scene.grippers]),
        )
        positions, rotations = self._first
        legs, times = [], [np.zeros(1)]
        for index, move in enumerate(scene.moves):
            before, start = (positions, rotations), float(times[-1][-1])
            there = carried(clips, start + move.duration) if carried is not None else clips
            positions, rotations = self._ends(f"moves[{index}]", move.targets, before, there)
            # A step is never longer than asked for; the tolerance keeps 0.3 / 0.1 from becoming four steps.
            steps = max(1, int(np.ceil(move.duration / scene.time_step - 1e-6)))
            turns = Rotation.from_matrix(np.swapaxes(before[1], 1, 2) @ rotations).as_rotvec()
            legs.append(Leg(move.name, start, start + move.duration, steps, np.stack([before[0], positions]), before[1], turns))
            times.append(start + move.duration * np.arange(1, steps + 1) / steps)
        self.legs = tuple(legs)
        self.times = np.concatenate(times)
        self.times.setflags(write=False)
        reached = dict(zip([move.name for move in scene.moves], np.cumsum([leg.steps for leg in legs]).tolist(), strict=True))
        self.keys = tuple(0 if picture.after == "start" else reached[picture.after] for picture in scene.pictures)

    @property
    def steps(self) -> int:
        """How many time steps follow the start."""
        return len(self.times) - 1

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Positions (g, 3) [m] and grasp frames (g, 3, 3) of the grippers, in the order of the scene; at rest before and after."""
        leg = self._leg(time)
        if leg is None:
            return self._first[0].copy(), self._first[1].copy()
        share = quintic(min(max((time - leg.start) / (leg.end - leg.start), 0.0), 1.0))
        positions = (1.0 - share) * leg.positions[0] + share * leg.positions[1]
        return positions, leg.rotations @ Rotation.from_rotvec(share * leg.turns).as_matrix()

    def move_at(self, time: float) -> str:
        """Name of the move under way; a move's last instant belongs to it, and before the first it is "start"."""
        leg = self._leg(time)
        return "start" if leg is None else leg.name

    def _leg(self, time: float) -> Leg | None:
        if not self.legs or time <= 0.0:
            return None
        return self.legs[min(bisect_left(self.legs, time, key=attrgetter("end")), len(self.legs) - 1)]

    def _ends(
        self, key: str, targets: tuple[Target, ...], before: tuple[np.ndarray, np.ndarray], clips: Clips
    ) -> tuple[np.ndarray, np.ndarray]:
        """Positions and frames at the end of a move; a gripper without a target stays."""
        positions, rotations = before[0].copy(), before[1].copy()
        moved = set()
        for index, target in enumerate(targets):
            if target.gripper is None:
                continue
            place = f"{key}.targets[{index}]"
            if target.gripper in moved:
                raise SceneError(
                    f"{place}.gripper: '{target.gripper}' has a target already; give one target a move", key=f"{place}.gripper"
                )
            moved.add(target.gripper)
            row = self._names.index(target.gripper)
            if target.by is not None:
                positions[row] += target.by
            elif target.to is not None:
                positions[row] = np.array(target.to) + target.offset
            elif target.clip is not None:
                positions[row] = find_clip(f"{place}.clip", target.clip, clips)[0] + target.offset
            if target.tangent is not None or target.approach is not None:
                tangent = np.array(target.tangent) if target.tangent is not None else before[1][row, :, 0]
                approach = np.array(target.approach) if target.approach is not None else before[1][row, :, 2]
                cosine = tangent @ approach / np.linalg.norm(tangent) / np.linalg.norm(approach)
                if abs(cosine) > 0.5:
                    raise SceneError(
                        f"{place}: 'tangent' and 'approach' are not within 30 degrees of square to each other; give both", key=place
                    )
                rotations[row] = grasp_frame(tangent, approach)
        return positions, rotations


def find_clip(key: str, name: str, clips: Clips) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) [m] and outward axis (3,) of the clip "body.clip".

    Raises:
        SceneError: If there is none; lists the clips that the body has.
    """
    body, _, clip = name.partition(".")
    found = clips.get(body, {})
    if clip not in found:
        known = ", ".join(f"'{body}.{each}'" for each in found) or "none; only generated bodies have clips"
        raise SceneError(f"{key}: '{name}' unknown; there are {known}", key=key)
    return found[clip]


def quintic(share: float) -> float:
    """s(u) = 10 u^3 - 15 u^4 + 6 u^5, from 0 to 1 with no velocity or acceleration at either end."""
    return share**3 * (10.0 + share * (6.0 * share - 15.0))


def grasp_frame(tangent: np.ndarray | tuple[float, float, float], approach: np.ndarray | tuple[float, float, float]) -> np.ndarray:
    """Frame (3, 3) with x along `tangent` and z as near to `approach` as is square to it; columns x, y, z."""
    x = np.asarray(tangent, dtype=np.float64) / np.linalg.norm(tangent)
    z = np.asarray(approach, dtype=np.float64) / np.linalg.norm(approach)
    z = z - (x @ z) * x
    z /= np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z], axis=1)


def cable_frames(grasps: np.ndarray) -> np.ndarray:
    """Frames (g, 3, 3) of the cable, columns d1, d2, d3, from grasp frames (g, 3, 3)."""
    return np.stack([grasps[:, :, 2], -grasps[:, :, 1], grasps[:, :, 0]], axis=2)
