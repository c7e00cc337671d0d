"""True error against CPU time while the far clamp of a rod goes round a loop: by tolerance, mesh, time step and program.

Two hundred motions of 4.4 mm and 0.7 degrees, in a plane or in space, are followed by `solve` from the last shape, as the environment asks,
by `Follower`, and by every other program that can follow a rod and is installed, all in this process and on this core. Every twentieth
posture has a reference by collocation (`peers.references`), which none of them knows. A longer time step is fewer, longer motions.

Time is CPU time of the whole loop without what comes before it: the median motion times their number. The error is the largest distance
of any node from the reference, over the length, at all postures that have one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import msgspec
import numpy as np

from protocol.cable import Cable
from protocol.errors import CablecosimError
from protocol.kinds import Hold, Outcome
from protocol.messages import Grasps, Problem, Shape, Start

from .. import kernels
from ..solve import solve
from .draws import GRAVITY
from .peers import installed, ours, timing
from .peers.collocation import Solved
from .peers.motions import MOTIONS, G, Motions, planar_motions, spatial_motions
from .peers.references import references
from .study import AUTOMATIC, Row, Studied

TOLERANCES: Final = tuple(10.0**-k for k in range(2, 7))  # over the length
STRIDES: Final = (1, 2, 4, 10, 20)  # motions in one; all lead to the postures that have a reference
FOLLOWER: Final = "Follower, by mesh"
TIME_STEP: Final = "time step"
STEP_TOLERANCE: Final = 1e-4  # over the length
LOST: Final = 1.0  # over the length; a program that is this far off has lost the rod

Told = Callable[[str], None]


@dataclass(frozen=True)
class Moving:
    """A rod whose clamps move."""

    name: str
    title: str
    motions: Motions


def standard() -> tuple[Moving, ...]:
    """Both that have references of other making."""
    return (
        Moving("moving in a plane", "the far clamp goes round a loop in a plane, in 200 motions", planar_motions(3e-3)),
        Moving("moving in space", "the same in space, with 180 degrees of end twist", spatial_motions(3e-3)),
    )


def study(moving: Moving, told: Told = lambda sentence: None) -> Studied:
    """Run every program at every setting round the loop."""
    told(f"{moving.name}: references")
    motions = moving.motions
    known = references(motions)
    rows = [*_by_tolerance(motions, known), *_ours(motions, known)]
    peers, missing = list[str](), list[str]()
    for peer in installed.FOLLOWING:
        if not installed.is_installed(peer):
            missing.append(installed.missing(peer))
            continue
        peers.append(peer.NAME)
        numbers = list(range(1, MOTIONS + 1)) if peer.REMEMBERS else sorted(known)[1:]
        for setting in peer.sweep(motions):
            told(f"{moving.name}: {peer.NAME}, {setting}")
            follower = peer.prepare(motions, known[0], setting)
            row = timing.follow(peer.NAME, setting, follower, motions, known, numbers=numbers)
            rows += _row(peer.NAME, str(setting), row, len(follower.s), MOTIONS)
    return Studied(moving.name, moving.title, tuple(rows), (), tuple(peers), tuple(missing), "the whole loop")


def _by_tolerance(motions: Motions, known: dict[int, Solved]) -> Iterator[Row]:
    for tolerance in TOLERANCES:
        yield from _led(AUTOMATIC, f"{tolerance:g} L", motions, known, tolerance, 1)
    for stride in STRIDES:
        yield from _led(TIME_STEP, f"{MOTIONS // stride} motions", motions, known, STEP_TOLERANCE, stride)


def _led(group: str, setting: str, motions: Motions, known: dict[int, Solved], tolerance: float, stride: int) -> Iterator[Row]:
    warm = Warm(motions, known[0], tolerance * motions.rod.length)
    numbers = list(range(stride, MOTIONS + 1, stride))
    row = timing.follow("", setting, warm, motions, known, numbers=numbers)
    estimate, factorisations = warm.estimate / motions.rod.length, warm.factorisations // max(warm.moved // len(numbers), 1)
    for one in _row(group, setting, row, len(warm.s), len(numbers)):
        yield Row(one.group, one.setting, one.error, estimate, one.seconds, one.nodes, factorisations, "rod")


def _ours(motions: Motions, known: dict[int, Solved]) -> Iterator[Row]:
    for setting in ours.sweep(motions):
        follower = ours.prepare(motions, known[0], setting)
        row = timing.follow("", setting, follower, motions, known, numbers=list(range(1, MOTIONS + 1)))
        yield from _row(FOLLOWER, str(setting), row, len(follower.s), MOTIONS)


def _row(group: str, setting: str, row: timing.Row, nodes: int, count: int) -> list[Row]:
    """A row of the study; none for a program that lost the rod."""
    if not row.error < LOST:
        return []
    return [Row(group, setting, row.error, np.inf, 1e-3 * row.milliseconds * count, nodes, 0, group)]


class Warm:
    """`solve` from the last shape, on the nodes that a first shape of this tolerance has; as a `timing.Follower`.

    The branch is that of the reference: a clamp that is turned by half a turn the other way is in the same pose.
    """

    def __init__(self, motions: Motions, first: Solved, tolerance: float) -> None:
        rod = motions.rod
        self._cable = Cable(
            name="rod", length=rod.length, diameter=5e-3, mass_per_length=rod.weight / G, bending=rod.bending, twist=rod.twist
        )
        self._tolerance = tolerance  # m
        self.estimate = 0.0  # m, the largest
        self.factorisations = self.moved = 0
        s = self._solve(motions.position[0], motions.quaternion[0], None).s
        start = Start(s=s, frames=first.frames(0.5 * (s[1:] + s[:-1])), grasp_forces=first.forces())
        self._last = self._solve(motions.position[0], motions.quaternion[0], start)

    @property
    def s(self) -> np.ndarray:
        """(n,) [m] Arc lengths of the nodes."""
        return self._last.s

    def move(self, position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
        """Nodes (n, 3) [m] after the clamps have moved."""
        last = self._last
        start = Start(s=last.s, frames=last.frames, grasp_forces=np.ascontiguousarray(last.grasp_wrenches[:, :3]))
        self._last = self._solve(position, quaternion, start)
        self.estimate = max(self.estimate, np.inf if self._last.error is None else self._last.error)
        self.factorisations += self._last.cost.factorisations
        self.moved += 1
        return self._last.nodes

    def _solve(self, position: np.ndarray, quaternion: np.ndarray, start: Start | None) -> Shape:
        held = Grasps(
            s=np.array([0.0, self._cable.length]), position=position.copy(), quaternion=quaternion.copy(), hold=(Hold.CLAMP, Hold.CLAMP)
        )
        problem = Problem(cable=self._cable, grasps=held)
        asked = problem if start is None else msgspec.structs.replace(problem, start=start)
        shape = solve(asked, GRAVITY, tolerance=self._tolerance, extrapolate=False, path=kernels)
        if shape.outcome is not Outcome.CONVERGED:
            raise CablecosimError(f"a moving rod was lost: {shape.sentence}")
        return shape
