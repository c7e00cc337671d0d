"""Scenes played step by step, with what must hold of every step of every case."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from protocol.hard_case import Check, Declined, Unsound
from protocol.kinds import Outcome
from protocol.messages import Bill, Problem, Shape, ShapeRequest, Start
from protocol.scene import Scene, check_scene

from ..asking import Asker
from ..audit import Audits
from ..hanging import Hanging
from ..looking import Reach
from ..loop import REACH_MOST, Loop
from ..memory import Checkpoint, resume
from ..polyline import points_at
from ..poses import moves
from ..self_boundary import meet
from ..stage import Stage
from ..stepped import Stepped
from .shells import Shell, written

SESSION: Final = "hard case"
DEEPEST: Final = 5e-6  # m; a step settles at 2e-6
NOTICED: Final = 0.02  # of the length, by which a cable must go in a step to have snapped
SUDDEN: Final = 15.0  # times as far as what drives it; a taut cable that is let go by x sinks by more than x
NOTHING: Final = Bill(solve=0.0, search=0.0, robot=0.0, encode=0.0, wire=0.0, wait=0.0, total=0.0)


class Played:
    """A scene of one cable on its way: its last step, and what all of them were like."""

    def __init__(self, stage: Stage, loop: Loop, first: Stepped) -> None:
        self.stage, self.now = stage, first
        self.deepest = 0.0  # m, in any body
        self.snaps: list[int] = []  # steps in which the cable snapped
        self.step = 0
        self._loop = loop
        self._check()

    @property
    def shape(self) -> Shape:
        """As it is now."""
        return self.now.cables[0].shape

    def on(self, steps: int | None = None) -> Iterator[Shape]:
        """The shapes after each of so many steps more, or of all.

        Raises:
            Declined: If a step has no shape, with its sentence.
            Unsound: If what it has is none.
        """
        last = self.stage.path.steps if steps is None else self.step + steps
        while self.step < last:
            self.step += 1
            before, self.now = self.now, self._loop.advance(self.step)
            self._check()
            if self._has_leapt(before):
                self.snaps.append(self.step)
            yield self.shape

    def to(self, steps: int | None = None) -> Shape:
        """The shape after so many steps more, or after all."""
        for _ in self.on(steps):
            pass
        return self.shape

    def checks(self, *, snaps: int = 0, deepest: float = DEEPEST) -> Iterator[Check]:
        """What every case measures at its end, with as many snaps and as deep in a body [m] at most as it allows."""
        shape, posture = self.shape, self.now.posture
        yield Check("deepest in a body", self.deepest, deepest)
        grasps = self.stage.grasps(self.stage.scene.cables[0].name, posture)
        yield Check("distance from a grasp", float(np.linalg.norm(points_at(shape, grasps.s) - grasps.position, axis=1).max()), 1e-7)
        yield Check("snaps", len(self.snaps), snaps + 0.5, "of them")
        size = np.linalg.norm(shape.contact_forces, axis=1).sum() + np.linalg.norm(shape.grasp_wrenches[:, :3], axis=1).sum()
        weight = self.stage.scene.cables[0].mass_per_length * float(shape.s[-1])
        weight += sum(mass.mass for mass in self.stage.scene.cables[0].masses)
        total = shape.grasp_wrenches[:, :3].sum(axis=0) + shape.contact_forces.sum(axis=0) + weight * np.array(self.stage.scene.gravity)
        yield Check("sum of the forces", float(np.linalg.norm(total)) / max(float(size), 1e-12), 1e-7, "of all of them")

    def _has_leapt(self, before: Stepped) -> bool:
        """Whether the cable went much further than all that drives it."""
        was, now, at, goal = before.cables[0].shape, self.shape, before.posture, self.now.posture
        far = float(np.linalg.norm(now.nodes - points_at(was, now.s), axis=1).max())
        extents = np.where(np.isfinite(self.stage.extents), self.stage.extents, 0.0)
        turned = (Rotation.from_quat(goal.quaternions) * Rotation.from_quat(at.quaternions).inv()).magnitude() * float(now.s[-1])
        shifted = np.linalg.norm(goal.positions - at.positions, axis=1)
        driven = max(float((turned + shifted).max()), float(moves(at.surfaces, goal.surfaces, extents).max(initial=0.0)))
        return far > NOTICED * float(now.s[-1]) and far > SUDDEN * driven

    def _check(self) -> None:
        shape, where = self.shape, f"step {self.step} of {self.stage.path.steps}"
        if shape.outcome is not Outcome.CONVERGED:
            if len(shape.sentence) <= 20:
                raise Unsound(f"{where}: {shape.outcome.value} with the sentence {shape.sentence!r}")
            raise Declined(shape.outcome, f"{where}: {shape.sentence}")
        values = (shape.nodes, shape.frames, shape.tension, shape.curvature, shape.grasp_wrenches, shape.contact_forces)
        if not all(np.isfinite(value).all() for value in values):
            raise Unsound(f"{where}: converged, with values that are not finite")
        if not shape.is_stable:
            raise Unsound(f"{where}: converged, without being stable")
        self.deepest = max(self.deepest, self.now.cables[0].bodies.penetration)


@contextmanager
def playing(
    scene: Scene, asker: Asker, start: Start | None = None, shells: Mapping[str, Shell] | None = None, *, is_loose: bool = False
) -> Iterator[Played]:
    """A scene after its first shape: found from the grasps alone, or from a start that is held by friction where it is touched.

    Args:
        scene: Of one cable.
        asker: Who answers.
        start: What rests.
        shells: Surfaces that the bodies of the scene name as their meshes.
        is_loose: Let the start slide to where it rests without friction, as at the start of a run.
    """
    check_scene(scene)
    with TemporaryDirectory(prefix="cc-") as folder:
        stage = Stage(written(scene, shells or {}, Path(folder)), lambda _: None)
    try:
        loop = Loop(stage, asker, SESSION)
        if start is not None:
            go_on_from(loop, laid(stage, asker, start, is_loose=is_loose))
        yield Played(stage, loop, loop.first() if start is None else loop.advance(0))
    finally:
        stage.close()


def go_on_from(loop: Loop, laid_out: Stepped) -> None:
    """Let a loop that has not begun go on from a step before its first."""
    resume(loop, Checkpoint(SESSION, -1, 0.0, 0, laid_out, (), Reach(REACH_MOST, REACH_MOST, REACH_MOST), Audits()))


def laid(stage: Stage, asker: Asker, start: Start, *, is_loose: bool = False) -> Stepped:
    """The step before the first: every point of the one cable where `start` has it; held there by friction unless `is_loose`."""
    scene, posture = stage.scene, stage.at_step(0)
    cable, grasps = scene.cables[0], stage.grasps(scene.cables[0].name, posture)
    tangents = Rotation.from_quat(start.frames).apply([0.0, 0.0, 1.0])
    nodes = np.vstack([np.zeros(3), np.cumsum(np.diff(start.s)[:, None] * tangents, axis=0)])
    nodes = nodes + grasps.position[0] - nodes[int(np.argmin(np.abs(start.s - grasps.s[0])))]
    problem = Problem(cable=cable, grasps=grasps)
    asker.send(ShapeRequest(session=SESSION, step=0, round=0, gravity=scene.gravity, tolerance=1.0, problems=(problem,)))
    shape = msgspec.structs.replace(
        asker.receive().shapes[0],
        s=start.s,
        nodes=nodes,
        frames=start.frames,
        tension=np.zeros(len(start.s) - 1),
        curvature=np.zeros(len(start.s)),
        grasp_wrenches=np.hstack([start.grasp_forces, np.zeros_like(start.grasp_forces)]),
        error=None,
    )
    before = replace(posture, time=posture.time - scene.time_step)
    boundary = stage.untouched(0) if is_loose else stage.untouched(0).anchored(None, shape, before.surfaces, before.time)
    radius, count = 0.5 * cable.diameter, stage.body_count
    bodies = stage.touch_bodies.search(nodes, posture.surfaces[:count], radius, REACH_MOST)
    links = stage.touch_links.search(nodes, posture.surfaces[count:], radius, REACH_MOST)
    hanging = Hanging(shape, boundary, bodies, links, meet(cable, shape, REACH_MOST))
    return Stepped(before, (hanging,), 0, (), NOTHING)
