"""What a descent lowers, the energy with rows as penalties and multipliers (augmented Lagrangian), and the search along a step."""

from __future__ import annotations

import numpy as np

from .chain import retract
from .drag import soft_drag, soft_work
from .jitted import kernel
from .rod import State, energy, is_active, look


@kernel
def soft_forces(rod, state, view, force, push, drag, stiffness):  # type: ignore[no-untyped-def]
    """The state with the forces that the penalties and the multipliers `force`, `push` and `drag` give."""
    soft, bond = force - stiffness * view.miss, rod.held.rows["bond"]
    for row in range(len(soft)):
        if not is_active(bond, state.holds, row):
            soft[row] = 0.0
    pressed = np.maximum(push - 10.0 * stiffness * view.gap, 0.0)
    rubbed, ease, sticks = soft_drag(rod, view, pressed, drag, stiffness)
    return State(state.frames, soft, state.holds, pressed, pressed > 0.0, state.fraction, rubbed, sticks, ease)


@kernel
def _merit(rod, state, view, force, push, stiffness):  # type: ignore[no-untyped-def]
    """Augmented Lagrangian [J], whose gradient is that of the energy with the forces of `soft_forces`."""
    total, bond = energy(rod, state, view), rod.held.rows["bond"]
    for row in range(len(force)):
        if is_active(bond, state.holds, row):
            total += view.miss[row] * (0.5 * stiffness * view.miss[row] - force[row])
    hardness = 10.0 * stiffness
    for row in range(len(push)):
        pressed = max(push[row] - hardness * view.gap[row], 0.0)
        total += 0.5 / hardness * (pressed * pressed - push[row] * push[row])
    return total


@kernel
def search(rod, state, view, step, scale, force, push, stiffness):  # type: ignore[no-untyped-def]
    """Shorten the step until the merit falls; the start again, and False, if it does not."""
    before = _merit(rod, state, view, force, push, stiffness)
    # The bulge of `contact_geometry` is left out of the slope, so with contacts the merit may rise a little.
    slack = 1e-13 * abs(before) + (1e-7 * rod.force_scale * rod.length if len(view.gap) > 0 else 0.0)
    for _ in range(12):
        frames = retract(state.frames, scale * step.turn)
        trial, seen = look(
            rod,
            State(frames, state.force, state.holds, state.push, state.touches, state.fraction, state.drag, state.sticks, state.ease),
            view.push,
        )
        after = _merit(rod, trial, seen, force, push, stiffness) + soft_work(state, view, seen.slip)
        if after <= before + 1e-4 * scale * step.slope + slack:
            return trial, seen, True
        scale *= 0.4
    return state, view, False
