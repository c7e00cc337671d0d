"""Nonlinear least squares: the numbers with which the predicted shape is nearest to the measured points.

The points p_i are taken to lie on the axis of the cable but for errors of measurement, independent and alike in every measured
direction. Sought are the logarithms theta of the numbers with the least

    S(theta) = sum_i |(1 - t t^T) (p_i - r(s_i; theta))|^2                                             [m^2]

with r the equilibrium shape, s_i the place nearest to p_i and t the tangent there: distances square to the cable, since nobody
measures arc length. With n numbers told by the points (two each in space, one each in a plane) and k numbers sought, the error of
measurement is estimated by sigma^2 = S / (n - k).

What cannot be told: without given forces the shape of an inextensible cable depends on ratios such as EI / (weight per length) only;
GJ matters where the cable is twisted or leaves a plane. So the weight is taken as known unless it is asked for, and of the others those
are fitted that the points determine within a factor of two (from the Jacobian at the best fit). What the posture
says of grasps and loads is taken as exact, friction and plastic bending are not in the model: what they do shows in the misfit.

Source: G. A. F. Seber, C. J. Wild, "Nonlinear Regression", Wiley 1989, chapters 2 and 5.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Final

import msgspec
import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from protocol.errors import CablecosimError
from protocol.kinds import Model, Outcome
from protocol.messages import Problem, Shape, Start
from protocol.scene import Vector

from .. import numpy_path
from ..solve import solve
from .interval import CONFIDENCE, Interval, intervals, significant
from .measured import Measured, misfit
from .parameters import first_guess, is_one_scale, with_values

STEP: Final = 1e-3  # of a logarithm, to either side, for a derivative
SCAN: Final = np.log(10.0) * np.linspace(-2.0, 2.0, 9)  # around the first guess, to find the valley
SPREAD: Final = math.log(1e4)  # a number is sought within this factor of its first guess
TWOFOLD: Final = math.log(2.0)
SINGULAR: Final = 1e-5  # singular value of the Jacobian over the largest, below which two numbers are one
FITTED: Final = ("bending", "twist", "micro_length")  # in the order in which they are tried
FINE: Final = 3e-5  # of the length; a predicted shape is this exact, or ten times more than the points are

Told = Callable[[str], None]


@dataclass(frozen=True)
class Calibration:
    """Numbers fitted to measured points, and what is left over."""

    intervals: dict[str, Interval]  # of each number that was fitted
    left: dict[str, str]  # why each of the others was not
    shape: Shape  # the best fit
    deviations: np.ndarray  # (m,) m, distance of each point from it
    sigma: float  # m, estimated error of measurement, of one coordinate


class Predicted:
    """The misfit of a cable as a function of the logarithms of some of its numbers; starts from its last shape."""

    def __init__(self, problem: Problem, gravity: Vector, measured: Measured, names: tuple[str, ...], path: ModuleType) -> None:
        self.names = names
        self._problem = msgspec.structs.replace(problem, model=Model.ROD)
        self._gravity, self._measured, self._path = gravity, measured, path
        self._start: Start | None = problem.start
        self.guess: np.ndarray = np.log([first_guess(problem.cable, name) for name in names])
        self.bounds = (self.guess - SPREAD, self.guess + SPREAD)
        self.shape: Shape

    def __call__(self, theta: np.ndarray) -> np.ndarray:
        """Misfit (3 m,) [m].

        Raises:
            CablecosimError: If there is no shape.
        """
        cable = with_values(self._problem.cable, self.names, np.exp(theta))
        problem = msgspec.structs.replace(self._problem, cable=cable, start=self._start)
        fine = FINE * cable.length
        shape = solve(problem, self._gravity, tolerance=fine, path=self._path)
        if shape.outcome is not Outcome.CONVERGED and self._start is not None:
            shape = solve(msgspec.structs.replace(problem, start=None), self._gravity, tolerance=fine, path=self._path)
        if shape.outcome is not Outcome.CONVERGED:
            numbers = ", ".join(f"{name} = {value:.4g}" for name, value in zip(self.names, np.exp(theta).tolist(), strict=True))
            raise CablecosimError(f"no shape with {numbers}: {shape.sentence}")
        self._start = Start(s=shape.s, frames=shape.frames, grasp_forces=np.ascontiguousarray(shape.grasp_wrenches[:, :3]))
        self.shape = shape
        return misfit(shape, self._measured).ravel()

    def jacobian(self, theta: np.ndarray) -> np.ndarray:
        """Derivative (3 m, k) [m] by central differences."""
        columns = [(self(theta + step) - self(theta - step)) / (2 * STEP) for step in STEP * np.eye(len(theta))]
        return np.array(columns).T

    def fit(self, theta: np.ndarray) -> np.ndarray:
        """The logarithms with the least misfit, from some nearby."""
        found: np.ndarray = least_squares(self, theta, self.jacobian, bounds=self.bounds, xtol=1e-8, ftol=1e-10).x
        self(found)
        return found


def calibrate(
    problem: Problem,
    gravity: Vector,
    measured: Measured,
    names: tuple[str, ...] = (),
    *,
    path: ModuleType = numpy_path,
    told: Told = lambda sentence: None,
) -> Calibration:
    """Fit numbers of a cable to measured points of its shape.

    Args:
        problem: The cable, with first guesses within a factor of a hundred, and how it was held and loaded when it was measured.
        gravity: [m/s^2].
        measured: Points on the axis.
        names: Numbers to fit; those that the points determine unless given.
        path: `numpy_path`, or the compiled `kernels`.
        told: Told in a sentence how far it is.

    Raises:
        CablecosimError: If there are too few points, if there is no shape, or if the points do not tell the numbers apart.
    """
    wanted = names or ("bending",)
    if problem.cable.bending is None:
        raise CablecosimError("cable.bending: missing; only a cable that resists bending can be calibrated", key="cable.bending")
    if measured.freedom <= len(wanted) + 1:
        raise CablecosimError(f"{len(measured.points)} points are too few for {' and '.join(wanted)}; measure more along the cable")
    if is_one_scale(problem, wanted):
        raise CablecosimError(
            f"the shape tells only the ratios of {', '.join(wanted)}: nothing else sets the scale of the forces; take one of them as known"
        )
    told("looking for the valley of the least misfit")
    predicted = Predicted(problem, gravity, measured, wanted, path)
    theta = predicted.fit(_valley(predicted))
    left: dict[str, str] = {}
    if names:
        _check_apart(predicted, theta)
    else:
        for name in FITTED[1:]:
            told(f"trying whether the points determine {name}")
            predicted, theta = _with_one_more(problem, gravity, measured, path, predicted, theta, name, left)
    told("bounding what the points leave open")
    bounds = intervals(predicted, theta, measured.freedom)
    rest = predicted(theta).reshape(-1, 3)
    sigma = math.sqrt(float((rest**2).sum()) / (measured.freedom - len(theta)))
    return Calibration(bounds, left, predicted.shape, np.linalg.norm(rest, axis=1), sigma)


def _valley(predicted: Predicted) -> np.ndarray:
    """The best of some values of the first number, from the guess outwards, where there are shapes."""
    found: dict[float, float] = {}
    middle = len(SCAN) // 2
    for side in (SCAN[middle:], SCAN[middle - 1 :: -1]):
        for factor in side.tolist():
            theta = predicted.guess + factor * np.eye(len(predicted.guess))[0]
            try:
                found[factor] = float((predicted(theta) ** 2).sum())
            except CablecosimError:
                if factor == 0.0:
                    raise
                break
    best = predicted.guess.copy()
    best[0] += min(found, key=lambda factor: found[factor])
    return best


def _with_one_more(
    problem: Problem,
    gravity: Vector,
    measured: Measured,
    path: ModuleType,
    predicted: Predicted,
    theta: np.ndarray,
    name: str,
    left: dict[str, str],
) -> tuple[Predicted, np.ndarray]:
    """The fit with one more number, if the points determine it; else as it was, with the reason in `left`."""
    names = (*predicted.names, name)
    if is_one_scale(problem, names):
        left[name] = "nothing else sets the scale of the forces"
        return predicted, theta
    more = Predicted(problem, gravity, measured, names, path)
    try:
        tried = more.fit(np.append(theta, more.guess[-1]))
    except CablecosimError as error:
        left[name] = str(error)
        return predicted, theta
    without, now = (float((one(at) ** 2).sum()) for one, at in ((predicted, theta), (more, tried)))
    if getattr(problem.cable, name) is None and without < significant(now, measured.freedom - len(tried)):
        left[name] = "the points are no nearer to a cable with it than chance allows; taken as none"
        return predicted, theta
    spread = _spread(more, tried, measured.freedom)
    if spread > TWOFOLD or abs(tried[-1] - more.guess[-1]) > 0.99 * SPREAD:
        left[name] = f"the points do not determine it within a factor of two ({_factor(spread)}); taken as given"
        return predicted, theta
    return more, tried


def _spread(predicted: Predicted, theta: np.ndarray, freedom: int) -> float:
    """Half the width of the linearised interval of the last logarithm; infinite where it has no effect."""
    jacobian = predicted.jacobian(theta)
    sizes = np.linalg.norm(jacobian, axis=0)
    if not (sizes > 0.0).all() or np.linalg.svd(jacobian / sizes, compute_uv=False)[-1] < SINGULAR:
        return math.inf
    rest = predicted(theta)
    left = freedom - len(theta)
    covariance = np.linalg.inv(jacobian.T @ jacobian) * float(rest @ rest) / left
    return float(student.ppf(0.5 + 0.5 * CONFIDENCE, left) * math.sqrt(covariance[-1, -1]))


def _factor(spread: float) -> str:
    return f"a factor of {math.exp(spread):.3g}" if spread < SPREAD else "not at all"


def _check_apart(predicted: Predicted, theta: np.ndarray) -> None:
    """Refuse numbers that move the points alike."""
    jacobian = predicted.jacobian(theta)
    sizes = np.linalg.norm(jacobian, axis=0)
    blind = [name for name, size in zip(predicted.names, sizes, strict=True) if size < SINGULAR * sizes.max()]
    if blind:
        raise CablecosimError(f"the points do not tell {', '.join(blind)}: another value moves none of them; leave it out")
    if np.linalg.svd(jacobian / sizes, compute_uv=False)[-1] < SINGULAR:
        raise CablecosimError(f"the points do not tell {' and '.join(predicted.names)} apart; take one of them as known")
