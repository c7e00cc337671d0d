"""A budget of time, kept while solving: what the next steps, the next mesh and the answer will take, from what the last ones took.

A Newton step on n segments takes a + b n, with b larger the more contacts there are; both are learnt as the solution goes on. Steps are
taken in slices between which the clock is read, and none is begun that the rest of the budget has no room for. Two things cannot be learnt
in time: the first step with contacts, which is taken for `WITH_CONTACT` times as long for each as one without (measured up to 0.2 times
where the contacts are near the cable), and a Newton step from far away, where finding out which of a hundred contacts push takes up to
fifty times as long as at the end. So where contacts are, an iteration that does not become shorter is given up.

The clock counts the processor's time for this thread, which is that of the wall on a core of one's own (decision 0022).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from types import ModuleType
from typing import Final

import numpy as np

from .equilibrium import CLOSE, GOING_ON, NOT_SHORT, WARM_STEPS, Descent, Settled
from .numpy_vertices import relative
from .rod import Rod, State

SPARE: Final = 0.9  # of the budget, that is planned for
MANY: Final = 8  # contacts beyond which a settling is watched step by step; the kernel that allows it is loaded for them alone
SLICE: Final = 50  # steps between two signs of life
FIRST: Final = 2  # slices of one step each, of which the first may have loaded a library and so tell too much
PART: Final = 8  # of what is left, one slice takes no more than this part
TAIL: Final = 4  # steps from close to an equilibrium to it
WITH_CONTACT: Final = 0.25
WRITING: Final = 0.5  # of the time that a mesh takes
AS_LAST: Final = 1.3  # times the longest of the last steps, for the next one
CLOSER: Final = 2e-3  # rad; after a step this short, one or two more end the iteration
FAR: Final = 1e6  # rad; a settling that ends after one step, however long
IDLE: Final = 2  # steps in a row that do not become shorter, after which an iteration is given up
SHORTER: Final = 0.9  # from one step to the next

Told = Callable[[int, float], None]


class OutOfTime(Exception):
    """What comes next does not fit into the budget; the text says what that is."""


class Clock:
    """Watches one budget; told of progress as any other listener is, and passes it on."""

    def __init__(self, budget: float, told: Told) -> None:
        self.budget = budget  # s
        self.begun = time.thread_time()
        self._told = told
        self._taken: dict[tuple[int, bool], dict[int, float]] = {}  # s a step, by contacts and whether they are exact, and by segments
        self._begun_level = 0.0  # s
        self._level: list[tuple[int, float]] = []  # segments and s of the last two meshes
        self._stepping = 0.0  # s
        self._slices = 0

    def __call__(self, iteration: int, residual: float) -> None:
        """Pass a sign of life on."""
        self._told(iteration, residual)

    @property
    def spent(self) -> float:
        """[s] Of processor time so far."""
        return time.thread_time() - self.begun

    @property
    def rest(self) -> float:
        """[s] Of the budget, a tenth of which is left for what nobody foresees."""
        return SPARE * self.budget - self.spent

    @property
    def left(self) -> float:
        """[s] Of the budget, less what it takes to read a shape and to write the answer."""
        if self._level:
            return self.rest - WRITING * self._level[-1][1]
        # Both are Python, like all that was not stepping so far.
        return self.rest - min(self.spent - self._stepping, 0.25 * self.budget)

    def iterate(self, path: ModuleType, rod: Rod, descent: Descent) -> tuple[Descent, Settled]:
        """As `iteration.iterate`, for as many steps as are well within what is left."""
        while True:
            before, count, begun = descent.settled.iterations, self._fits(rod, is_exact=False), time.thread_time()
            settles = len(rod.touch) <= MANY
            descent, settled = path.iterate(rod, descent, count, settles)
            found = Settled(*descent.settled)
            also = settled[4] if settles and found.why == CLOSE else 0
            self._took(rod, found.iterations - before + also, time.thread_time() - begun, is_exact=False)
            self(found.iterations, float(found.unbalanced))
            if found.why == CLOSE:
                return Descent(*descent), Settled(*settled) if settles else self.settle(path, rod, found.state)
            if found.why != GOING_ON:
                return Descent(*descent), found

    def settle(self, path: ModuleType, rod: Rod, state: State) -> Settled:
        """As `iteration.settle`; step by step with many contacts, or where all steps may not fit, and given up if it goes astray."""
        if len(rod.touch) <= MANY and WARM_STEPS * self._step(rod, is_exact=True) <= self.left:
            return self._settled(path, rod, state, 0.0)
        last, idle, spent = math.inf, 0, 0
        while spent < WARM_STEPS:
            self._fits(rod, is_exact=True)
            found = self._settled(path, rod, state, FAR)
            spent += 1
            turned = 2.0 * float(np.linalg.norm(relative(state.frames, found.state.frames)[:, :3], axis=1).max(initial=0.0))
            if not found.is_converged:  # not finite
                return found._replace(iterations=spent)
            state = State(*found.state)
            if turned < CLOSER:
                end = self._settled(path, rod, state, 0.0)
                return end._replace(iterations=spent + end.iterations)
            idle = 0 if turned < SHORTER * last else idle + 1
            if idle >= IDLE:
                break
            last = turned
        return found._replace(is_converged=False, iterations=spent, why=NOT_SHORT)

    def begin(self) -> None:
        """Begin a mesh."""
        self._begun_level = self.spent

    def level(self, segments: int) -> None:
        """Learn what a whole mesh took, with its reading and its estimate: all since `begin`."""
        self._level = [*self._level[-1:], (segments, self.spent - self._begun_level)]

    def fits(self, segments: int) -> bool:
        """Whether a mesh of so many segments and the answer that is read from it fit."""
        if not self._level:
            expected = self.rest - self.left
        else:
            (few, first), (many, last) = self._level[0], self._level[-1]
            slope = (last - first) / (many - few) if many > few else 0.0
            expected = last + max(slope, 0.5 * last / many) * (segments - many)
        return (1.0 + WRITING) * expected <= self.rest

    def _step(self, rod: Rod, *, is_exact: bool) -> float:
        """[s] What a step on a rod will take; none that nobody has seen yet."""
        rows, segments = len(rod.touch), len(rod.lengths)
        for known in (self._taken.get((rows, is_exact)), self._taken.get((rows, not is_exact))):
            if known:
                return AS_LAST * self._on(known, segments)
        bare = self._taken.get((0, is_exact))
        return self._on(bare, segments) * (1.0 + WITH_CONTACT * rows) if bare else 0.0

    def _on(self, known: dict[int, float], segments: int) -> float:
        """[s] A step on so many segments, from what is known of others: in a straight line from two, half of it fixed from one."""
        if segments in known:
            return known[segments]
        near = sorted(known, key=lambda count: abs(math.log(count / segments)))[:2]
        first = near[0]
        slope = 0.5 * known[first] / first
        if len(near) == 2:
            slope = max((known[near[1]] - known[first]) / (near[1] - first), 0.2 * slope)
        return max(known[first] + slope * (segments - first), 0.5 * known[first])

    def _fits(self, rod: Rod, *, is_exact: bool) -> int:
        """How many steps make a slice."""
        step = self._step(rod, is_exact=is_exact)
        self._slices += 1
        if self._slices <= FIRST and self.left > 0.0:
            return 1
        left = self.left - TAIL * self._step(rod, is_exact=True)
        if left < step:
            rows = len(rod.touch)
            raise OutOfTime(f"a step on {len(rod.lengths)} segments" + (f" with {rows} contacts" if rows else ""))
        return 1 if step <= 0.0 else max(1, min(SLICE, int(left / (PART * step))))

    def _settled(self, path: ModuleType, rod: Rod, state: State, near: float) -> Settled:
        begun = time.thread_time()
        found = Settled(*path.settle(rod, state, near))
        self._took(rod, found.iterations, time.thread_time() - begun, is_exact=True)
        return found

    def _took(self, rod: Rod, steps: int, seconds: float, *, is_exact: bool) -> None:
        """Learn. Without contacts all steps are alike, and the machine makes one longer; with them they become longer and shorter."""
        self._stepping += seconds
        if steps:
            rows, segments, each = len(rod.touch), len(rod.lengths), seconds / steps
            known = self._taken.setdefault((rows, is_exact), {})
            before = known.get(segments, each)
            known[segments] = max(each, 0.5 * (each + before)) if rows else min(each, before)
