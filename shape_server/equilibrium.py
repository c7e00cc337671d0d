"""From a start to a stable equilibrium: Newton with an active set, and an augmented Lagrangian where that is not enough.

`settle` is the warm path. It repeats Newton steps with exact rows; after each, a closed contact that would pull is
opened, an open one that is penetrated is closed, and a bond that pulls is dropped (primal-dual active set, Hintermueller,
Ito and Kunisch 2002, "The primal-dual active set strategy as a semismooth Newton method"). It gives up when a step is
too long, the sets do not settle, or the equilibrium is not stable.

`relax` is the robust path. Rows become penalties with multipliers (augmented Lagrangian; Nocedal and Wright 2006,
"Numerical Optimization", ch. 17), the Hessian is shifted until its inertia is that of a minimum, and each step is
shortened until the merit function falls (Armijo). It ends near a minimum of the energy, never at a saddle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from .rod import Rod, State, Step, View, energy, look, newton_step

TURN_DONE: Final = 2e-4  # rad; a Newton step this long leaves an error of about its square
TURN_MAX: Final = 0.6  # rad, of any segment in one step
WARM_STEPS: Final = 25
RELAX_STEPS: Final = 400
MISS_DONE: Final = 1e-8  # of the length, for held points

Progress = Callable[[int, float], None]


@dataclass(frozen=True)
class Settled:
    """Where an iteration ended."""

    state: State
    view: View
    is_converged: bool
    is_stable: bool
    iterations: int
    unbalanced: float  # N m
    why: str  # why it stopped


def settle(rod: Rod, state: State, progress: Progress) -> Settled:
    """Newton's method with exact rows from a state nearby."""
    state, view = look(rod, state)
    state = _close_penetrated(rod, state, view)
    seen: dict[bytes, int] = {}
    step: Step | None = None
    for iteration in range(1, WARM_STEPS + 1):
        step = newton_step(rod, state, view)
        progress(iteration, step.unbalanced)
        longest = float(np.abs(step.turn).max())
        if not longest < 1e3:
            return Settled(state, view, False, False, iteration, step.unbalanced, "a step of the iteration was not finite")
        scale = min(1.0, TURN_MAX / longest) if longest > 0 else 1.0
        state, view, has_changed = _advance(rod, state, step, scale)
        if not has_changed and longest < TURN_DONE and _worst_miss(rod, state, view) < MISS_DONE * rod.length:
            why = "" if step.is_stable else "the equilibrium is not stable"
            return Settled(state, view, True, step.is_stable, iteration, step.unbalanced, why)
        key = state.touches.tobytes() + state.holds.tobytes()
        seen[key] = seen.get(key, 0) + has_changed
        if seen[key] > 3:
            return Settled(state, view, False, step.is_stable, iteration, step.unbalanced, "the set of closed contacts repeats itself")
    assert step is not None
    return Settled(state, view, False, step.is_stable, WARM_STEPS, step.unbalanced, f"no convergence within {WARM_STEPS} steps")


def relax(rod: Rod, state: State, progress: Progress) -> Settled:
    """Descend to a minimum of the energy from any state, then settle there."""
    stiffness = 30.0 * rod.force_scale / rod.length
    hardness = 10.0 * stiffness
    multiplier = replace(state, push=np.maximum(state.push, 0.0))
    shift, iteration, polishes = 0.0, 0, 0
    state, view = look(rod, multiplier)
    unbalanced = np.inf
    while iteration < RELAX_STEPS:
        state = _soft_forces(multiplier, state, view, stiffness, hardness)
        softness = (1.0 / stiffness, 1.0 / hardness)
        step = newton_step(rod, state, view, softness=softness, shift=shift)
        iteration += 1
        progress(iteration, step.unbalanced)
        unbalanced = step.unbalanced
        if not step.is_stable or not np.isfinite(step.turn).all():
            shift = max(4.0 * shift, 1e-3 * rod.force_scale)
            if shift > 1e9 * rod.force_scale:
                return Settled(state, view, False, False, iteration, unbalanced, "no shift makes the energy convex")
            continue
        longest = float(np.abs(step.turn).max())
        state, view, accepted = _search(rod, multiplier, state, view, step, min(1.0, TURN_MAX / longest), stiffness, hardness)
        shift = (
            shift / 4.0
            if accepted and shift > 1e-6 * rod.force_scale
            else (max(4.0 * shift, 1e-3 * rod.force_scale) if not accepted else 0.0)
        )
        if longest < 0.05 or not accepted:
            now = _soft_forces(multiplier, state, view, stiffness, hardness)
            multiplier = replace(multiplier, force=now.force, push=now.push)
            if longest < 0.02 and _worst_miss(rod, state, view) < 3e-3 * rod.length and polishes < 12:
                polishes += 1
                settled = settle(rod, replace(now, touches=now.push > 0.0), progress)
                iteration += settled.iterations
                if settled.is_converged and settled.is_stable:
                    return replace(settled, iterations=iteration)
    return Settled(state, view, False, False, iteration, float(unbalanced), f"no minimum found within {RELAX_STEPS} steps")


def _advance(rod: Rod, state: State, step: Step, scale: float) -> tuple[State, View, bool]:
    """Take a step, then open the contacts and drop the bonds that would pull, and close those that are penetrated."""
    push = np.where(state.touches, step.push, 0.0)
    pulls = state.touches & (push < 0.0)
    let_go = state.holds & (np.einsum("ij,ij->i", step.force, rod.held.normal) < 0.0)
    force = np.where((state.holds & ~let_go)[:, None], step.force, 0.0)
    frames = rod.path.retract(state.frames, scale * step.turn)
    moved = replace(
        state,
        frames=frames,
        force=force,
        holds=state.holds & ~let_go,
        push=np.where(pulls, 0.0, push),
        touches=state.touches & ~pulls,
    )
    moved, view = look(rod, moved)
    closed = _close_penetrated(rod, moved, view)
    has_changed = bool(pulls.any() or let_go.any() or (closed.touches != moved.touches).any())
    return closed, view, has_changed


def _close_penetrated(rod: Rod, state: State, view: View) -> State:
    if rod.touch is None:
        return state
    return replace(state, touches=state.touches | (view.gap < -1e-9 * rod.length))


def _soft_forces(multiplier: State, state: State, view: View, stiffness: float, hardness: float) -> State:
    """The state with the forces that the penalties and multipliers give."""
    push = np.maximum(multiplier.push - hardness * view.gap, 0.0)
    force = multiplier.force - stiffness * view.miss
    return replace(state, force=np.where(state.holds[:, None], force, 0.0), push=push, touches=push > 0.0)


def _merit(rod: Rod, multiplier: State, state: State, view: View, stiffness: float, hardness: float) -> float:
    """Augmented Lagrangian [J], whose gradient is that of the energy with the forces of `_soft_forces`."""
    miss = np.where(state.holds[:, None], view.miss, 0.0)
    held = -np.vdot(multiplier.force, miss) + 0.5 * stiffness * np.vdot(miss, miss)
    push = np.maximum(multiplier.push - hardness * view.gap, 0.0)
    touched = 0.5 / hardness * (push @ push - multiplier.push @ multiplier.push)
    return energy(rod, state, view) + float(held) + float(touched)


def _search(
    rod: Rod, multiplier: State, state: State, view: View, step: Step, scale: float, stiffness: float, hardness: float
) -> tuple[State, View, bool]:
    """Shorten the step until the merit falls; the start again, and False, if it does not."""
    before = _merit(rod, multiplier, state, view, stiffness, hardness)
    for _ in range(12):
        trial, seen = look(rod, replace(state, frames=rod.path.retract(state.frames, scale * step.turn)))
        after = _merit(rod, multiplier, trial, seen, stiffness, hardness)
        if after <= before + 1e-4 * scale * step.slope + 1e-13 * abs(before):
            return trial, seen, True
        scale *= 0.4
    return state, view, False


def _worst_miss(rod: Rod, state: State, view: View) -> float:
    return float(np.abs(view.miss[state.holds]).max(initial=0.0))
