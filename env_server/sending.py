"""Turns steps into frames and sends them, while the shape server thinks about the next step.

The frame of a step is made and sent when the next request is on its way, or before anything waits: the program would only be idle then.
What a resumed run goes on from is taken when the step ends, and written after its frame.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

import msgspec
import numpy as np

from protocol.codec import encode
from protocol.errors import RecordingError
from protocol.messages import Finished, Frame, Shape

from .memory import Checkpoint
from .outlet import Outlet
from .stage import Stage
from .stepped import Stepped, touch_points


class Sending:
    """Sends what a run has to show.

    Args:
        stage: The rigid side of the scene.
        outlet: Where everything goes.
        session: Of the run.
        report: Told the number of every step whose frame has been sent.
        sequence: Of the first frame to be sent.

    Attributes:
        sequence: Of the next frame.
    """

    def __init__(self, stage: Stage, outlet: Outlet, session: str, report: Callable[[int], None], sequence: int) -> None:
        self._stage, self._outlet, self._session, self._report = stage, outlet, session, report
        self.sequence = sequence
        self._took = 0.0  # s that the last frame took to be sent; on the bill of the next
        self._pending: Callable[[], None] | None = None

    def later(self, stepped: Stepped, shapes: tuple[Shape, ...], step: int, wait: float, kept: Checkpoint) -> None:
        """Send the frame of a step, from which the run goes on as `kept` says, when `flush` is called next."""
        self.flush()
        self._pending = partial(self._step, stepped, shapes, step, wait, kept)

    def flush(self) -> None:
        """Send what is to be sent, if there is anything.

        Raises:
            RecordingError: If the journal's disk is full, with the number of the step.
        """
        if self._pending is not None:
            pending, self._pending = self._pending, None
            pending()

    def between(self, stepped: Stepped, step: int, late: float, share: float) -> None:
        """Send a frame before that of a step now: a share of a relaxation.

        Raises:
            RecordingError: If the journal's disk is full, with the number of the step.
        """
        self.flush()
        shapes = tuple(cable.shape for cable in stepped.cables)
        with self._told(step):
            self._outlet.between(self._framed(stepped, shapes, -1, 0.0, late, relaxing=share))
        self.sequence += 1

    def last(self, stepped: Stepped, shapes: tuple[Shape, ...], step: int, wait: float, late: float) -> None:
        """Send the frame of a step that failed now; nothing goes on from it."""
        self.flush()
        self._outlet.last(self._framed(stepped, shapes, step, wait, late))
        self.sequence += 1

    def finish(self, *, failed: bool, sentence: str) -> None:
        """Send the end of the run."""
        self._outlet.last(encode(Finished(session=self._session, frames=self.sequence, failed=failed, sentence=sentence)))

    def _step(self, stepped: Stepped, shapes: tuple[Shape, ...], step: int, wait: float, kept: Checkpoint) -> None:
        begun = time.perf_counter()
        frame = self._framed(stepped, shapes, step, wait, kept.late)
        with self._told(step):
            self._outlet.step(frame, kept)
        self.sequence += 1
        self._report(step)
        self._took = time.perf_counter() - begun

    @contextmanager
    def _told(self, step: int) -> Iterator[None]:
        """Say with an error at which step it was."""
        try:
            yield
        except RecordingError as error:
            raise RecordingError(f"step {step} of {self._stage.path.steps}: {error}", key=error.key) from error

    def _framed(self, stepped: Stepped, shapes: tuple[Shape, ...], step: int, wait: float, late: float, *, relaxing: float = 0.0) -> bytes:
        begun, stage, scene, posture = time.perf_counter(), self._stage, self._stage.scene, stepped.posture
        misses, wrenches = [0.0], {}
        for cable, shape in zip(scene.cables, shapes, strict=True):
            points, holders = stage.grasp_points(cable.name, posture), stage.holders(cable.name)
            for row, gripper in enumerate(scene.grippers[index] for index in holders):
                node = int(np.argmin(np.abs(shape.s - gripper.at)))
                misses.append(float(np.linalg.norm(shape.nodes[node] - points[row])))
                if gripper.arm is not None:
                    wrenches[gripper.arm] = -shape.grasp_wrenches[row]
        torque_ratio = stage.torque_ratio(wrenches, posture)
        bill = msgspec.structs.replace(
            stepped.bill,
            robot=stepped.bill.robot + time.perf_counter() - begun,
            encode=stepped.bill.encode + self._took,
            wait=wait + stepped.bill.wait,
        )
        frame = Frame(
            session=self._session,
            sequence=self.sequence,
            time=posture.time + late,
            move=stage.path.move_at(posture.time),
            picture=scene.pictures[stage.path.keys.index(step)].name if step in stage.path.keys else "",
            joints=posture.joints,
            poses=stage.poses(posture),
            grasps=tuple(stage.grasps(cable.name, posture) for cable in scene.cables),
            shapes=shapes,
            touching=touch_points(stage, stepped),
            rounds=stepped.rounds,
            penetration=max(max(c.bodies.penetration, c.links.penetration) for c in stepped.cables),
            grasp_error=max(misses),
            collisions=stepped.collisions,
            torque_ratio=torque_ratio,
            bill=bill,
            relaxation=relaxing,
            crossing=stepped.crossed.pushes if stepped.crossed is not None else None,
            coupling=stepped.coupling,
            audits=stepped.audits if not relaxing else (),
        )
        return encode(frame)
