"""How well fitted numbers are determined: intervals from the profile of the misfit.

A value of one number belongs to its interval if the others can be chosen so that

    S(theta) <= S_min (1 + F(1, n - k) / (n - k)),

F the quantile of Fisher's distribution at the confidence asked for. Unlike the interval from the curvature of S, this one follows
where the shape depends on the number in one direction only, as for a bending stiffness that is next to nothing.

Source: D. M. Bates, D. G. Watts, "Nonlinear Regression Analysis and Its Applications", Wiley 1988, section 6.1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.optimize import brentq, least_squares
from scipy.stats import f as fisher

from protocol.errors import CablecosimError

if TYPE_CHECKING:
    from .fit import Predicted

CONFIDENCE: Final = 0.95
FARTHEST: Final = math.log(1e3)  # a bound beyond this factor is none
CLOSE: Final = 2e-3  # of a logarithm; a bound is found to this
FIRST_STEP: Final = 0.02  # of a logarithm, growing by `GROWTH` each
GROWTH: Final = 2.0


@dataclass(frozen=True)
class Interval:
    """A fitted number and the interval that holds the true one at the confidence of `CONFIDENCE`."""

    value: float
    low: float  # zero where the points set no lower bound
    high: float  # infinite where they set no upper one

    @property
    def is_determined(self) -> bool:
        """Whether the points bound it on both sides."""
        return self.low > 0.0 and math.isfinite(self.high)


def intervals(predicted: Predicted, theta: np.ndarray, freedom: int) -> dict[str, Interval]:
    """The interval of each number.

    Args:
        predicted: The misfit as a function of the logarithms.
        theta: (k,) The best ones.
        freedom: How many numbers the points say.
    """
    left = freedom - len(theta)
    limit = significant(float((predicted(theta) ** 2).sum()), left)
    found = {}
    for number, name in enumerate(predicted.names):
        low, high = (_bound(_Profile(predicted, theta, number, side, limit)) for side in (-1.0, 1.0))
        found[name] = Interval(math.exp(theta[number]), math.exp(theta[number] - low), math.exp(theta[number] + high))
    predicted(theta)
    return found


def significant(least: float, left: int) -> float:
    """The misfit [m^2] above which one number less, or another value of one, is refuted; `least` is the least, `left` is n - k."""
    return least * (1.0 + float(fisher.ppf(CONFIDENCE, 1, left)) / left)


class _Profile:
    """The least misfit with one logarithm a distance away from the best, over the limit [m^2]; the others follow."""

    def __init__(self, predicted: Predicted, theta: np.ndarray, number: int, side: float, limit: float) -> None:
        self._predicted, self._number, self._side, self._limit = predicted, number, side, limit
        self._best, self._others = theta[number], np.delete(theta, number)

    def __call__(self, distance: float) -> float:
        """Negative inside the interval."""
        if distance == 0.0:
            return -self._limit
        fixed = self._best + self._side * distance
        if not len(self._others):
            return float((self._predicted(np.array([fixed])) ** 2).sum()) - self._limit

        def rest(others: np.ndarray) -> np.ndarray:
            return self._predicted(np.insert(others, self._number, fixed))

        def slope(others: np.ndarray) -> np.ndarray:
            return np.delete(self._predicted.jacobian(np.insert(others, self._number, fixed)), self._number, axis=1)

        low, high = (np.delete(bound, self._number) for bound in self._predicted.bounds)
        found = least_squares(rest, self._others, slope, bounds=(low, high), xtol=1e-5, ftol=1e-7)
        self._others = found.x
        return 2.0 * float(found.cost) - self._limit


def _bound(profile: _Profile) -> float:
    """How far the logarithm may go; infinite if nothing stops it within the factor `FARTHEST`, or there are no shapes beyond."""
    inner, outer = 0.0, FIRST_STEP
    while outer < FARTHEST:
        try:
            if profile(outer) > 0.0:
                return float(brentq(profile, inner, outer, xtol=CLOSE))
        except CablecosimError:
            return math.inf
        inner, outer = outer, GROWTH * outer
    return math.inf
