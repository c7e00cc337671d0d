"""A time step as it ended: where everything is, what touches, and where its time went."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import msgspec
import numpy as np

from protocol.kinds import Outcome
from protocol.messages import Audited, Bill, Problem, Shape, TouchPoints

from .crossed import Crossed
from .hanging import Hanging
from .stage import Posture, Stage

LEAP: Final = 10.0  # times the tolerance, an error that is not the mesh's
LEAPS_MOST: Final = 3  # halvings for that


@dataclass
class Meter:
    """Seconds spent in the present step, by part."""

    solve: float = 0.0
    search: float = 0.0
    robot: float = 0.0
    wire: float = 0.0
    wait: float = 0.0

    def bill(self, *, encode: float, total: float) -> Bill:
        """For the frame; seconds spent on messages and in all are measured elsewhere."""
        return Bill(solve=self.solve, search=self.search, robot=self.robot, encode=encode, wire=self.wire, wait=self.wait, total=total)


@dataclass
class Try:
    """What one attempt at a step came to."""

    cables: tuple[Hanging, ...] = ()
    crossed: Crossed | None = None
    rounds: int = 0
    is_settled: bool = False
    may_have_passed: bool = False
    coupling: tuple[float, ...] = ()  # m, what one more round would change of every cable
    answered: tuple[tuple[Problem, ...], tuple[Shape, ...]] = (), ()  # in the last round; none where cables touch each other

    @property
    def has_shapes(self) -> bool:
        """Whether every cable has one."""
        return all(cable.shape.outcome is Outcome.CONVERGED for cable in self.cables)

    def may_stay(self, tolerance: float, depth: int) -> bool:
        """Whether the step is done: settled, past nothing, and not with a leap of its error where cables rub on each other.

        Such an error is that of two meshes, on one of which a cable sticks and slides on the other. It is as large on any mesh, and small
        in a smaller step.
        """
        if not self.is_settled or self.may_have_passed:
            return False
        if depth >= LEAPS_MOST or self.crossed is None or not any(pair.mu for pair in self.crossed.pairs):
            return True
        return all(cable.shape.error is None or cable.shape.error < LEAP * tolerance for cable in self.cables)


@dataclass(frozen=True)
class Stepped:
    """A time step as it ended."""

    posture: Posture
    cables: tuple[Hanging, ...]
    rounds: int
    collisions: tuple[tuple[str, str], ...]
    bill: Bill
    crossed: Crossed | None = None  # what the cables do to each other; None where all pass through each other
    coupling: tuple[float, ...] = ()  # m, what one more round would change of every cable; none between two equilibria
    audits: tuple[Audited, ...] = ()  # whose answers count from this step on


def touch_points(stage: Stage, stepped: Stepped) -> TouchPoints:
    """The contacts of a step that carry a force, for its frame."""
    pushes = [(index, cable.boundary.pushes) for index, cable in enumerate(stepped.cables)]
    return TouchPoints(
        cable=np.concatenate([np.full(len(p.s), index, dtype=np.int64) for index, p in pushes]),
        body=np.concatenate([stage.solid_of_surface[p.surface] for _, p in pushes]),
        s=np.concatenate([p.s for _, p in pushes]),
        point=np.vstack([p.point for _, p in pushes]),
        force=np.vstack([p.force for _, p in pushes]),
    )


def shown(stepped: Stepped, last: tuple[Shape, ...]) -> tuple[Shape, ...]:
    """The shapes of a step; a cable without one is shown as it was last, with the outcome and sentence of now."""
    return tuple(
        cable.shape
        if cable.shape.outcome is Outcome.CONVERGED
        else msgspec.structs.replace(before, outcome=cable.shape.outcome, sentence=cable.shape.sentence)
        for cable, before in zip(stepped.cables, last, strict=True)
    )
