"""Scenes whose bodies rub, stepped by the very loop of the environment, with the shape server in the same process."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from env_server.hard_cases.playing import go_on_from, laid
from env_server.loop import Loop
from env_server.stage import Posture, Stage
from protocol.messages import ShapeReply, ShapeRequest, Start
from protocol.scene import Scene
from shape_server import kernels
from shape_server.solve import answer

RADIUS = 0.0045  # m
Motion = Callable[[float], tuple[float, np.ndarray, bool]]  # of time: angle [rad], shift (3,) [m], whether the grippers go along


class InProcess:
    """Answers at once, in place of `Asker`."""

    coding = 0.0

    def __init__(self, path: Any = kernels) -> None:
        self._path = path
        self.requests: list[ShapeRequest] = []

    def send(self, request: ShapeRequest) -> None:
        self.requests = [*self.requests[-20:], request]

    def receive(self) -> ShapeReply:
        request = self.requests[-1]
        shapes = tuple(answer(problem, request, self._path) for problem in request.problems)
        return ShapeReply(session=request.session, step=request.step, round=request.round, shapes=shapes, busy=0.0)


class Moved:
    """A stage that a function of time carries along: all bodies by a turn about the z axis and a shift, and the grippers if asked."""

    def __init__(self, stage: Stage, motion: Motion | None) -> None:
        self._stage, self._motion = stage, motion

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stage, name)

    def at_step(self, step: int) -> Posture:
        return self._moved(self._stage.at_step(step))

    def between(self, time: float, seed: np.ndarray) -> Posture:
        return self._moved(self._stage.between(time, seed))

    def _moved(self, posture: Posture) -> Posture:
        if self._motion is None:
            return posture
        angle, shift, with_grippers = self._motion(posture.time)
        turn = Rotation.from_rotvec([0.0, 0.0, angle])
        turned = np.hstack([turn.apply(posture.surfaces[:, :3]) + shift, (turn * Rotation.from_quat(posture.surfaces[:, 3:])).as_quat()])
        if not with_grippers:
            return replace(posture, surfaces=turned)
        frames = (turn * Rotation.from_quat(posture.quaternions)).as_quat()
        return replace(posture, surfaces=turned, positions=turn.apply(posture.positions) + shift, quaternions=frames)


@contextmanager
def stepping(scene: Scene, start: Start, motion: Motion | None = None, path: Any = kernels) -> Iterator[Loop]:
    """A loop that goes on from a shape that rests as it is, held there by friction where it is touched."""
    stage = Stage(scene, lambda _: None)
    try:
        moved: Any = Moved(stage, motion)
        asker: Any = InProcess(path)
        loop = Loop(moved, asker, "session")
        go_on_from(loop, laid(moved, asker, start))
        loop.advance(0)
        yield loop
    finally:
        stage.close()


def saved(folder: Path, name: str, vertices: np.ndarray, triangles: np.ndarray) -> str:
    """A mesh in a file."""
    file = folder / f"{name}.ply"
    trimesh.Trimesh(vertices, triangles, process=False).export(file)
    return str(file)


def floor(folder: Path, half: float = 3.0) -> str:
    """A large plate whose upper side is z = 0."""
    box = trimesh.creation.box((2 * half, 2 * half, 0.2))
    return saved(folder, "floor", box.vertices - [0.0, 0.0, 0.1], box.faces)


def cylinder(folder: Path, radius: float, sections: int) -> str:
    """A prism around the y axis whose edges touch a circle from within."""
    angles = 2 * np.pi * np.arange(sections) / sections
    ring = radius * np.column_stack([np.cos(angles), np.zeros(sections), np.sin(angles)])
    half = np.array([0.0, 0.1, 0.0])
    vertices = np.vstack([ring - half, ring + half])
    here, after = np.arange(sections), (np.arange(sections) + 1) % sections
    sides = np.vstack([np.column_stack([here, here + sections, after]), np.column_stack([after, here + sections, after + sections])])
    return saved(folder, "cylinder", vertices, sides)
