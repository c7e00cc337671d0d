"""Runs a scene: starts the three programs, waits until they are ready, follows the run, and ends them in good order.

Addresses are ipc sockets in a directory of the run's own, made for this user only. The run folder is made when the
environment is ready and not before, so a scene that cannot be simulated leaves nothing behind. A program that is killed, or
falls silent, is started again (`keeper.py`), and the run goes on where it was.
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
from protocol.keys import read as read_keys
from protocol.messages import Frame, Stop
from protocol.scene import Scene

from . import summary
from .children import Child, end_all
from .keeper import AUDITOR, FROM_OUTSIDE, SILENCE, Keeper
from .progress import Display
from .remote import POLL, START_LIMIT, Remote
from .watch import Watch

DRAW_LIMIT: Final = 600.0  # s for pictures and the replay page after the last step
JOURNAL: Final = "journal"  # folder of the environment's own record, while it runs


@dataclass(frozen=True)
class Ended:
    """How a run ended."""

    folder: Path
    summary: summary.Summary
    interrupted: bool


def launch(
    scene: Scene,
    name: str,
    show: Display,
    *,
    out: Path | None = None,
    kernels: str = "auto",
    replay: bool = True,
    pictures: bool = True,
    silence: float = SILENCE,
    keys: Path | None = None,
) -> Ended:
    """Run a scene to its end, or until it is interrupted.

    Args:
        scene: What to simulate.
        name: Of the scene, for the run folder.
        show: Where progress goes.
        out: The run folder; without it, `runs/<name>-<time>/` is made.
        kernels: "auto", "compiled" or "numpy", for the shape server.
        replay: Whether to write `replay.html` and `report.html`.
        pictures: Whether to draw the key postures.
        silence: [s] Without a sign of life after which a program is ended and started again.
        keys: Folder of keys to encrypt with; see `protocol.keys`.

    Raises:
        SceneError: If the environment refuses the scene; nothing is left behind.
        PeerLostError: If a program dies or falls silent; names it.
        KeyboardInterrupt: If interrupted before the first step; nothing is left behind.
    """
    begun = time.monotonic()
    _check_free(out)
    run = _Run(private_directory(), show, silence, keys)
    interrupted, failure = False, None
    try:
        run.start(scene, kernels)
        run.wait_until_ready()
        folder = run.open_folder(out or Path("runs") / f"{name}-{datetime.now():%Y%m%d-%H%M%S}")
        try:
            run.follow(replay=replay, pictures=pictures)
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
    """Three programs, the way to the environment, and the folder that their files go to."""

    def __init__(self, box: Path, show: Display, silence: float, keys: Path | None) -> None:
        self._box = box
        self._show = show
        self._folder: Path | None = None
        names = ("shape", "frames", "live", "control", "audit")
        self._shape, self._frames, self._live, self._control, self._audit = (f"ipc://{box}/{name}" for name in names)
        self._options = ("--keys", str(keys)) if keys is not None else ()
        self._keys = read_keys(keys) if keys is not None else None
        self._keeper = Keeper(box, show.say, silence)
        self._watch = Watch(self._keeper)
        self._remote = Remote(self._control, self._keeper, self._keys)
        self._view = Subscriber(self._live, latest_only=True, keys=self._keys)

    def start(self, scene: Scene, kernels: str) -> None:
        """Start the shape server and the environment."""
        file = self._box / "scene.json"
        file.write_bytes(scene_file.write(scene))
        self._kernels = ("--kernels", kernels, *self._options)
        self._keeper.start("shape_server", ("--bind", self._shape, *self._kernels))
        listening = ("--frames", self._frames, "--live", self._live, "--control", self._control)
        addresses = ("--shape", self._shape, "--audit", self._audit, *listening)
        self._keeper.start("env_server", ("--scene", str(file), *addresses, "--journal", str(self._box / JOURNAL), *self._options))

    def wait_until_ready(self) -> None:
        """Wait until the environment says that it could begin."""
        end = time.monotonic() + START_LIMIT
        self._show.say("starting the shape server and the environment")
        self._remote.greet(end)
        while (state := self._remote.statistics()).state != "ready":
            if state.state == "failed":
                raise SceneError(state.sentence)
            if time.monotonic() > end:
                raise PeerLostError(f"env_server was not ready within {START_LIMIT:g} s; it says: {state.sentence}", key="env_server")
            self._watch.look(state)
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
            (made / JOURNAL).mkdir()
        except OSError as error:
            raise CablecosimError(f"{made}: cannot be made ({error.strerror}); give another folder with --out", key=str(made)) from error
        # It grows like the recording, so it is kept where there is room for that; the environment was told before this folder had a name.
        (self._box / JOURNAL).symlink_to(made.resolve() / JOURNAL)
        self._folder = made
        self._show.say(f"recording to {made}")
        return made

    def follow(self, *, replay: bool, pictures: bool) -> None:
        """Start the recorder and the run, and wait for the end of both."""
        assert self._folder is not None
        wanted = [word for word, is_wanted in (("--no-replay", replay), ("--no-pictures", pictures)) if not is_wanted]
        options = (*self._options, *wanted, "--patience", f"{START_LIMIT:g}")
        arguments = ("--frames", self._frames, "--control", self._control, "--out", str(self._folder), *options)
        self._keeper.start("viz_client", arguments, again=(*arguments, "--resume"))
        self._watch.follow(self._folder)
        contacts = 0
        while True:
            over = self._keeper.child("viz_client").code == 0  # looked at before the environment, so that a quick end is no early one
            state = self._remote.state()
            contacts = self._contacts(contacts)
            if state is None or state.state in ("finished", "failed"):
                break
            self._watch.look(state)
            if state.wants_audits and AUDITOR not in self._keeper.names:
                arguments = ("--bind", self._audit, "--gives-way", *self._kernels)
                self._keeper.start(AUDITOR, arguments, program="shape_server")
            if state.state == "ready":
                self._remote.start()
            elif over:
                raise PeerLostError(self._keeper.child("viz_client").obituary(), key="viz_client")
            elif state.state == "running":
                self._show.step(state.step, state.steps, contacts)
            elif state.state == "paused":
                self._show.say(state.sentence)
            time.sleep(POLL)
        if state is not None:
            self._show.step(state.step, state.steps, contacts)
        self._show.say("drawing pictures and the replay page" if replay else "drawing pictures" if pictures else "recording")
        self._await_recorder()

    def stop(self) -> None:
        """End the run early: what is recorded stays."""
        self._show.say("stopping; press Ctrl-C again to stop at once")
        self._keeper.let_end()
        self._remote.stop()
        self._await_recorder()

    def close(self) -> None:
        """End the programs, keep their logs, and tidy up; whatever happened before."""
        self._keeper.let_end()
        children = self._keeper.children
        try:
            self._say_stop(children)
        finally:
            end_all(children)
            self._remote.close()
            self._view.close()
            if self._folder is not None:
                for child in children:
                    shutil.move(child.log, self._folder / "logs" / child.log.name)
                shutil.rmtree(self._folder / JOURNAL, ignore_errors=True)
            shutil.rmtree(self._box, ignore_errors=True)
            self._show.close()

    def _await_recorder(self) -> None:
        """Wait until the recorder has drawn everything; the environment goes on answering meanwhile, and is started again if need be."""
        if "viz_client" not in self._keeper.names:
            return
        end = time.monotonic() + DRAW_LIMIT
        while self._keeper.child("viz_client").code != 0:
            if time.monotonic() > end:
                sentence = f"viz_client did not end within {DRAW_LIMIT:g} s; see logs/viz_client.log in {self._folder}"
                raise PeerLostError(sentence, key="viz_client")
            is_there = self._keeper.child("env_server").code in (None, *FROM_OUTSIDE)
            self._watch.look(self._remote.state() if is_there else None)
            self._keeper.mend()
            time.sleep(POLL)

    def _contacts(self, before: int) -> int:
        """Contacts in the newest frame; as before if there is none."""
        data = self._view.receive(0)
        frame = decode(data) if data is not None else None
        return len(frame.touching.s) if isinstance(frame, Frame) else before

    def _say_stop(self, children: Sequence[Child]) -> None:
        """Ask environment and shape server to end, and give them a moment."""
        if not children:
            return
        farewell = Client(self._shape, "launcher", self._keys)
        self._remote.say_stop()
        farewell.send(Stop())
        end = time.monotonic() + 2.0
        for child in children[:2]:
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
