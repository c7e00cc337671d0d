"""Are the price tags true? Estimated against true errors, and times against budgets, over random requests.

| what | meaning | wanted |
| --- | --- | --- |
| coverage | the true error of the nodes is below the estimate | in 95 % |
| pessimism | estimate over true error, median; errors below 1e-10 of the length count as that | at most 3 |
| tolerance kept | the true error is below the tolerance asked for, where the answer does not say otherwise | in 99 % |
| budget kept | CPU time is at most 1.2 times the budget asked for | in 95 % |
| answered | the budget reached for a shape; else the answer says that it did not | |
| its coverage | the true error of such a shape is below its estimate, where it has one; none takes a second mesh | in 95 % |

The true error is the largest distance of any node from the exact point at its arc length, from references of other making
(`boundary_value`, `floor`, `hanging`); a catenary promises the polyline between its nodes too. A request
whose reference is not found, or that has no shape, is counted and left out.
"""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from protocol.kinds import Outcome
from protocol.messages import Shape

from .. import kernels
from ..solve import solve
from .draws import Draw, draw, true_error

ROUNDING: Final = 1e-10  # of the length, below which errors are rounding
WARM_UP: Final = 10  # requests, two of each kind
LATE: Final = 1.2  # times the budget
BUDGETS: Final = (2e-3, 0.1)  # s, drawn evenly in the logarithm
COVERAGE, PESSIMISM, TOLERANCE_KEPT, BUDGET_KEPT = 0.95, 3.0, 0.99, 0.95


@dataclass(frozen=True)
class Audited:
    """One request, asked by tolerance and again by budget."""

    seed: int
    kind: str
    sentence: str  # why there is nothing to compare; empty if there is
    error: float = 0.0  # over the length, true
    estimate: float = 0.0  # over the length
    tolerance: float = 0.0  # over the length
    seconds: float = 0.0  # of CPU
    budget: float = 0.0  # s
    spent: float = 0.0  # s of CPU, of the answer to the budget
    is_answered: bool = True  # whether that is a shape
    budget_error: float = 0.0  # over the length, true, of that
    budget_estimate: float | None = None  # over the length; none without a shape or a second mesh

    @property
    def is_covered(self) -> bool:
        """Whether the true error is below the estimate."""
        return self.error <= max(self.estimate, ROUNDING)

    @property
    def pessimism(self) -> float:
        """Estimate over true error, neither below rounding."""
        return max(self.estimate, ROUNDING) / max(self.error, ROUNDING)

    @property
    def is_within(self) -> bool:
        """Whether the tolerance was kept, or the answer says that it was not."""
        return self.error <= self.tolerance or self.estimate > self.tolerance


@dataclass(frozen=True)
class Summary:
    """What the audited requests of one kind come to."""

    kind: str
    cases: int
    unknown: int  # without a shape or a reference
    coverage: float
    pessimism: float
    tolerance_kept: float
    budget_kept: float
    answered: float
    answered_coverage: float  # of the answers by budget that have an estimate
    milliseconds: float  # of CPU, median, by tolerance

    @property
    def is_true(self) -> bool:
        """Whether the price tags are as good as wanted."""
        shares = (
            (self.coverage, COVERAGE),
            (self.tolerance_kept, TOLERANCE_KEPT),
            (self.budget_kept, BUDGET_KEPT),
            (self.answered_coverage, COVERAGE),
        )
        return self.pessimism <= PESSIMISM and all(share >= wanted for share, wanted in shares)


def audit(seeds: Sequence[int]) -> Iterator[Audited]:
    """Audit the requests of some seeds, one after the other, for their times count; the first kernels are loaded before."""
    for seed in range(WARM_UP):
        solve(draw(seed).problem, draw(seed).gravity, budget=1.0, path=kernels)
    yield from map(audited, seeds)


def audited(seed: int) -> Audited:
    """The request of a seed, answered and compared."""
    drawn = draw(seed)
    length = drawn.problem.cable.length
    begun = time.process_time()
    shape = solve(drawn.problem, drawn.gravity, tolerance=drawn.tolerance, path=kernels)
    seconds = time.process_time() - begun
    if shape.outcome is not Outcome.CONVERGED or shape.error is None:
        return Audited(seed, drawn.kind, f"no shape: {shape.sentence}")
    budget, spent, within = _within_budget(drawn, seed)
    is_answered = within.outcome is Outcome.CONVERGED
    exact = drawn.exact(shape)
    if exact is None:
        return Audited(seed, drawn.kind, "no reference was found")
    return Audited(
        seed=seed,
        kind=drawn.kind,
        sentence="",
        error=true_error(shape, exact) / length,
        estimate=shape.error / length,
        tolerance=drawn.tolerance / length,
        seconds=seconds,
        budget=budget,
        spent=spent,
        is_answered=is_answered,
        budget_error=true_error(within, exact) / length if is_answered else 0.0,
        budget_estimate=None if within.error is None else within.error / length,
    )


def summaries(results: Sequence[Audited]) -> list[Summary]:
    """One for each kind and one for all."""
    kinds = list(dict.fromkeys(one.kind for one in results))
    return [*(_summary(kind, [one for one in results if one.kind == kind]) for kind in kinds), _summary("all", results)]


def _summary(kind: str, results: Sequence[Audited]) -> Summary:
    known = [one for one in results if not one.sentence]
    if not known:
        return Summary(kind, len(results), len(results), 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0)
    estimated = [(one.budget_error, one.budget_estimate) for one in known if one.budget_estimate is not None]
    return Summary(
        kind=kind,
        cases=len(results),
        unknown=len(results) - len(known),
        coverage=statistics.fmean(one.is_covered for one in known),
        pessimism=statistics.median(one.pessimism for one in known),
        tolerance_kept=statistics.fmean(one.is_within for one in known),
        budget_kept=statistics.fmean(one.spent <= LATE * one.budget for one in known),
        answered=statistics.fmean(one.is_answered for one in known),
        answered_coverage=statistics.fmean([error <= max(estimate, ROUNDING) for error, estimate in estimated] or [1.0]),
        milliseconds=1e3 * statistics.median(one.seconds for one in known),
    )


def _within_budget(drawn: Draw, seed: int) -> tuple[float, float, Shape]:
    """A budget [s], the CPU time of an answer to it, and that."""
    low, high = np.log(BUDGETS)
    budget = float(np.exp(np.random.default_rng([21, seed]).uniform(low, high)))
    gc.collect()  # what the reference before has left is not the solver's to clear away
    begun = time.process_time()
    shape = solve(drawn.problem, drawn.gravity, budget=budget, path=kernels)
    return budget, time.process_time() - begun, shape
