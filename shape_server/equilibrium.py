"""From a start to a stable equilibrium: Newton with an active set, and an augmented Lagrangian where that is not enough.

`settle` is the warm path. It repeats Newton steps with exact rows, in each of which the contacts that push are found from the
linearised system (see `border`); a bond that pulls is dropped. It gives up when a step is not finite, does not become short,
or the equilibrium is not stable.

`relax` is the robust path. Rows become penalties with multipliers (augmented Lagrangian; Nocedal and Wright 2006,
"Numerical Optimization", ch. 17), the Hessian is shifted until its inertia is that of a minimum, and each step is
shortened until the merit function falls (Armijo). It ends near a minimum of the energy, never at a saddle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from .rod import Rod, State, Step, View, energy, hardness_of, look, newton_step

TURN_DONE: Final = 2e-4  # rad; a Newton step this long leaves an error of about its square
TURN_EXACT: Final = 1e-9  # rad
TURN_MAX: Final = 0.6  # rad, of any segment in one step
WARM_STEPS: Final = 15
RELAX_STEPS: Final = 400
NEAR: Final = 0.05  # rad; a Newton step this long leaves an error of a few thousandths
NEAR_STEPS: Final = 6
IDLE_AFTER: Final = 6  # steps
IDLE_MOVE: Final = 1e-5  # of the length, of any node in one step
IDLE_MISS: Final = 1e-7  # of the length
KICK: Final = 0.05  # rad
NEUTRAL: Final = 1e-4  # of EI over length squared; a stiffness below this is neutral, not unstable
GIVE_MAX: Final = 1e-6  # of the length, that a contact may give way
MISS_DONE: Final = 1e-8  # of the length, for held points
CONTACT_EASE: Final = 0.1  # how much a miss of a contact counts; two rows at one bend share their force slowly

Progress = Callable[[int, float], None]


@dataclass(frozen=True)
class Settled:
    """Where an iteration ended."""

    state: State
    view: View
    is_converged: bool
    is_stable: bool
    iterations: int
    unbalanced: float  # N
    why: str  # why it stopped


def settle(rod: Rod, state: State, progress: Progress) -> Settled:
    """Newton's method with exact rows from a state nearby."""
    state, view = look(rod, state)
    step: Step | None = None
    for iteration in range(1, WARM_STEPS + 1):
        step = newton_step(rod, state, view, shift=NEUTRAL * float(rod.law.max()) / rod.length**2)
        progress(iteration, step.unbalanced)
        longest = float(np.abs(step.turn).max())
        if not longest < 1e3:
            return Settled(state, view, False, False, iteration, step.unbalanced, "a step of the iteration was not finite")
        scale = min(1.0, TURN_MAX / longest) if longest > 0 else 1.0
        before = view.nodes
        state, view, let_go = _advance(rod, state, step, scale)
        # Close to the answer a neutral direction may still look unstable: an unstable verdict is given at the answer itself.
        turn_done = TURN_DONE if step.is_stable else TURN_EXACT
        if not let_go and scale == 1.0 and longest < turn_done and _worst_miss(rod, state, view) < MISS_DONE * rod.length:
            why = "" if step.is_stable else "the equilibrium is not stable"
            return Settled(state, view, True, step.is_stable, iteration, step.unbalanced, why)
        # Where several edges meet, contacts may go on taking turns without moving the cable any more.
        moved = float(np.abs(view.nodes - before).max())
        is_idle = iteration >= IDLE_AFTER and moved < IDLE_MOVE * rod.length and _worst_miss(rod, state, view) < IDLE_MISS * rod.length
        if is_idle and step.is_stable and not let_go:
            return Settled(state, view, True, True, iteration, step.unbalanced, "")
    assert step is not None
    return Settled(state, view, False, step.is_stable, WARM_STEPS, step.unbalanced, f"no convergence within {WARM_STEPS} steps")


def step_near(rod: Rod, state: State) -> Settled:
    """Newton steps until the error is far below the step: for comparing meshes, where no more is needed."""
    state, view = look(rod, state)
    for iteration in range(1, NEAR_STEPS + 1):
        step = newton_step(rod, state, view)
        longest = float(np.abs(step.turn).max())
        state, view, _ = _advance(rod, state, step, min(1.0, TURN_MAX / max(longest, TURN_MAX)))
        if not longest > NEAR:
            return Settled(state, view, True, step.is_stable, iteration, step.unbalanced, "")
    return Settled(state, view, False, False, NEAR_STEPS, step.unbalanced, "the steps did not become small")


def relax(rod: Rod, state: State, progress: Progress) -> Settled:
    """Descend to a minimum of the energy from any state, then settle there."""
    piece = _shortest_piece(rod)
    stiffness = 30.0 * (rod.weight + 10.0 * float(rod.law.max()) / piece**2) / piece
    softest, hardness = stiffness, 10.0 * stiffness
    multiplier = replace(state, push=np.maximum(state.push, 0.0))
    shift, iteration, helped, unbalanced, worst = 0.0, 0, 0, np.inf, np.inf
    state, view = look(rod, multiplier)
    while iteration < RELAX_STEPS and shift < 1e9 * rod.force_scale:
        state = _soft_forces(multiplier, state, view, stiffness, hardness)
        step = newton_step(rod, state, view, softness=(1.0 / stiffness, 1.0 / hardness), shift=shift)
        iteration += 1
        progress(iteration, step.unbalanced)
        unbalanced = step.unbalanced
        longest = float(np.abs(step.turn).max())
        accepted = step.is_stable and longest < np.inf
        if accepted:
            scale = min(1.0, TURN_MAX / longest) if longest > 0.0 else 1.0
            state, view, accepted = _search(rod, multiplier, state, view, step, scale, stiffness, hardness)
        if not accepted:
            shift = max(4.0 * shift, 1e-3 * rod.force_scale)
            continue
        helped = helped + 1 if shift > 0.0 and longest < 0.05 else 0
        shift = shift / 4.0 if shift > 1e-3 * rod.force_scale else 0.0
        if longest >= 0.05:
            continue
        now = _soft_forces(multiplier, state, view, stiffness, hardness)
        multiplier = replace(multiplier, force=now.force, push=now.push)
        worst, last = _worst_miss(rod, state, view), worst
        if worst > 0.3 * last and helped == 0 and stiffness < 1e3 * softest:
            stiffness, hardness = 3.0 * stiffness, 3.0 * hardness
        # A step that needed a shift may be on its way to a saddle: wait until it stalls there, then look what it is.
        is_near = longest < 0.02 if helped == 0 else (longest < 1e-3 or helped > 8)
        if is_near and worst < 3e-3 * rod.length:
            settled = settle(rod, replace(now, touches=now.push > 0.0), progress)
            iteration += settled.iterations
            if settled.is_converged and settled.is_stable:
                return replace(settled, iterations=iteration)
            if helped:
                helped = 0
                state, view = look(rod, replace(state, frames=rod.path.retract(state.frames, kick(rod))))
    why = f"no minimum found within {RELAX_STEPS} steps" if iteration >= RELAX_STEPS else "no step lowers the energy"
    return Settled(state, view, False, False, iteration, float(unbalanced), why)


def kick(rod: Rod) -> np.ndarray:
    """Small smooth turns (n-1, 3) [rad] without symmetry, the same every time: a way off a saddle."""
    s = 0.5 * (rod.mesh.s[:-1] + rod.mesh.s[1:])[:, None] / rod.length
    turn: np.ndarray = _kick_size(rod) * np.sin(np.array([2.0, 3.1, 4.3]) * s + np.array([0.3, 1.0, 2.0]))
    return turn


def _kick_size(rod: Rod) -> float:
    """[rad] Less for a nearly taut cable, which a large kick would take past the arch that it belongs to."""
    ends = np.vstack([rod.origin, rod.held.goal])
    at = np.append(rod.mesh.s[rod.base], rod.mesh.s[rod.held.element] + rod.held.fraction * rod.mesh.lengths[rod.held.element])
    if len(at) == 1:
        return KICK
    slack = 1.0 - np.linalg.norm(np.diff(ends, axis=0), axis=1) / np.maximum(np.diff(at), 1e-300)
    return min(KICK, 0.5 * float(np.sqrt(np.clip(slack[: len(at) - 1], 0.0, 1.0).min())) + 1e-4)


def _shortest_piece(rod: Rod) -> float:
    """Length of the shortest piece of cable between held points [m], at least a fifth of the cable."""
    held = rod.mesh.s[rod.held.element] + rod.held.fraction * rod.mesh.lengths[rod.held.element]
    stops = np.unique(np.append(held, rod.mesh.s[rod.base]))
    return max(float(np.diff(stops).min(initial=rod.length)), 0.2 * rod.length)


def _advance(rod: Rod, state: State, step: Step, scale: float) -> tuple[State, View, bool]:
    """Take a step, then drop the bonds that pull; whether there were any."""
    let_go = state.holds & (np.einsum("ij,ij->i", step.force, rod.held.normal) < 0.0)
    moved = replace(
        state,
        frames=rod.path.retract(state.frames, scale * step.turn),
        force=np.where((state.holds & ~let_go)[:, None], step.force, 0.0),
        holds=state.holds & ~let_go,
        push=step.push,
        touches=step.touches,
    )
    moved, view = look(rod, moved)
    return moved, view, bool(let_go.any())


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
    # The bulge of `contact_geometry` is left out of the slope, so with contacts the merit may rise a little.
    slack = 1e-13 * abs(before) + (1e-7 * rod.force_scale * rod.length if len(view.gap) else 0.0)
    for _ in range(12):
        trial, seen = look(rod, replace(state, frames=rod.path.retract(state.frames, scale * step.turn)))
        after = _merit(rod, multiplier, trial, seen, stiffness, hardness)
        if after <= before + 1e-4 * scale * step.slope + slack:
            return trial, seen, True
        scale *= 0.4
    return state, view, False


def _worst_miss(rod: Rod, state: State, view: View) -> float:
    """Largest distance of a held point from its goal, or of a contact from where its force would have it [m].

    Infinite where a contact gave way further than a force can be meant: a body that the cable cannot escape.
    """
    if -view.gap.min(initial=0.0) > GIVE_MAX * rod.length:
        return np.inf
    gives = np.any(rod.held.normal, axis=1, keepdims=True) * hardness_of(rod)
    held = float(np.abs((view.miss + gives * state.force)[state.holds]).max(initial=0.0))
    balance = view.gap + hardness_of(rod) * state.push
    wrong = np.where(state.touches, np.abs(balance), np.maximum(-balance, 0.0))
    return max(held, CONTACT_EASE * float(wrong.max(initial=0.0)))
