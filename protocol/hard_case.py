"""A hard case: what it measures, how it ends, and how a program that holds cases answers for them.

A case measures errors, each against its own tolerance. On the way it may find that the simulation declines (`Declined`), or that what is
called an answer is none (`Unsound`). Each program keeps the cases of its own room and is asked for them by numbers, so that one
that hangs or crashes can be ended, and the others go on; `cablecosim hardcases` does so.
"""

from __future__ import annotations

import json
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final

import numpy as np

from .errors import CablecosimError
from .kinds import Outcome

READY: Final = "ready"  # the line that asks for what the cases need


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
    """The simulation gives no shape, and says why."""

    def __init__(self, outcome: Outcome, sentence: str) -> None:
        super().__init__(sentence)
        self.outcome = outcome


class Unsound(Exception):
    """A shape that cannot be one, or none without a reason."""


@dataclass(frozen=True)
class Case:
    """A problem, or a chain of them, with what must hold of the answer.

    `measure` is given what answers: a path of the shape server's solver, or whom the environment asks. `known` says why the case is known
    to end wrong; `may_decline` that it is known to be refused, or to own up to more than the tolerance; `is_slow` that it takes more
    than about half a second.
    """

    name: str
    family: str
    measure: Callable[[Any], Iterable[Check]]
    is_slow: bool = False
    may_decline: bool = False
    known: str = ""

    def run(self, answering: Any) -> Verdict:
        """Measure, and judge what comes out; warnings count as wrong."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                return _verdict(list(self.measure(answering)))
        except Declined as declined:
            ending = Ending.OUTSIDE if declined.outcome is Outcome.UNSUPPORTED else Ending.REFUSED
            return Verdict(ending, 0.0, f"{declined.outcome.value}: {declined}")
        except CablecosimError as error:
            return Verdict(Ending.REFUSED, 0.0, str(error))
        except Unsound as unsound:
            return Verdict(Ending.WRONG, np.inf, str(unsound))
        except Exception as error:  # whatever else is raised is what the catalogue looks for
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


def serve(cases: Sequence[Case], prepare: Callable[[], tuple[Any, str]]) -> None:
    """Answer for cases until the input ends: a line that names them all, then for every number that is read a line with its verdict.

    Before the first number comes the word `READY`, on which `prepare` makes what the cases are given; the answer is what solves them,
    "compiled" or "numpy".
    """
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # some libraries print when they are imported
    names = [{"family": case.family, "name": case.name, "is_slow": case.is_slow, "known": case.known} for case in cases]
    _say(answers, names)
    answering = None
    for line in sys.stdin:
        if line.strip() == READY:
            answering, kernels = prepare()
            _say(answers, kernels)
            continue
        begun = time.perf_counter()
        verdict = cases[int(line)].run(answering)
        error = verdict.error if np.isfinite(verdict.error) else None
        seconds = time.perf_counter() - begun
        _say(answers, {"ending": verdict.ending.value, "error": error, "sentence": verdict.sentence, "seconds": seconds})


def _say(answers: Any, value: object) -> None:
    answers.write(json.dumps(value) + "\n")
    answers.flush()
