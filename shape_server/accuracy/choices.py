"""Does the automatic choice of effects keep the tolerance, and what does it cost beside the best that hindsight would choose?

The reference has every effect on and is solved `FINER` times as exactly; of several equilibria it is the one that it reaches from the
answer.
Hindsight tries every set of effects that may be left out, by the rod and by whatever else covers what is left, and takes the cheapest whose
true error is within the tolerance. Times are of CPU, the best of `REPEATS`, by compiled kernels.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import msgspec
import numpy as np
from scipy.interpolate import CubicSpline

from protocol.effects import WITH_BENDING
from protocol.kinds import Model, Outcome
from protocol.messages import Problem, Shape, Start

from .. import effects, kernels
from ..choice import without
from ..solve import solve
from .draws import Draw
from .effect_draws import draw_effects

FINER: Final = 50.0
REPEATS: Final = 15
LEAVES: Final = ("stretch", "preform", "micro_length", "bend_radius", "masses")


@dataclass(frozen=True)
class Chosen:
    """What the automatic choice came to for one request."""

    seed: int
    kind: str
    sentence: str  # why there is nothing to compare; empty if there is
    model: str = ""
    left_out: tuple[str, ...] = ()
    tolerance: float = 0.0  # m
    error: float = 0.0  # m, true
    estimate: float = 0.0  # m
    left_size: float = 0.0  # m, predicted, of all that was left out
    seconds: float = 0.0
    best_seconds: float = 0.0
    best_model: str = ""

    @property
    def is_within(self) -> bool:
        """Whether the tolerance was kept, or the answer says that it was not."""
        return self.error <= self.tolerance or self.estimate > self.tolerance

    @property
    def price(self) -> float:
        """Time over that of the best choice."""
        return self.seconds / self.best_seconds if self.best_seconds else 1.0


def compared(seed: int, *, hindsight: bool = True) -> Chosen:
    """The request of a seed, answered by the automatic choice and by every other one."""
    drawn = draw_effects(seed)
    _, shape = _timed(drawn, drawn.problem, 1)
    if shape.outcome is not Outcome.CONVERGED or shape.error is None:
        return Chosen(seed, drawn.kind, f"no shape: {shape.sentence}")
    exact = reference(drawn.problem, drawn, shape)
    if exact is None:
        return Chosen(seed, drawn.kind, "no reference was found")
    cheapest = _best(drawn, exact) if hindsight else None
    seconds, best, model = 0.0, 0.0, ""
    if cheapest is not None:
        # Alternately and equally often, so that both have the same chance of a quiet moment.
        pairs = [(_timed(drawn, drawn.problem, 1)[0], _timed(drawn, cheapest, 1)) for _ in range(REPEATS)]
        seconds, best, model = min(own for own, _ in pairs), min(other for _, (other, _) in pairs), pairs[0][1][1].model
    return Chosen(
        seed=seed,
        kind=drawn.kind,
        sentence="",
        model=shape.model,
        left_out=tuple(shape.left_out),
        tolerance=drawn.tolerance,
        error=true_distance(shape, exact),
        estimate=shape.error,
        left_size=sum(shape.left_out.values()),
        seconds=seconds,
        best_seconds=best,
        best_model=model,
    )


def compare(seeds: Sequence[int]) -> Iterator[Chosen]:
    """Some seeds, one after the other, for their times count."""
    yield from map(compared, seeds)


def reference(problem: Problem, drawn: Draw, shape: Shape) -> Shape | None:
    """Everything on, as exactly as is worth it, on the branch of an answer."""
    model = Model.CATENARY if problem.cable.bending is None else Model.ROD
    bare = msgspec.structs.replace(problem, effects=None, model=model)
    wanted = drawn.tolerance / FINER
    exact = solve(bare, drawn.gravity, tolerance=wanted, path=kernels)
    if exact.outcome is Outcome.CONVERGED and true_distance(shape, exact) <= 3 * drawn.tolerance:
        return exact
    # Perhaps another branch: that of the answer, on the mesh of the reference and finer ones.
    start = Start(s=shape.s, frames=shape.frames, grasp_forces=np.ascontiguousarray(shape.grasp_wrenches[:, :3]))
    near = solve(msgspec.structs.replace(bare, start=start), drawn.gravity, tolerance=wanted, path=kernels)
    if near.outcome is not Outcome.CONVERGED or near.error is None or near.error > 0.2 * drawn.tolerance:
        return exact if exact.outcome is Outcome.CONVERGED else None
    return near if true_distance(shape, near) < true_distance(shape, exact) else exact


def true_distance(shape: Shape, exact: Shape) -> float:
    """Largest distance [m] of a node from the point of the reference at its arc length."""
    if exact.outcome is not Outcome.CONVERGED:
        return np.inf
    return float(np.linalg.norm(CubicSpline(exact.s, exact.nodes)(shape.s) - shape.nodes, axis=1).max())


def _best(drawn: Draw, exact: Shape) -> Problem | None:
    """The cheapest choice that keeps the tolerance."""
    asked = effects.asked_for(drawn.problem, drawn.gravity)
    leaves = [name for name in LEAVES if name in asked]
    best, cheapest = np.inf, None
    for count in range(len(leaves) + 1):
        for off in combinations(leaves, count):
            for gone in (set(off), {*off, "bending", *WITH_BENDING}):
                problem, _ = without(drawn.problem, drawn.gravity, gone)
                problem = msgspec.structs.replace(problem, effects=None)
                seconds, shape = _timed(drawn, problem, 2)
                if shape.outcome is Outcome.CONVERGED and seconds < best and true_distance(shape, exact) <= drawn.tolerance:
                    best, cheapest = seconds, problem
    return cheapest


def _timed(drawn: Draw, problem: Problem, repeats: int) -> tuple[float, Shape]:
    """Least CPU time [s] of an answer, and the answer."""
    best = np.inf
    for _ in range(repeats):
        begun = time.process_time()
        shape = solve(problem, drawn.gravity, tolerance=drawn.tolerance, path=kernels)
        best = min(best, time.process_time() - begun)
    return best, shape
