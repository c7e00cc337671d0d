"""The first shape on a mesh, from nothing but the grasps: by several ways, of which the likeliest is tried first."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from . import hinges, link
from .cold import PULL, curve_frames
from .descent import off_the_saddle, relax, settle_alone, settle_or_relax
from .equilibrium import Settled
from .rod import NO_RUB, Rod, State
from .system import System, force_scale, micro_length, no_strands, stiffest
from .task import Task

SLIP: Final = 2.5  # rad of twist between the curve to start from and the shape; beyond, two in three were not the lowest
PULLED: Final = 1e-6  # of the length; with less slack a cable that stretches starts straight
GIVES: Final = (0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0)  # shares of the compliance, on the way to the whole
SOFTER: Final = (1e3, 1e2, 1e1, 1.0)  # times the stiffness, on the way from a stiff cable to the one asked for
STRONGER: Final = 4.0  # times the stiffness against a change of curvature, from one micro-structure length to the next


def from_grasps(task: Task, system: System) -> Settled:
    """The first shape, from nothing but the grasps: without contacts at first, so that these find the cable in one piece."""
    curve = curve_frames(system.mesh, task.problem, np.asarray(task.gravity), task.path)
    begin = system.start(curve)
    begin = begin._replace(
        force=np.zeros_like(begin.force),
        push=np.zeros_like(begin.push),
        touches=np.zeros_like(begin.touches),
        drag=np.zeros_like(begin.drag),
    )
    if not len(system.rod.touch):
        return _hanging(task, system, begin)
    free = replace(
        system,
        rod=system.rod._replace(touch=system.rod.touch[:0], rub=NO_RUB, strands=no_strands()),
        push=np.zeros(0),
        fraction=np.zeros(0),
        drag=np.zeros((0, 2)),
    )
    none = np.zeros(0, dtype=bool)
    bare = begin._replace(push=np.zeros(0), touches=none, fraction=np.zeros(0), drag=np.zeros((0, 2)), sticks=none, ease=np.zeros(0))
    hanging = _hanging(task, free, bare)
    state = begin._replace(frames=hanging.state.frames, force=hanging.state.force, holds=hanging.state.holds)
    after = settle_or_relax(task.path, system.rod, state, task.progress)
    spent = after.iterations + hanging.iterations
    if not after.is_converged:  # perhaps balanced on an edge: beside it
        kicked = task.path.retract(state.frames, task.path.kick(system.rod))
        after = relax(task.path, system.rod, state._replace(frames=kicked), task.progress)
        spent += after.iterations
    return after._replace(iterations=spent)


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
    """Settle from a straight pulled start, by way of a cable that gives less if need be; descend from where it is not stable."""
    spent = 0
    for shares in ((1.0,), GIVES):
        state = begin
        for share in shares:
            rod = system.rod._replace(give=share * system.rod.give)
            found = settle_alone(task.path, rod, state, 0.0, task.progress)
            spent += found.iterations
            if not found.is_converged:
                break
            state = State(*found.state)
        if found.is_converged and found.is_stable:
            break
    else:  # straight it would buckle
        found = relax(task.path, system.rod, off_the_saddle(task.path, system.rod, begin, found), task.progress)
        spent += found.iterations
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
    return np.asarray(np.einsum("ij,ij->i", system.rod.held.rows["axis"], out[rows]) * (rows >= 0))


def _relaxed(task: Task, system: System, begin: State) -> Settled:
    """The first of several ways to a stable shape, or of all ways the lowest, if the first slips by whole turns of twist.

    A soft cable can shed or gain twist by looping over itself on the way, and rest there (by 4 pi, for frames at both ends). Where turns
    of twist are asked for, those that it has kept come first (`link`).
    """
    expected, spent = system.twist(task.path, begin.frames), 0
    known = list[tuple[int, Settled]]()
    for way in _ways(task, system):
        found = way(begin)
        spent += found.iterations
        if found.is_converged and found.is_stable:
            is_slipped = abs(system.twist(task.path, found.state.frames) - expected) >= SLIP
            missing = abs(link.shed(task, system, begin, found)) if is_slipped and any(task.problem.turns) else 0
            known.append((missing, found))
            if not is_slipped or (any(task.problem.turns) and not missing):
                break
    if len(known) > 1:
        found = min(known, key=lambda item: (item[0], _energy(task, system, item[1])))[1]
    elif known:
        found = known[0][1]
    return found._replace(iterations=spent)


def _ways(task: Task, system: System) -> Iterator[Callable[[State], Settled]]:
    """Ways from a state to a shape: the likelier to succeed first."""
    rod, on_hinges = system.rod, hinges.count(task.problem) if len(task.problem.grasps.s) > 1 else 0

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
    if len(rod.elastic.smoothing):
        yield lambda begin: _by_shorter_micro_lengths(task, system, begin)


def _by_stiffer_cables(task: Task, rod: Rod, state: State) -> Settled:
    """Relax a cable that is a thousand times stiffer, which knows no loops, then softer ones, each from the one before."""
    spent = 0
    for factor in SOFTER:
        own = rod.elastic
        elastic = own._replace(law=factor * own.law, node_law=factor * own.node_law, smoothing=factor * own.smoothing)
        stiffer = rod._replace(elastic=elastic, stiffest=factor * rod.stiffest)
        found = relax(task.path, stiffer, state, task.progress)
        spent += found.iterations
        state = State(*found.state)
    return found._replace(iterations=spent)


def _by_shorter_micro_lengths(task: Task, system: System, state: State) -> Settled:
    """Relax with a micro-structure length as long as the cable, then with longer ones, each from the one before.

    The longer it is, the narrower the valley of shapes whose curvature runs straight from end to end, all that is left at last.
    """
    rod, spent = system.rod, 0
    own = rod.elastic
    steps = max(math.ceil(2.0 * math.log(micro_length(own.law, own.smoothing, rod.lengths) / rod.length) / math.log(STRONGER)), 0)
    for step in range(steps, -1, -1):
        elastic = own._replace(smoothing=own.smoothing / STRONGER**step)
        most = stiffest(elastic, system.mesh)
        shorter = rod._replace(elastic=elastic, stiffest=most, force_scale=force_scale(rod.weight, most, rod.length))
        found = settle_or_relax(task.path, shorter, state, task.progress)
        spent += found.iterations
        if not found.is_converged:
            break
        state = State(*found.state)
    return found._replace(iterations=spent)


def _energy(task: Task, system: System, found: Settled) -> float:
    return float(task.path.energy(system.rod, found.state, found.seen))
