"""A scene played to its end in this process, as a recording would hold it: the run itself, without sockets, files or other programs."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Any, cast

from in_process import Direct

from env_server.asking import Asker
from env_server.loop import Loop
from env_server.server import Run
from env_server.stage import Stage
from protocol.codec import decode
from protocol.messages import Finished, Frame
from protocol.recording import Frames
from scenarios.load import load
from scenarios.paper.figure import Figure, Result
from scenarios.paper.recorded import Recorded


class _Ears:
    """In the place of the streams: keeps every frame."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.finished: Finished | None = None

    def between(self, frame: bytes) -> None:
        self.frames.append(cast(Frame, decode(frame)))

    def step(self, frame: bytes, *_: object) -> None:
        self.between(frame)

    def last(self, message: bytes) -> None:
        found = decode(message)
        if isinstance(found, Finished):
            self.finished = found
        else:
            self.between(message)


class _Nobody:
    """In the place of who controls the run: lets it run."""

    is_stopped = False

    def hold(self) -> float:
        return 0.0

    def report(self, *_: object) -> None:
        pass


def play(scene_name: str, settings: tuple[str, ...] = ()) -> Recorded:
    """Every frame of a built-in scene, those between two equilibria too."""
    scene, ears, run = load(scene_name, settings), _Ears(), cast(Any, object.__new__(Run))
    run._scene, run._session, run._outlet, run._control = scene, "played", ears, _Nobody()
    run._sequence, run._publishing, run._framed, run._late = 0, 0.0, 0.0, 0.0
    with closing(Stage(scene, lambda _: None)) as stage:
        loop = Loop(stage, cast(Asker, Direct()), "played")
        run._step(stage, loop, loop.first(), 0, stage.path.steps)
    assert ears.finished is not None
    return Recorded(scene_name, Path(), scene, cast(Frames, ears.frames), not ears.finished.failed, ears.finished.sentence)


def measured(figure: Figure) -> Result:
    """What is measured of a figure from all its takes."""
    return figure.measure({take.name: play(take.scene, take.settings) for take in figure.takes})
