"""One hard case, what it measures, and how it ends.

A case measures errors, each against its own tolerance. On the way it may find that the solver declines (`Declined`), or that
what it calls an answer is none (`Unsound`).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from types import ModuleType

import numpy as np

from protocol.errors import CablecosimError, MessageError
from protocol.kinds import Outcome
from protocol.messages import Problem, Shape
from protocol.scene import Vector

from ..solve import solve


class Ending(Enum):
    """How a case ended."""

    RIGHT = "right"
    REFUSED = "refused"
    OUTSIDE = "outside"
    WRONG = "wrong"


@dataclass(frozen=True)
class Check:
    """An error with its tolerance, both in `unit`; `told` is the error that the answer itself owns up to."""

    what: str
    error: float
    tolerance: float
    unit: str = "m"
    told: float = 0.0


@dataclass(frozen=True)
class Verdict:
    """How a case ended: the worst error over its tolerance, and a sentence."""

    ending: Ending
    error: float
    sentence: str


class Declined(Exception):
    """The solver gives no shape, and says why."""

    def __init__(self, outcome: Outcome, sentence: str) -> None:
        super().__init__(sentence)
        self.outcome = outcome


class Unsound(Exception):
    """The solver gives a shape that cannot be one, or none without a reason."""


Measure = Callable[[ModuleType], Iterable[Check]]


@dataclass(frozen=True)
class Case:
    """A problem, or a chain of them, with what must hold of the answer.

    `known` says why the case is known to end wrong; `may_decline` that the solver is known to refuse it, or to own up to more than
    the tolerance; `is_slow` that it takes more than about half a second.
    """

    name: str
    family: str
    measure: Measure
    is_slow: bool = False
    may_decline: bool = False
    known: str = ""

    def run(self, path: ModuleType) -> Verdict:
        """Solve by a path, `numpy_path` or the compiled `kernels`, and judge what comes out; warnings count as wrong."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                return _verdict(list(self.measure(path)))
        except Declined as declined:
            ending = Ending.OUTSIDE if declined.outcome is Outcome.UNSUPPORTED else Ending.REFUSED
            return Verdict(ending, 0.0, f"{declined.outcome.value}: {declined}")
        except CablecosimError as error:
            return Verdict(Ending.REFUSED, 0.0, str(error))
        except Unsound as unsound:
            return Verdict(Ending.WRONG, np.inf, str(unsound))
        except Exception as error:  # whatever else a solver raises is what the catalogue looks for
            return Verdict(Ending.WRONG, np.inf, f"raised {type(error).__name__}: {error}")


def _verdict(checks: list[Check]) -> Verdict:
    if not checks:
        return Verdict(Ending.WRONG, np.inf, "nothing was measured")
    # A comparison with NaN is false, so that what is not a number is wrong.
    bad = [check for check in checks if not check.error <= check.tolerance]
    worst = max(bad or checks, key=lambda check: check.error / check.tolerance if check.error == check.error else np.inf)
    ratio = worst.error / worst.tolerance
    sentence = f"{worst.what}: {worst.error:.2g} {worst.unit}, tolerance {worst.tolerance:.2g}"
    if not bad:
        return Verdict(Ending.RIGHT, ratio, sentence)
    if all(check.error <= check.told for check in bad):
        return Verdict(Ending.OUTSIDE, ratio, f"{sentence}; the answer says {worst.told:.2g}")
    return Verdict(Ending.WRONG, ratio, sentence)


def found(
    problem: Problem,
    gravity: Vector,
    path: ModuleType,
    *,
    tolerance: float = 1e-3,
    extrapolate: bool = True,
    margin: bool = False,
) -> Shape:
    """The shape of a problem, finite and stable.

    Raises:
        Declined: If the solver gives none, with its sentence.
        Unsound: If the shape is not finite or not certified as stable, or none is given without a sentence.
    """
    try:
        shape = solve(problem, gravity, tolerance=tolerance, extrapolate=extrapolate, margin=margin, path=path)
    except MessageError as error:  # the problem is a valid message, so what is refused here is the solver's own answer
        raise Unsound(f"an answer that no message can carry: {error}") from error
    if shape.outcome is not Outcome.CONVERGED:
        if len(shape.s) or len(shape.sentence) <= 20:
            raise Unsound(f"{shape.outcome.value} with the sentence {shape.sentence!r} and {len(shape.s)} nodes")
        raise Declined(shape.outcome, shape.sentence)
    values = (shape.nodes, shape.frames, shape.tension, shape.curvature, shape.grasp_wrenches, shape.contact_forces)
    if not all(np.isfinite(value).all() for value in values):
        raise Unsound("converged, with values that are not finite")
    if not shape.is_stable or len(shape.s) < 2:
        raise Unsound("converged, without being stable")
    # A round cable that is free to swing about an axis has the margin zero, but for rounding.
    if shape.margin is not None and shape.margin < -1e-6 * float(np.abs(shape.tension).max()):
        raise Unsound(f"called stable, with a margin of {shape.margin:.2g} N")
    return shape


def refused(problem: Problem, gravity: Vector, path: ModuleType, words: str) -> Iterable[Check]:
    """What a problem without an answer must end in: a refusal whose sentence holds some words."""
    try:
        shape = found(problem, gravity, path)
    except Declined as declined:
        if words not in str(declined):
            raise Unsound(f"refused for another reason than {words!r}: {declined}") from declined
        raise
    raise Unsound(f"an answer to a problem that has none: {shape.sentence} ({shape.model})")
