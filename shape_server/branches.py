"""Several stable shapes under the same boundary conditions: found from many curves to start from, told apart, ordered by energy.

A cable between two clamps often has two or more stable shapes: it may bow to one side or the other, run in a loop, or hold a
turn of twist. No method finds all of them; this one starts from curves that go far or little along the clamps, hang down, up and
to both sides, and carry a whole turn of twist or none, and says how many different shapes that gave.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Final

import msgspec
import numpy as np

from protocol.kinds import Hold

from .cold import PULL, curve_frames
from .descent import relax
from .equilibrium import Settled
from .rod import State
from .system import System
from .task import Task

PULLS: Final = (PULL, 0.2, 1.0)
SAME: Final = 1e-3  # of the length, between the nodes of one shape found twice
EVEN: Final = 1e-9  # of the typical energy; shapes this near in energy keep the order in which they were found


def stable_shapes(task: Task, system: System) -> list[Settled]:
    """All different stable shapes found (without contacts), the one of least energy first."""
    rod, found = system.rod, list[Settled]()
    for frames in _starts(task, system):
        state = system.start(frames)
        begin = state._replace(force=np.zeros_like(state.force))
        for kick in (False, True):
            there = State(*begin)._replace(frames=task.path.retract(frames, task.path.kick(rod))) if kick else begin
            shape = relax(task.path, rod, there, task.progress)
            if shape.is_converged and shape.is_stable and not any(_is_same(task, system, shape, other) for other in found):
                found.append(shape)
    grain = EVEN * rod.force_scale * rod.length
    return sorted(found, key=lambda shape: round(float(task.path.energy(rod, shape.state, shape.seen)) / grain))


def _starts(task: Task, system: System) -> Iterator[np.ndarray]:
    """Frames (n-1, 4) of all curves to start from."""
    problem = task.problem
    gravity = np.asarray(task.gravity, dtype=float)
    down = gravity / np.linalg.norm(gravity) if gravity.any() else np.array([0.0, 0.0, -1.0])
    aside = np.cross(problem.grasps.position[-1] - problem.grasps.position[0], down)
    size = float(np.linalg.norm(aside))
    sides = [down, -down, aside / size, -aside / size] if size > 1e-9 else [down, -down]
    clamps = sum(hold is not Hold.HINGE for hold in problem.grasps.hold)
    own = problem.turns or (0,) * max(clamps - 1, 0)
    twists = [own, *((own[0] + more, *own[1:]) for more in (1, -1))] if own else [own]
    for turns, pull, side in product(twists, PULLS, sides):
        yield curve_frames(system.mesh, msgspec.structs.replace(problem, turns=turns), side, task.path, pull)


def _is_same(task: Task, system: System, one: Settled, other: Settled) -> bool:
    """Whether two shapes are one; without any load, also if they are one turned about the line between the ends."""
    twists = [system.twist(task.path, shape.state.frames) for shape in (one, other)]
    if abs(twists[0] - twists[1]) > 1.0:
        return False
    if not system.rod.loads.any():
        energies = [task.path.energy(system.rod, shape.state, shape.seen) for shape in (one, other)]
        return bool(abs(energies[0] - energies[1]) < SAME**2 * (abs(energies[0]) + abs(energies[1])))
    return bool(np.linalg.norm(one.seen.nodes - other.seen.nodes, axis=1).max() < SAME * system.rod.length)
