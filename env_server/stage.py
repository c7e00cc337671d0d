"""Everything that moves in a scene at a given time: grippers, robot, bodies, and the surfaces that cables may touch.

Before the first step the whole path of the robot is planned: a start posture away from joint limits and free of
collisions, then inverse kinematics from step to step. A target out of reach is thus refused before anything is written.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.cable import reaches_any_distance
from protocol.errors import SceneError
from protocol.kinds import Friction, Inclination
from protocol.messages import Grasps, Solid
from protocol.scene import Gripper, Scene

from .anchors import laws_of
from .boundary import Boundary
from .crossed import crossed_of
from .meshes import Mesh, load_body, place_clips
from .motion import Path, cable_frames
from .remesh import tolerance_of
from .robot import Robot
from .surface import Surface
from .touch import Touch
from .world import World

if TYPE_CHECKING:
    from .body_path import BodyPath
    from .primitives import Primitives

HAND_REACH: Final = 0.12  # m along the cable within which the hand that holds it may touch it


@dataclass(frozen=True)
class Posture:
    """Grippers, robot and surfaces at one time."""

    time: float  # s
    positions: np.ndarray  # (g, 3) m, of the grippers
    quaternions: np.ndarray  # (g, 4) of the cable's frame at each gripper
    joints: np.ndarray  # (j,) rad or m
    links: np.ndarray  # (l, 7) poses of the robot's links
    surfaces: np.ndarray  # (s, 7) poses of everything that a cable can touch


class Stage:
    """The rigid side of a scene. Close it when done."""

    def __init__(self, scene: Scene, say: Callable[[str], None]) -> None:
        """Load bodies and robot, and plan the path.

        Args:
            scene: What to set up.
            say: Told what is being done, for whoever waits.

        Raises:
            SceneError: If a body cannot be loaded or a gripper cannot be where the scene wants it.
        """
        self.scene = scene
        say("loading the bodies")
        self.meshes: tuple[Mesh, ...] = tuple(load_body(body, f"bodies[{index}]") for index, body in enumerate(scene.bodies))
        clips = {body.name: place_clips(body, mesh) for body, mesh in zip(scene.bodies, self.meshes, strict=True)}
        self._body_path = _body_path(scene)
        self.path = Path(scene, clips, self._body_path.carried if self._body_path is not None else None)
        self.robot: Robot | None = None
        if scene.robot is not None:
            say("loading the robot")
            self.robot = Robot.load(scene.robot)
            _check_arms(scene, self.robot)
        self.world = World(self.robot, scene.bodies, self.meshes, scene.gravity)
        surfaces = self.world.surfaces()
        self.surface_names = tuple(surface.name for surface in surfaces)
        self.body_count = len(scene.bodies)
        self.extents = np.array([float(np.linalg.norm(surface.vertices, axis=1).max()) for surface in surfaces])
        say("sorting the surfaces for the contact search")
        self.touch_bodies = self._search_of_bodies()
        self.touch_links = Touch([Surface(surface.vertices, surface.triangles) for surface in surfaces[self.body_count :]])
        self._body_poses = np.array([surface.pose for surface in surfaces[: self.body_count]]).reshape(-1, 7)
        self._link_rows = np.array([surface.link for surface in surfaces[self.body_count :]], dtype=np.int64)
        self.bonding = np.array([body.friction is Friction.BOND for body in scene.bodies] + [False] * len(self._link_rows), dtype=bool)
        self.tolerance: Final = tolerance_of(scene)
        self.may_bond: Final = bool(self.bonding.any()) and any(cable.bending is None for cable in scene.cables)
        self.crossed, self.laws = crossed_of(scene.cables), laws_of(scene.bodies, len(self.bonding))
        fixed = [body.inclination is Inclination.FIXED for body in scene.bodies] + [False] * len(self._link_rows)
        self.inclined = np.array(fixed, dtype=bool) if any(fixed) else None
        self.solids: tuple[Solid, ...] = self.world.solids()
        names = [solid.name for solid in self.solids]
        self.solid_of_surface = np.array([names.index(name) if name in names else -1 for name in self.surface_names], dtype=np.int64)
        self._check_reach_of_cables()
        self._excluded: dict[str, np.ndarray] = {}
        say("planning the path of the arms")
        self._joints = self._plan()

    def close(self) -> None:
        """Let go of the rigid scene."""
        self.world.close()

    def at_step(self, step: int) -> Posture:
        """The posture at a time step, as planned."""
        return self._posture(float(self.path.times[step]), self._joints[step])

    def _search_of_bodies(self) -> Touch | Primitives:
        """The contact search on the bodies, and how far they reach where they are more than triangles."""
        if all(body.shape is None for body in self.scene.bodies):
            return Touch([Surface(mesh.vertices, mesh.triangles) for mesh in self.meshes])
        from .primitives import Primitives, extent

        for index, body in enumerate(self.scene.bodies):
            if body.shape is not None:
                self.extents[index] = extent(body)
        return Primitives(self.scene.bodies, self.meshes, {k for k, cable in enumerate(self.scene.cables) if cable.bending is None})

    def put(self, posture: Posture) -> None:
        """Bring the rigid scene into a posture."""
        self.world.set_joints(posture.joints)
        if self._body_path is not None:
            self.world.set_bodies(posture.surfaces[: self.body_count])

    def poses(self, posture: Posture) -> np.ndarray:
        """Poses (d, 7) of `solids` in a posture."""
        return self.world.poses(posture.links, posture.surfaces[: self.body_count])

    def between(self, time: float, seed: np.ndarray) -> Posture:
        """The posture at any time, its joints (j,) found from a posture nearby."""
        return self._posture(time, self._reach(time, seed))

    def grasps(self, cable: str, posture: Posture) -> Grasps:
        """Boundary conditions that the grippers set for a cable, in the order of growing arc length."""
        rows = self.holders(cable)
        return Grasps(
            s=np.array([self.scene.grippers[row].at for row in rows]),
            position=posture.positions[rows],
            quaternion=posture.quaternions[rows],
            hold=tuple(self.scene.grippers[row].hold for row in rows),
        )

    def holders(self, cable: str) -> list[int]:
        """Indices of the grippers that hold a cable, in the order of growing arc length."""
        grippers = self.scene.grippers
        return sorted((row for row in range(len(grippers)) if grippers[row].cable == cable), key=lambda row: grippers[row].at)

    def excluded(self, cable: str, s: np.ndarray) -> np.ndarray:
        """Segments (n-1, links) of a cable that may touch a link: those beside a gripper, for the hand that holds it."""
        known = self._excluded.get(cable)
        if known is None or len(known) != len(s) - 1:
            known = self._excluded[cable] = self._find_excluded(cable, s)
        return known

    def _find_excluded(self, cable: str, s: np.ndarray) -> np.ndarray:
        mask = np.zeros((len(s) - 1, len(self._link_rows)), dtype=bool)
        if self.robot is None:
            return mask
        for row in self.holders(cable):
            gripper = self.scene.grippers[row]
            if gripper.arm is None:
                continue
            near = (s[1:] > gripper.at - HAND_REACH) & (s[:-1] < gripper.at + HAND_REACH)
            hand = self.robot.arms[gripper.arm].hand
            of_hand = np.array([name in hand for name in self.surface_names[self.body_count :]], dtype=bool)
            mask |= near[:, None] & of_hand
        return mask

    def grasp_points(self, cable: str, posture: Posture) -> np.ndarray:
        """Where the hands really are (g, 3) [m]: by the robot's own kinematics, or the gripper's goal without an arm."""
        points = posture.positions[self.holders(cable)].copy()
        if self.robot is not None:
            for place, row in enumerate(self.holders(cable)):
                arm = self.scene.grippers[row].arm
                if arm is not None:
                    points[place] = self.robot.grasp_pose(arm, posture.joints)[0]
        return points

    def torque_ratio(self, wrenches: dict[str, np.ndarray], posture: Posture) -> float:
        """Largest static joint torque over its limit, with the wrenches (6,) of the cables on the hands, by arm."""
        return self.world.torque_ratio(posture.joints, wrenches)

    def _check_reach_of_cables(self) -> None:
        """Refuse a path that pulls two grippers further apart than the cable between them reaches."""
        grippers, times = self.scene.grippers, self.path.times
        positions = np.array([self.path.at(float(time))[0] for time in times])  # (t, g, 3)
        for cable in self.scene.cables:
            holders = self.holders(cable.name)
            if reaches_any_distance(cable, (grippers[row].hold for row in holders)):
                continue
            for first, last in pairwise(holders):
                span = grippers[last].at - grippers[first].at
                chords = np.linalg.norm(positions[:, last] - positions[:, first], axis=1)
                if chords.max() > span:
                    step = int(np.argmax(chords > span))
                    names = f"'{grippers[first].name}' and '{grippers[last].name}'"
                    raise SceneError(
                        f"moves: in '{self.path.move_at(float(times[step]))}' the grippers {names} come to be {chords.max():.4g} m apart, "
                        f"with {span:.4g} m of cable '{cable.name}' between them; keep them within {span:.4g} m",
                        key="moves",
                    )

    def _posture(self, time: float, joints: np.ndarray) -> Posture:
        positions, rotations = self.path.at(time)
        links = self.robot.link_poses(joints) if self.robot is not None else np.zeros((0, 7))
        quaternions = Rotation.from_matrix(cable_frames(rotations)).as_quat()
        bodies = self._body_path.at(time) if self._body_path is not None else self._body_poses
        return Posture(time, positions, quaternions, joints, links, np.vstack([bodies, links[self._link_rows]]))

    def untouched(self, index: int) -> Boundary:
        """Boundary conditions of a cable, by its number, that touches nothing yet."""
        cable = self.scene.cables[index]
        return Boundary(
            radius=0.5 * cable.diameter,
            length=cable.length,
            bonding=self.bonding,
            laws=self.laws,
            inclined=self.inclined,
            is_limp=cable.bending is None,
        )

    def _plan(self) -> np.ndarray:
        """Joints (steps + 1, j) of the whole path."""
        if self.robot is None:
            return np.zeros((len(self.path.times), 0))
        joints = self._start_posture(self.robot)
        plan = [joints]
        for time in self.path.times[1:]:
            joints = self._reach(float(time), joints)
            plan.append(joints)
        return np.array(plan)

    def _start_posture(self, robot: Robot) -> np.ndarray:
        joints = robot.home.copy()
        positions, rotations = self.path.at(0.0)
        cables = {cable.name: cable for cable in self.scene.cables}

        def is_free(posture: np.ndarray) -> bool:
            self.world.set_joints(posture)
            return not self.world.collisions()

        for gripper in self.scene.grippers:
            if gripper.arm is not None:
                joints = robot.hold(gripper.arm, cables[gripper.cable].diameter, joints)
        for row, gripper in enumerate(self.scene.grippers):
            if gripper.arm is None:
                continue
            found = robot.search(gripper.arm, positions[row], rotations[row], joints, collision_free=is_free)
            if not found.ok:
                raise SceneError(self._out_of_reach(row, 0.0, found.position_error), key=f"grippers[{row}]")
            joints = found.joints
        return joints

    def _reach(self, time: float, joints: np.ndarray) -> np.ndarray:
        """Joints for the path at a time, from a posture nearby."""
        if self.robot is None:
            return joints
        positions, rotations = self.path.at(time)
        for row, gripper in enumerate(self.scene.grippers):
            if gripper.arm is not None:
                found = self.robot.reach(gripper.arm, positions[row], rotations[row], joints)
                if not found.ok:
                    raise SceneError(self._out_of_reach(row, time, found.position_error), key=f"grippers[{row}]")
                joints = found.joints
        return joints

    def _out_of_reach(self, row: int, time: float, miss: float) -> str:
        gripper: Gripper = self.scene.grippers[row]
        x, y, z = self.path.at(time)[0][row]
        when = "at the start" if time == 0.0 else f"at {time:.2f} s, in move '{self.path.move_at(time)}'"
        return (
            f"grippers[{row}]: arm '{gripper.arm}' cannot bring '{gripper.name}' to ({x:.3f}, {y:.3f}, {z:.3f}) m {when}, "
            f"it misses by {1000 * miss:.1f} mm within its joint limits; move the target closer to the arm or turn it"
        )


def _body_path(scene: Scene) -> BodyPath | None:
    """The path of the bodies, if any of them moves."""
    if all(target.body is None for move in scene.moves for target in move.targets):
        return None
    from .body_path import BodyPath

    return BodyPath(scene)


def _check_arms(scene: Scene, robot: Robot) -> None:
    taken: dict[str, str] = {}
    for index, gripper in enumerate(scene.grippers):
        if gripper.arm is None:
            continue
        if gripper.arm not in robot.arms:
            known = ", ".join(f"'{name}'" for name in robot.arms)
            raise SceneError(f"grippers[{index}].arm: '{gripper.arm}' unknown; the robot has {known}", key=f"grippers[{index}].arm")
        if gripper.arm in taken:
            raise SceneError(
                f"grippers[{index}].arm: '{gripper.arm}' carries '{taken[gripper.arm]}' already; give each gripper an arm of its own",
                key=f"grippers[{index}].arm",
            )
        taken[gripper.arm] = gripper.name
