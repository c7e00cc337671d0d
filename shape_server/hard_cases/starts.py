"""Absurd starts: random, folded back, coiled, too coarse, uneven, with wild forces; the answer must be one all the same."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from types import ModuleType
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.hard_case import Case, Check
from protocol.kinds import Model
from protocol.messages import Problem, Start

from .answers import found
from .balance import balance
from .posing import ALONG_X, GRAVITY, cable, frame, span

FAMILY: Final = "absurd starts"
COUNT: Final = 50
BACK: Final = frame((-1.0, 0.0, 0.0))
STARTS: Final = {
    "random": Rotation.random(COUNT, random_state=np.random.default_rng(1)).as_quat(),
    "straight back": np.tile(BACK, (COUNT, 1)),
    "zigzag": np.array([ALONG_X if j % 2 else BACK for j in range(COUNT)]),
    "coiled": Rotation.from_rotvec(np.outer(np.arange(COUNT), [0.0, 1.5, 0.0])).as_quat(),
    "twisted": (Rotation.from_quat(ALONG_X) * Rotation.from_rotvec(np.outer(np.arange(COUNT), [0.0, 0.0, 2.0]))).as_quat(),
    "signs mixed": np.tile(ALONG_X, (COUNT, 1)) * np.where(np.arange(COUNT) % 3, 1.0, -1.0)[:, None],
}


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for name, frames in STARTS.items():
        for force in (0.0, 1e3, 1e8):
            yield Case(f"{name}, forces of {force:g} N", FAMILY, partial(_settled, np.linspace(0, 1, COUNT + 1), frames, force))
    for count in (1, 2, 3, 5):
        few = np.tile(ALONG_X, (count, 1))
        yield Case(f"{count} segments", FAMILY, partial(_settled, np.linspace(0, 1, count + 1), few, 0.0), may_decline=True)
    for smallest in (1e-3, 1e-6, 1e-9):
        s = np.concatenate([np.linspace(0, 0.5, 20), 0.5 + smallest * np.arange(1, 4), np.linspace(0.55, 1, 18)])
        frames = np.tile(ALONG_X, (len(s) - 1, 1))
        yield Case(f"segments of {smallest:g} m beside those of 25 mm", FAMILY, partial(_settled, s, frames, 0.0))


def _settled(s: np.ndarray, frames: np.ndarray, force: float, path: ModuleType) -> Iterable[Check]:
    start = Start(s=s, frames=frames, grasp_forces=np.full((2, 3), force))
    problem = Problem(cable=cable(), grasps=span(), start=start, model=Model.ROD)
    return balance(problem, found(problem, GRAVITY, path, extrapolate=False), GRAVITY, within=1e-4)
