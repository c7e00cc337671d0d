"""The cable that sags between two clamps and touches nothing, from which contacts start."""

from __future__ import annotations

from functools import cache
from types import ModuleType

import numpy as np

from protocol.kinds import Model
from protocol.messages import Problem, Shape, Start

from .answers import found
from .posing import GRAVITY, cable, span


@cache
def free(path: ModuleType, count: int = 100) -> Shape:
    """The sagging cable that touches nothing."""
    begin = found(Problem(cable=cable(), grasps=span(), model=Model.ROD), GRAVITY, path)
    s = np.linspace(0.0, 1.0, count + 1)
    frames = begin.frames[np.clip(np.searchsorted(begin.s, (s[1:] + s[:-1]) / 2) - 1, 0, len(begin.frames) - 1)]
    start = Start(s=s, frames=frames, grasp_forces=begin.grasp_wrenches[:, :3].copy())
    return found(Problem(cable=cable(), grasps=span(), start=start, model=Model.ROD), GRAVITY, path, extrapolate=False)
