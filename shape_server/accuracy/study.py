"""True error against CPU time: every model, element count, tolerance, budget and effect set of a static problem.

Time is CPU time of the process for one cold answer, the median of repeats after one that does not count. The error is the largest distance
of any node from the exact point at its arc length, over the length of the cable. Both are of the same answer.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from types import ModuleType
from typing import Final, TypeVar

import msgspec
import numpy as np

from protocol.errors import CablecosimError
from protocol.kinds import Model, Outcome
from protocol.messages import Problem, Shape

from .. import effects, kernels
from ..mesh import even, stops
from ..refine import cold
from ..solve import solve
from ..task import Task
from . import boundary_value
from .draws import Points, polyline_error, true_error
from .peers import at_rest, installed, peer_moorpy
from .peers.motions import Hanging, Motions
from .peers.references import at_start
from .problems import Static

REPEATS, LONG = 7, 0.25  # repeats at most, and s of CPU after which there is none more
SEGMENTS: Final = (12, 24, 48, 96, 192, 384, 768)
TOLERANCES: Final = tuple(10.0**-k for k in range(2, 9))  # over the length
BUDGETS: Final = (1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2)  # s
FINEST: Final = 1e-7  # over the length, of the answer that the reference starts from
OPTIONAL: Final = ("bending", "stretch", "natural_curvature", "bending_2")  # numbers of a cable whose effects can be left out
PEER: Final = "SciPy solve_bvp, from our coarse shape"
PEER_MESH: Final = np.linspace(0.0, 1.0, 21)
PEER_TOLERANCES: Final = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)  # relative residual
MOORPY_NODES: Final = (26, 101, 401)
Answer = TypeVar("Answer")
AUTOMATIC: Final = "tolerance, automatic"


@dataclass(frozen=True)
class Row:
    """One setting."""

    group: str
    setting: str
    error: float  # over the length
    estimate: float  # over the length; infinite where the program gives none
    seconds: float  # of CPU
    nodes: int
    factorisations: int
    model: str


@dataclass(frozen=True)
class Studied:
    """All settings of one problem."""

    name: str
    title: str
    rows: tuple[Row, ...]
    refused: tuple[tuple[str, str], ...]  # settings that gave no shape, with the sentence
    peers: tuple[str, ...] = ()  # groups of rows that are other programs
    missing: tuple[str, ...] = ()  # a sentence for each program that could run this and is not installed, and other remarks
    measured: str = "one answer"  # what the time is of


def study(static: Static, told: Callable[[str], None] = lambda sentence: None) -> Studied:
    """Run every setting of a problem against its reference.

    Raises:
        CablecosimError: If the reference is not found.
    """
    told(f"{static.name}: reference")
    length = static.problem.cable.length
    fine = solve(static.problem, static.gravity, tolerance=FINEST * length, path=kernels)
    exact = static.exact(fine) if fine.outcome is Outcome.CONVERGED else None
    if exact is None:
        raise CablecosimError(f"{static.name}: no reference was found", key=static.name)
    rows, refused = list[Row](), list[tuple[str, str]]()
    for group, setting, ask in _settings(static):
        told(f"{static.name}: {group}, {setting}")
        shape, seconds = _timed(ask)
        if shape.outcome is not Outcome.CONVERGED:
            refused.append((f"{group}, {setting}", shape.sentence))
            continue
        away, cost = true_error(shape, exact), shape.cost.factorisations
        estimate = math.inf if shape.error is None else shape.error / length
        rows.append(Row(group, setting, away / length, estimate, seconds, len(shape.s), cost, shape.model))
    others, peers, missing = _others(static, exact, told)
    rows += others
    return Studied(static.name, static.title, tuple(rows), tuple(refused), tuple(peers), tuple(missing))


def _others(static: Static, exact: Points, told: Callable[[str], None]) -> tuple[list[Row], list[str], list[str]]:
    """Rows of other programs, which of them these are, and a sentence for each that is not here or is not set up for the problem."""
    rows, peers, missing = list[Row](), list[str](), list[str]()
    if boundary_value.is_covered(static.problem):
        told(f"{static.name}: {PEER}")
        rows += _peer(static, exact)
        peers.append(PEER)
    motions = at_rest.as_motions(static.problem, _weight(static))
    for peer in installed.FOLLOWING[1:] if motions is not None else ():  # the first is SciPy
        assert motions is not None
        if motions.needs - peer.CAN:
            missing.append(f"{peer.NAME}: not set up for {' and '.join(sorted(motions.needs - peer.CAN))}.")
        elif not installed.is_installed(peer):
            missing.append(installed.missing(peer))
        else:
            told(f"{static.name}: {peer.NAME}")
            rows += _at_rest(peer, static, motions, exact)
            peers.append(peer.NAME)
    if _hangs_level(static.problem):
        if installed.is_installed(peer_moorpy):
            told(f"{static.name}: {peer_moorpy.NAME}")
            rows += _moorpy(static, exact)
            peers.append(peer_moorpy.NAME)
        else:
            missing.append(installed.missing(peer_moorpy))
    return rows, peers, missing


def _weight(static: Static) -> float:
    """Of the cable [N/m]."""
    return static.problem.cable.mass_per_length * float(np.linalg.norm(static.gravity))


def _settings(static: Static) -> Iterator[tuple[str, str, Callable[[], Shape]]]:
    problem, length = static.problem, static.problem.cable.length

    def by(asked: Problem, tolerance: float) -> Callable[[], Shape]:
        return lambda: solve(asked, static.gravity, tolerance=tolerance * length, path=kernels)

    for tolerance in TOLERANCES:
        yield AUTOMATIC, f"{tolerance:g} L", by(problem, tolerance)
    for budget in BUDGETS:
        yield "budget", f"{1e3 * budget:g} ms", lambda budget=budget: solve(problem, static.gravity, budget=budget, path=kernels)  # type: ignore[misc]
    for model in (Model.TAUT, Model.CATENARY, Model.GRADIENT, Model.ROD):
        yield "model", model.value, by(msgspec.structs.replace(problem, model=model), 1e-3)
    if problem.cable.bending is not None:
        for segments in SEGMENTS:
            yield "elements, even mesh", str(segments), _on_even_mesh(static, segments)
    for name in OPTIONAL:
        if getattr(problem.cable, name) is not None:
            yield "effect left out", f"without {name}", by(_without(problem, name), 1e-4)


def _peer(static: Static, exact: Points) -> Iterator[Row]:
    """SciPy's collocation by tolerance; it gets our coarse shape to start from, whose time is not counted."""
    length, s = static.problem.cable.length, np.linspace(0.0, static.problem.cable.length, 101)
    near = solve(static.problem, static.gravity, tolerance=1e-3 * length, path=kernels)
    known = exact(s)
    for tolerance in PEER_TOLERANCES:
        begun = time.process_time()
        found = boundary_value.reference(static.problem, static.gravity, near, tolerance=tolerance, points=PEER_MESH)
        seconds = time.process_time() - begun
        if found is not None:
            away = float(np.linalg.norm(found.nodes(s) - known, axis=1).max()) / length
            yield Row(PEER, f"{tolerance:g}", away, math.inf, seconds, len(found.found.x), 0, PEER)


def _at_rest(peer: ModuleType, static: Static, motions: Motions, there: Points) -> Iterator[Row]:
    """A peer that marches in time, or solves statics afresh."""
    near = at_rest.Near(solve(static.problem, static.gravity, tolerance=1e-3 * static.problem.cable.length, path=kernels))
    origin = static.problem.grasps.position[0]  # of the motions

    def exact(s: np.ndarray) -> np.ndarray:
        moved: np.ndarray = there(s) - origin
        return moved

    known = [exact] if motions.is_planar or motions.needs else [exact, at_start(motions).positions]
    for one, nodes in at_rest.rested(peer, motions, near, known):
        yield Row(peer.NAME, one.setting, one.error, math.inf, 1e-3 * one.milliseconds, nodes, 0, peer.NAME)


def _hangs_level(problem: Problem) -> bool:
    """Whether this is a cable without bending between two points at one height along x, the first of which is the origin."""
    at, cable = problem.grasps.position, problem.cable
    return cable.bending is None and problem.contacts is None and len(at) == 2 and not at[0].any() and not at[1][1:].any()


def _moorpy(static: Static, exact: Points) -> Iterator[Row]:
    """MoorPy's catenary by its number of nodes, judged as ours by the polyline; its nodes are 9e-8 of the length off."""
    length, span = static.problem.cable.length, float(static.problem.grasps.position[1, 0])
    weight = _weight(static)
    for nodes in MOORPY_NODES:
        asked = Hanging(length, span, weight, nodes)
        found, seconds = _timed(partial(peer_moorpy.hang, asked, span))
        away = polyline_error(asked.s(), found, exact) / length
        yield Row(peer_moorpy.NAME, f"{nodes} nodes", away, math.inf, seconds, nodes, 0, peer_moorpy.NAME)


def _on_even_mesh(static: Static, segments: int) -> Callable[[], Shape]:
    problem, used = static.problem, effects.asked_for(static.problem, static.gravity)

    def ask() -> Shape:
        task = Task(problem, static.gravity, 1e-12, None, False, False, used, kernels, lambda iteration, residual: None)
        return cold(task, mesh=even(stops(problem), problem.grasps.s, segments))

    return ask


def _without(problem: Problem, name: str) -> Problem:
    """The problem with a number of its cable left out, and with it the effect that it asks for."""
    left_out = {name: None} | ({"twist": None, "bending_2": None, "natural_curvature": None} if name == "bending" else {})
    return msgspec.structs.replace(problem, cable=replace(problem.cable, **left_out))  # type: ignore[arg-type]


def _timed(ask: Callable[[], Answer]) -> tuple[Answer, float]:
    """An answer and its CPU time [s]."""
    shape, taken, begun = ask(), list[float](), time.process_time()
    while len(taken) < REPEATS and (not taken or time.process_time() - begun < LONG):
        start = time.process_time()
        ask()
        taken.append(time.process_time() - start)
    return shape, statistics.median(taken)
