"""A take as it was recorded: key postures by name, places along a cable, and which of its parts are straight.

Everything here is read from the recording, as anyone could read it; nothing is asked of the programs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from protocol.errors import CablecosimError
from protocol.kinds import Outcome
from protocol.messages import Frame, Shape
from protocol.recording import FILE_NAME, Frames, read
from protocol.scene import Scene

APART: Final = 1e-3  # of the length; places nearer to each other are one, as where a point touches both chords at a bend


@dataclass(frozen=True)
class Recorded:
    """The recording of one take."""

    name: str
    folder: Path
    scene: Scene
    frames: Frames
    is_finished: bool  # whether it came to the end of its path
    sentence: str  # how it ended

    def at(self, picture: str) -> Frame:
        """The frame of a key posture.

        Raises:
            CablecosimError: If the run did not come there.
        """
        for frame in self.frames:
            if frame.picture == picture:
                return frame
        raise CablecosimError(f"take '{self.name}' did not come to '{picture}': {self.sentence}", key=picture)

    def during(self, move: str) -> Iterator[Frame]:
        """Frames of equilibria during a move, in order."""
        return (frame for frame in self.frames if frame.move == move and not frame.relaxation)

    def motion(self) -> list[Frame]:
        """The frames of the first artificial motion, with the equilibrium before it and the one after.

        Raises:
            CablecosimError: If nothing has snapped.
        """
        frames = list(self.frames)
        first = next((index for index, frame in enumerate(frames) if frame.relaxation), 0)
        last = next((index for index in range(first, len(frames)) if not frames[index].relaxation), 0)
        if not first or not last:
            raise CablecosimError(f"take '{self.name}' shows no motion from one equilibrium to the next", key=self.name)
        return frames[first - 1 : last + 1]

    @property
    def converged(self) -> int:
        """How many frames have nothing but converged shapes."""
        return sum(all(shape.outcome is Outcome.CONVERGED for shape in frame.shapes) for frame in self.frames)

    def weight(self, cable: int = 0) -> float:
        """Weight of a cable per length [N/m]."""
        return self.scene.cables[cable].mass_per_length * float(np.linalg.norm(self.scene.gravity))

    def cable(self, name: str) -> int:
        """Index of a cable."""
        return [cable.name for cable in self.scene.cables].index(name)

    def body(self, name: str) -> int:
        """Index of a body, which is also that of its solid."""
        return [body.name for body in self.scene.bodies].index(name)


def open_take(name: str, folder: Path) -> Recorded:
    """The recording in the folder of a run."""
    record = read(folder / FILE_NAME)
    finished = record.finished
    is_finished = finished is not None and not finished.failed
    return Recorded(name, folder, record.snapshot.scene, record.frames, is_finished, finished.sentence if finished else record.ending)


def place_at(shape: Shape, s: float) -> np.ndarray:
    """Where (3,) [m] an arc length [m] of a shape is."""
    return np.array([np.interp(s, shape.s, column) for column in shape.nodes.T])


def obstacle(take: Recorded, frame: Frame, name: str = "obstacle") -> np.ndarray:
    """Where (3,) [m] a body is."""
    place: np.ndarray = frame.poses[take.body(name), :3]
    return place


def touched(frame: Frame, cable: int = 0) -> np.ndarray:
    """Arc lengths (c,) [m] at which a cable is touched, growing."""
    return np.sort(frame.touching.s[frame.touching.cable == cable])


def slacks(frame: Frame, cable: int = 0) -> list[float]:
    """How much longer each part of a cable between held and touched places is than its chord, over its length; 0 is straight."""
    shape, least = frame.shapes[cable], APART * float(frame.shapes[cable].s[-1])
    places = sorted([*frame.grasps[cable].s.tolist(), *touched(frame, cable).tolist()])
    apart = [s for before, s in pairwise([-1.0, *places]) if s - before > least]
    chords = [float(np.linalg.norm(place_at(shape, t) - place_at(shape, s))) for s, t in pairwise(apart)]
    return [1.0 - chord / span for chord, span in zip(chords, np.diff(apart).tolist(), strict=True)]
