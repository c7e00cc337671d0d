"""What the solver answers to a hard case: a sound shape, or a reason why there is none."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from types import ModuleType

import numpy as np

from protocol.errors import MessageError
from protocol.hard_case import Check, Declined, Unsound
from protocol.kinds import Outcome
from protocol.messages import Problem, Shape
from protocol.scene import Vector

from ..solve import solve


@dataclass(eq=False)
class Asked:
    """A path of the solver that keeps what was asked on it and answered, up to what `why_not` has a reason against."""

    path: ModuleType
    why_not: Callable[[Problem, Vector, int], str]  # of a problem under gravity, after so many others
    answers: list[tuple[Problem, Vector, Shape]] = field(default_factory=list)
    refusal: str = ""

    def about_to(self, problem: Problem, gravity: Vector) -> ModuleType:
        """The path on which a problem is to be solved.

        Raises:
            Declined: If there is a reason against it.
        """
        self.refusal = self.refusal or self.why_not(problem, gravity, len(self.answers))
        if self.refusal:
            raise Declined(Outcome.UNSUPPORTED, self.refusal)
        return self.path


def found(
    problem: Problem,
    gravity: Vector,
    path: ModuleType | Asked,
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
    kernels = path.about_to(problem, gravity) if isinstance(path, Asked) else path
    try:
        shape = solve(problem, gravity, tolerance=tolerance, extrapolate=extrapolate, margin=margin, path=kernels)
    except MessageError as error:  # the problem is a valid message, so what is refused here is the solver's own answer
        raise Unsound(f"an answer that no message can carry: {error}") from error
    if isinstance(path, Asked):
        path.answers.append((problem, gravity, shape))
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
