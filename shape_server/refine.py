"""From the grasps alone, on finer and finer meshes, until the shape is as exact as asked for."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from protocol.kinds import Outcome
from protocol.messages import Shape

from . import branches, hinges
from .answer import Price, no_shape, rod_shape
from .balance import balanced
from .cold import PULL, curve_frames
from .descent import relax, settle_or_relax
from .equilibrium import WHY, Settled
from .mesh import LAYER_SHARE, Mesh, doubled, even, graded, halved, stops
from .reading import Reading
from .richardson import FLOOR, RATIO_LEAST, RATIO_MOST, SAFETY, apart, combined, transfer
from .rod import Rod, State
from .system import System
from .task import Solution, Task

COARSEST: Final = 24  # segments of the first mesh
FINEST: Final = 12_000  # segments of the last one
FINEST_TOUCHING: Final = 900  # with contacts, which every finer mesh multiplies
ATTEMPTS: Final = 3  # at a first shape, each on twice as many segments: contacts may not fit into a coarse mesh
GIVES: Final = (0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0)  # shares of the compliance, on the way to the whole
TURN_MOST: Final = 0.5  # rad between neighbouring segments
PULLED: Final = 1e-6  # of the length; with less slack a cable that stretches starts straight
SLIP: Final = 2.5  # rad of twist between the curve to start from and the shape; beyond, two in three were not the lowest
SOFTER: Final = (1e3, 1e2, 1e1, 1.0)  # times the stiffness, on the way from a stiff cable to the one asked for


def cold(task: Task, *, mesh: Mesh | None = None, spent: int = 0) -> Shape:
    """Solve from the grasps alone, refining the mesh, or on the mesh given and one coarser."""
    problem = task.problem
    places = stops(problem)
    coarsest = even(places, problem.grasps.s, COARSEST) if mesh is None else halved(mesh)
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
            break
    else:
        return _failed(task, found, spent)
    levels = [Solution.of(task, system, found)]
    if mesh is None:
        layered = _layered(task, levels[0], places)
        if layered is not None:
            levels = [_next(task, levels[0], layered)]
            spent += levels[0].found.iterations
    if not _is_good(levels[0]):
        return _failed(task, levels[0].found, spent)
    while True:
        last = levels[-1]
        reading, price = judged(task, levels, spent)
        is_last = len(levels) == 2 if mesh is not None else len(levels) > 1 and _is_enough(task, levels, price)
        if is_last:
            return rod_shape(task, last, reading, _sentence(task, price, last), price)
        begun = time.perf_counter()
        finer = _next(task, last, doubled(last.system.mesh) if mesh is None else mesh)
        spent += finer.found.iterations
        if not _is_good(finer):
            if mesh is not None or len(levels) == 1:
                return _failed(task, finer.found, spent)
            why = f"{_sentence(task, price, last)}; on twice as many segments {WHY[finer.found.why]}"
            return rod_shape(task, last, reading, why, price)
        levels = [*levels[-2:], finer]
        if task.budget is not None and task.seconds + 2.5 * (time.perf_counter() - begun) > task.budget:
            reading, price = judged(task, levels, spent)
            return rod_shape(task, finer, reading, _sentence(task, price, finer), price)


def _is_good(solution: Solution) -> bool:
    return bool(solution.found.is_converged and solution.found.is_stable)


def judged(task: Task, levels: list[Solution], spent: int) -> tuple[Reading, Price]:
    """The best reading of the last meshes, each with every segment of the one before halved, and its estimated errors."""
    solved = time.perf_counter()
    last = levels[-1]
    if len(levels) == 1:
        return last.reading, Price(math.inf, math.inf, math.inf, spent, solved)
    before, floor = levels[-2], FLOOR * task.problem.cable.length
    gaps = [apart(*pair) for pair in pairwise(levels)]
    is_regular = len(gaps) == 2 and (RATIO_LEAST < gaps[0] / max(gaps[1], 1e-300) < RATIO_MOST or gaps[1] < 1e3 * floor)
    share = SAFETY / 3 if is_regular or len(gaps) == 1 else 1.0
    plain = Price(
        error=share * gaps[-1] + floor,
        error_tension=share * _change(before.reading.tension, last.reading.tension),
        error_curvature=share * _change(before.reading.curvature, last.reading.curvature),
        iterations=spent,
        solved=solved,
    )
    if not task.extrapolate or task.problem.contacts is not None or len(last.system.mesh.s) != 2 * len(before.system.mesh.s) - 1:
        return last.reading, plain
    if task.budget is None and plain.error <= task.tolerance:
        return last.reading, plain
    if not is_regular:
        return last.reading, plain
    finer, coarser = combined(before, last), combined(levels[-3], before)
    loads = last.system.rod.loads
    finer = replace(finer, wrenches=balanced(task.problem, finer.nodes, loads, finer.wrenches, finer.contact_forces))
    share = SAFETY / 7  # as for third order, which uneven meshes and kinks can leave; for fourth it is twice too large
    return finer, Price(
        error=share * float(np.linalg.norm(finer.nodes[::2] - coarser.nodes, axis=1).max()) + floor,
        error_tension=share * _change(coarser.tension, finer.tension),
        error_curvature=share * _change(coarser.curvature, finer.curvature),
        iterations=spent,
        solved=solved,
    )


def _change(coarse: np.ndarray, fine: np.ndarray) -> float:
    """Largest change from one mesh to the next, at places that both have or nearly have."""
    at = np.linspace(0.0, 1.0, len(coarse))
    return float(np.abs(np.interp(at, np.linspace(0.0, 1.0, len(fine)), fine) - coarse).max())


def _is_enough(task: Task, levels: list[Solution], price: Price) -> bool:
    count = len(levels[-1].system.rod.lengths)
    finest = FINEST if task.problem.contacts is None else FINEST_TOUCHING
    if 2 * count > finest:
        return True
    return task.budget is None and price.error <= task.tolerance and _turn_at_nodes(levels[-1]) <= TURN_MOST


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


def _failed(task: Task, found: Settled, spent: int) -> Shape:
    outcome = Outcome.UNSTABLE if found.is_converged else Outcome.NOT_CONVERGED
    return no_shape(task.problem, task.used, outcome, f"cold start: {WHY[found.why]}", "rod", task.seconds, spent)


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
    system = task.system(mesh)
    begin = transfer(task.path, system, last.system, last.found.state)
    found = settle_or_relax(task.path, system.rod, begin, task.progress)
    if not (found.is_converged and found.is_stable):
        anew = from_grasps(task, system)
        found = anew._replace(iterations=anew.iterations + found.iterations)
    return Solution.of(task, system, found)


def from_grasps(task: Task, system: System) -> Settled:
    """The first shape, from nothing but the grasps: without contacts at first, so that these find the cable in one piece."""
    curve = curve_frames(system.mesh, task.problem, np.asarray(task.gravity), task.path)
    begin = system.start(curve)
    begin = begin._replace(force=np.zeros_like(begin.force), push=np.zeros_like(begin.push), touches=np.zeros_like(begin.touches))
    if not len(system.rod.touch.contact):
        return _hanging(task, system, begin)
    empty = system.rod.touch._replace(**{name: column[:0] for name, column in system.rod.touch._asdict().items()})
    free = replace(system, rod=system.rod._replace(touch=empty), push=np.zeros(0), fraction=np.zeros(0))
    bare = begin._replace(push=np.zeros(0), touches=np.zeros(0, dtype=bool), fraction=np.zeros(0))
    hanging = _hanging(task, free, bare)
    state = begin._replace(frames=hanging.state.frames, force=hanging.state.force, holds=hanging.state.holds)
    after = settle_or_relax(task.path, system.rod, state, task.progress)
    return after._replace(iterations=after.iterations + hanging.iterations)


def _hanging(task: Task, system: System, begin: State) -> Settled:
    """Relax without stretch first; then let it stretch. What is pulled beyond its length starts straight and pulled."""
    if len(system.rod.give) and _is_pulled(task):
        return _stretched(task, system, begin._replace(force=_pulls(task, system)))
    rigid = replace(system, rod=system.rod._replace(give=np.zeros(0)))
    found = _relaxed(task, rigid, begin)
    if not len(system.rod.give) or not found.is_converged:
        return found
    stretched = settle_or_relax(task.path, system.rod, State(*found.state), task.progress)
    return stretched._replace(iterations=stretched.iterations + found.iterations)


def _stretched(task: Task, system: System, begin: State) -> Settled:
    """Settle from a straight pulled start, by way of a cable that gives less if need be."""
    spent = 0
    for shares in ((1.0,), GIVES):
        state = begin
        for share in shares:
            rod = system.rod._replace(give=share * system.rod.give)
            found = Settled(*task.path.settle(rod, state, 0.0))
            spent += found.iterations
            if not found.is_converged:
                break
            state = State(*found.state)
        if found.is_converged and found.is_stable:
            break
    return found._replace(iterations=spent)


def _is_pulled(task: Task) -> bool:
    """Whether held points are as far apart as the cable between them, or further."""
    grasps = task.problem.grasps
    chords = np.linalg.norm(np.diff(grasps.position, axis=0), axis=1)
    return bool((chords > np.diff(grasps.s) * (1 - PULLED)).any())


def _pulls(task: Task, system: System) -> np.ndarray:
    """Forces of the rows (h,) [N] that pull every span straight to its chord, and a slack one with its weight."""
    grasps, mesh, give = task.problem.grasps, system.mesh, system.rod.give
    out = np.zeros((len(grasps.s), 3))
    for k, (first, last) in enumerate(pairwise(mesh.grasp_nodes.tolist())):
        chord = grasps.position[k + 1] - grasps.position[k]
        size, span = float(np.linalg.norm(chord)), float(mesh.s[last] - mesh.s[first])
        pull = max((size - span) / float(give[first:last].sum()), system.rod.weight) * chord / max(size, 1e-300)
        out[k] -= pull
        out[k + 1] += pull
    rows = system.row_grasp
    return np.einsum("ij,ij->i", system.rod.held.axis, out[rows]) * (rows >= 0)


def _relaxed(task: Task, system: System, begin: State) -> Settled:
    """The first of several ways to a stable shape, or of all ways the lowest, if the first slips by whole turns of twist.

    A soft cable can shed or gain twist by looping over itself on the way, and rest there (by 4 pi, for frames at both ends).
    """
    expected, spent = _twist(task, system, begin), 0
    best: Settled | None = None
    for way in _ways(task, system):
        found = way(begin)
        spent += found.iterations
        if found.is_converged and found.is_stable:
            best = found if best is None or _energy(task, system, found) < _energy(task, system, best) else best
            if abs(_twist(task, system, found.state) - expected) < SLIP:
                break
    return (best if best is not None else found)._replace(iterations=spent)


def _ways(task: Task, system: System) -> Iterator[Callable[[State], Settled]]:
    """Ways from a state to a shape: the likelier to succeed first."""
    rod, on_hinges = system.rod, hinges.count(task.problem)

    def plainly(begin: State) -> Settled:
        return relax(task.path, rod, begin, task.progress)

    def on_another_curve(begin: State) -> Settled:
        curve = curve_frames(system.mesh, task.problem, np.asarray(task.gravity), task.path, 0.5 * PULL)
        return plainly(begin._replace(frames=curve))

    def beside(begin: State) -> Settled:
        return plainly(begin._replace(frames=task.path.retract(begin.frames, task.path.kick(rod))))

    def by_stiffer(begin: State) -> Settled:
        return _by_stiffer_cables(task, rod, begin)

    def by_pieces(begin: State) -> Settled:
        return hinges.let_go(task, system, from_grasps)

    yield from (by_pieces, plainly) if on_hinges > hinges.MANY else (plainly, by_pieces) if on_hinges else (plainly,)
    yield on_another_curve
    yield beside
    yield by_stiffer


def _by_stiffer_cables(task: Task, rod: Rod, state: State) -> Settled:
    """Relax a cable that is a thousand times stiffer, which knows no loops, then softer ones, each from the one before."""
    spent = 0
    for factor in SOFTER:
        law, node_law = factor * rod.elastic.law, factor * rod.elastic.node_law
        stiffer = rod._replace(elastic=rod.elastic._replace(law=law, node_law=node_law), stiffest=factor * rod.stiffest)
        found = relax(task.path, stiffer, state, task.progress)
        spent += found.iterations
        state = State(*found.state)
    return found._replace(iterations=spent)


def _twist(task: Task, system: System, state: State) -> float:
    return float(task.path.twist_of(system.rod, state))


def _energy(task: Task, system: System, found: Settled) -> float:
    return float(task.path.energy(system.rod, found.state, found.seen))
