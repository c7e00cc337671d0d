"""Runs a scene: starts the three programs, waits until they are ready, follows the run, and ends them in good order.

Addresses are ipc sockets in a directory of the run's own, made for this user only. The run folder is made when the
environment is ready and not before, so a scene that cannot be simulated leaves nothing behind.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final

from protocol import recording, scene_file
from protocol.address import private_directory
from protocol.channel import Client, Subscriber
from protocol.codec import decode
from protocol.errors import CablecosimError, PeerLostError, RecordingError, SceneError
from protocol.messages import AnyMessage, Done, Error, Frame, Message, StartRun, Statistics, StatisticsRequest, Stop
from protocol.scene import Scene

from . import summary
from .children import Child, end_all
from .progress import Display

START_LIMIT: Final = 300.0  # s until the environment is ready, with every kernel compiled for the first time
ANSWER_LIMIT: Final = 60.0  # s for an answer of the environment, which may be in the middle of a hard step
STOP_LIMIT: Final = 10.0  # s for the environment to end a run that is stopped
DRAW_LIMIT: Final = 600.0  # s for pictures and the replay page after the last step
POLL: Final = 0.1  # s between looks at the run


@dataclass(frozen=True)
class Ended:
    """How a run ended."""

    folder: Path
    summary: summary.Summary
    interrupted: bool


def launch(scene: Scene, name: str, show: Display, *, out: Path | None = None, kernels: str = "auto", replay: bool = True) -> Ended:
    """Run a scene to its end, or until it is interrupted.

    Args:
        scene: What to simulate.
        name: Of the scene, for the run folder.
        show: Where progress goes.
        out: The run folder; without it, `runs/<name>-<time>/` is made.
        kernels: "auto", "compiled" or "numpy", for the shape server.
        replay: Whether to write `replay.html`.

    Raises:
        SceneError: If the environment refuses the scene; nothing is left behind.
        PeerLostError: If a program dies or falls silent; names it.
        KeyboardInterrupt: If interrupted before the first step; nothing is left behind.
    """
    begun = time.monotonic()
    _check_free(out)
    run = _Run(private_directory(), show)
    interrupted, failure = False, None
    try:
        run.start(scene, kernels)
        run.wait_until_ready()
        folder = run.open_folder(out or Path("runs") / f"{name}-{datetime.now():%Y%m%d-%H%M%S}")
        try:
            run.follow(replay=replay)
        except KeyboardInterrupt:
            interrupted = True
            run.stop()
        except CablecosimError as error:
            failure = error
    finally:
        run.close()
    result = _summarise(folder, failure, time.monotonic() - begun)
    return Ended(folder, result, interrupted)


def _summarise(folder: Path, failure: CablecosimError | None, wall: float) -> summary.Summary:
    """Write the summary, also of a run that failed on its way, and then raise what it failed of."""
    try:
        result = summary.summarise(recording.read(folder / recording.FILE_NAME), wall=wall)
        summary.write(folder, result)
    except RecordingError as error:
        raise failure or error from error
    if failure is not None:
        raise PeerLostError(f"{failure}\nthe first {result['steps']} steps are in {folder}", key=failure.key) from failure
    return result


class _Run:
    """Three children, the sockets to them, and the folder that their files go to."""

    def __init__(self, box: Path, show: Display) -> None:
        self._box = box
        self._show = show
        self._folder: Path | None = None
        self._children: list[Child] = []
        self._shape, self._frames, self._live, self._control = (f"ipc://{box}/{name}" for name in ("shape", "frames", "live", "control"))
        self._client = Client(self._control, "launcher")
        self._view = Subscriber(self._live, latest_only=True)

    def start(self, scene: Scene, kernels: str) -> None:
        """Start the shape server and the environment."""
        file = self._box / "scene.json"
        file.write_bytes(scene_file.write(scene))
        self._add("shape_server", ("--bind", self._shape, "--kernels", kernels))
        addresses = ("--shape", self._shape, "--frames", self._frames, "--live", self._live, "--control", self._control)
        self._add("env_server", ("--scene", str(file), *addresses))

    def wait_until_ready(self) -> None:
        """Wait until the environment says that it could begin."""
        end = time.monotonic() + START_LIMIT
        self._show.say("starting the shape server and the environment")
        self._greet(end)
        while (state := self._statistics()).state != "ready":
            if state.state == "failed":
                raise SceneError(state.sentence)
            if time.monotonic() > end:
                raise PeerLostError(f"env_server was not ready within {START_LIMIT:g} s; it says: {state.sentence}", key="env_server")
            self._show.say(state.sentence)
            time.sleep(POLL)

    def open_folder(self, folder: Path) -> Path:
        """Make the run folder, under another name if a run of the same second has it."""
        made, number = folder, 1
        while made.exists() and any(made.iterdir()):
            number += 1
            made = folder.with_name(f"{folder.name}-{number}")
        try:
            (made / "logs").mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise CablecosimError(f"{made}: cannot be made ({error.strerror}); give another folder with --out", key=str(made)) from error
        self._folder = made
        self._show.say(f"recording to {made}")
        return made

    def follow(self, *, replay: bool) -> None:
        """Start the recorder and the run, and wait for the end of both."""
        assert self._folder is not None
        options = () if replay else ("--no-replay",)
        viewer = self._add("viz_client", ("--frames", self._frames, "--control", self._control, "--out", str(self._folder), *options))
        self._command(StartRun(recorders=1))
        contacts = 0
        while True:
            over = viewer.code is not None  # looked at before the environment is asked, so that a quick end is no early one
            state = self._state()
            contacts = self._contacts(contacts)
            if state is None or state.state in ("finished", "failed"):
                break
            if over:
                raise PeerLostError(viewer.obituary(), key=viewer.name)
            if state.state == "running":
                self._show.step(state.step, state.steps, contacts)
            elif state.state == "paused":
                self._show.say(state.sentence)
            time.sleep(POLL)
        if state is not None:
            self._show.step(state.step, state.steps, contacts)
        self._show.say("drawing pictures and the replay page" if replay else "drawing pictures")
        self._await(viewer, DRAW_LIMIT)

    def stop(self) -> None:
        """End the run early: what is recorded stays."""
        self._show.say("stopping; press Ctrl-C again to stop at once")
        self._command(Stop(), limit=STOP_LIMIT)
        for child in self._children[2:]:
            self._await(child, DRAW_LIMIT)

    def close(self) -> None:
        """End the programs, keep their logs, and tidy up; whatever happened before."""
        try:
            self._say_stop()
        finally:
            end_all(self._children)
            for socket in (self._client, self._view):
                socket.close()
            if self._folder is not None:
                for child in self._children:
                    shutil.move(child.log, self._folder / "logs" / child.log.name)
            shutil.rmtree(self._box, ignore_errors=True)
            self._show.close()

    def _add(self, name: str, arguments: Sequence[str]) -> Child:
        child = Child(name, arguments, self._box / f"{name}.log")
        self._children.append(child)
        return child

    def _greet(self, end: float) -> None:
        while True:
            try:
                self._client.greet(1.0)
            except PeerLostError:
                self._check()
                if time.monotonic() > end:
                    raise
            else:
                return

    def _statistics(self) -> Statistics:
        while not isinstance(answer := self._ask(StatisticsRequest(), ANSWER_LIMIT), Statistics):
            if isinstance(answer, Error):
                raise SceneError(answer.sentence, key=answer.key)
        return answer

    def _state(self) -> Statistics | None:
        """How far the run is; None if the environment has ended well by itself."""
        try:
            return self._statistics()
        except PeerLostError:
            if self._children[1].code == 0:
                return None
            raise

    def _command(self, message: Message, limit: float = ANSWER_LIMIT) -> None:
        answer = self._ask(message, limit)
        if isinstance(answer, Error):
            raise SceneError(answer.sentence, key=answer.key)

    def _ask(self, message: Message, limit: float) -> AnyMessage:
        """Ask the environment, and look after the children while it thinks."""
        self._client.send(message)
        wanted = (Statistics, Error) if isinstance(message, StatisticsRequest) else (Done, Error)
        end = time.monotonic() + limit
        while time.monotonic() < end:
            self._check()
            answer = self._client.receive(POLL)
            if isinstance(answer, wanted):
                return answer
        raise PeerLostError(f"env_server gave no answer to a {type(message).__name__} within {limit:g} s", key="env_server")

    def _check(self) -> None:
        """Raise if a child has died; one that ended well before its time has died too."""
        for child in self._children:
            child.check()
        if self._children[1].code is not None:
            raise PeerLostError(self._children[1].obituary(), key="env_server")

    def _await(self, child: Child, limit: float) -> None:
        if not child.wait(limit):
            raise PeerLostError(f"{child.name} did not end within {limit:g} s; see logs/{child.log.name} in {self._folder}", key=child.name)
        child.check()

    def _contacts(self, before: int) -> int:
        """Contacts in the newest frame; as before if there is none."""
        data = self._view.receive(0)
        frame = decode(data) if data is not None else None
        return len(frame.touching.s) if isinstance(frame, Frame) else before

    def _say_stop(self) -> None:
        """Ask environment and shape server to end, and give them a moment."""
        if not self._children:
            return
        farewell = Client(self._shape, "launcher")
        self._client.send(Stop())
        farewell.send(Stop())
        end = time.monotonic() + 2.0
        for child in self._children[:2]:
            child.wait(max(0.0, end - time.monotonic()))
        farewell.close()


def _check_free(out: Path | None) -> None:
    if out is None:
        return
    parent = next(folder for folder in (out.absolute(), *out.absolute().parents) if folder.exists())
    if not parent.is_dir() or not os.access(parent, os.W_OK):
        raise CablecosimError(f"{out}: cannot be made, {parent} is no folder that you can write to; give another one", key=str(out))
    if out.exists() and not (out.is_dir() and not any(out.iterdir())):
        raise CablecosimError(f"{out}: exists and is not an empty folder; give another one, for nothing is overwritten", key=str(out))
