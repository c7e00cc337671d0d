"""Contacts far from touching are left out of a Newton step: it is the step with all of them, also where one of them closes in it."""

from __future__ import annotations

import numpy as np
import pytest
from rods import GRAVITY, KERNELS, Row, cable, contacts, span

from protocol.kinds import Feature
from protocol.messages import Problem
from shape_server import newton
from shape_server.border import is_far
from shape_server.equilibrium import EXACT
from shape_server.mesh import even, stops
from shape_server.rod import Rod, State, View
from shape_server.system import System
from shape_server.task import Task

SEGMENTS = 60


def over_edges(chord: float, depth: float) -> tuple[System, State]:
    """A cable over seven edges in a hollow of some depth [m], at rest."""
    x = np.linspace(0.15, 0.85, 7)
    heights = -depth * np.sin(np.pi * x)
    rows = [
        Row(s=float(at), point=(float(chord * at), 0.0, float(z)), feature=Feature.EDGE, direction=(0.0, 1.0, 0.0))
        for at, z in zip(x, heights, strict=True)
    ]
    problem = Problem(cable=cable(bending=1e-3), grasps=span(chord), contacts=contacts(*rows))
    task = Task(problem, GRAVITY, 1e-3, None, False, False, ("gravity", "bending", "twist", "contact"), KERNELS, lambda *_: None)
    system = task.system(even(stops(problem), problem.grasps.s, SEGMENTS))
    flat = np.tile([0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)], (SEGMENTS, 1))
    return system, KERNELS.settle(system.rod, system.start(flat), 0.0).state


def both(rod: Rod, state: State) -> tuple[newton.Step, newton.Step, View]:
    """The step, and that with every contact, from a state with the view of it."""
    state, view = KERNELS.look(rod, state, np.ascontiguousarray(rod.touch["normal"]))
    return newton.newton_step(rod, state, view, EXACT, 0.0), newton.step_with.py_func(rod, state, view, EXACT, 0.0, np.inf), view


@pytest.mark.parametrize("depth", [0.02, 0.04, 0.05, 0.06, 0.1])
@pytest.mark.parametrize("move", [1e-4, 1e-3, 1e-2])
def test_a_step_without_far_contacts_is_the_step_with_all(depth: float, move: float) -> None:
    system, state = over_edges(0.97, depth)
    rod = system.rod
    rod.held.rows["goal"][2] -= move  # the far clamp goes down
    step, whole, _ = both(rod, state)
    assert np.abs(step.turn - whole.turn).max() < 1e-12  # rad
    assert np.abs(step.push - whole.push).max() < 1e-10 * rod.force_scale
    assert np.array_equal(step.touches, whole.touches)
    assert step.is_stable == whole.is_stable


def test_contacts_are_left_out_and_one_that_closes_all_the_same_is_taken_in() -> None:
    left, closed = 0, 0
    for depth in np.linspace(0.02, 0.12, 26):
        system, state = over_edges(0.97, float(depth))
        system.rod.held.rows["goal"][2] -= 5e-3
        step, _, view = both(system.rod, state)
        state, _ = KERNELS.look(system.rod, state, np.ascontiguousarray(system.rod.touch["normal"]))
        far = is_far(state.push, state.touches, view.gap, newton.AHEAD * newton.farthest_off(system.rod, state, view))
        left, closed = left + int(far.any()), closed + int((far & step.touches).any())
    assert left > 20
    assert closed > 0
