"""The rigid scene: where robot and bodies are, what of them touches what, and how hard the robot's joints work to hold still.

PyBullet finds collisions of the robot and the torques of gravity. Traps that this file keeps away from the others: a mesh body
is its convex hull unless GEOM_FORCE_CONCAVE_TRIMESH is given, two bodies at rest are skipped unless both have collision filters
of their own, large meshes must come from a file, and a pose that is not finite makes a body vanish without a word.
A scene without a robot does not load PyBullet.
"""

from __future__ import annotations

import os
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import numpy as np

from protocol import scene
from protocol.errors import SceneError
from protocol.messages import Solid

from .links import drawn_surface, touched_surface
from .meshes import Mesh
from .poses import body_pose
from .robot import Robot

BODY_COLORS: Final = ((0.30, 0.33, 0.38), (0.62, 0.64, 0.66), (0.45, 0.36, 0.28), (0.28, 0.40, 0.36))
ROOT_COLOR, LINK_COLOR, HAND_COLOR, FINGER_COLOR = (0.26, 0.28, 0.31), (0.92, 0.92, 0.90), (0.70, 0.72, 0.74), (0.20, 0.20, 0.22)
IDENTITY: Final = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
ROBOT_FILTER, BODY_FILTER = 1, 2  # collision groups


@dataclass(frozen=True)
class Surface:
    """A surface that a cable can touch."""

    name: str
    vertices: np.ndarray  # (v, 3) m, in its own frame
    triangles: np.ndarray  # (t, 3) int
    link: int  # row of the robot's `link_poses` that moves it; -1 for a body
    pose: np.ndarray  # (7,) of a body in the world; of a link: not used


class World:
    """Robot and bodies of one scene; `close` it, or use it in a `with` statement."""

    def __init__(self, robot: Robot | None, bodies: tuple[scene.Body, ...], meshes: tuple[Mesh, ...], gravity: scene.Vector) -> None:
        """Place everything.

        Args:
            robot: Or none.
            bodies: Of the scene.
            meshes: Surface of each body.
            gravity: [m/s^2]

        Raises:
            SceneError: If PyBullet refuses the robot or a body.
        """
        self.robot = robot
        self.bodies = bodies
        self.meshes = meshes
        self.body_poses = np.array([body_pose(body) for body in bodies]).reshape(-1, 7)
        self._folder = robot.source.parent if robot is not None and robot.source is not None else Path()
        visible = {shape.link for shape in robot.description.visuals} if robot is not None else set()
        self._drawn = [index for index, name in enumerate(robot.link_names) if name in visible] if robot is not None else []
        self._bullet: ModuleType | None = None
        if robot is not None:
            self._load(robot, gravity)
            self.set_joints(robot.home)

    def __enter__(self) -> World:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of PyBullet; may be called twice."""
        if self._bullet is not None:
            self._bullet.disconnect(physicsClientId=self._client)
            self._bullet = None

    def set_joints(self, joints: np.ndarray) -> None:
        """Put the robot into a posture (j,) [rad or m].

        Raises:
            ValueError: If a position is not finite; PyBullet would lose the links without a word.
        """
        if self._bullet is None:
            return
        if not np.isfinite(joints).all():
            raise ValueError("joint positions must be finite")
        values = [[value] for value in joints.tolist()]
        self._bullet.resetJointStatesMultiDof(self._model, self._indices, values, physicsClientId=self._client)

    def set_bodies(self, poses: np.ndarray) -> None:
        """Put the bodies where they are (b, 7).

        Raises:
            ValueError: If a pose is not finite; PyBullet would lose the body without a word.
        """
        if self._bullet is None:
            return
        if not np.isfinite(poses).all():
            raise ValueError("poses of bodies must be finite")
        for model, pose in zip(list(self._names)[1:], poses.tolist(), strict=True):
            self._bullet.resetBasePositionAndOrientation(model, pose[:3], pose[3:], physicsClientId=self._client)

    def collisions(self) -> tuple[tuple[str, str], ...]:
        """Pairs of links, or of a link and a body, that touch in the present posture; neighbours in the chain left out."""
        if self._bullet is None:
            return ()
        self._bullet.performCollisionDetection(physicsClientId=self._client)
        touching = set()
        for point in self._bullet.getContactPoints(self._model, physicsClientId=self._client):
            if point[8] < 0.0:  # distance; Bullet also reports what is about to touch
                first, second = self._name(point[1], point[3]), self._name(point[2], point[4])
                touching.add((first, second) if point[2] != self._model or point[3] < point[4] else (second, first))
        return tuple(sorted(touching))

    def torque_ratio(self, joints: np.ndarray, wrenches: dict[str, np.ndarray]) -> float:
        """Largest static joint torque over its limit, tau = g(q) - J^T w.

        Args:
            joints: (j,) [rad or m]
            wrenches: By arm, (6,) [N, N m] on the hand at its grasp frame's origin, force then moment, in the world.
        """
        if self._bullet is None or self.robot is None:
            return 0.0
        still = [0.0] * len(joints)
        ordered = joints[self._order].tolist()
        gravity = self._bullet.calculateInverseDynamics(self._model, ordered, still, still, physicsClientId=self._client)
        torque = np.empty(len(joints))
        torque[self._order] = gravity
        for arm, wrench in wrenches.items():
            torque[self.robot.arms[arm].columns] -= self.robot.jacobian(arm, joints).T @ wrench
        return float((np.abs(torque) / self.robot.effort).max())

    def solids(self) -> tuple[Solid, ...]:
        """Everything that can be drawn: the robot's links that have a visual shape, then the bodies."""
        found = []
        if self.robot is not None:
            for link in self._drawn:
                name = self.robot.link_names[link]
                shapes = tuple(shape for shape in self.robot.description.visuals if shape.link == name)
                vertices, triangles = drawn_surface(shapes, self._folder)
                found.append(Solid(name=name, vertices=vertices, triangles=triangles, color=self._color(name, shapes[0].color)))
        for index, (body, mesh) in enumerate(zip(self.bodies, self.meshes, strict=True)):
            color = BODY_COLORS[index % len(BODY_COLORS)]
            found.append(Solid(name=body.name, vertices=mesh.vertices, triangles=mesh.triangles, color=color))
        return tuple(found)

    def poses(self, link_poses: np.ndarray, body_poses: np.ndarray) -> np.ndarray:
        """Poses (d, 7) of `solids` in their order, from those of the robot's links (L, 7), none without a robot, and of the bodies."""
        return np.vstack([link_poses[self._drawn], body_poses])

    def surfaces(self) -> tuple[Surface, ...]:
        """Everything that a cable can touch: the bodies in the order of the scene, then the links as convex hulls."""
        found = [
            Surface(name=body.name, vertices=mesh.vertices, triangles=mesh.triangles, link=-1, pose=pose)
            for body, mesh, pose in zip(self.bodies, self.meshes, self.body_poses, strict=True)
        ]
        if self.robot is not None:
            for link, name in enumerate(self.robot.link_names):
                shapes = tuple(shape for shape in self.robot.description.collisions if shape.link == name)
                if shapes:
                    vertices, triangles = touched_surface(shapes, self._folder)
                    found.append(Surface(name=name, vertices=vertices, triangles=triangles, link=link, pose=np.array(IDENTITY)))
        return tuple(found)

    def _color(self, link: str, own: scene.Vector | None) -> scene.Vector:
        assert self.robot is not None
        if own is not None and own != (1.0, 1.0, 1.0):
            return own
        if link == self.robot.link_names[0]:
            return ROOT_COLOR
        if any(link in arm.hand for arm in self.robot.arms.values()):
            return FINGER_COLOR if "finger" in link else HAND_COLOR
        return LINK_COLOR

    def _load(self, robot: Robot, gravity: scene.Vector) -> None:
        with _quiet() as said, tempfile.TemporaryDirectory() as folder:
            import pybullet

            self._bullet = pybullet
            self._client = pybullet.connect(pybullet.DIRECT)
            self._there: dict[str, Any] = {"physicsClientId": self._client}
            try:
                self._load_robot(robot, Path(folder))
                self._names = {self._model: ""}
                for index, (body, mesh) in enumerate(zip(self.bodies, self.meshes, strict=True)):
                    # PyBullet remembers meshes by file name, so every body needs a name of its own.
                    model = self._load_body(mesh, self.body_poses[index], Path(folder) / f"body_{index}.obj")
                    self._names[model] = body.name
            except pybullet.error as error:
                self.close()
                last = (said() or [str(error)])[-1]
                raise SceneError(
                    f"robot.model: PyBullet refused the robot or a body ({last}); check the meshes", key="robot.model"
                ) from error
        pybullet.setGravity(*gravity, **self._there)

    def _load_robot(self, robot: Robot, folder: Path) -> None:
        bullet = self._bullet
        assert bullet is not None
        path = robot.source
        if path is None:
            path = folder / "robot.urdf"
            path.write_text(_without_visuals(robot.text), encoding="utf-8")
        root = _root_pose(robot)
        flags = bullet.URDF_USE_SELF_COLLISION | bullet.URDF_USE_SELF_COLLISION_EXCLUDE_PARENT
        self._model = bullet.loadURDF(str(path), root[:3], root[3:], useFixedBase=True, flags=flags, **self._there)
        infos = [bullet.getJointInfo(self._model, index, **self._there) for index in range(bullet.getNumJoints(self._model, **self._there))]
        index_of = {info[1].decode(): index for index, info in enumerate(infos)}
        self._link_names = {-1: robot.link_names[0], **{index: info[12].decode() for index, info in enumerate(infos)}}
        self._indices = [index_of[name] for name in robot.joint_names]
        self._order = np.argsort(self._indices)  # PyBullet's degrees of freedom are in the order of its joint indices
        index_of_link = {name: index for index, name in self._link_names.items()}
        for first, second in _neighbours(robot):
            bullet.setCollisionFilterPair(self._model, self._model, index_of_link[first], index_of_link[second], 0, **self._there)
        for index in self._link_names:
            bullet.setCollisionFilterGroupMask(self._model, index, ROBOT_FILTER, ROBOT_FILTER | BODY_FILTER, **self._there)

    def _load_body(self, mesh: Mesh, pose: np.ndarray, file: Path) -> int:
        bullet = self._bullet
        assert bullet is not None
        lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.vertices.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (mesh.triangles + 1).tolist()]
        file.write_text("\n".join(lines) + "\n", encoding="ascii")
        shape = bullet.createCollisionShape(bullet.GEOM_MESH, fileName=str(file), flags=bullet.GEOM_FORCE_CONCAVE_TRIMESH, **self._there)
        body = int(bullet.createMultiBody(0.0, shape, -1, pose[:3].tolist(), pose[3:].tolist(), **self._there))
        bullet.setCollisionFilterGroupMask(body, -1, BODY_FILTER, ROBOT_FILTER, **self._there)
        return body

    def _name(self, model: int, link: int) -> str:
        return self._link_names[link] if model == self._model else self._names[model]


def _neighbours(robot: Robot) -> set[tuple[str, str]]:
    """Pairs of links that touch by construction: next to each other in the chain, links without a shape skipped; one hand's links."""
    shaped = {shape.link for shape in robot.description.collisions}
    carrier = {joint.child: joint.parent for joint in robot.description.joints}
    pairs = set()
    for link in shaped:
        above = carrier.get(link)
        while above is not None and above not in shaped:
            above = carrier.get(above)
        if above is not None:
            pairs.add((above, link))
    for arm in robot.arms.values():
        pairs |= {(first, second) for first in arm.hand for second in arm.hand if first < second}
    return pairs


def _without_visuals(text: str) -> str:
    """The URDF without what is only looked at; PyBullet then loads in a tenth of the time."""
    root = ElementTree.fromstring(text)
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
    return ElementTree.tostring(root, encoding="unicode")


def _root_pose(robot: Robot) -> list[float]:
    return [float(value) for value in robot.link_poses(robot.home)[0]]


@contextmanager
def _quiet() -> Iterator[Any]:
    """Catch what compiled code prints; yields a function that returns the lines so far."""
    sys.stdout.flush()
    sys.stderr.flush()
    with tempfile.TemporaryFile() as file:
        saved = os.dup(1), os.dup(2)

        def said() -> list[str]:
            file.seek(0)
            return [line for line in file.read().decode(errors="replace").splitlines() if line.strip()]

        try:
            os.dup2(file.fileno(), 1)
            os.dup2(file.fileno(), 2)
            yield said
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            for number, copy in zip((1, 2), saved, strict=True):
                os.dup2(copy, number)
                os.close(copy)
