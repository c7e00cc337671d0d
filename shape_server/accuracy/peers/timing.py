"""One program at one setting along the motions: its time, its error, and how programs compare at equal error.

Time is CPU time of the process per motion, the median over the motions after a warm-up, so compiling does not count; a lap that did not
take long is run again, up to three times, and the fastest counts, since a neighbour on the machine slows this process too. The error is the
largest distance of any node to the reference, over the length, over all motions that have a reference: a program that lags, drifts or
leaves the branch pays for it. Each node is compared at its own arc length, so nobody pays for interpolation.
"""

from __future__ import annotations

import math
import resource
import statistics
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .collocation import Solved
from .motions import Motions

WARM_UP = 10  # motions that are not timed
LAPS = 3
LONG = 0.4  # s of CPU time, of a lap that is not run again
BATCH = 100  # calls timed together


class Follower(Protocol):
    """A program that follows the clamps of a rod."""

    @property
    def s(self) -> np.ndarray:
        """(n,) [m] Arc lengths of the nodes."""

    def move(self, position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
        """Nodes (n, 3) [m] after the clamps have moved to (2, 3) [m] and (2, 4); not a number where it found no shape."""


@dataclass(frozen=True)
class Row:
    """What one program did at one setting."""

    program: str
    setting: str
    milliseconds: float  # CPU time per motion
    error: float  # largest distance of a node over the length; infinite where it found no shape


def follow(
    program: str, setting: object, follower: Follower, motions: Motions, references: Mapping[int, Solved], *, numbers: list[int]
) -> Row:
    """Lead one program through the motions with these numbers, round and round."""
    fastest, error = math.inf, 0.0
    for _ in range(LAPS):
        times, missed = _lap(follower, motions, references, numbers)
        fastest = min(fastest, statistics.median(times[min(WARM_UP, len(times) // 4) :]))
        error = max(error, missed)
        if sum(times) > LONG or error > 1:
            break
    return Row(program, str(setting), 1e3 * fastest, error)


def _lap(follower: Follower, motions: Motions, references: Mapping[int, Solved], numbers: list[int]) -> tuple[list[float], float]:
    """CPU time [s] of every motion, and the largest error over the length."""
    times, error = [], 0.0
    for motion in numbers:
        position, quaternion = motions.position[motion], motions.quaternion[motion]
        before, began = children_time(), time.process_time()
        nodes = follower.move(position, quaternion)
        ended = time.process_time()
        times.append(ended - began + children_time() - before)
        if motion in references:
            error = max(error, distance(nodes, references[motion].positions(follower.s)) / motions.rod.length)
        if error > 1:
            break
    return times, error


def children_time() -> float:
    """[s] CPU time of the programs that this process has started and seen end."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def milliseconds(call: Callable[[int], object]) -> float:
    """CPU time of a call that is too short to be timed alone; it is told the number of the call."""
    batches = []
    for _ in range(LAPS * WARM_UP):
        began = time.process_time()
        for number in range(BATCH):
            call(number)
        batches.append((time.process_time() - began) / BATCH)
    return 1e3 * min(batches)


def distance(nodes: np.ndarray, exact: np.ndarray) -> float:
    """Largest distance [m] of a node; infinite where one is not a number."""
    far = float(np.linalg.norm(nodes - exact, axis=1).max())
    return far if math.isfinite(far) else math.inf


def frontier(rows: Iterable[Row]) -> list[Row]:
    """The settings that no other setting beats in both time and error, fastest first."""
    best: list[Row] = []
    for row in sorted(rows, key=lambda row: (row.milliseconds, row.error)):
        if row.error < (best[-1].error if best else math.inf):
            best.append(row)
    return best


def time_for(rows: Iterable[Row], error: float) -> float:
    """Milliseconds to stay below an error, between the settings of a frontier on straight lines of log-log axes.

    Coarser than its coarsest setting a program is as fast as that; finer than its finest it does not get: infinite.
    """
    best = frontier(rows)
    if not best or error < best[-1].error:
        return math.inf
    errors, times = (np.log([getattr(row, name) for row in best[::-1]]) for name in ("error", "milliseconds"))
    return float(np.exp(np.interp(math.log(error), errors, times)))


def least_ratio(ours: Iterable[Row], theirs: Iterable[Row], *, coarsest: float, finest: float) -> tuple[float, float]:
    """How many times longer a peer takes at equal error where it does best, and that error; none of its errors: infinite.

    Between settings both times are straight lines, so the least ratio is at a setting of either, or at the coarsest error.
    """
    mine, other = frontier(ours), frontier(theirs)
    reached = [error for error in (coarsest, *(row.error for row in mine + other)) if finest <= error <= coarsest]
    found = [(time_for(other, error) / time_for(mine, error), error) for error in reached if math.isfinite(time_for(other, error))]
    return min(found, default=(math.inf, math.nan))


def table(rows: Iterable[Row]) -> str:
    """The rows as text."""
    lines = [f"{'program':<20} {'setting':<40} {'ms / motion':>12} {'error / L':>10}"]
    lines += [f"{row.program:<20} {row.setting:<40} {row.milliseconds:>12.4f} {row.error:>10.1e}" for row in rows]
    return "\n".join(lines)
