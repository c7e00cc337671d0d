"""The robot: its joints, where its links are, and joint positions that bring a hand to a grasp.

The built-in robot "dual_panda" has an arm "left" (world +y when the robot faces +x) and an arm "right". A grasp frame lies between the
fingertips: z where the hand points, x along the held cable, so the fingers close along y.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from protocol import scene
from protocol.errors import SceneError

from .kinematics import FIXED, ROW, SLIDING, chain_frame, poses_of, reach_pose, tree_frames
from .urdf import Description, check_urdf, dual_panda, read_urdf

BUILT_IN: Final = "dual_panda"
DUAL_PANDA_ARMS: Final = tuple(
    scene.Arm(name=side, tip=f"{side}_grasp", hand=(f"{side}_hand", f"{side}_leftfinger", f"{side}_rightfinger"))
    for side in ("left", "right")
)
DUAL_PANDA_HOME: Final = {  # rad; both hands point down 0.42 m ahead and 0.28 m to the side, 1.14 m high, for a cable from left to right
    "left": (0.0, 0.14, 0.0, -2.59, 0.80, 2.57, 1.62),
    "right": (0.0, 0.14, 0.0, -2.59, -0.80, 2.57, -0.05),
}
POSITION_OK: Final = 1e-9  # m
ANGLE_OK: Final = 1e-8  # rad
ROUNDS: Final = 100  # most steps of inverse kinematics; near the last posture it takes 3 or 4
RESTARTS: Final = 200  # random postures that `search` starts from
SEED: Final = 7


@dataclass(frozen=True)
class Reach:
    """Joint positions of the whole robot that bring one arm's grasp frame to a pose, as near as they can."""

    joints: np.ndarray  # (j,) rad or m
    position_error: float  # m
    angle_error: float  # rad
    iterations: int
    clear: bool = True  # no collision, if `search` was given a way to ask

    @property
    def ok(self) -> bool:
        """Whether the pose is reached."""
        return self.position_error < POSITION_OK and self.angle_error < ANGLE_OK


@dataclass(frozen=True)
class ArmChain:
    """One arm as a chain from the world to its grasp frame."""

    name: str
    columns: np.ndarray  # (n,) int, the arm's joints among the robot's
    chain: np.ndarray  # (n+1, 16) rows as in `kinematics`, fixed joints merged
    lower: np.ndarray  # (n,) rad or m
    upper: np.ndarray  # (n,) rad or m
    fingers: np.ndarray  # (f,) int, sliding joints that close the hand
    hand: tuple[str, ...]  # links that hold the cable


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot at a fixed place in the world; made by `Robot.load`."""

    description: Description
    source: Path | None  # file it was read from; None for the built-in robot
    text: str  # URDF
    base: np.ndarray  # (4, 3) frame of the root link in the world
    joint_names: tuple[str, ...]  # movable joints, fingers included
    link_names: tuple[str, ...]
    lower: np.ndarray  # (j,) rad or m
    upper: np.ndarray  # (j,) rad or m
    effort: np.ndarray  # (j,) N m or N
    home: np.ndarray  # (j,) rad or m
    arms: dict[str, ArmChain]
    tree: tuple[np.ndarray, np.ndarray, np.ndarray]  # parents (L,), rows (L, 16), columns (L,)

    @staticmethod
    def load(robot: scene.Robot) -> Robot:
        """Make the built-in robot, or read a URDF after a child process has survived loading it.

        Raises:
            SceneError: If the file cannot be loaded, no arm is named, or a named link does not exist.
        """
        if robot.model == BUILT_IN:
            source, text = None, dual_panda()
        else:
            source = Path(robot.model)
            check_urdf(source)
            text = source.read_text(encoding="utf-8", errors="replace")
        description = read_urdf(text, robot.model)
        arms = robot.arms or (DUAL_PANDA_ARMS if source is None else ())
        if not arms:
            raise SceneError(f"robot.arms: missing; name at least one arm of '{robot.model}' with its tip link", key="robot.arms")
        movable = [joint for joint in description.joints if joint.kind != FIXED]
        names = tuple(joint.name for joint in movable)
        lower, upper = np.array([joint.lower for joint in movable]), np.array([joint.upper for joint in movable])
        base = _base_frame(robot)
        chains = {arm.name: _arm_chain(f"robot.arms[{i}]", arm, description, names, base) for i, arm in enumerate(arms)}
        home = np.clip(np.zeros(len(names)), lower, upper)
        if source is None:
            for side, positions in DUAL_PANDA_HOME.items():
                home[[names.index(f"{side}_joint{i + 1}") for i in range(7)]] = positions
        return Robot(
            description=description,
            source=source,
            text=text,
            base=base,
            joint_names=names,
            link_names=description.links,
            lower=_sealed(lower),
            upper=_sealed(upper),
            effort=_sealed(np.array([joint.effort for joint in movable])),
            home=_sealed(home),
            arms=chains,
            tree=_tree(description, names),
        )

    def link_poses(self, joints: np.ndarray) -> np.ndarray:
        """Pose of every link in the world, (L, 7) position and quaternion, in the order of `link_names`."""
        return np.asarray(poses_of(tree_frames(*self.tree, self.base, joints)))

    def grasp_pose(self, arm: str, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position (3,) [m] and rotation (3, 3) of an arm's grasp frame in the world."""
        chain = self.arms[arm]
        frame = chain_frame(chain.chain, joints[chain.columns], np.empty((6, len(chain.columns))))
        return frame[3].copy(), frame[:3].copy()

    def jacobian(self, arm: str, joints: np.ndarray) -> np.ndarray:
        """Geometric Jacobian (6, n) of an arm's grasp frame: velocity, then angular velocity, by the arm's joint rates."""
        chain = self.arms[arm]
        jacobian = np.empty((6, len(chain.columns)))
        chain_frame(chain.chain, joints[chain.columns], jacobian)
        return jacobian

    def reach(self, arm: str, position: ArrayLike, rotation: ArrayLike, joints: np.ndarray) -> Reach:
        """Bring an arm's grasp frame to a pose from the posture `joints`, moving that arm alone, little, and off its limits."""
        chain = self.arms[arm]
        goal = np.empty((4, 3))
        goal[:3], goal[3] = rotation, position
        found, distance, angle, iterations = reach_pose(chain.chain, goal, joints[chain.columns], chain.lower, chain.upper, ROUNDS)
        result = joints.copy()
        result[chain.columns] = found
        return Reach(joints=result, position_error=distance, angle_error=angle, iterations=iterations)

    def search(
        self,
        arm: str,
        position: ArrayLike,
        rotation: ArrayLike,
        joints: np.ndarray,
        *,
        collision_free: Callable[[np.ndarray], bool] | None = None,
    ) -> Reach:
        """Bring an arm's grasp frame to a pose from any posture: the solution furthest from the joint limits.

        Starts from `joints`, from home, and from the same `RESTARTS` random postures every time. With `collision_free` the first
        solution in that order that is free; if none is, the first, with `clear` false. Without a solution, the nearest miss.
        """
        chain = self.arms[arm]
        low, high = np.maximum(chain.lower, -math.pi), np.minimum(chain.upper, math.pi)
        starts = [joints[chain.columns], self.home[chain.columns]]
        starts += list(np.random.default_rng(SEED).uniform(low, high, size=(RESTARTS, len(chain.columns))))
        found = []
        for start in starts:
            posture = joints.copy()
            posture[chain.columns] = start
            found.append(self.reach(arm, position, rotation, posture))
        solutions = sorted((r for r in found if r.ok), key=lambda r: -_room(chain, r.joints))
        if not solutions:
            return min(found, key=lambda r: r.position_error + r.angle_error)
        if collision_free is None:
            return solutions[0]
        for solution in solutions:
            if collision_free(solution.joints):
                return solution
        best = solutions[0]
        return Reach(best.joints, best.position_error, best.angle_error, best.iterations, clear=False)

    def hold(self, arm: str, diameter: float, joints: np.ndarray) -> np.ndarray:
        """The posture `joints` with the fingers of an arm closed on a cable of that diameter [m]."""
        fingers = self.arms[arm].fingers
        result = joints.copy()
        result[fingers] = np.clip(0.5 * diameter, self.lower[fingers], self.upper[fingers])
        return result


def _room(chain: ArmChain, joints: np.ndarray) -> float:
    """Smallest distance of an arm's joints to their limits, as a share of their range; joints without limits do not count."""
    bounded = np.isfinite(chain.upper - chain.lower) & (chain.upper > chain.lower)
    if not bounded.any():
        return 1.0
    own, lower, upper = joints[chain.columns][bounded], chain.lower[bounded], chain.upper[bounded]
    return float((np.minimum(own - lower, upper - own) / (upper - lower)).min())


def _base_frame(robot: scene.Robot) -> np.ndarray:
    x, y, z, w = np.array(robot.quaternion) / math.hypot(*robot.quaternion)
    frame = np.empty((4, 3))
    frame[0] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    frame[1] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    frame[2] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)
    frame[3] = robot.position
    return frame


def _tree(description: Description, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    place = {link: index for index, link in enumerate(description.links)}
    rows = np.zeros((len(place), ROW))
    parents, columns = np.zeros(len(place), dtype=np.int64), np.full(len(place), -1)
    for index, joint in enumerate(description.joints, start=1):
        rows[index] = _row(joint.origin, joint.axis, joint.kind)
        parents[index] = place[joint.parent]
        columns[index] = names.index(joint.name) if joint.kind != FIXED else -1
    return parents, rows, columns


def _arm_chain(key: str, arm: scene.Arm, description: Description, names: tuple[str, ...], base: np.ndarray) -> ArmChain:
    carriers = {joint.child: joint for joint in description.joints}
    for link in (arm.tip, *arm.hand):
        if link not in description.links:
            raise SceneError(f"{key}: there is no link '{link}'; there are {', '.join(description.links)}", key=key)
    path, link = [], arm.tip
    while link in carriers:
        path.append(carriers[link])
        link = carriers[link].parent
    moving = [joint for joint in reversed(path) if joint.kind != FIXED]
    if not moving:
        raise SceneError(f"{key}.tip: no movable joint carries '{arm.tip}'; name the last link of an arm", key=f"{key}.tip")
    rows, frame = [], base
    for joint in reversed(path):
        frame = _compose(frame, joint.origin)
        if joint.kind != FIXED:
            rows.append(_row(frame, joint.axis, joint.kind))
            frame = _compose(np.vstack([np.eye(3), np.zeros(3)]), np.vstack([np.eye(3), np.zeros(3)]))
    rows.append(_row(frame, np.zeros(3), FIXED))
    own = {joint.name for joint in moving}
    fingers = [j.name for j in description.joints if j.kind == SLIDING and j.child in arm.hand and j.name not in own]
    return ArmChain(
        name=arm.name,
        columns=np.array([names.index(joint.name) for joint in moving]),
        chain=_sealed(np.array(rows)),
        lower=_sealed(np.array([joint.lower for joint in moving])),
        upper=_sealed(np.array([joint.upper for joint in moving])),
        fingers=np.array([names.index(name) for name in fingers], dtype=np.int64),
        hand=arm.hand,
    )


def _compose(outer: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """Frame (4, 3) of `inner`, given in `outer`."""
    return np.vstack([outer[:3] @ inner[:3], outer[:3] @ inner[3] + outer[3]])


def _row(frame: np.ndarray, axis: np.ndarray, kind: int) -> np.ndarray:
    return np.concatenate([frame[:3].ravel(), frame[3], axis, [float(kind)]])


def _sealed(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array
