"""Which effects of a cable are simulated: those whose predicted size is above a share of the tolerance, and those asked for.

Each effect says in its own file what leaving it out could change (`size`), from the shape that is known: before there is one, from a
first guess (`guess`); with a start shape, from what was simulated in that one; and, at last, from the shape that was found without it.
What is written into the answer is the last of these. Where it is more than allowed the effect is switched on, and the shape found anew.

| what is left out | may come to | because |
| --- | --- | --- |
| bending, with what goes with it or with no catenary | `HANGING` of the tolerance | a closed form is cheaper than a rod |
| the others | `OTHERS` of the tolerance | a rod without them costs hardly less, a finer mesh more |

What is simulated goes off where it would stay below `EASE` of that, so that nothing flickers. Gravity stays, for of two shapes that are
alike without it, it decides for one. An effect that is left out is taken off the cable's numbers, so that nothing below knows of it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Set
from dataclasses import dataclass, replace
from functools import cached_property
from types import ModuleType
from typing import Any, Final

import msgspec
import numpy as np

from protocol.effects import CHOOSABLE, GOING, WITH_BENDING, Predicted
from protocol.kinds import Model, Outcome, SelfInteraction
from protocol.messages import Problem, Shape, Start
from protocol.scene import Vector

from . import effects, hanging, ladder
from .guess import guess
from .seen import Seen, Size, bending_of, seen_at_start, seen_in

HANGING: Final = 0.5
OTHERS: Final = 0.1
EASE: Final = 0.5
NEGLIGIBLE: Final = 1e-5  # of the length: what is left out where a budget stands in the place of the tolerance
ROUNDS: Final = 4
SAME_NODES: Final = frozenset(("stretch", "preform"))  # effects that need no other nodes where they are switched on
SURELY: Final = 4.0  # layers, within which what bending moves stays in most shapes; what was found is looked at in any case

Plainly = Callable[[Problem, Vector, float, float | None], Shape]  # solve with all that is asked for; tolerance [m], budget [s] or none


@dataclass(frozen=True)
class Choice:
    """What there is to choose for one cable."""

    problem: Problem
    gravity: Vector
    names: tuple[str, ...]  # effects that the numbers ask for and that may be left out
    forced: dict[str, bool]
    allowed: float  # m, tolerance, or what stands in its place
    path: ModuleType

    @cached_property
    def needed(self) -> Set[str]:
        """Left out as asked only: what nothing is gained by, or what no closed form covers the rest of."""
        own = {"bend_radius"} if self.problem.cable.self_interaction is SelfInteraction.FICTITIOUS else set()
        return {"gravity", "twist"} | own | (set() if self.may_hang else {"bending"})

    @cached_property
    def may_hang(self) -> bool:
        """Whether a cable without bending would be one that a closed form covers: nothing in reach, no turns, no sections."""
        problem = self.problem
        if problem.cable.self_interaction is not SelfInteraction.TRANSPARENT:
            return False
        if problem.contacts is not None or problem.self_contacts is not None or any(problem.turns) or problem.branch:
            return False
        if problem.model is not Model.AUTO or any(self.forced.get(name) for name in ("bending", *WITH_BENDING, "masses", "loads")):
            return False
        off = {"bending", "masses", "loads"}
        bare, gravity = without(problem, self.gravity, off)
        return not hanging.not_built(bare, bare.cable.mass_per_length * math.hypot(*gravity))

    @property
    def is_soft(self) -> bool:
        """Whether bending surely does not matter: layers sqrt(2 EI / W) beside its ends, which bear half the weight W, are that short."""
        cable = self.problem.cable
        weight = cable.mass_per_length * cable.length * math.hypot(*self.gravity)
        layer = math.sqrt(2.0 * bending_of(cable)[1] / max(weight, 1e-300))
        return "bending" in self.names and self.may_hang and SURELY * layer <= HANGING * self.allowed

    def begin(self) -> tuple[set[str], float]:
        """Effects to leave out in the first place, and what that is expected to change [m]."""
        start = self.problem.start
        if start is not None and start.effects is not None:
            return self.closed({name for name in self.free if name not in start.effects} | self.refused), 0.0
        if start is None and self.is_soft:
            return self.closed(set(self.free) | self.refused), HANGING * self.allowed
        seen = guess(self.problem, self.gravity, self.path) if start is None else seen_at_start(self.problem, self.gravity, self.path)
        assert seen is not None
        sizes = {name: effects.load(name).size(self.problem, self.gravity, seen) for name in self.free}
        # A guess may be wrong: a catenary tried in vain costs little, a rod solved twice much.
        doubted = frozenset(sizes) - {"bending", *WITH_BENDING, "masses", "loads"} if start is None else frozenset()
        off = self.least(sizes, doubted)
        if start is None and "bending" not in off and "preform" in off - self.refused:
            # Where a cable is pressed a preform moves it most, which no guess knows; and to a rod it costs nothing.
            slack = replace(seen, force=np.zeros_like(seen.force))
            if effects.load("preform").size(self.problem, self.gravity, slack).length > OTHERS * self.allowed:
                off -= {"preform"}
        return off, sum(size.length for name, size in sizes.items() if name in off)

    @property
    def free(self) -> list[str]:
        """Effects that may be left out by their size."""
        return [name for name in self.names if name not in self.forced and name not in self.needed]

    def layer(self, shape: Shape) -> float:
        """Shortest boundary layer [m] that bending could have beside a held point."""
        most = float(np.sqrt((shape.grasp_wrenches[:, :3] ** 2).sum(axis=1).max()))
        return min(math.sqrt(bending_of(self.problem.cable)[0] / max(most, 1e-300)), self.problem.cable.length)

    @property
    def refused(self) -> set[str]:
        """Left out as asked."""
        return {name for name in self.names if self.forced.get(name) is False}

    def closed(self, off: set[str]) -> set[str]:
        """With bending goes all that goes with it; twist stays with bending."""
        if "bending" in off:
            return off | {name for name in self.names if name in WITH_BENDING}
        return off - {"twist"}

    def sizes(self, seen: Seen) -> dict[str, Size]:
        """What leaving out each effect could change in a shape."""
        return {name: effects.load(name).size(self.problem, self.gravity, seen) for name in self.names}

    def least(self, sizes: dict[str, Size], on: Set[str]) -> set[str]:
        """The effects to leave out, of those that may go; `on` are simulated, and stay on for longer."""
        weight = {name: size.length / (EASE if name in on else 1.0) for name, size in sizes.items()}
        off = self.refused
        free = self.free
        if "bending" in free:
            group = {name for name in self.names if name in ("bending", *WITH_BENDING, "masses", "loads")} - off
            if sum(weight.get(name, 0.0) for name in group if name not in ladder.PART_OF) <= HANGING * self.allowed:
                off |= group
            free.remove("bending")
        spent = 0.0
        for name in sorted(free, key=lambda name: weight[name]):
            spent += weight[name] if name not in off else 0.0
            if spent > OTHERS * self.allowed:
                break
            off.add(name)
        return self.closed(off)

    def left_out(self, sizes: dict[str, Size], off: Set[str]) -> dict[str, float]:
        """Predicted size [m] of each effect that is off; of those counted in bending none of their own."""
        return {
            name: 0.0 if name in ladder.PART_OF and "bending" in off else float(sizes[name].length) for name in self.names if name in off
        }


def solve_chosen(problem: Problem, gravity: Vector, tolerance: float, budget: float | None, path: ModuleType, plainly: Plainly) -> Shape:
    """The shape of a cable with the effects that it calls for, and what those left out could have changed."""
    begun = time.perf_counter()
    forced = dict(problem.effects or {})
    bare = problem.altered(effects=None)
    names = tuple(name for name in effects.asked_for(bare, gravity) if name in CHOOSABLE)
    choice = Choice(bare, gravity, names, forced, tolerance if budget is None else NEGLIGIBLE * problem.cable.length, path)
    if not choice.free and not choice.refused:
        return _solved(choice, frozenset(), 0.0, tolerance, budget, plainly)
    off, expected = choice.begin()
    if choice.free == ["bending"] and not off and problem.start is not None:
        shape = plainly(bare, gravity, tolerance, budget)
        layer = choice.layer(shape)
        if layer > tolerance or shape.outcome is not Outcome.CONVERGED:
            sure = Predicted(name="bending", size=layer, force=0.0, curvature=1.0 / layer, is_on=True, why="above")
            return msgspec.structs.replace(shape, predicted=(sure,))
    near: Start | None = None
    for attempt in range(ROUNDS):
        shape = _solved(choice, off, expected, tolerance, budget, plainly, near)
        if near is not None and not _is_exact(shape, expected, tolerance):
            shape = _solved(choice, off, expected, tolerance, budget, plainly)
        if shape.outcome is not Outcome.CONVERGED:
            if off == choice.closed(choice.refused):
                return shape if budget is None else _or_hung(choice, shape, off, tolerance, plainly, begun)
            off, expected, near = choice.closed(choice.refused), 0.0, None
            continue
        sizes = choice.sizes(seen_in(bare, gravity, shape, path))
        more = off - choice.least(sizes, frozenset()) - choice.refused
        if not more or attempt == ROUNDS - 1:
            break
        may_start = more <= SAME_NODES and problem.start is None and not problem.branch
        near = _start_of(shape) if may_start else None
        off = choice.closed(choice.refused) if "bending" in more else off - more
        expected = sum(choice.left_out(sizes, off - choice.refused).values())
    answer = _priced(choice, shape, sizes, off, time.perf_counter() - begun)
    return answer if budget is None else _or_hung(choice, answer, off, tolerance, plainly, begun)


def _or_hung(choice: Choice, answer: Shape, off: Set[str], tolerance: float, plainly: Plainly, begun: float) -> Shape:
    """The answer within a budget, or the shape without bending, if that is better; where the answer's error is not known, good enough."""
    if "bending" in off or "bending" not in choice.free:
        return answer
    error = answer.error if answer.outcome is Outcome.CONVERGED and answer.error is not None else tolerance
    without_it = choice.closed({"bending", *(name for name in ("masses", "loads") if name in choice.free)} | choice.refused)
    shape = _solved(choice, without_it, 0.0, error, None, plainly)
    if shape.outcome is not Outcome.CONVERGED:
        return answer
    sizes = choice.sizes(seen_in(choice.problem, choice.gravity, shape, choice.path))
    hung = _priced(choice, shape, sizes, without_it, time.perf_counter() - begun)
    return answer if hung.error is None or hung.error >= error else hung


def without(problem: Problem, gravity: Vector, off: Set[str]) -> tuple[Problem, Vector]:
    """The problem with the numbers taken away that ask for some effects."""
    if not off:
        return problem, gravity
    cable, loads = problem.cable, problem.loads
    gone: dict[str, Any] = {name: None for name in ("stretch", "micro_length", "bend_radius") if name in off}
    if "preform" in off:
        gone["natural_curvature"] = None
    if "bending" in off:
        gone |= dict.fromkeys(("bending", "bending_2", "twist", "natural_curvature", "micro_length", "bend_radius"))
    masses = () if "masses" in off else cable.masses
    parts: dict[str, Any] = {name: None for name in gone if name not in ("micro_length", "bend_radius")}
    sections = tuple(replace(section, **parts) for section in cable.sections) if parts else cable.sections
    bare = replace(cable, **gone, masses=masses, sections=sections) if gone or masses is not cable.masses else cable
    changed = problem.altered(cable=bare, loads=None if "loads" in off else loads)
    return changed, (0.0, 0.0, 0.0) if "gravity" in off else gravity


def _solved(
    choice: Choice, off: Set[str], expected: float, tolerance: float, budget: float | None, plainly: Plainly, near: Start | None = None
) -> Shape:
    """The shape without some effects, by the cheapest model that knows the others, or by the rod from a shape that is `near`."""
    problem, gravity = without(choice.problem, choice.gravity, off)
    left = tolerance - min(expected, (HANGING if "bending" in off else OTHERS) * tolerance)
    model = problem.model if near is None else Model.ROD
    if model is Model.AUTO:
        model = Model.CATENARY if problem.cable.bending is None else ladder.of_bending(problem, gravity, left)
        if model is Model.AUTO or (model is Model.TAUT and choice.forced.get("bending")):
            model = Model.ROD
    problem = problem.altered(model=model, start=problem.start if near is None else near)
    return plainly(problem, gravity, left, budget)


def _is_exact(shape: Shape, expected: float, tolerance: float) -> bool:
    """Whether a shape found from another one, on its nodes, is as good as one from the grasps alone."""
    return shape.outcome is Outcome.CONVERGED and shape.error is not None and shape.error + expected <= tolerance


def _start_of(shape: Shape) -> Start | None:
    """A rod to go on from with other effects."""
    if shape.model != Model.ROD.value:
        return None
    return Start(s=shape.s, frames=np.array(shape.frames), grasp_forces=np.ascontiguousarray(shape.grasp_wrenches[:, :3]))


def _priced(choice: Choice, shape: Shape, sizes: dict[str, Size], off: Set[str], seconds: float) -> Shape:
    """The answer with what was left out, and what that could have changed, in its error and, where it was asked for, its sentence."""
    left_out = choice.left_out(sizes, off)
    on = tuple(name for name in shape.effects if name not in off)
    going = choice.least(sizes, frozenset(on)) - off
    predicted = tuple(
        Predicted(
            name=name,
            size=float(sizes[name].length),
            force=float(sizes[name].force),
            curvature=float(sizes[name].curvature),
            is_on=name in on,
            why=_why(choice, name, is_on=name in on, is_going=name in going, hangs="bending" in off),
        )
        for name in choice.names
    )
    warnings = [
        f"'{name}' was left out as asked, and may move the cable by up to {left_out[name]:.2g} m"
        for name in sorted(choice.refused)
        if left_out[name] > OTHERS * choice.allowed
    ]
    return shape.altered(
        effects=on,
        left_out={**shape.left_out, **left_out},
        error=None if shape.error is None else shape.error + sum(left_out.values()),
        error_tension=None if shape.error_tension is None else float(shape.error_tension + sum(sizes[name].force for name in left_out)),
        error_curvature=None
        if shape.error_curvature is None
        else float(shape.error_curvature + sum(sizes[name].curvature for name in left_out)),
        sentence="; ".join([shape.sentence, *warnings]),
        predicted=predicted,
        cost=shape.cost.altered(solve=seconds - shape.cost.estimate - shape.cost.certify),
    )


def _why(choice: Choice, name: str, *, is_on: bool, is_going: bool, hangs: bool) -> str:
    if name in choice.forced:
        return "asked"
    if not is_on:
        return "with bending" if name in ladder.PART_OF and hangs else "below"
    return GOING if is_going else "needed" if name in choice.needed else "above"
