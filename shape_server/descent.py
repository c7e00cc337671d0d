"""Drives the iterations of `equilibrium` from Python: in slices, so that a long one can say that it is alive.

Compiled, all steps that settle take less than a blink, and are one call; by numpy each says that it has been taken.
"""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numpy as np

from . import numpy_path
from .clock import SLICE, Clock
from .equilibrium import CLOSE, GOING_ON, NO_MINIMUM, RELAX_STEPS, Descent, Settled
from .rod import Rod, State

Progress = Callable[[int, float], None]
KICKS = 4  # times that the way off a saddle is doubled


def relax(path: ModuleType, rod: Rod, state: State, progress: Progress) -> Settled:
    """Descend to a minimum of the energy from any state, then settle there."""
    descent, saddles = begun(path, rod, state._replace(push=np.maximum(state.push, 0.0))), 0
    while True:
        if isinstance(progress, Clock):
            descent, settled = progress.iterate(path, rod, descent)
        elif path is numpy_path:
            descent, settled = path.descend(rod, descent, 1), None
        else:
            descent, settled = path.iterate(rod, descent, SLICE, True)
        found = descent.settled
        progress(found.iterations, float(found.unbalanced))
        if found.why == CLOSE:
            settled = settle(path, rod, found.state, progress) if settled is None else Settled(*settled)
            iterations = found.iterations + settled.iterations
            if settled.is_converged and settled.is_stable:
                return settled._replace(iterations=iterations)
            saddles += settled.is_converged
            descent = _go_on(path, rod, Descent(*descent), settled, iterations, saddles)
            if descent.settled.why == NO_MINIMUM:
                return descent.settled
        elif found.why != GOING_ON:
            return Settled(*found)


def begun(path: ModuleType, rod: Rod, state: State) -> Descent:
    """A descent that has not begun."""
    seen, view = path.look(rod, state, np.ascontiguousarray(rod.touch["normal"]))
    start = Settled(seen, view, False, False, 0, np.inf, GOING_ON)
    stiffness = float(path.begin_stiffness(rod.weight, rod.stiffest, rod.shortest))
    return Descent(start, state.force, state.push, state.drag, stiffness, 0.0, 0, np.inf)


def _go_on(path: ModuleType, rod: Rod, descent: Descent, settled: Settled, iterations: int, saddles: int) -> Descent:
    """The descent after an equilibrium that is none to settle at; beside it if that is a saddle, or it came there with help, as to one.

    What slides is a spring in a descent, which leads back to a saddle that is left by a little: each time it is left by twice as much.
    """
    found, state, view = descent.settled, descent.settled.state, descent.settled.seen
    if descent.helped > 0 or settled.is_converged:
        far = 2.0 ** min(saddles - 1, KICKS) if saddles and len(rod.rub.rows) else 1.0
        kicked = State(*state)._replace(frames=path.retract(state.frames, far * path.kick(rod)))
        state, view = path.look(rod, kicked, np.ascontiguousarray(rod.touch["normal"]))
    over = iterations >= RELAX_STEPS
    beside = Settled(state, view, False, False, iterations, found.unbalanced, NO_MINIMUM if over else GOING_ON)
    return descent._replace(settled=beside, helped=0)


def settle_or_relax(path: ModuleType, rod: Rod, begin: State, progress: Progress) -> Settled:
    """Settle from a state nearby; relax from it where that finds no stable equilibrium."""
    after = settle(path, rod, begin, progress)
    progress(after.iterations, float(after.unbalanced))
    if after.is_converged and after.is_stable:
        return after
    relaxed = relax(path, rod, off_the_saddle(path, rod, begin, after), progress)
    return relaxed._replace(iterations=relaxed.iterations + after.iterations)


def settle(path: ModuleType, rod: Rod, begin: State, progress: Progress) -> Settled:
    """Settle from a state nearby, for a cold start, which relaxes too: see `iteration`."""
    if isinstance(progress, Clock):
        return progress.settle(path, rod, begin)
    if path is numpy_path:
        return settle_alone(path, rod, begin, 0.0, progress)
    return Settled(*path.iterate(rod, begun(path, rod, begin), 0, True)[1])


def settle_alone(path: ModuleType, rod: Rod, begin: State, near: float, progress: Progress) -> Settled:
    """As `iteration.settle`, of which whoever does not relax loads nothing else."""
    if path is not numpy_path:
        return Settled(*path.settle(rod, begin, near))
    state, view = path.look(rod, begin, np.ascontiguousarray(rod.touch["normal"]))
    found = Settled(state, view, False, False, 0, np.inf, GOING_ON)
    while found.why == GOING_ON:
        found = path.settle_on(rod, found, near, 1)
        progress(found.iterations, float(found.unbalanced))
    return found


def off_the_saddle(path: ModuleType, rod: Rod, begin: State, after: Settled) -> State:
    """Where to relax from: beside the unstable equilibrium that was found, or the beginning if there was none."""
    if not after.is_converged:
        return begin
    return State(*after.state)._replace(frames=path.retract(after.state.frames, path.kick(rod)))
