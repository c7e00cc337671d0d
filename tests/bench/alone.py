"""Times calls, and tells those that had their core to themselves from those that shared it.

Two hardware threads of a core share its arithmetic. Work of somebody else on the other one leaves the clock as it is, so that a chain of
products that wait for each other takes the same 20 us, but makes sums that could go on at once take up to 2.7 times as long, and so
all that we time. A short such sum is timed for two seconds, and before and after every call; where both are near the least of all, the call
was alone, and a call waits for that while there is patience. If the core was never free, the least is too long and too many calls count:
figures are then worse than the truth. Calls should be about equally long, for short ones are undisturbed more often.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Final, NamedTuple, TypeVar

import numpy as np
from numba import njit

Result = TypeVar("Result")

WATCH: Final = 2.0  # s, in which the least is looked for
SHARED: Final = 1.15  # times the least, from which on the core counts as shared; up to 2.7 were measured
PATIENCE: Final = 20.0  # s, for which the calls of a watch together wait for the core to be free
FEW: Final = 10  # calls below which no median is given


class Medians(NamedTuple):
    """Of the CPU time of many calls [ms]."""

    all: float
    alone: float  # of those that had the core to themselves; not a number if they were few
    count: int  # of these


class Stopwatch:
    """Times one kind of call."""

    def __init__(self) -> None:
        self._times: list[float] = []
        self._yards: list[float] = []
        self._patience = PATIENCE

    def time(self, call: Callable[[], Result]) -> Result:
        before, began = _yard(), time.perf_counter()
        while before > SHARED * LEAST and self._patience > 0.0:
            before, now = _yard(), time.perf_counter()
            self._patience, began = self._patience - (now - began), now
        began = time.process_time()
        result = call()
        self._times.append(1e3 * (time.process_time() - began))
        self._yards.append(max(before, _yard()))
        return result

    def medians(self) -> Medians:
        least = min(LEAST, *self._yards)
        alone = [took for took, yard in zip(self._times, self._yards, strict=True) if yard < SHARED * least]
        return Medians(statistics.median(self._times), statistics.median(alone) if len(alone) >= FEW else float("nan"), len(alone))


@njit(error_model="numpy")  # type: ignore[untyped-decorator]
def _sums(factors: np.ndarray, sums: np.ndarray) -> None:
    for _ in range(60):
        for place in range(len(sums)):
            sums[place] = 0.999 * sums[place] + factors[place]


FACTORS, SUMS = np.ones(256), np.ones(256)
_sums(FACTORS, SUMS)


def _yard() -> float:
    """Time [s] of a sum of always the same length, the least of two."""
    least = np.inf
    for _ in range(2):
        began = time.perf_counter()
        _sums(FACTORS, SUMS)
        least = min(least, time.perf_counter() - began)
    return least


def _least() -> float:
    least, end = np.inf, time.perf_counter() + WATCH
    while time.perf_counter() < end:
        least = min(least, _yard())
    return least


LEAST: Final = _least()
