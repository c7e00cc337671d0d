"""From the grasps alone, on finer and finer meshes, until the shape is as exact as asked for."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from protocol.kinds import Feature, Outcome
from protocol.messages import Problem, Shape

from . import branches, link
from .answer import Price, no_shape, rod_shape
from .balance import balanced, swung
from .clock import OutOfTime
from .cold import curve_frames
from .descent import settle_or_relax
from .equilibrium import WHY, Settled
from .first_shape import from_grasps
from .mesh import LAYER_SHARE, Mesh, doubled, even, graded, halved, stops
from .reading import Reading
from .richardson import FLOOR, LYING, RATIO_LEAST, RATIO_MOST, SAFETY, apart, combined, transfer
from .system import System
from .task import Solution, Task

COARSEST: Final = 24  # segments of the first mesh
FINEST: Final = 12_000  # segments of the last one
FINEST_TOUCHING: Final = 900  # with contacts, which every finer mesh multiplies
ATTEMPTS: Final = 3  # at a first shape, each on twice as many segments: contacts may not fit into a coarse mesh
THINNED: Final = 1.95  # times the error on meshes that have fewer rows the coarser they are, which converge more like first order
CURVED: Final = 2.0  # times the change of curvature, a second derivative, which beside clamps and loads is less regular than that of places
SLIDES: Final = 5  # segments that a contact may slide, where with one no shape was found
TWIST_MOST: Final = 2.2  # rad between neighbouring segments of the first mesh
TURN_MOST: Final = 0.5  # rad between neighbouring segments


def cold(task: Task, *, mesh: Mesh | None = None, spent: int = 0) -> Shape:
    """Solve from the grasps alone, refining the mesh, or on the mesh given and one coarser; by the budget the best that fits."""
    try:
        return _cold(task, mesh, spent)
    except OutOfTime as what:
        return late(task, what, spent)


def late(task: Task, what: OutOfTime, spent: int) -> Shape:
    """No shape within the budget, and what did not fit."""
    budget = 1e3 * (task.budget or 0.0)
    sentence = f"the budget of {budget:.3g} ms does not reach for a first shape: {what} would not have ended in time"
    advice = "Give more time, or leave out the budget; a start shape from the step before helps most."
    return no_shape(task.problem, task.used, Outcome.NOT_CONVERGED, sentence, "rod", task.seconds, spent, advice=advice)


def _cold(task: Task, mesh: Mesh | None, spent: int) -> Shape:
    problem = task.problem
    places = stops(problem)
    coarsest = even(places, problem.grasps.s, _coarsest(task)) if mesh is None else halved(mesh)
    for attempt in range(ATTEMPTS if mesh is None else 1):
        coarsest = doubled(coarsest) if attempt else coarsest
        system = task.system(coarsest)
        if problem.branch:
            known = branches.stable_shapes(task, system)
            if len(known) < problem.branch:
                sentence = f"branch {problem.branch} was asked for, and {len(known)} different stable shapes were found"
                return no_shape(problem, task.used, Outcome.UNSUPPORTED, sentence, "rod", task.seconds, spent)
            found = known[problem.branch - 1]
        else:
            found = from_grasps(task, system)
        spent += found.iterations
        if found.is_converged and found.is_stable:
            lost = _shed(task, system, found)
            if lost:
                sentence = f"in every stable shape found the cable passed through itself, and lost {lost} turns; {link.advice(problem)}"
                return no_shape(problem, task.used, Outcome.UNSUPPORTED, sentence, "rod", task.seconds, spent)
            break
    else:
        return _further(task, mesh, found, spent)
    first = Solution(task, system, found)
    levels = [first]
    if mesh is None:
        try:
            layered = _layered(task, levels[0], places)
            if layered is not None:
                levels = [_next(task, levels[0], layered)]
                spent += levels[0].found.iterations
        except OutOfTime as what:
            return _as_far_as(task, levels, spent, what)
    if not _is_good(levels[0]):
        return _further(task, mesh, levels[0].found, spent)
    while True:
        last = levels[-1]
        reading, price = judged(task, levels, spent)
        if task.clock is not None:
            task.clock.level(len(last.system.mesh.lengths))
        is_last = len(levels) == 2 if mesh is not None else len(levels) > 1 and _is_enough(task, levels, price)
        if is_last:
            return rod_shape(task, last, reading, _sentence(task, price, last), price)
        try:
            finer = _next(task, last, doubled(last.system.mesh) if mesh is None else mesh)
        except OutOfTime as what:
            return _as_far_as(task, [first, last] if last is levels[0] and last is not first else levels, spent, what)
        spent += finer.found.iterations
        if not _is_good(finer):
            if mesh is not None or len(levels) == 1:
                return _further(task, mesh, finer.found, spent)
            why = f"{_sentence(task, price, last)}; on twice as many segments {WHY[finer.found.why]}"
            return rod_shape(task, last, reading, why, price)
        levels = [*levels[-2:], finer]


def _as_far_as(task: Task, levels: list[Solution], spent: int, what: OutOfTime) -> Shape:
    """The best answer so far, and what did not fit into the budget any more."""
    reading, price = judged(task, levels, spent)
    unknown = "; its error is not known, for that takes a second mesh" if len(levels) == 1 else ""
    return rod_shape(task, levels[-1], reading, f"{_sentence(task, price, levels[-1])}; {what} was out of the budget{unknown}", price)


def _coarsest(task: Task) -> int:
    """Segments of the first mesh: enough of them for the turns of twist asked for, of which a node can tell half a turn at most."""
    turns = sum(abs(turn) for turn in task.problem.turns)
    count = COARSEST if task.budget is None or not task.touches else COARSEST // 2
    while 2 * math.pi * turns > TWIST_MOST * count:
        count *= 2
    return count


def _is_good(solution: Solution) -> bool:
    return bool(solution.found.is_converged and solution.found.is_stable)


def judged(task: Task, levels: list[Solution], spent: int) -> tuple[Reading, Price]:
    """The best reading of the last meshes, each with every segment of the one before halved, and its estimated errors."""
    last = levels[-1]
    reading, solved = last.reading, time.perf_counter()
    if len(levels) == 1:
        return reading, Price(math.inf, math.inf, math.inf, spent, solved)
    before, floor = levels[-2], FLOOR * task.problem.cable.length
    gaps = [apart(*pair) for pair in pairwise(levels)]
    # Where a least bend radius is reached the arc begins at a place that moves from mesh to mesh as it likes.
    is_smooth = not last.is_kinked
    is_regular = is_smooth and len(gaps) == 2 and (RATIO_LEAST < gaps[0] / max(gaps[1], 1e-300) < RATIO_MOST or gaps[1] < 1e3 * floor)
    is_doubled = is_smooth and len(last.system.mesh.s) == 2 * len(before.system.mesh.s) - 1
    lying = LYING if task.budget is None else THINNED * LYING
    share = (lying if last.lies else SAFETY) / 3 if is_regular or (len(gaps) == 1 and is_doubled) else 1.0
    plain = Price(
        error=share * gaps[-1] + floor,
        error_tension=share * _change(before.sections[0], reading.tension),
        error_curvature=CURVED * share * _change(before.sections[1], reading.curvature) + last.hidden,
        iterations=spent,
        solved=solved,
    )
    if not task.extrapolate or task.touches or not is_doubled:
        return reading, plain
    if task.budget is None and plain.error <= task.tolerance:
        return reading, plain
    if not is_regular or len(before.system.mesh.s) != 2 * len(levels[-3].system.mesh.s) - 1:
        return reading, plain
    finer, coarser = combined(before, last), combined(levels[-3], before)
    finer = _at_rest(task.problem, before.system, last.system, finer)
    share = SAFETY / 7  # as for third order, which uneven meshes and kinks can leave; for fourth it is twice too large
    return finer, Price(
        error=share * float(np.linalg.norm(finer.nodes[::2] - coarser.nodes, axis=1).max()) + floor,
        error_tension=share * _change(coarser.tension, finer.tension),
        error_curvature=CURVED * share * _change(coarser.curvature, finer.curvature) + last.hidden,
        iterations=spent,
        solved=solved,
    )


def _at_rest(problem: Problem, coarse: System, fine: System, reading: Reading) -> Reading:
    """The combined reading in balance, with the loads of both meshes combined in the same way."""
    loads = 4 / 3 * fine.rod.loads
    loads[::2] -= coarse.rod.loads / 3
    grasps = fine.mesh.grasp_nodes
    nodes = swung(problem, reading.nodes[grasps], reading.nodes, loads)
    wrenches = balanced(problem, nodes[grasps], nodes, loads, reading.wrenches, reading.contact_forces, np.zeros(3))
    return replace(reading, nodes=nodes, wrenches=wrenches)


def _change(coarse: np.ndarray, fine: np.ndarray) -> float:
    """Largest change from one mesh to the next, at places that both have or nearly have."""
    at, places = np.arange(len(coarse)) / (len(coarse) - 1), np.arange(len(fine)) / (len(fine) - 1)
    return float(np.abs(np.interp(at, places, fine) - coarse).max())


def _is_enough(task: Task, levels: list[Solution], price: Price) -> bool:
    count = len(levels[-1].system.rod.lengths)
    finest = FINEST_TOUCHING if task.touches else FINEST
    if 2 * count > finest:
        return True
    if task.budget is not None:
        return price.error <= 2 * FLOOR * task.problem.cable.length
    return price.error <= task.tolerance and _turn_at_nodes(levels[-1]) <= TURN_MOST


def _turn_at_nodes(solution: Solution) -> float:
    """Largest bend at a node, or mean twist, [rad]: forces and moments are off by its square over 48."""
    mesh, reading = solution.system.mesh, solution.reading
    bend = float((reading.curvature[1:-1] * 0.5 * (mesh.lengths[1:] + mesh.lengths[:-1])).max(initial=0.0))
    return max(bend, abs(reading.total_twist) / len(mesh.lengths))


def _sentence(task: Task, price: Price, last: Solution) -> str:
    how = "cold start"
    if task.budget is not None or price.error <= task.tolerance:
        return how
    nodes = len(last.system.mesh.s)
    return f"{how}; the error estimate of {price.error:.2g} m is above the tolerance of {task.tolerance:.2g} m on {nodes} nodes"


def _further(task: Task, mesh: Mesh | None, found: Settled, spent: int) -> Shape:
    """No shape: once more with contacts that may slide further, as edges do that run nearly along the cable."""
    contacts = task.problem.contacts
    if task.reach >= SLIDES or contacts is None or (contacts.feature == Feature.FACE).all():
        return failed(task, found, spent)
    return cold(replace(task, reach=SLIDES), mesh=mesh, spent=spent)


def failed(task: Task, found: Settled, spent: int, how: str = "cold start") -> Shape:
    """No shape, and why."""
    outcome = Outcome.UNSTABLE if found.is_converged else Outcome.NOT_CONVERGED
    why = f"{how}: {WHY[found.why]}" + (f"; {link.advice(task.problem)}" if any(task.problem.turns) else "") + _too_long(task.problem)
    return no_shape(task.problem, task.used, outcome, why, "rod", task.seconds, spent)


def _too_long(problem: Problem) -> str:
    """What to say of a micro-structure length beyond the length of the cable, when no shape was found."""
    cable = problem.cable
    if cable.micro_length is None or cable.micro_length <= cable.length:
        return ""
    times = cable.micro_length / cable.length
    return f"; micro_length is {times:.3g} times the length, which leaves next to nothing but curvatures that run straight from end to end"


def _shed(task: Task, system: System, found: Settled) -> int:
    """Whole turns of twist that a first shape has lost (or won) of those asked for."""
    problem = task.problem
    if problem.branch or not any(problem.turns):
        return 0
    return abs(link.shed(task, system, system.start(curve_frames(system.mesh, problem, np.asarray(task.gravity), task.path)), found))


def _layered(task: Task, first: Solution, places: np.ndarray) -> Mesh | None:
    """A coarse mesh that is finer in the boundary layers; None if the even one sees them."""
    centres, layers = first.layers()
    mesh = first.system.mesh
    segment, _ = mesh.locate(centres)
    if (LAYER_SHARE * mesh.lengths[segment] <= layers).all():
        return None
    return graded(places, task.problem.grasps.s, COARSEST, centres, np.maximum(layers, 1e-5 * mesh.s[-1]))


def _next(task: Task, last: Solution, mesh: Mesh) -> Solution:
    """The shape on a finer mesh: carried over from the last one, or from the grasps if it does not settle there."""
    if task.clock is not None:
        if not task.clock.fits(len(mesh.lengths)):
            raise OutOfTime(f"a mesh of {len(mesh.lengths)} segments")
        task.clock.begin()
    system = task.system(mesh)
    begin = transfer(task.path, system, last.system, last.found.state)
    found = settle_or_relax(task.path, system.rod, begin, task.progress)
    if not (found.is_converged and found.is_stable):
        anew = from_grasps(task, system)
        found = anew._replace(iterations=anew.iterations + found.iterations)
    return Solution(task, system, found)
