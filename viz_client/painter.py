"""Pictures drawn in a process of their own, so that drawing never keeps the recorder from recording."""

from __future__ import annotations

import importlib
import multiprocessing
import os
import re
import signal
from collections import deque
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

from protocol import recording
from protocol.codec import decode
from protocol.messages import Frame

from .picture import Studio

DIRECTORY: Final = "pictures"
PICTURE_LIMIT: Final = 60.0  # s that one picture may take; about 3 s are usual


class Painter:
    """Draws key postures in the order offered; nothing but `finish` waits.

    Args:
        run: Folder of the run; holds the recording, whose first message is already there.
        drawn: Told of every picture that has been stored.
        failed: Told a sentence when a picture could not be drawn.
    """

    def __init__(self, run: Path, *, drawn: Callable[[Path], None], failed: Callable[[str], None]) -> None:
        self._run = run
        self._drawn = drawn
        self._failed = failed
        self._offered = 0
        self._waiting: deque[tuple[bytes, Path]] = deque()
        self._busy: Path | None = None
        self._process: multiprocessing.process.BaseProcess | None = None
        self._pipe: Connection | None = None

    def offer(self, frame: bytes, name: str) -> None:
        """Have the encoded frame drawn some time, as `pictures/<n>_<name>.png`."""
        self._offered += 1
        words = re.sub(r"[^\w-]+", "_", name).strip("_")
        self._waiting.append((frame, self._run / DIRECTORY / f"{self._offered:02d}_{words}.png"))

    def turn(self, patience: float = 0.0) -> None:
        """Take note of a picture that is done and start the next, waiting at most `patience` seconds."""
        if self._busy is not None and self._pipe is not None and self._pipe.poll(patience):
            self._collect(self._pipe, self._busy)
        if self._busy is None and self._waiting:
            self._start_next()

    def finish(self) -> None:
        """Wait until all that was offered is drawn, or has failed."""
        while self._busy is not None or self._waiting:
            before = self._busy
            self.turn(PICTURE_LIMIT)
            if before is not None and self._busy is before:
                self._failed(f"{before.name} took longer than {PICTURE_LIMIT:g} s; it and the pictures after it are left out")
                self._waiting.clear()
                break
        self.close()

    def close(self) -> None:
        """End the process, with what it is drawing."""
        if self._pipe is not None:
            self._pipe.close()
        if self._process is not None:
            self._process.terminate()
            self._process.join()
        self._pipe = self._process = self._busy = None

    def _start_next(self) -> None:
        if self._pipe is None:
            context = multiprocessing.get_context("spawn")
            self._pipe, theirs = context.Pipe()
            self._process = context.Process(target=_paint, args=(theirs, self._run / recording.FILE_NAME), daemon=True)
            self._process.start()
            theirs.close()
        frame, path = self._waiting.popleft()
        path.parent.mkdir(exist_ok=True)
        self._busy = path
        # The process waits to read, so this returns at once even when the pipe's buffer is smaller than the frame.
        self._pipe.send((frame, path))

    def _collect(self, pipe: Connection, path: Path) -> None:
        self._busy = None
        try:
            problem = pipe.recv()
        except EOFError:
            self._failed(f"{path.name} and the pictures after it are left out: the drawing process died")
            self._waiting.clear()
            return
        if problem:
            self._failed(f"{path.name} could not be drawn: {problem}")
        else:
            self._drawn(path)


def _paint(pipe: Connection, recording_path: Path) -> None:
    """Life of the drawing process: a picture for every frame that comes, until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(5)  # the programs that compute go first
    _import_quietly()
    with Studio(recording.read(recording_path).snapshot) as studio:
        while True:
            try:
                data, path = pipe.recv()
            except EOFError:
                return
            frame = decode(data)
            assert isinstance(frame, Frame)
            try:
                studio.draw(frame, path)
            except (ValueError, OSError, IndexError) as error:
                pipe.send(f"{error}")
            else:
                pipe.send("")


def _import_quietly() -> None:
    """Import PyBullet, which prints when it was built."""
    kept, nothing = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    os.dup2(nothing, 2)
    importlib.import_module("pybullet")
    os.dup2(kept, 2)
