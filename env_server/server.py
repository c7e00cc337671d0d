"""The environment's run: sets up the scene, waits to be started, steps it to its end, and publishes every frame."""

from __future__ import annotations

import hashlib
import time
import uuid
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

import msgspec
import numpy as np

from protocol import scene_file
from protocol.codec import encode
from protocol.errors import CablecosimError, PeerLostError, RecordingError
from protocol.keys import Keys
from protocol.kinds import Outcome
from protocol.messages import Finished, Frame, Shape, Snapshot
from protocol.scene import Relaxation, Scene

from . import touch
from .asking import Asker
from .audit import auditor_of, is_wanted
from .control import Control
from .journal import Journal
from .loop import Loop
from .memory import Checkpoint, resume
from .outlet import Outlet
from .stage import Stage
from .stepped import Stepped, shown, touch_points
from .versions import versions

RECORDERS_LIMIT: Final = 60.0  # s for the recorders to join after the start
COMPILING: Final = "; kernels compile beside the run, once, for a minute or two, and numpy serves meanwhile"
LINGER: Final = 60.0  # s to go on answering after the run and the last question


class Run:
    """One scene from set-up to the last frame."""

    def __init__(
        self,
        scene: Scene,
        *,
        shape: str,
        frames: str,
        live: str,
        control: str,
        patience: float,
        journal: Path | None = None,
        keys: Keys | None = None,
        audit: str | None = None,
    ) -> None:
        """Begin to listen.

        Args:
            scene: What to run.
            shape: Where the shape server listens.
            frames: Where to publish every frame, for recorders.
            live: Where to publish frames for looking.
            control: Where to answer.
            patience: [s] To wait for a silent shape server.
            journal: Folder to keep the run in, so that it can go on after this program was killed; gone on from if it holds one.
            keys: For every socket.
            audit: Where a shape server listens, or will, that solves sampled steps with every effect; without it none are.
        """
        self._scene = scene
        self._patience = patience
        data = scene_file.write(scene)
        # The session is part of every request; made from the scene, it lets two runs of one scene give the same bytes.
        self._session = uuid.uuid5(uuid.NAMESPACE_OID, data.decode()).hex
        self._outlet = Outlet(frames, live, self._session, journal, keys)
        self._asker = Asker(shape, patience=patience, keys=keys)
        auditor = self._auditor = auditor_of(scene, Asker(audit, patience=patience, keys=keys) if audit is not None else None)
        frame = self._outlet.journal.message if self._outlet.journal is not None else None
        scene_hash = hashlib.sha256(data).hexdigest()[:16]
        audits = partial(is_wanted, auditor)
        self._control = Control(control, scene_hash, silent=lambda: self._asker.silent, audits=audits, frame=frame, keys=keys)
        self._kernels = ""  # of the shape server, when it was greeted
        self._sequence = 0
        self._publishing = self._framed = 0.0  # s that the last frame took; on the bill of the next
        self._late = 0.0  # s of simulated time by which relaxations have held up the path

    @property
    def addresses(self) -> dict[str, str]:
        """Where it listens, by purpose."""
        return {"control": self._control.address, **self._outlet.addresses}

    def go(self, *, at_once: bool) -> str:
        """Set up, wait to be started (unless `at_once`), and run; returns why it failed; empty if it ended well or was stopped."""
        journal = self._outlet.journal
        if journal is not None and journal.ending is not None:
            return self._tell_ending(journal, *journal.ending)
        stage = self._set_up()
        try:
            if self._control.is_stopped:
                return ""
            snapshot = self._snapshot(stage)
            self._control.offer(snapshot)
            loop = Loop(stage, self._asker, self._session, self._auditor)
            kept = self._outlet.kept
            first = self._first(loop) if kept is None else self._continued(loop, kept)
            self._control.report(0 if kept is None else kept.step, snapshot.steps, "ready", "ready")
            recorders = 0 if at_once else self._control.wait_for_start()
            if recorders is None:
                return ""
            if not self._outlet.wait_for(recorders, RECORDERS_LIMIT):
                raise PeerLostError(
                    f"{self._outlet.recorders} of {recorders} recorders joined within {RECORDERS_LIMIT:g} s; start the visualiser",
                    key="frames",
                )
            self._outlet.begin(encode(snapshot))
            sentence = self._step(stage, loop, first, 0 if kept is None else kept.step + 1, snapshot.steps)
            self._control.wait_for_stop(LINGER)
            return sentence
        finally:
            stage.close()

    def stop(self) -> None:
        """End the run in good order, after the present step."""
        self._control.stop()

    def close(self) -> None:
        """Give all addresses back."""
        self._asker.close()
        if self._auditor is not None:
            self._auditor.close()
        self._control.close()
        self._outlet.close()

    def _tell_ending(self, journal: Journal, failed: bool, sentence: str) -> str:
        """Go on answering for a run that was over before this program was started."""
        step = journal.kept.step if journal.kept is not None else 0
        self._control.report(step, step, "failed" if failed else "finished", sentence)
        self._control.wait_for_stop(LINGER)
        return sentence if failed else ""

    def _first(self, loop: Loop) -> Stepped:
        self._control.say("predicting the first shape" + (COMPILING if self._kernels == "compiling" else ""))
        first = loop.first()
        sentence = self._trouble(first)
        if sentence:
            raise CablecosimError(sentence)
        return first

    def _continued(self, loop: Loop, kept: Checkpoint) -> Stepped:
        """Where an earlier program was."""
        resume(loop, kept)
        self._late, self._sequence = kept.late, self._outlet.frames
        return kept.now

    def _set_up(self) -> Stage:
        if not touch.is_compiled():
            self._control.say("compiling the contact search, once: about 20 s")
        touch.warm_up()
        stage = Stage(self._scene, self._control.say)
        self._control.say("waiting for the shape server")
        self._greet_shape_server()
        return stage

    def _greet_shape_server(self) -> None:
        """Agree on the version of the protocol, a second at a time, so that a stop is heard meanwhile."""
        end = time.monotonic() + self._patience
        while not self._control.is_stopped:
            try:
                kernels = self._asker.greet(min(1.0, max(0.1, end - time.monotonic())))
            except PeerLostError as error:
                if time.monotonic() > end:
                    sentence = f"no shape server at {error.key} within {self._patience:g} s; start it with: python -m shape_server --bind"
                    raise PeerLostError(f"{sentence} {error.key}", key=error.key) from error
            else:
                self._kernels = kernels
                return

    def _snapshot(self, stage: Stage) -> Snapshot:
        return Snapshot(
            session=self._session,
            scene=self._scene,
            solids=stage.solids,
            joints=stage.robot.joint_names if stage.robot is not None else (),
            steps=stage.path.steps,
            versions=versions(),
        )

    def _step(self, stage: Stage, loop: Loop, first: Stepped, begin: int, steps: int) -> str:
        """All time steps from `begin` on; returns why they ended early, or an empty sentence."""
        stepped, shapes = first, tuple(cable.shape for cable in first.cables)
        sentence, was_stopped, step, before = "", False, begin, first
        for step in range(begin, steps + 1):
            wait = self._control.hold()
            if self._control.is_stopped:
                sentence, was_stopped = f"stopped before step {step} of {steps}", True
                break
            try:
                stepped = loop.advance(step) if step else first
            except CablecosimError as error:
                sentence = f"step {step} of {steps}: {error}"
                break
            sentence = self._trouble(stepped)
            if sentence:
                sentence = f"step {step} of {steps}, move '{stage.path.move_at(stepped.posture.time)}': {sentence}"
            shapes = shown(stepped, shapes)
            try:
                if self._scene.relaxation is not None and step and not sentence:
                    stepped = self._relax(stage, loop, before, stepped, step, self._scene.relaxation)
                frame = self._frame(stage, stepped, shapes, step, wait)
                if sentence:
                    self._outlet.last(encode(frame))
                else:
                    self._outlet.step(encode(frame), loop, step, self._late)
            except RecordingError as error:
                sentence = f"step {step} of {steps}: {error}"
                break
            self._has_sent()
            before = stepped
            self._control.report(step, steps, "running", "running")
            if sentence:
                break
        self._control.report(step, steps, "failed" if sentence else "finished", sentence or "finished")
        finished = Finished(session=self._session, frames=self._sequence, failed=bool(sentence), sentence=sentence or "finished")
        self._outlet.last(encode(finished))
        return "" if was_stopped else sentence

    def _relax(self, stage: Stage, loop: Loop, before: Stepped, after: Stepped, step: int, given: Relaxation) -> Stepped:
        """Publish what is between two steps if a cable has snapped; the path goes on when it is at rest. Looking for it is on the bill."""
        from . import relaxation

        begun = time.perf_counter()
        found = relaxation.between(stage, partial(loop.tried, step), before, after, given)
        priced = replace(after, bill=msgspec.structs.replace(after.bill, total=after.bill.total + time.perf_counter() - begun))
        if found is not None:
            start, late = before.posture.time, self._late
            for moment in found[1]:
                self._late = late + start + moment.time - moment.stepped.posture.time
                shapes = tuple(cable.shape for cable in moment.stepped.cables)
                self._outlet.between(encode(self._frame(stage, moment.stepped, shapes, -1, 0.0, relaxing=moment.share)))
                self._has_sent()
            self._late = late + max(0.0, found[0] - (after.posture.time - start))
        stage.put(after.posture)
        return priced

    def _has_sent(self) -> None:
        """Count a frame, and put what it took on the next bill."""
        self._sequence += 1
        self._publishing = time.perf_counter() - self._framed

    def _frame(self, stage: Stage, stepped: Stepped, shapes: tuple[Shape, ...], step: int, wait: float, *, relaxing: float = 0.0) -> Frame:
        begun = time.perf_counter()
        posture, scene = stepped.posture, self._scene
        misses, wrenches = [0.0], {}
        for cable, shape in zip(scene.cables, shapes, strict=True):
            points, holders = stage.grasp_points(cable.name, posture), stage.holders(cable.name)
            for row, gripper in enumerate(scene.grippers[index] for index in holders):
                node = int(np.argmin(np.abs(shape.s - gripper.at)))
                misses.append(float(np.linalg.norm(shape.nodes[node] - points[row])))
                if gripper.arm is not None:
                    wrenches[gripper.arm] = -shape.grasp_wrenches[row]
        torque_ratio = stage.torque_ratio(wrenches, posture)
        worked = self._framed = time.perf_counter()
        bill = msgspec.structs.replace(
            stepped.bill,
            robot=stepped.bill.robot + worked - begun,
            encode=stepped.bill.encode + self._publishing,
            wait=wait + stepped.bill.wait,
            total=stepped.bill.total + worked - begun + self._publishing,
        )
        return Frame(
            session=self._session,
            sequence=self._sequence,
            time=posture.time + self._late,
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

    def _trouble(self, stepped: Stepped) -> str:
        """Why a step is no good; an empty sentence if it is."""
        for cable, hanging in zip(self._scene.cables, stepped.cables, strict=True):
            if hanging.shape.outcome is not Outcome.CONVERGED:
                return f"cable '{cable.name}' is {hanging.shape.outcome.value}: {hanging.shape.sentence}"
        return ""
